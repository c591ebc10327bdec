"""Move a surface, smoothly, until its outlines touch the drawn ones.

At a point of a drawn outline the lowest f along the ray is the error e, in px, at the place x*
where the ray comes nearest. f is corrected there and, by a Gaussian kernel that narrows from round
to round, around it:

    f <- f - (K * sum w e) / (K * sum w + c),    w = 1 / (1 + (e / SCALE_PX)^2)
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float
from scipy import ndimage

from toonset.nerf.sections.drawing import TALL, Drawing, sample
from toonset.nerf.sections.grid import VOXEL_PX, Grid, Volume, blurred, distance_again

ROUNDS, AGAIN = 6, 3  # every so many rounds f is made a distance again
WIDTHS_PX = 0.06 * TALL, 0.025 * TALL  # of the kernel, first and last
SCALE_PX, MOST_PX = 4.0, 6.0  # errors beyond are another pose's
MIRRORED = 0.35  # weight of a mirrored drawing
EVERY_PX, MIRRORED_EVERY_PX = 3, 4  # along the outlines
SPARSE = 0.02  # of the median weight beside the surface: where fewer outlines are, f stays
NEAR_PX = 3.0
TRUNCATE = 2.5
FINAL_VOXELS = 0.8


def touching(grid: Grid, f: Volume, drawings: Sequence[Drawing]) -> Volume:
    """Return f with its outlines moved to those of the drawings."""
    rays = [(grid.along(drawing, outline(drawing)), _weight(drawing)) for drawing in drawings]
    for step in range(ROUNDS):
        share = step / (ROUNDS - 1)
        width = WIDTHS_PX[0] ** (1 - share) * WIDTHS_PX[1] ** share / VOXEL_PX
        pull, weight = np.zeros((2, *f.shape), np.float32)
        for points, own in rays:
            values = grid.at(f, points)
            lowest = values.argmin(axis=1)[:, None]
            error = np.take_along_axis(values, lowest, axis=1)[:, 0]
            place = np.take_along_axis(points, lowest[..., None], axis=1)[:, 0]
            there = tuple(np.rint(grid.index(place)).astype(int).T)
            there = tuple(i.clip(0, n - 1) for i, n in zip(there, f.shape, strict=True))
            trust = own / (1 + np.square(error / SCALE_PX))
            np.add.at(pull, there, trust * error.clip(-MOST_PX, MOST_PX))
            np.add.at(weight, there, trust)
        most = weight.max()
        pull, weight = (
            ndimage.gaussian_filter(v, width, truncate=TRUNCATE) for v in (pull, weight)
        )
        usual = np.median(weight[np.abs(f) < NEAR_PX])
        f = f - pull / (weight + SPARSE * usual + 1e-4 * most)
        if (step + 1) % AGAIN == 0:
            f = distance_again(f)
    return blurred(f, FINAL_VOXELS)


def outline(drawing: Drawing) -> Float[np.ndarray, "n 2"]:
    """Return points of a drawing's outline, between pixels, EVERY_PX apart."""
    every = MIRRORED_EVERY_PX if drawing.mirrored else EVERY_PX
    mask = drawing.mask.astype(np.uint8)
    contours, _ = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    points = np.concatenate([contour[:, 0] for contour in contours])[::every] + np.float32(0.5)
    slopes = np.gradient(drawing.distance)[::-1]
    normal = np.stack([sample(slope, points) for slope in slopes], axis=-1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-3)
    return points - normal * sample(drawing.distance, points)[:, None]


def _weight(drawing: Drawing) -> float:
    return MIRRORED if drawing.mirrored else 1.0
