"""Ask whether what a run knows of itself tells how its new views look, for unknown characters.

Every set of terms is fitted to FLIP over the figure, without a constant, and predicts sheets of
characters that it was not fitted on; so is a bound chosen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float

from lab.bench.records.record import aligned
from lab.bench.verdict.curve import BAD
from lab.bench.verdict.measure import TERMS, Judged
from toonset.nerf.score.verdict import MOST_OFF

OWN = "-own"  # ends the names of sheets with their own mannequin
FEWEST = 6  # sheets of which weights are fitted
MOST_ALARMS = 0.1  # of sheets with their own mannequin, that a bound may call weak
HEAD = ("terms", "all", "own body", "others", "own called weak", "bad ones found")


@dataclass(frozen=True)
class Told:
    """What a set of terms tells of characters that it was not fitted on.

    Attributes:
        terms: of TERMS.
        rank: Spearman's of predicted FLIP over the figure and the true one.
        rank_own, rank_others: the same of sheets with and without their own mannequin.
        alarms: sheets with their own mannequin above a bound under which 9 of 10 of those of the
            other characters are.
        found: sheets above it that look bad and are not off by more than MOST_OFF.
    """

    terms: tuple[str, ...]
    rank: float
    rank_own: float
    rank_others: float
    alarms: int
    found: int


def told(sheets: Sequence[Judged]) -> list[Told]:
    """Return what every set of terms tells; empty of too few sheets or characters."""
    known = [sheet for sheet in sheets if sheet.terms and sheet.flip]
    characters = np.array([character_of(sheet.name) for sheet in known])
    if len(known) < FEWEST or len(np.unique(characters)) == 1:
        return []
    terms = np.array([sheet.terms for sheet in known])
    flip = np.array([np.mean(sheet.flip) for sheet in known])
    own = np.array([sheet.name.endswith(OWN) for sheet in known])
    missed = np.array([_is_missed(sheet) for sheet in known])
    result = []
    for count in range(1, len(TERMS) + 1):
        for chosen in combinations(range(len(TERMS)), count):
            guess, above = _left_out(terms[:, chosen], flip, characters, own)
            names = tuple(TERMS[i] for i in chosen)
            whole, mine, others = (
                _rank(guess[part], flip[part]) for part in (own | ~own, own, ~own)
            )
            alarms, found = int((above & own).sum()), int((above & missed).sum())
            result.append(Told(names, whole, mine, others, alarms, found))
    return result


def character_of(name: str) -> str:
    """Return whom a sheet shows: its name up to the hyphen of its condition, without a seed."""
    return name.partition("-")[0].rstrip("0123456789") or name


def told_text(sheets: Sequence[Judged]) -> str:
    """Return a row for every set of terms; "" of too few sheets."""
    found = told(sheets)
    if not found:
        return ""
    own = sum(sheet.name.endswith(OWN) for sheet in sheets)
    missed = sum(_is_missed(sheet) for sheet in sheets)
    rows = [
        (
            " ".join(one.terms),
            *(f"{rank:.2f}" for rank in (one.rank, one.rank_own, one.rank_others)),
            f"{one.alarms} of {own}",
            f"{one.found} of {missed}",
        )
        for one in found
    ]
    title = "rank correlation with FLIP over the figure, each character left out"
    return "\n".join([title, *aligned([HEAD, *rows], words=1)])


def _is_missed(sheet: Judged) -> bool:
    return sheet.worst_look > BAD and sheet.off <= MOST_OFF


def _left_out(
    terms: Float[np.ndarray, "n terms"],
    flip: Float[np.ndarray, " n"],
    characters: np.ndarray,
    own: Bool[np.ndarray, " n"],
) -> tuple[Float[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """Return predicted FLIP, by weights and bounds of the other characters, and what is above.

    Weights are least squares, none negative (Lawson, Hanson 1974).
    """
    from scipy.optimize import nnls

    guess, above = np.zeros(len(flip)), np.zeros(len(flip), bool)
    for character in np.unique(characters):
        here = characters == character
        summed = terms @ nnls(terms[~here], flip[~here])[0]
        guess[here] = summed[here]
        if (own & ~here).any():
            bound = np.quantile(summed[own & ~here], 1 - MOST_ALARMS, method="inverted_cdf")
            above[here] = summed[here] > bound
    return guess, above


def _rank(first: np.ndarray, second: np.ndarray) -> float:
    from scipy.stats import rankdata

    if len(first) < FEWEST or not (np.ptp(first) and np.ptp(second)):
        return float("nan")
    return float(np.corrcoef(rankdata(first), rankdata(second))[0, 1])
