"""Part a shaded drawing into patches: areas without an edge in them, however their light changes.

Basins of the gradient (watershed) are merged, the softest border first, until every border left is
an edge. A border's strength is the mean step of colour across it beyond the slope on its sides, a
ramp's is none, and how far the two areas' hues lie apart. Hue is a and b over lightness: a paint in
light and shade lies on one ray through black (`shaded_oklab_from_rgb`).

Sources: F. Meyer, "Color image segmentation" (1992), watershed; R. Adams and L. Bischof, "Seeded
region growing" (1994); P. Arbelaez and others, "Contour detection and hierarchical image
segmentation" (2011), mean strength of a border as the order of merging.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from math import sqrt

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, Int, UInt8

from toonset.palette.colors import shaded_oklab_from_rgb
from toonset.palette.pixels.antialias import OPAQUE
from toonset.raster import dilate, erode, is_uniform, nearest, parts

TALL_PX = 260  # figures are parted no taller: patches are not counted in pixels of a scan
GRAIN, WINDOW_PX, NEAR_PX = 18.0, 7, 3.0  # levels, window and reach of the filter that takes grain
HUE = 4.0  # times lightness: what a step of a or b weighs in edges
SLOPE_SIGMA, BASIN_SIGMA = 0.8, 0.5  # pixels: of the gradient's scale, of its basins
STEPS = 2000.0  # levels of the gradient in a unit of OKLab: as many as fit into 16 bits
SOFT = 0.03  # in OKLab: a softer border is none
NOISE = 0.01  # in OKLab, of one pixel of a border: brush and grain
APART = 0.5  # of the hues' distance, in a border's strength
SMALL_PX, SPECK_PX = 40.0, 6.0  # areas below are merged sooner, of the second at half strength
RIM_PX = 2  # from a figure's inside: what is farther away is a part of its own
SIDE_PX = 3  # from a border to where its sides' slopes are read
DARKEST = 0.05  # lightness: below, hue says nothing

Picture = UInt8[np.ndarray, "height width 4"]
Lab = Float32[np.ndarray, "height width 3"]
Numbers = Int[np.ndarray, "height width"]


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of some drawings.

    Attributes:
        pixels: of each.
        inner: those of them that have none but its own around.
        mean: its colour in `shaded_oklab_from_rgb`.
        spread: covariance of its colours.
    """

    pixels: Int[np.ndarray, " patches"]
    inner: Int[np.ndarray, " patches"]
    mean: Float[np.ndarray, "patches 3"]
    spread: Float[np.ndarray, "patches 3 3"]


def shrunk(picture: Picture) -> Picture:
    """Return a drawing whose figure is no taller than `TALL_PX`."""
    rows = np.flatnonzero((picture[..., 3] >= OPAQUE).any(axis=1))
    tall = int(rows[-1] - rows[0] + 1) if len(rows) else 1
    if tall <= TALL_PX:
        return picture
    width, height = (max(1, round(TALL_PX / tall * n)) for n in picture.shape[1::-1])
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA))


def smooth_lab(picture: Picture) -> tuple[Lab, Bool[np.ndarray, "height width"]]:
    """Return a drawing's colours without grain in `shaded_oklab_from_rgb`, and where it is opaque.

    A figure's rim, which holds paper and line, has the colour beside it, but for parts that are all
    rim; so has what is not opaque.
    """
    opaque = picture[..., 3] >= OPAQUE
    rgb = np.ascontiguousarray(picture[..., :3])
    inside = erode(opaque)
    known = inside | (opaque & ~dilate(inside, RIM_PX))
    if known.any():
        rgb = np.ascontiguousarray(rgb[nearest(known)])
    return shaded_oklab_from_rgb(without_grain(rgb)).astype(np.float32), opaque


def without_grain(rgb: UInt8[np.ndarray, "height width 3"]) -> UInt8[np.ndarray, "height width 3"]:
    """Return a shrunk drawing without grain and brush."""
    for _ in range(2):
        rgb = np.asarray(cv2.bilateralFilter(rgb, WINDOW_PX, GRAIN, NEAR_PX))
    return rgb


def find_patches(lab: Lab, opaque: Bool[np.ndarray, "height width"]) -> tuple[Numbers, Patches]:
    """Return every pixel's patch, -1 where nothing is drawn, and the patches.

    Args:
        lab: see `smooth_lab`.
        opaque: where something is drawn.
    """
    basins = _basins(lab, opaque)
    if not opaque.any():
        return basins - 1, _measured(basins, lab)
    merged = _merged(basins, lab)
    found = np.unique(merged[opaque])
    number = np.zeros(int(merged.max()) + 1, dtype=np.int64)
    number[found] = np.arange(1, len(found) + 1)
    numbers = np.where(opaque, number[merged], 0)
    return numbers - 1, _measured(numbers, lab)


def _basins(lab: Lab, opaque: Bool[np.ndarray, "height width"]) -> Numbers:
    """Return the basin of the gradient that a pixel is in, from 1; 0 where nothing is drawn."""
    from skimage.segmentation import watershed

    blurred = cv2.GaussianBlur(lab * np.array([1, HUE, HUE], np.float32), (0, 0), SLOPE_SIGMA)
    squares = np.zeros(opaque.shape, dtype=np.float32)
    for channel in np.moveaxis(blurred, -1, 0):
        for x, y in ((1, 0), (0, 1)):
            squares += np.square(cv2.Sobel(channel, cv2.CV_32F, x, y) / 8)
    levels = np.minimum(np.sqrt(squares) * STEPS, np.iinfo(np.uint16).max).astype(np.uint16)
    levels = cv2.GaussianBlur(levels, (0, 0), BASIN_SIGMA)
    lowest = (levels == cv2.erode(levels, np.ones((3, 3), np.uint8))) & opaque
    return np.asarray(watershed(levels, parts(lowest, connectivity=4), mask=opaque), np.int64)


def _measured(numbers: Numbers, lab: Lab) -> Patches:
    """Return the patches of a map of numbers from 1."""
    own = numbers > 0
    place, count = numbers[own] - 1, int(numbers.max(initial=0))
    inside = (is_uniform(numbers) & own)[own]
    weight = np.where(inside, 1.0, 0.1)
    color = lab[own].astype(np.float64)
    total = np.bincount(place, weight, count)
    sums = np.stack([np.bincount(place, weight * c, count) for c in color.T], axis=1)
    mean = sums / np.maximum(total, 1e-9)[:, None]
    off = color - mean[place]
    spread = np.empty((count, 3, 3))
    for i in range(3):
        for j in range(3):
            spread[:, i, j] = np.bincount(place, weight * off[:, i] * off[:, j], count)
    return Patches(
        np.bincount(place, minlength=count),
        np.bincount(place, inside, count).astype(np.int64),
        mean,
        spread / np.maximum(total, 1e-9)[:, None, None],
    )


Triple = tuple[float, float, float]
Border = tuple[float, Triple]


@dataclass(eq=False)
class _Areas:
    """Areas while they merge; one that is merged into another is alive no longer.

    Plain numbers: arrays of three take five times as long.

    Attributes:
        pixels: of each.
        sums: of their colours, a and b `HUE` times.
        beside: per area the areas next to it: pixels of the border, sum of the steps to it.
        age: how often it has changed.
        parent: the area that each was merged into; itself.
    """

    pixels: list[float]
    sums: list[Triple]
    beside: list[dict[int, Border]]
    age: list[int]
    parent: list[int]

    def strength(self, one: int, other: int) -> float:
        """Return how strong the border between two areas is."""
        length, (light, a, b) = self.beside[one][other]
        first, second = self.pixels[one], self.pixels[other]
        (l1, a1, b1), (l2, a2, b2) = self.sums[one], self.sums[other]
        light1, light2 = max(l1 / first, DARKEST), max(l2 / second, DARKEST)
        hue_a = a1 / (first * light1) - a2 / (second * light2)
        hue_b = b1 / (first * light1) - b2 / (second * light2)
        noise = NOISE / sqrt(length)
        step = sqrt(light * light + a * a + b * b) / length
        apart = min(light1, light2) * sqrt(hue_a * hue_a + hue_b * hue_b)
        strong = max(step - noise, 0.0) + APART * max(apart - noise, 0.0)
        small = min(first, second)
        return strong * small / (small + SPECK_PX) if small < SMALL_PX else strong

    def merge(self, kept: int, gone: int) -> None:
        """Merge an area into another one."""
        self.parent[gone] = kept
        self.age[kept] += 1
        self.sums[kept] = _sum(self.sums[kept], self.sums[gone])
        self.pixels[kept] += self.pixels[gone]
        del self.beside[kept][gone]
        for other, (length, steps) in self.beside[gone].items():
            if other == kept:
                continue
            del self.beside[other][gone]
            if other in self.beside[kept]:
                more, before = self.beside[kept][other]
                length, steps = length + more, _sum(steps, before)
            self.beside[kept][other] = length, steps
            self.beside[other][kept] = length, _negative(steps)
        self.beside[gone] = {}


def _sum(one: Triple, other: Triple) -> Triple:
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


def _negative(one: Triple) -> Triple:
    return -one[0], -one[1], -one[2]


def _merged(basins: Numbers, lab: Lab) -> Numbers:
    """Return basins after all merges over soft borders."""
    areas = _areas(basins, lab)
    heap = [
        (areas.strength(one, other), one, other, 0, 0)
        for one, beside in enumerate(areas.beside)
        for other in beside
        if one < other
    ]
    heapq.heapify(heap)
    while heap:
        strong, one, other, age, other_age = heapq.heappop(heap)
        alive = areas.parent[one] == one and areas.parent[other] == other
        if not alive or (areas.age[one], areas.age[other]) != (age, other_age):
            continue
        if strong > SOFT:
            break
        kept, gone = one, other
        if len(areas.beside[one]) < len(areas.beside[other]):
            kept, gone = other, one
        areas.merge(kept, gone)
        for near in areas.beside[kept]:
            first, second = min(kept, near), max(kept, near)
            ages = areas.age[first], areas.age[second]
            heapq.heappush(heap, (areas.strength(first, second), first, second, *ages))
    root = np.array(areas.parent)
    while not np.array_equal(root[root], root):
        root = root[root]
    return np.asarray(root[basins])


def _areas(basins: Numbers, lab: Lab) -> _Areas:
    """Return basins with the borders between them."""
    count = int(basins.max()) + 1
    weighed = lab * np.array([1, HUE, HUE], np.float32)
    place = basins.ravel()
    pixels = np.bincount(place, minlength=count).astype(float)
    sums = np.stack([np.bincount(place, c.ravel(), count) for c in np.moveaxis(weighed, -1, 0)], 1)
    both = [_steps(basins, weighed), _steps(basins.T, weighed.transpose(1, 0, 2))]
    first, second, step = (np.concatenate(part) for part in zip(*both, strict=True))
    swap = first > second
    first, second = np.where(swap, second, first), np.where(swap, first, second)
    step = np.where(swap[:, None], -step, step)
    pairs, own = np.unique(first * count + second, return_inverse=True)
    lengths = np.bincount(own).astype(float)
    total = np.stack([np.bincount(own, channel) for channel in step.T], axis=1)
    beside: list[dict[int, Border]] = [{} for _ in range(count)]
    for pair, length, (x, y, z) in zip(
        pairs.tolist(), lengths.tolist(), total.tolist(), strict=True
    ):
        one, other = divmod(pair, count)
        beside[one][other], beside[other][one] = (length, (x, y, z)), (length, (-x, -y, -z))
    colors = [(x, y, z) for x, y, z in sums.tolist()]
    return _Areas(pixels.tolist(), colors, beside, [0] * count, list(range(count)))


def _steps(
    basins: Numbers, color: Lab
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " n"], Float[np.ndarray, "n 3"]]:
    """Return the areas on both sides of every upright border, and the step beyond the slopes."""
    pad = ((0, 0), (SIDE_PX, SIDE_PX))
    wide = np.pad(basins, pad, mode="edge")
    colors = np.pad(color, (*pad, (0, 0)), mode="edge")
    left, right = basins[:, :-1], basins[:, 1:]
    row, column = np.nonzero((left != right) & (left > 0) & (right > 0))
    sides = []
    for start, way in ((column + SIDE_PX, -1), (column + SIDE_PX + 1, 1)):
        own = wide[row, start]
        there = np.ones(len(row), dtype=bool)
        read = [colors[row, start]]
        for away in range(1, SIDE_PX + 1):
            at = (start + way * away).clip(0, wide.shape[1] - 1)
            there &= wide[row, at] == own
            read.append(np.where(there[:, None], colors[row, at], read[-1]))
        slope = (read[1] - read[SIDE_PX]) * -way / (SIDE_PX - 1) * there[:, None]
        sides.append((read[1], slope))
    (before, rise), (after, fall) = sides
    jump = after - before
    agreed = np.where(np.sign(rise) == np.sign(fall), np.minimum(np.abs(rise), np.abs(fall)), 0)
    slope = SIDE_PX * np.sign(rise) * agreed
    less = np.sign(jump) * np.maximum(np.abs(jump) - np.abs(slope), 0)
    step = np.where(np.sign(jump) == np.sign(slope), less, jump)
    return basins[row, column], basins[row, column + 1], step.astype(np.float64)
