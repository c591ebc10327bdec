"""Model a drawing's error as a smooth random field and marginalise it out of a fit.

A hand-drawn outline is not off by independent noise. Its error drifts over a body part, so a long
arc is wrong the same way and a hundred points on it say no more than a few. Residuals r across the
outline are modelled as

    r = J x + Phi c + e,    c ~ N(0, smooth^2 I),    e ~ N(0, white^2 / weight)

with the columns of Phi Gaussian bumps on a grid over the drawing, once displacing it in u and once
in v, projected on the outline's normals. Integrating c out is generalised least squares with the
covariance smooth^2 Phi Phi^T + white^2 / weight, by Woodbury's identity in the size of c. It weighs
every direction of x by what the drawing can tell about it, so that covariances come out true
without a factor, and x moves only where bending the drawing is dearer. Both variances are
estimated on the sheet along the way (empirical Bayes).

Sources: Gaussian process regression as a linear model of bumps (Rasmussen and Williams 2006,
section 2.1); variances by MacKay's fixed point ("Bayesian interpolation", 1992, section 4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from toonset.calib.outline.correspondences import Drawing

LENGTH_OF_HEIGHT = 0.13  # a bump's width and the grid's spacing; chosen on synthetic sheets
WHITE_POINTS = 200.0  # independent samples of what is not smooth: the points of a drawn outline
ROUGH_POINTS = 80.0  # the same where the mannequin is, or may be, another body: it errs along arcs
PRIOR_MODES = 20.0  # how many of a sheet's determined modes the expected smooth error is worth
LEAST_WHITE_PX = 0.2  # of the drawing as it is: what a pixel hides
LEAST_SMOOTH, MOST_SMOOTH = 0.0007, 0.05  # of the height


@dataclass(frozen=True)
class Noise:
    """Standard deviations of a drawing's error.

    Attributes:
        smooth: part of the outline's error that drifts, over the figure's height.
        white: the rest, over the figure's height.
        turned: of a drawing's body in elevation, radians; see `toonset.calib.fit.turned_bodies`.
    """

    smooth: float = 0.008
    white: float = 0.004
    turned: float = 0.0


@dataclass(frozen=True, eq=False)
class Residuals:
    """How far outlines are apart, and how that changes with the unknowns.

    Attributes:
        px: (n,) across the drawn outline.
        slopes: (n, u) their derivatives, px per unknown.
        target_index: (n,) which drawn point a row aims at; rows of one point share its error.
        shares: (n,) of the outline; they sum to one.
        robust: (n,) weights in [0, 1].
    """

    px: Float[np.ndarray, " n"]
    slopes: Float[np.ndarray, "n u"]
    target_index: Int[np.ndarray, " n"]
    shares: Float[np.ndarray, " n"]
    robust: Float[np.ndarray, " n"]


@dataclass(frozen=True, eq=False)
class Marginal:
    """A view's normal equations with its drawing error integrated out, and what that error is.

    Attributes:
        normal: (u, u) information about the unknowns.
        gradient: (u,).
        energy: -2 log likelihood up to a constant, at the most probable drawing error.
        bent: sum of squares of the drawing error's coefficients.
        determined: how many of them the drawing determines (MacKay's gamma).
        rest: mean square of what is not smooth, over the height squared.
    """

    normal: Float[np.ndarray, "u u"]
    gradient: Float[np.ndarray, " u"]
    energy: float
    bent: float
    determined: float
    rest: float


def error_modes(drawing: Drawing) -> Float[np.ndarray, "points modes"]:
    """Return the displacement in px across the outline of every mode (unit: figure's height).

    Where bumps outnumber points, as on a figure far wider than it is tall, as many modes as points
    make the same covariance.
    """
    spacing = LENGTH_OF_HEIGHT * drawing.height
    low, high = drawing.points.min(axis=0), drawing.points.max(axis=0)
    u, v = (np.arange(low[i] - spacing / 2, high[i] + spacing, spacing) for i in (0, 1))
    centres = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    squared = ((drawing.points[:, None] - centres) ** 2).sum(axis=-1)
    near = squared.min(axis=0) < spacing**2
    bumps = np.exp(-squared[:, near] / (2 * spacing**2))
    bumps *= drawing.height / np.sqrt((bumps**2).sum(axis=1).mean())
    modes = np.hstack([bumps * drawing.normals[:, :1], bumps * drawing.normals[:, 1:]])
    if modes.shape[1] > len(modes):
        left, sizes, _ = np.linalg.svd(modes, full_matrices=False)
        modes = left * sizes
    return modes


def marginalise(
    modes: Float[np.ndarray, "points modes"],
    noise: Noise,
    height_px: float,
    off: Residuals,
    width: float,
    samples: float,
) -> Marginal:
    """Return the normal equations of slopes x = -residuals under the drawing's error.

    Args:
        modes: of the drawing.
        noise: assumed.
        height_px: the figure's height.
        off: the residuals.
        width: robust width over the height, for the energy.
        samples: how many independent samples the outline is worth.
    """
    from scipy.linalg import cho_factor, cho_solve

    weighed = off.shares * off.robust
    weights = weighed * samples / (noise.white * height_px) ** 2
    per_point = np.bincount(off.target_index, weights, len(modes))
    inner = (modes * per_point[:, None]).T @ modes
    inner[np.diag_indices_from(inner)] += 1 / noise.smooth**2
    both = np.column_stack([off.slopes, off.px])
    weighted = both * weights[:, None]
    gathered = np.zeros((len(modes), both.shape[1]))
    np.add.at(gathered, off.target_index, weighted)
    projected = modes.T @ gathered
    factor = cho_factor(inner)
    solved = cho_solve(factor, projected)
    system = both.T @ weighted - projected.T @ solved
    bent = solved[:, -1]
    rest = (off.px - (modes @ bent)[off.target_index]) / height_px
    unsure = float(np.trace(cho_solve(factor, np.eye(len(bent))))) / noise.smooth**2
    capped = rest**2 * width**2 / (width**2 + rest**2)
    return Marginal(
        system[:-1, :-1],
        system[:-1, -1],
        float(bent @ bent / noise.smooth**2 + samples * off.shares @ capped / noise.white**2),
        float(bent @ bent),
        max(len(bent) - unsure, 1e-3),
        float(weighed @ rest**2 / (off.shares @ off.robust)),
    )


def least_white(drawings: Sequence[Drawing]) -> float:
    """Return the white noise over the height that pixels cause."""
    return float(np.mean([LEAST_WHITE_PX * d.factor / d.height for d in drawings]))


def next_noise(views: Sequence[Marginal], least: float, most: float) -> Noise:
    """Return the noise that the views of a sheet show together, its white part within limits."""
    bent = PRIOR_MODES * Noise().smooth ** 2 + sum(view.bent for view in views)
    smooth = bent / (PRIOR_MODES + sum(view.determined for view in views))
    white = np.mean([view.rest for view in views])
    return Noise(
        float(np.clip(np.sqrt(smooth), LEAST_SMOOTH, MOST_SMOOTH)),
        float(np.clip(np.sqrt(white), least, most)),
    )
