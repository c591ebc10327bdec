"""Fit the weights of what eyes mind between drawings to how held-out views look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from bench.verdict.measure import Judged
from toonset.nerf.score.torn import APART, BORDERS, OFF, OUTLINE

TERMS = ("off", "apart", "borders", "outline")
IN_USE = (OFF, APART, BORDERS, OUTLINE)
FEWEST = 6  # sheets of which weights are fitted


@dataclass(frozen=True)
class Fit:
    """Weights, and how well those of the other characters predict each sheet.

    Attributes:
        weights: of TERMS, none negative (Lawson, Hanson 1974).
        rank: Spearman's of predicted and true looks, each character left out.
        error: root mean square of these predictions, share of the height.
        rank_in_use: Spearman's of the weights in use.
    """

    weights: tuple[float, ...]
    rank: float
    error: float
    rank_in_use: float


def fitted(sheets: Sequence[Judged]) -> Fit | None:
    """Return the weights that fit the mean look of sheets; None of too few."""
    known = [sheet for sheet in sheets if sheet.terms and sheet.look]
    if len(known) < FEWEST:
        return None
    terms = np.array([sheet.terms for sheet in known])
    look = np.array([np.mean(sheet.look) for sheet in known])
    characters = np.array([character_of(sheet.name) for sheet in known])
    predicted = np.zeros(len(known))
    for character in np.unique(characters):
        own = characters == character
        predicted[own] = terms[own] @ _weights(terms[~own], look[~own])
    error = float(np.sqrt(np.mean((predicted - look) ** 2)))
    in_use = _rank(terms @ np.array(IN_USE), look)
    return Fit(tuple(_weights(terms, look).tolist()), _rank(predicted, look), error, in_use)


def character_of(name: str) -> str:
    """Return whom a sheet shows: its name up to the hyphen of its condition, without a seed."""
    return name.partition("-")[0].rstrip("0123456789") or name


def fit_text(sheets: Sequence[Judged]) -> str:
    """Return the weights beside those in use, a line each; "" of too few sheets."""
    found = fitted(sheets)
    if found is None:
        return ""
    rows = zip(TERMS, found.weights, IN_USE, strict=True)
    return "\n".join(
        [
            f"torn, weights that fit {len(sheets)} sheets (none negative), and those in use:",
            *(f"  {name:8s} {weight:.4f}  {used:.4f}" for name, weight, used in rows),
            f"each character left out: rank correlation {found.rank:.2f}, error "
            f"{100 * found.error:.2f} % of the height; of those in use {found.rank_in_use:.2f}",
        ]
    )


def _weights(terms: Float[np.ndarray, "n terms"], look: Float[np.ndarray, " n"]) -> np.ndarray:
    from scipy.optimize import nnls

    return np.asarray(nnls(terms, look)[0])


def _rank(first: np.ndarray, second: np.ndarray) -> float:
    from scipy.stats import rankdata

    return float(np.corrcoef(rankdata(first), rankdata(second))[0, 1])
