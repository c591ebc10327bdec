"""The error of a drawing, and how a fit looks through it: a smooth field, marginalised.

A hand-drawn outline is not off by independent noise. Its error drifts over a body part, so a long
arc is wrong the same way and a hundred points on it say no more than a few. Residuals r across the
outline are modelled as

    r = J x + Phi c + e,    c ~ N(0, smooth^2 I),    e ~ N(0, white^2 / weight)

with the columns of Phi Gaussian bumps on a grid over the drawing, once displacing it in u and once
in v, projected on the outline's normals. Integrating c out is generalised least squares with the
covariance smooth^2 Phi Phi^T + white^2 / weight, by Woodbury's identity in the size of c. It weighs
every direction of x by what the drawing can tell about it, so that covariances come out true
without a factor, and x moves only where bending the drawing is dearer. Both variances are
estimated on the sheet by expectation maximisation (empirical Bayes).

Sources: Gaussian process regression as a linear model of bumps (Rasmussen and Williams 2006,
section 2.1); variance components by EM (Dempster, Laird and Rubin 1977).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.linalg import cho_factor, cho_solve

from toonset.calib.match import Drawing

LENGTH_OF_HEIGHT = 0.1  # a bump's width and the grid's spacing; chosen on synthetic sheets
WHITE_POINTS = 80.0  # independent samples of what is not smooth: one per 1 to 2 % of the outline
LEAST_WHITE, MOST_SMOOTH = 0.0007, 0.05  # of the height: a pixel of a large drawing; not a drawing


@dataclass(frozen=True)
class Noise:
    """Standard deviations of a drawing's error over the figure's height: smooth and white part."""

    smooth: float = 0.008
    white: float = 0.004


@dataclass(frozen=True, eq=False)
class Marginal:
    """A view's normal equations with its drawing error integrated out, and what that error is.

    Attributes:
        normal: (u, u) information about the unknowns.
        gradient: (u,).
        energy: -2 log likelihood up to a constant, at the most probable drawing error.
        noise: this view's share of the next estimate of the noise.
    """

    normal: Float[np.ndarray, "u u"]
    gradient: Float[np.ndarray, " u"]
    energy: float
    noise: Noise


def error_modes(drawing: Drawing) -> Float[np.ndarray, "points modes"]:
    """Return the displacement in px across the outline of every mode (unit: figure's height)."""
    spacing = LENGTH_OF_HEIGHT * drawing.height
    low, high = drawing.points.min(axis=0), drawing.points.max(axis=0)
    u, v = (np.arange(low[i] - spacing / 2, high[i] + spacing, spacing) for i in (0, 1))
    centres = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    squared = ((drawing.points[:, None] - centres) ** 2).sum(axis=-1)
    near = squared.min(axis=0) < spacing**2
    bumps = np.exp(-squared[:, near] / (2 * spacing**2))
    bumps *= drawing.height / np.sqrt((bumps**2).sum(axis=1).mean())
    return np.hstack([bumps * drawing.normals[:, :1], bumps * drawing.normals[:, 1:]])


def marginalise(
    modes: Float[np.ndarray, "points modes"],
    noise: Noise,
    height_px: float,
    target_index: Int[np.ndarray, " n"],
    rows: Float[np.ndarray, "n u"],
    residuals: Float[np.ndarray, " n"],
    shares: Float[np.ndarray, " n"],
    robust: Float[np.ndarray, " n"],
    width: float,
) -> Marginal:
    """Return the normal equations of rows x = -residuals under the drawing's error.

    Args:
        modes: of the drawing.
        noise: assumed.
        height_px: the figure's height.
        target_index: which drawn point a row aims at; rows of one point share its error.
        rows: derivatives of the residuals, px per unknown.
        residuals: px across the outline.
        shares: each row's share of the outline; sums to one.
        robust: weight of each row in [0, 1].
        width: robust width over the height, for the energy.
    """
    weights = shares * robust * WHITE_POINTS / (noise.white * height_px) ** 2
    per_point = np.bincount(target_index, weights, len(modes))
    inner = (modes * per_point[:, None]).T @ modes
    inner[np.diag_indices_from(inner)] += 1 / noise.smooth**2
    both = np.column_stack([rows, residuals])
    weighted = both * weights[:, None]
    gathered = np.zeros((len(modes), both.shape[1]))
    np.add.at(gathered, target_index, weighted)
    projected = modes.T @ gathered
    factor = cho_factor(inner)
    solved = cho_solve(factor, projected)
    system = both.T @ weighted - projected.T @ solved
    bent = solved[:, -1]
    rest = (residuals - (modes @ bent)[target_index]) / height_px
    spread = float(np.trace(cho_solve(factor, np.eye(len(bent)))))
    capped = rest**2 * width**2 / (width**2 + rest**2)
    return Marginal(
        system[:-1, :-1],
        system[:-1, -1],
        float(bent @ bent / noise.smooth**2 + WHITE_POINTS * shares @ capped / noise.white**2),
        Noise(
            np.sqrt((bent @ bent + spread) / len(bent)),
            np.sqrt((shares * robust) @ rest**2 / (shares @ robust)),
        ),
    )


def pooled(noises: list[Noise], width: float) -> Noise:
    """Return the noise of a sheet from its views'."""
    smooth = np.sqrt(np.mean([noise.smooth**2 for noise in noises]))
    white = np.sqrt(np.mean([noise.white**2 for noise in noises]))
    return Noise(
        float(np.clip(smooth, LEAST_WHITE, MOST_SMOOTH)), float(np.clip(white, LEAST_WHITE, width))
    )
