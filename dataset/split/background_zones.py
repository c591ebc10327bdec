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
from toonset.raster import dilate

LONGEST_PX = 1600  # of the copy in which steps are looked for
MEDIAN_PX = 5  # grain and thin lines are no edges
EDGE = 10  # levels between neighbours
LEAST_ZONE = 0.06  # of the border
TOGETHER = 0.9  # of the border
LEAST_STEP = 12  # levels: a fainter one is noise
CLOSE = 8  # levels from the zone's colour
STEP_PX = 3  # half the width of a step


@dataclass(frozen=True, eq=False)
class Zones:
    """Smooth connected patches of a picture.

    Attributes:
        labels: (rows, columns) number of the zone, from 1; 0 at edges and in small patches.
        shrink: cells of `labels` per pixel of the picture, at most 1.
    """

    labels: Int[np.ndarray, "rows columns"]
    shrink: float

    def mask(self, number: int, size_wh: tuple[int, int]) -> Bool[np.ndarray, "height width"]:
        """Return a zone's pixels in the picture."""
        own = (self.labels == number).view(np.uint8)
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


def shrunk(picture: UInt8[np.ndarray, "height width c"], longest_px: int) -> tuple[np.ndarray, float]:
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
    zones = find_zones(*shrunk(rgb, LONGEST_PX), 0.0)
    at_border = cv2.resize(ring.view(np.uint8), zones.labels.shape[::-1], interpolation=0) > 0
    shares = np.bincount(zones.labels[at_border], minlength=2) / max(np.count_nonzero(at_border), 1)
    shares[0] = 0
    numbers = np.flatnonzero(shares >= LEAST_ZONE)
    if len(numbers) < 2:
        return None
    masks, fields = [], []
    for number in numbers:
        mask = zones.mask(int(number), size_wh)
        field = fit_zone(rgb, mask)
        away = cv2.absdiff(rgb, field.colors((0, 0, *size_wh))).max(axis=2)
        masks.append((away <= CLOSE) & dilate(mask, 2 * STEP_PX + round(1 / zones.shrink)))
        fields.append(field)
    taken = np.any(masks, axis=0)
    typical = [np.array(field.typical) for field in fields]
    step = max(int(np.abs(a - b).max()) for a in typical for b in typical)
    if taken[ring].mean() < TOGETHER or step < LEAST_STEP:
        return None
    largest = fields[int(shares[numbers].argmax())]
    return Plate(_laid(rgb, masks, fields), largest.typical, f"{len(numbers)} zones at its border")


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
    _, nearest = cv2.distanceTransformWithLabels(
        (numbers == 0).view(np.uint8), cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.zeros(int(nearest.max()) + 1, dtype=np.int32)
    of_label[nearest[numbers > 0]] = numbers[numbers > 0]
    zone = of_label[nearest]
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
