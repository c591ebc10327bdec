"""Deform the mannequin to the character's proportions, by a few numbers per sheet.

The mannequin is bent as a whole, symmetrically about its own x = 0 plane, by bands of its height
(feet to crown): how wide, how deep, how high and how far forward each band is, and how long, how
raised and how far forward the arms are. Symmetry keeps the front where it is, so proportions cannot
take the place of yaw. Every number has a prior centred on "as the mannequin is", and neighbouring
bands resemble each other. No part labels are needed, so any mannequin serves.

Source of the idea: free-form deformation (Sederberg and Parry 1986), reduced to one axis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.calib.outline.occluding_contour import Surface

BANDS = 6
SCALE_SIGMA = 0.15  # of a band's width and depth
MOVE_SIGMA = 0.04  # of a band's height and depth position, over the body's height
ARM_SIGMA = 0.22  # of an arm's length, and of the tangents of its raise and forward swing
NEIGHBOURS = 0.7  # difference of neighbouring bands over their own sigma
LEGS_BELOW, ARMS_FROM = 0.3, 0.25  # of the height: what is out to the side above are arms
OUTSIDE = 0.95  # quantile of the legs' |x| beyond which something above is an arm


@dataclass(frozen=True, eq=False)
class Body:
    """A surface with its proportions.

    Attributes:
        rest: the mannequin as it is.
        low: y of its feet.
        shoulder: |x| where the arms begin.
        theta: (p,) proportions, zero for the mannequin's own.
        precision: (p, p) of their prior.
        surface: the bent surface.
    """

    rest: Surface
    low: float
    shoulder: float
    theta: Float[np.ndarray, " p"]
    precision: Float[np.ndarray, "p p"]
    surface: Surface

    def moved(self, step: Float[np.ndarray, " p"]) -> Body:
        """Return the body with its proportions changed."""
        theta = self.theta + step
        vertices = self.rest.vertices + self.slopes(self.rest.vertices) @ theta
        return replace(self, theta=theta, surface=replace(self.rest, vertices=vertices))

    def slopes(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 p"]:
        """Return the displacement of points of the unbent mannequin per unit of every number."""
        height = self.rest.height
        x, y, z = points.T
        place = np.clip((y - self.low) / height, 0, 1)
        band = np.maximum(0, 1 - np.abs(place[:, None] * (BANDS - 1) - np.arange(BANDS)))
        out = np.maximum(0, np.abs(x) - self.shoulder)
        out *= np.clip((place - ARMS_FROM) * 10, 0, 1)
        slopes = np.zeros((len(points), 3, 4 * BANDS - 2 + 3))
        slopes[:, 0, :BANDS] = x[:, None] * band
        slopes[:, 2, BANDS : 2 * BANDS] = z[:, None] * band
        slopes[:, 2, 2 * BANDS : 3 * BANDS] = height * band
        slopes[:, 1, 3 * BANDS : -3] = height * band[:, 1:-1]  # the ends: scale and shift
        slopes[:, 0, -3] = np.sign(x) * out
        slopes[:, 1, -2] = slopes[:, 2, -1] = out
        return slopes

    def at_rest(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Return where points of the bent surface lie on the mannequin (fixed-point iteration)."""
        rest = points
        for _ in range(6):
            rest = points - self.slopes(rest) @ self.theta
        return rest


def as_it_is(surface: Surface) -> Body:
    """Return the body with the mannequin's own proportions."""
    vertices = surface.vertices
    low = float(vertices[:, 1].min())
    legs = np.abs(vertices[vertices[:, 1] < low + LEGS_BELOW * surface.height, 0])
    precision = _prior()
    return Body(
        surface,
        low,
        float(np.quantile(legs, OUTSIDE)),
        np.zeros(len(precision)),
        precision,
        surface,
    )


def _prior() -> Float[np.ndarray, "p p"]:
    own = np.concatenate(
        [np.full(2 * BANDS, SCALE_SIGMA), np.full(2 * BANDS - 2, MOVE_SIGMA), np.full(3, ARM_SIGMA)]
    )
    precision = np.diag(own**-2)
    for block in range(3):  # widths, depths, positions forward
        for i in range(block * BANDS, (block + 1) * BANDS - 1):
            stiff = (NEIGHBOURS * own[i]) ** -2
            precision[i, i] += stiff
            precision[i + 1, i + 1] += stiff
            precision[i, i + 1] -= stiff
            precision[i + 1, i] -= stiff
    return precision
