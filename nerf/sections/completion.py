"""Put back what a drawing shows and the body lacks: nothing that is drawn is cut off.

A missing part is inflated to a string of balls, each as thick as the part is wide, and put where
along its rays the other drawings object least: arms that another pose would carve off, blades,
hair.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float

from toonset.nerf.sections.drawing import Drawing, Mask, sample
from toonset.nerf.sections.grid import VOXEL_PX, Grid, Volume, distance_again, silhouette
from toonset.nerf.sections.limbs import thickness
from toonset.raster import parts

LACKING_PX = 5.0  # beside the surface, somewhere in a part, ...
BESIDE_PX = 1.0  # ... all of which lies so far beside it
LEAST_PART = 8e-4  # of the figure's pixels
LEAST_PX = 30
HOLD = 0.6  # of the radius: what other drawings have to show round a ball's middle
MOST_PX = 25.0  # squared: the largest objection
APART, MOST_APART_PX = 0.03, 60.0  # px^2 per squared px from the body
PAINT, MOST_UNLIKE = 800.0, 0.2
ALIKE = math.radians(15)  # drawings from opposite sides are one silhouette
BLUR, DEPTH_BLUR_PX = (9, 9), 3.0
CORE = 0.75  # of the radius: where a part's balls have their middles
BALLS = 1500
OVER_PX = 1.0  # by which balls may stand out of the drawing
THINNEST_PX = 1.5


def completed(
    grid: Grid, f: Volume, drawings: Sequence[Drawing], everything: Sequence[Drawing]
) -> Volume:
    """Return f with what it lacks of each drawing in turn.

    Args:
        grid: of f.
        f: a body.
        drawings: that must be covered, the surest first.
        everything: drawings that may object, mirrored ones, too.
    """
    for drawing in drawings:
        missing = missing_parts(drawing, silhouette(grid, f, drawing))
        if missing.sum() >= LEAST_PX:
            f = np.minimum(f, _inflated(grid, f, drawing, missing, everything))
    return distance_again(f)


def missing_parts(drawing: Drawing, seen: Float[np.ndarray, "height width"]) -> Mask:
    """Return the parts of a drawing that a body lacks.

    Args:
        drawing: what should be there.
        seen: the lowest f along each pixel's ray.
    """
    labels = parts(drawing.mask & (seen > BESIDE_PX))
    sizes = np.bincount(labels.reshape(-1))
    lacking = np.bincount(
        labels.reshape(-1), drawing.mask.reshape(-1) & (seen > LACKING_PX).reshape(-1)
    )
    chosen = (lacking > 0) & (sizes > LEAST_PART * drawing.mask.sum())
    chosen[0] = False
    return chosen[labels]


def _inflated(
    grid: Grid, f: Volume, drawing: Drawing, missing: Mask, everything: Sequence[Drawing]
) -> Volume:
    """Return f of the balls that a missing part is made of."""
    rows, columns = np.nonzero(missing)
    points = grid.along(drawing, np.stack([columns, rows], axis=-1) + 0.5)
    radii, deep = (picture[rows, columns] for picture in thickness(drawing.mask))
    rivals = [other for other in everything if not _opposite(other, drawing)]
    cost = APART * grid.at(f, points).clip(0, MOST_APART_PX) ** 2
    for other in rivals:
        objection = np.maximum(0, other.distance_at(points) + HOLD * radii[:, None])
        cost += np.minimum(objection, MOST_PX) ** 2 / len(rivals)
    cost += PAINT * _unlike(drawing, (rows, columns), points, rivals)
    steps = _smooth_choice(cost, missing)
    first = np.clip(steps.astype(int), 0, points.shape[1] - 2)
    share = (steps - first)[:, None].astype(np.float32)
    each = np.arange(len(points))
    middles = points[each, first] * (1 - share) + points[each, first + 1] * share
    radii = np.maximum(radii, THINNEST_PX)
    core = np.minimum(deep, radii) > CORE * radii
    balls = _balls(grid, middles[core], radii[core])
    inside = drawing.distance_at(grid.centres).reshape(balls.shape) - OVER_PX
    return np.maximum(balls, inside)


def _opposite(one: Drawing, other: Drawing) -> bool:
    """Return whether two drawings have one silhouette, or are the same."""
    turn = (one.yaw - other.yaw + math.pi / 2) % math.pi - math.pi / 2
    return abs(turn) < ALIKE


def _unlike(
    drawing: Drawing, at: tuple[np.ndarray, np.ndarray], points: np.ndarray, rivals: list[Drawing]
) -> Float[np.ndarray, "n steps"]:
    """Return how unlike other drawings' paint is, squared, mean over those that are no mirror's."""
    own = drawing.paint[at][:, None, :3]
    drawn = [other for other in rivals if not other.mirrored]
    total = np.zeros(points.shape[:2], np.float32)
    for other in drawn:
        places = other.pixels(points)
        apart = sum(np.square(sample(other.paint[..., i], places) - own[..., i]) for i in range(3))
        total += np.minimum(apart, MOST_UNLIKE) / len(drawn)
    return total


def _smooth_choice(cost: Float[np.ndarray, "n steps"], mask: Mask) -> Float[np.ndarray, " n"]:
    """Return the step of least cost at each pixel of a mask, smooth over the mask."""
    picture = np.zeros((*mask.shape, cost.shape[1]), np.float32)
    picture[mask] = cost
    weight = cv2.blur(mask.astype(np.float32), BLUR)[mask]
    mean = np.stack([cv2.blur(layer, BLUR)[mask] for layer in np.moveaxis(picture, -1, 0).copy()])
    chosen = np.zeros(mask.shape, np.float32)
    chosen[mask] = (mean / weight).argmin(axis=0)
    weight = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), DEPTH_BLUR_PX)
    return (cv2.GaussianBlur(chosen, (0, 0), DEPTH_BLUR_PX) / np.maximum(weight, 1e-6))[mask]


def _balls(
    grid: Grid, middles: Float[np.ndarray, "n 3"], radii_px: Float[np.ndarray, " n"]
) -> Volume:
    """Return the signed distance of balls, px, near to them."""
    f = np.full(grid.shape, 99.0, np.float32)
    order = np.argsort(-radii_px)[:: max(1, len(radii_px) // BALLS)]
    places, radii = grid.index(middles)[order], radii_px[order] / VOXEL_PX
    lows = np.maximum(np.floor(places - radii[:, None] - 2), 0).astype(int)
    highs = np.minimum(np.ceil(places + radii[:, None] + 3), grid.shape).astype(int)
    axes = [np.arange(n, dtype=np.float32) for n in grid.shape]
    for place, radius, low, high in zip(places, radii, lows, highs, strict=True):
        box = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
        x, y, z = (np.square(axes[i][box[i]] - place[i]) for i in range(3))
        away = np.sqrt(x[:, None, None] + y[None, :, None] + z[None, None]) - radius
        np.minimum(f[box], away * VOXEL_PX, out=f[box])
    return f
