"""Put back what a drawing shows and the body lacks: nothing that is drawn is cut off.

A missing part is inflated to a string of balls, each as thick as the part is wide, and put where
along its rays the other drawings object least: arms that another pose would carve off, blades,
hair.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float
from scipy import ndimage

from toonset.nerf.sections.drawing import Drawing, Mask, sample
from toonset.nerf.sections.grid import VOXEL_PX, Grid, Volume, silhouette
from toonset.nerf.sections.limbs import thickness
from toonset.raster import dilate, parts

LACKING_PX = 5.0  # beside the surface, somewhere in a part, ...
BESIDE_PX = 1.0  # ... all of which lies so far beside it
LEAST_PART = 8e-4  # of the figure's pixels
LEAST_PX = 30
CUT_OFF = 0.35  # of half the width of what a part belongs to, that it stands out
MIRRORED = 0.35  # weight of a mirrored drawing
INTO_PX = 2  # into the body, that parts hang on it
HOLD = 0.6  # of the radius: what other drawings have to show round a ball's middle
MOST_PX = 25.0  # squared: the largest objection
APART, MOST_APART_PX = 0.03, 60.0  # px^2 per squared px from the body
PAINT, MOST_UNLIKE = 800.0, 0.2
ALIKE = math.radians(15)  # drawings from opposite sides are one silhouette
FILLET_PX = 4.0
BLUR, COARSE_BLUR, DEPTH_BLUR_PX = 9, 25, 3.0
NEAR_STEPS, AWAY = 5, 1e6  # about the depth of a part as a whole
NEARER = 0.01  # px^2 per voxel: of two places alike, the nearer is the one seen
ALONG = math.cos(math.radians(25))  # the mirror axis: a side drawing
TWIN_PX = 1.0  # by which the other drawings may object more to a twin
CORE = 0.75  # of the radius: where a part's balls have their middles
BALLS = 1500
OVER_PX = 1.0  # by which balls may stand out of the drawing
THINNEST_PX = 1.5


def completed(
    grid: Grid,
    f: Volume,
    drawings: Sequence[Drawing],
    everything: Sequence[Drawing],
    plane_x: float | None = None,
) -> Volume:
    """Return f with what it lacks of each drawing in turn.

    Args:
        grid: of f.
        f: a body.
        drawings: that must be covered, the surest first.
        everything: drawings that may object, mirrored ones, too.
        plane_x: of the body's mirror plane; None: it has none.
    """
    for drawing in drawings:
        missing = missing_parts(drawing.mask, silhouette(grid, f, drawing))
        if missing.sum() < LEAST_PX:
            continue
        rivals = rivals_of(drawing, everything)
        balls = inflated(grid, f, drawing, missing, rivals)
        added = [balls] if plane_x is None else [balls, *_twins(balls, drawing, rivals, plane_x)]
        for part in added:
            inside = drawing.distance_at(grid.centres).reshape(grid.shape) - OVER_PX
            f = _united(f, np.maximum(part.distance(grid), inside))
    return f


@dataclass(frozen=True, eq=False)
class Balls:
    """Balls that a missing part is made of.

    Attributes:
        middles: (n, 3) in the world.
        radii: (n,) px.
        color: (n, 3) of the drawing's paint there.
    """

    middles: Float[np.ndarray, "n 3"]
    radii: Float[np.ndarray, " n"]
    color: Float[np.ndarray, "n 3"]

    def distance(self, grid: Grid) -> Volume:
        """Return the signed distance, px, near to the balls."""
        f = np.full(grid.shape, 99.0, np.float32)
        order = np.argsort(-self.radii)[:: max(1, len(self.radii) // BALLS)]
        places, radii = grid.index(self.middles)[order], self.radii[order] / VOXEL_PX
        lows = np.maximum(np.floor(places - radii[:, None] - 2), 0).astype(int)
        highs = np.minimum(np.ceil(places + radii[:, None] + 3), grid.shape).astype(int)
        axes = [np.arange(n, dtype=np.float32) for n in grid.shape]
        for place, radius, low, high in zip(places, radii, lows, highs, strict=True):
            box = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
            x, y, z = (np.square(axes[i][box[i]] - place[i]) for i in range(3))
            away = np.sqrt(x[:, None, None] + y[None, :, None] + z[None, None]) - radius
            np.minimum(f[box], away * VOXEL_PX, out=f[box])
        return f


def missing_parts(
    mask: Mask,
    seen: Float[np.ndarray, "height width"],
    cut_off: float = CUT_OFF,
    least: float = LEAST_PART,
) -> Mask:
    """Return the parts of a mask that a body lacks.

    Args:
        mask: what should be there.
        seen: the lowest f along each pixel's ray.
        cut_off: of half the width of what a part belongs to, that it stands out.
        least: of the mask's pixels: smaller parts are none.
    """
    labels = parts(mask & (seen > BESIDE_PX))
    sizes = np.bincount(labels.reshape(-1))
    reach = ndimage.maximum(seen, labels, np.arange(len(sizes)))
    chosen = (reach > LACKING_PX) & (sizes > least * mask.sum())
    wide = ndimage.median(thickness(mask)[0], labels, np.arange(len(sizes)))
    chosen &= reach > cut_off * wide  # else the outline is off, and nothing cut off
    chosen[0] = False
    return chosen[labels]


def inflated(
    grid: Grid, f: Volume, drawing: Drawing, missing: Mask, rivals: Sequence[Drawing]
) -> Balls:
    """Return the balls of a missing part, where the rivals object least."""
    rows, columns = np.nonzero(missing)
    points = grid.along(drawing, np.stack([columns, rows], axis=-1) + 0.5)
    part = dilate(missing, INTO_PX) & drawing.mask
    radii, deep = (picture[rows, columns] for picture in thickness(part))
    cost = APART * grid.at(f, points).clip(0, MOST_APART_PX) ** 2
    cost += _objections(points, radii[:, None], rivals)
    color = drawing.paint[rows, columns, :3]
    cost += PAINT * _unlike(color[:, None], points, rivals)
    cost += NEARER * np.arange(points.shape[1], dtype=np.float32)
    steps = _smooth_choice(cost, missing)
    first = np.clip(steps.astype(int), 0, points.shape[1] - 2)
    share = (steps - first)[:, None].astype(np.float32)
    each = np.arange(len(points))
    middles = points[each, first] * (1 - share) + points[each, first + 1] * share
    radii = np.maximum(radii, THINNEST_PX)
    core = np.minimum(deep, radii) > CORE * radii
    return Balls(middles[core], radii[core], color[core])


def _twins(
    balls: Balls, drawing: Drawing, rivals: Sequence[Drawing], plane_x: float
) -> list[Balls]:
    """Return the mirror image of what a side drawing shows once, if no other drawing objects.

    Of two feet or hands a side drawing shows one outline.
    """
    if abs(drawing.camera.rotation[2, 0]) < ALONG or not len(balls.radii):
        return []
    image = (balls.middles * [-1, 1, 1] + [2 * plane_x, 0, 0]).astype(np.float32)
    own, other = (
        _objections(m, balls.radii, rivals) + PAINT * _unlike(balls.color, m, rivals)
        for m in (balls.middles, image)
    )
    return [replace(balls, middles=image)] if other.mean() < own.mean() + TWIN_PX**2 else []


def _objections(
    points: Float[np.ndarray, "*n 3"], radii: Float[np.ndarray, "*#n"], rivals: Sequence[Drawing]
) -> Float[np.ndarray, "*n"]:
    """Return how far rivals would have balls elsewhere, mean square px."""
    total = np.zeros(points.shape[:-1], np.float32)
    weights = [MIRRORED if other.mirrored else 1.0 for other in rivals]
    for other, weight in zip(rivals, weights, strict=True):
        objection = np.maximum(0, other.distance_at(points) + HOLD * radii)
        total += weight / sum(weights) * np.minimum(objection, MOST_PX) ** 2
    return total


def _united(one: Volume, other: Volume) -> Volume:
    """Return the union of two bodies, without a crease where they meet."""
    fillet = (1 - np.abs(one - other) / FILLET_PX).clip(min=0)
    return np.minimum(one, other) - FILLET_PX / 4 * fillet**2


def rivals_of(drawing: Drawing, everything: Sequence[Drawing]) -> list[Drawing]:
    """Return the drawings of other silhouettes than one has."""
    return [other for other in everything if not _opposite(other, drawing)]


def _opposite(one: Drawing, other: Drawing) -> bool:
    """Return whether two drawings have one silhouette, or are the same."""
    turn = (one.yaw - other.yaw + math.pi / 2) % math.pi - math.pi / 2
    return abs(turn) < ALIKE


def _unlike(
    color: Float[np.ndarray, "*n 3"], points: Float[np.ndarray, "*n 3"], rivals: Sequence[Drawing]
) -> Float[np.ndarray, "*n"]:
    """Return how unlike other drawings' paint is, squared, mean over those that are no mirror's."""
    drawn = [other for other in rivals if not other.mirrored]
    total = np.zeros(points.shape[:-1], np.float32)
    for other in drawn:
        places = other.pixels(points)
        apart = sum(
            np.square(sample(other.paint[..., i], places) - color[..., i]) for i in range(3)
        )
        total += np.minimum(apart, MOST_UNLIKE) / len(drawn)
    return total


def _smooth_choice(cost: Float[np.ndarray, "n steps"], mask: Mask) -> Float[np.ndarray, " n"]:
    """Return the step of least cost at each pixel of a mask, smooth over the mask."""
    coarse = _blurred(cost, mask, COARSE_BLUR).argmin(axis=1)[:, None]
    away = np.abs(np.arange(cost.shape[1]) - coarse) > NEAR_STEPS  # else two legs have a mean
    chosen = np.zeros(mask.shape, np.float32)
    chosen[mask] = (_blurred(cost, mask, BLUR) + AWAY * away).argmin(axis=1)
    weight = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), DEPTH_BLUR_PX)
    return (cv2.GaussianBlur(chosen, (0, 0), DEPTH_BLUR_PX) / np.maximum(weight, 1e-6))[mask]


def _blurred(
    cost: Float[np.ndarray, "n steps"], mask: Mask, size: int
) -> Float[np.ndarray, "n steps"]:
    """Return the mean of the costs at the pixels of a mask within a square."""
    picture = np.zeros((*mask.shape, cost.shape[1]), np.float32)
    picture[mask] = cost
    weight = cv2.blur(mask.astype(np.float32), (size, size))[mask]
    layers = (np.ascontiguousarray(picture[..., i]) for i in range(cost.shape[1]))
    return np.stack([cv2.blur(layer, (size, size))[mask] / weight for layer in layers], axis=-1)
