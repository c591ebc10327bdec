"""Detect drawings that occur twice: equal pictures cannot be two directions.

Pictures are laid over each other by the moments of their coverage, so that place, size and half a
pixel do not matter, and blurred, so that a file's noise does not; then the largest difference
counts: an eye, or an ear alone, makes another drawing. A mirrored copy is another drawing, too.
Of silhouettes in one colour nothing is said: front and back may have equal ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import cv2
import numpy as np
from jaxtyping import Float

from toonset.view import View

SIDE, SPREAD = 96, 0.2  # of the picture in pixels; the figure's standard deviation over the side
WORKING_PX = 256  # height of a figure that is not made smaller first
BLUR = 2.0  # sigma, pixels
# Of premultiplied RGBA, where two blurred pictures differ most: between a file's noise and the most
# alike drawings of a sheet (docs/decisions.md)
MOST_NOISE = 0.04
PLAIN = 4.0  # levels: standard deviation of one colour with a file's noise


def repeated_drawings(drawings: Sequence[View]) -> list[tuple[int, int]]:
    """Return the pairs of views whose pictures are equal to within a file's noise."""
    pictures = {i: _picture(view) for i, view in enumerate(drawings) if _is_painted(view)}
    return [
        (i, j)
        for i, j in combinations(pictures, 2)
        if np.square(pictures[i] - pictures[j]).sum(axis=-1).max() < MOST_NOISE**2
    ]


def _is_painted(view: View) -> bool:
    return bool(view.rgba[view.mask][:, :3].std(axis=0).max() > PLAIN)


def _picture(view: View) -> Float[np.ndarray, "height width 4"]:
    """Return the blurred drawing, premultiplied, moved and sized by its coverage's moments."""
    rgba = view.rgba.astype(np.float32) / 255
    rgba[..., :3] *= rgba[..., 3:]
    factor = WORKING_PX / view.figure_box[3]
    if factor < 1:
        size = [max(1, round(factor * length)) for length in rgba.shape[1::-1]]
        rgba = cv2.resize(rgba, size, interpolation=cv2.INTER_AREA)
    row, column = np.indices(rgba.shape[:2])
    weight = rgba[..., 3] / rgba[..., 3].sum()
    x, y = float((weight * column).sum()), float((weight * row).sum())
    spread = np.sqrt((weight * (np.square(column - x) + np.square(row - y))).sum())
    scale = SPREAD * SIDE / max(float(spread), 0.5)
    place = np.array([[scale, 0, SIDE / 2 - scale * x], [0, scale, SIDE / 2 - scale * y]])
    margin = int(np.ceil(4 * BLUR / scale))
    padded = np.pad(rgba, ((margin, margin), (margin, margin), (0, 0)))
    place[:, 2] -= scale * margin
    blurred = cv2.GaussianBlur(padded, (0, 0), BLUR / scale)
    return np.asarray(cv2.warpAffine(blurred, place, (SIDE, SIDE)), dtype=np.float64)
