"""Find the smooth zones of a picture, and fit backgrounds of several: a horizon, two halves, edges.

A zone is a connected patch without edges: its colour may change slowly. Zones that together take
the border are one ground with steps. At a step the picture passes from one zone's colour to the
other's, so both and what lies between them are ground where the two zones meet.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Int, UInt8

from toonset.dataset.split.background_field import Field, fit_zone
from toonset.dataset.split.background_pattern import Plate
from toonset.raster import dilate, from_nearest

LONGEST_PX = 1600  # of the copy in which steps are looked for
MEDIAN_PX = 5  # grain and thin lines are no edges
EDGE = 7  # levels between neighbours
LEAST_PIECE = 0.0005  # of the sheet: a smaller patch is no zone
LEAST_ZONE = 0.06  # of the border
TOGETHER = 0.9  # of the border
LEAST_STEP = 12  # levels: a fainter one is noise
LEAST_PATCH = 0.01  # of the sheet: figures part a zone into patches of its colour
CLOSE = 8  # levels from the zone's colour
STEP_PX = 6  # half the width of a step


@dataclass(frozen=True, eq=False)
class Zones:
    """Smooth connected patches of a picture.

    Attributes:
        labels: (rows, columns) number of the zone, from 1; 0 at edges and in small patches.
        shrink: cells of `labels` per pixel of the picture, at most 1.
    """

    labels: Int[np.ndarray, "rows columns"]
    shrink: float

    @property
    def count(self) -> int:
        """Return how many zones there are."""
        return int(self.labels.max())

    def mask(
        self, numbers: list[int], size_wh: tuple[int, int]
    ) -> Bool[np.ndarray, "height width"]:
        """Return the pixels of zones in the picture."""
        own = np.isin(self.labels, numbers).view(np.uint8)
        return cv2.resize(own, size_wh, interpolation=cv2.INTER_NEAREST) > 0


def find_zones(
    rgb: UInt8[np.ndarray, "height width 3"], shrink: float, least_share: float
) -> Zones:
    """Return the zones that take more than a share of the picture.

    Args:
        rgb: the picture, shrunk already.
        shrink: its cells per pixel of the whole one.
        least_share: of the picture.
    """
    small = cv2.medianBlur(np.ascontiguousarray(rgb), MEDIAN_PX)
    near = np.ones((3, 3), np.uint8)
    steep = cv2.subtract(cv2.dilate(small, near), cv2.erode(small, near)).max(axis=2)
    smooth = (steep <= EDGE).view(np.uint8)
    _, found, stats, _ = cv2.connectedComponentsWithStats(smooth, connectivity=4)
    large = stats[:, cv2.CC_STAT_AREA] >= least_share * smooth.size
    large[0] = False
    number = np.where(large, np.cumsum(large), 0).astype(np.int32)
    return Zones(number[np.asarray(found, dtype=np.int32)], shrink)


def shrunk(
    picture: UInt8[np.ndarray, "height width c"], longest_px: int
) -> tuple[np.ndarray, float]:
    """Return a picture no longer than that, and its cells per pixel of the whole one."""
    shrink = min(1.0, longest_px / max(picture.shape[:2]))
    if shrink == 1:
        return picture, shrink
    size = (max(round(side * shrink), 1) for side in picture.shape[1::-1])
    return cv2.resize(picture, tuple(size), interpolation=cv2.INTER_AREA), shrink


def fit_steps(
    rgb: UInt8[np.ndarray, "height width 3"], ring: Bool[np.ndarray, "height width"]
) -> Plate | None:
    """Return a background of several zones that together take the border; None if none do.

    Args:
        rgb: the sheet.
        ring: its border.
    """
    size_wh = rgb.shape[1], rgb.shape[0]
    small, shrink = shrunk(rgb, LONGEST_PX)
    zones = find_zones(small, shrink, LEAST_PIECE)
    groups = _of_one_color(zones, small, _outermost(ring, zones.labels.shape))
    if len(groups) < 2:
        return None
    masks, fields = [], []
    for numbers in groups:
        mask = zones.mask(numbers, size_wh)
        field = fit_zone(rgb, mask)
        away = cv2.absdiff(rgb, field.colors((0, 0, *size_wh))).max(axis=2)
        masks.append((away <= CLOSE) & dilate(mask, STEP_PX + round(1 / zones.shrink)))
        fields.append(field)
    taken = np.any(masks, axis=0)
    typical = [np.array(field.typical) for field in fields]
    step = max(int(np.abs(a - b).max()) for a in typical for b in typical)
    if taken[ring].mean() < TOGETHER or step < LEAST_STEP:
        return None
    return Plate(_laid(rgb, masks, fields), fields[0].typical, f"{len(groups)} zones at its border")


def _outermost(
    ring: Bool[np.ndarray, "height width"], shape: tuple[int, ...]
) -> Bool[np.ndarray, "rows columns"]:
    """Return the outermost cells of a border, which drawn frames do not reach."""
    cells = cv2.resize(ring.view(np.uint8), shape[::-1], interpolation=cv2.INTER_NEAREST)
    x, y, width, height = cv2.boundingRect(cells)
    edge = np.zeros(shape, dtype=bool)
    edge[y : y + height, x : x + width] = True
    edge[y + 1 : y + height - 1, x + 1 : x + width - 1] = False
    return edge


def _of_one_color(
    zones: Zones,
    small: UInt8[np.ndarray, "rows columns 3"],
    at_border: Bool[np.ndarray, "rows columns"],
) -> list[list[int]]:
    """Return the zones that take enough of the border, those of one colour together, and patches.

    Figures part a zone into several, of which some do not reach the border.
    """
    areas = np.bincount(zones.labels.ravel())
    shares = np.bincount(zones.labels[at_border], minlength=len(areas)) / at_border.sum()
    numbers = np.flatnonzero((shares > 0) | (areas >= LEAST_PATCH * zones.labels.size))
    numbers = numbers[numbers > 0][np.argsort(-shares[numbers[numbers > 0]], kind="stable")]
    groups: list[list[int]] = []
    colors: list[np.ndarray] = []
    for number in numbers.tolist():
        color = np.median(small[zones.labels == number], axis=0)
        same = [k for k, other in enumerate(colors) if np.abs(other - color).max() < CLOSE]
        if same:
            groups[same[0]].append(number)
        elif shares[number] > 0:
            groups.append([number])
            colors.append(color)
    return [group for group in groups if shares[group].sum() >= LEAST_ZONE]


def _laid(
    rgb: UInt8[np.ndarray, "height width 3"],
    masks: list[Bool[np.ndarray, "height width"]],
    fields: list[Field],
) -> UInt8[np.ndarray, "height width 3"]:
    """Return the nearest zone's colours; the sheet's own, clipped to the zones', at steps."""
    box = (0, 0, rgb.shape[1], rgb.shape[0])
    numbers = np.zeros(rgb.shape[:2], dtype=np.int32)
    for k, mask in enumerate(masks):
        numbers[mask] = k + 1
    zone = from_nearest(numbers, numbers > 0)
    plate = np.zeros_like(rgb)
    low, high = np.full_like(rgb, 255), np.zeros_like(rgb)
    met = np.zeros(rgb.shape[:2], dtype=np.uint8)
    for k, (mask, field) in enumerate(zip(masks, fields, strict=True)):
        colors = field.colors(box)
        plate = np.where((zone == k + 1)[..., None], colors, plate)
        near = dilate(mask, STEP_PX)
        met += near
        low = np.where(near[..., None], np.minimum(low, colors), low)
        high = np.where(near[..., None], np.maximum(high, colors), high)
    between = np.clip(rgb, low, np.maximum(low, high))
    return np.where((met >= 2)[..., None], between, plate)
