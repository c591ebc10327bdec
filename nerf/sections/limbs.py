"""Find how deep limbs are and where: the front drawing's runs beside the widest one.

A limb is at most LIMB_DEPTH times as deep as wide. Along the ray through a run's middle its depth
is where the diagonal drawings object least, where the side drawing shows the run's colour, and near
the middle of the side drawing's run; the cost is blurred along the limb. What sticks out of the
body in the side drawing is held by the limbs at which no diagonal objects to it.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.nerf.sections.drawing import Drawing, Mask, cells, sample
from toonset.nerf.sections.grid import VOXEL_PX, Grid
from toonset.nerf.sections.runs import Outline, Runs, median_along, smoothed
from toonset.raster import quick_depth_inside, quick_distance_to

LIMB_DEPTH = 1.6  # times the width
SLENDER = 0.6  # of a run's half width: a limb is at least so wide
HOLD = 0.8  # of the half depth: what a diagonal has to show round a limb's middle
MOST_HOLD_PX = 24.0
PAINT, MOST_APART = 800.0, 0.2  # px^2 per squared difference in colour, and the largest
CENTRED = 0.02  # px^2 per squared px from the middle of the side drawing's run
OUTSIDE = 1e4  # px^2: beyond the run
HELD_OFF = 9.0  # px^2: by which diagonals may have elsewhere what a limb holds out
ROWS, MEDIAN_ROWS, LAST_ROWS = 3.6, 10, 4.8  # blur of costs; median and blur of depths
THICKNESS_PX = 2.0  # blur of the thickness
FINE_RADII, RADII_STEP = 12, 3


def depths_of(
    grid: Grid,
    face: Outline,
    profile: Outline,
    held: Mask,
    width: Float[np.ndarray, " n"],
    lead: Bool[np.ndarray, " n"],
    diagonals: Sequence[Drawing],
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return half the depth of the front drawing's runs and their middles, px of the side drawing.

    Only runs beside the body's have a meaning.

    Args:
        grid: depths are tried along its rays.
        face: the front drawing's body.
        profile: the side drawing's.
        held: what limbs hold out of the body in the side drawing.
        width: half the width of what each run is of.
        lead: which runs are the body's.
        diagonals: drawings from between; there may be none.
    """
    runs, limb = face.runs, ~lead
    half, middle = LIMB_DEPTH * width, np.zeros(len(width), np.float32)
    if not limb.any():
        return half, middle
    pixels = np.stack([runs.middle, runs.row + np.float32(0.5)], axis=-1)[limb]
    points = grid.along(face.drawing, pixels)
    places = profile.drawing.pixels(points)
    there = profile.runs.number[cells(profile.mask.shape, places)]
    deep = np.minimum(profile.runs.half[there], half[limb, None])
    off = places[..., 0] - profile.runs.middle[there]
    objections = _objections(points, deep, diagonals)
    cost = objections + CENTRED * off**2
    cost += PAINT * _unlike(face, profile.drawing, places, limb)
    cost += OUTSIDE * (np.abs(off) > profile.runs.half[there] - deep + VOXEL_PX)
    links = _within(runs.links(limb), limb)
    best = smoothed(cost, links, ROWS).argmin(axis=1)[:, None]
    depth = np.take_along_axis(deep, best, axis=1)[:, 0]
    found = np.take_along_axis(places[..., 0], best, axis=1)[:, 0]
    found = smoothed(median_along(found, links, MEDIAN_ROWS), links, LAST_ROWS)
    low, high = found - depth, found + depth
    if diagonals and held.any():  # else nobody says which limb holds what
        shown = sample(held.astype(np.float32), places) > 0.5
        against = (objections * shown).sum(axis=1)
        shown &= (against < HELD_OFF * shown.sum(axis=1))[:, None]
        low, high = _reaching(profile.mask, places, shown, best, low, high)
    half[limb], middle[limb] = (high - low) / 2, (high + low) / 2
    return half, middle


def _reaching(
    side: Mask,
    places: Float[np.ndarray, "n steps 2"],
    shown: Bool[np.ndarray, "n steps"],
    best: Int[np.ndarray, "n 1"],
    low: Float[np.ndarray, " n"],
    high: Float[np.ndarray, " n"],
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return where limbs begin and end with what they hold, px of the side drawing.

    Limbs reach as far; where the side drawing has a gap between a limb's place and what it holds,
    the limb is there alone.

    Args:
        side: the side drawing's body.
        places: pixels of the side drawing along each limb's ray.
        shown: at which of them it shows what the limb holds.
        best: the step of each limb's own place.
        low: where each limb begins by itself.
        high: where it ends.
    """
    near = np.where(shown, places[..., 0], np.inf).min(axis=1) - VOXEL_PX / 2
    far = np.where(shown, places[..., 0], -np.inf).max(axis=1) + VOXEL_PX / 2
    gaps = np.cumsum(sample(side.astype(np.float32), places) <= 0.5, axis=1)
    joined = (shown & (gaps == np.take_along_axis(gaps, best, axis=1))).any(axis=1)
    elsewhere = shown.any(axis=1) & ~joined
    low = np.where(elsewhere, near, np.minimum(near, low))
    return low, np.where(elsewhere, far, np.maximum(far, high))


def slenderness(runs: Runs, mask: Mask) -> Float[np.ndarray, " n"]:
    """Return half the width of what each run is of: less than the run's if that crosses a limb."""
    weight = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), THICKNESS_PX)
    radius = cv2.GaussianBlur(thickness(mask)[0] * mask, (0, 0), THICKNESS_PX)
    at = runs.row, runs.middle.astype(int)
    return np.clip(radius[at] / np.maximum(weight[at], 1e-3), SLENDER * runs.half, runs.half)


def thickness(
    mask: Mask,
) -> tuple[Float[np.ndarray, "height width"], Float[np.ndarray, "height width"]]:
    """Return the radius of the largest disc in the mask that covers a pixel, and how deep it lies.

    Radii are whole, or, from FINE_RADII on, RADII_STEP apart.
    """
    deep = quick_depth_inside(mask)
    radius = np.zeros_like(deep)
    coarse = np.arange(FINE_RADII, max(float(deep.max()), FINE_RADII + 1), RADII_STEP)
    for r in (*range(1, FINE_RADII), *coarse.tolist()):
        middles = deep >= r
        if not middles.any():
            break
        radius[quick_distance_to(middles) < r] = r
    return np.maximum(radius, deep), deep


def _objections(
    points: Float[np.ndarray, "n steps 3"],
    deep: Float[np.ndarray, "n steps"],
    diagonals: Sequence[Drawing],
) -> Float[np.ndarray, "n steps"]:
    """Return how far diagonals would have limbs elsewhere, mean square px."""
    total = np.zeros(deep.shape, np.float32)
    hold = HOLD * np.minimum(deep, MOST_HOLD_PX / HOLD)
    for drawing in diagonals:
        total += np.maximum(0, drawing.distance_at(points) + hold) ** 2
    return total / max(len(diagonals), 1)


def _unlike(
    face: Outline, side: Drawing, places: np.ndarray, limb: Bool[np.ndarray, " n"]
) -> Float[np.ndarray, "n steps"]:
    """Return how unlike the side drawing's paint is to each run's, squared."""
    paint = face.drawing.paint
    color = face.runs.means(paint[..., :3], paint[..., 3] * face.mask)[limb]
    apart = sum(np.square(sample(side.paint[..., i], places) - color[:, None, i]) for i in range(3))
    return np.minimum(apart, MOST_APART)


def _within(
    links: tuple[np.ndarray, np.ndarray], some: Bool[np.ndarray, " n"]
) -> tuple[np.ndarray, np.ndarray]:
    """Return links that lead from and to some runs only, numbered among them."""
    number = np.cumsum(some) - 1
    above, below = (number[link[some]] for link in links)
    return above, below
