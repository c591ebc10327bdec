"""Fit displacements of drawings under which they show the mannequin.

Outlines first, then lines where one part hides another. Minimised over the numbers c of every
drawing's displacement d, by Gauss-Newton:

    sum over points b of the mannequin's outline of  rho(D(b + d(b)) / sigma)^2 / CORRELATED
    + sum over points b of its steps in depth of     rho(o(b + d(b)) / sigma)^2 / CORRELATED
    + c' K^-1 c / tau^2

D is the signed distance to the drawing's outline, o the way across a step to the line that the
artist drew there. tau, the size of the drawings' errors, and whether there are any, come from the
marginal likelihood, as in `toonset.dataset.silhouettes.empirical_bayes`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from toonset.dataset.silhouettes.displacement import Bends
from toonset.dataset.silhouettes.empirical_bayes import Fit, Normal, Numbers, Prior, fit, weighed
from toonset.dataset.silhouettes.outlines import Outline
from toonset.nerf.look.step_lines import lines_across

NOISE, NOISE_PX = 0.001, 0.1  # of the square, but at least so many pixels: a known shape's error
EXPECTED = 0.01  # of the square: a careful hand's error, as a first guess
ROUNDS = 10  # of Gauss-Newton
FARTHEST, NEAREST = 0.03, 0.01  # of the square: how far lines are looked for, at first and at last
_BENDS = Bends.expected()


@dataclass(frozen=True, eq=False)
class InnerLines:
    """Expected and drawn lines within a figure.

    Attributes:
        unit: (n, 2) places of the mannequin's steps in depth, in the drawing's square.
        across: (n, 2) unit vectors from the near side of a step to the far one.
        beyond: how far on its far side the middle of its line lies, of the square.
        cover: (height, width) how far lines cover every pixel of the drawing, 0 to 1.
        low, size: of the square, pixels of the drawing.
    """

    unit: Float[np.ndarray, "n 2"]
    across: Float[np.ndarray, "n 2"]
    beyond: float
    cover: Float[np.ndarray, "height width"]
    low: Float[np.ndarray, " 2"]
    size: float

    def off(self, unit: Float[np.ndarray, "n 2"], reach: float) -> Float[np.ndarray, " n"]:
        """Return how far across each step its line lies from where it should; nan: none near.

        Args:
            unit: where the steps' places are drawn.
            reach: how far to look, all of the square.
        """
        places = self.low + self.size * unit
        far = FARTHEST * self.size
        off = lines_across(self.cover, places, self.across, reach * self.size, far)
        return off / self.size - self.beyond


def fit_bends(
    drawn: Sequence[Outline],
    shapes: Sequence[Outline],
    lines: Sequence[InnerLines] | None = None,
    start: Fit | None = None,
) -> Fit:
    """Return the smallest displacements under which drawings show the mannequin.

    Args:
        drawn: the drawings' outlines, in small pictures.
        shapes: the mannequin's, as the same cameras see it.
        lines: within the figures, one per drawing; None: outlines alone.
        start: displacements to begin with; None: none.
    """
    prior = Prior(np.linalg.inv(_BENDS.covariance))

    def linearise(at: Numbers, round_: int) -> list[Normal]:
        reach = max(NEAREST, FARTHEST * (1 - round_ / ROUNDS))
        inner: Sequence[InnerLines | None] = lines or [None] * len(drawn)
        views = zip(drawn, shapes, inner, at, strict=True)
        return [_normal(*view, reach) for view in views]

    first = linearise(np.zeros((len(drawn), len(prior.precision))), 0)
    if start is None:
        return fit(linearise, first, prior, EXPECTED, ROUNDS)
    begin = (start.numbers, linearise(start.numbers, 0))
    return fit(linearise, first, prior, start.tau, ROUNDS, start=begin)


def _normal(
    drawn: Outline,
    shape: Outline,
    lines: InnerLines | None,
    numbers: Float[np.ndarray, " k"],
    reach: float,
) -> Normal:
    size = drawn.square.size
    jacobian = _BENDS.jacobian(drawn.square.unit(shape.points))
    distance, *slope = drawn.at(shape.points + size * jacobian @ numbers)
    across = np.stack(slope, axis=-1)
    squares, points = float((distance**2).sum()), len(distance)
    if lines is not None and len(lines.unit):
        inner = _BENDS.jacobian(lines.unit)
        off = -size * lines.off(lines.unit + inner @ numbers, reach)
        there = np.isfinite(off)
        distance = np.concatenate([distance, off[there]])
        jacobian = np.concatenate([jacobian, inner[there]])
        across = np.concatenate([across, lines.across[there]])
    sigma = max(NOISE * size, NOISE_PX)
    weight, cost = weighed(distance, sigma, size)
    way = size * np.einsum("nd,ndk->nk", across, jacobian)
    return Normal(
        way.T @ (weight[:, None] * way), way.T @ (weight * distance), cost, squares, points
    )
