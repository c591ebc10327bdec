"""Enclosed patches in the background's colour: holes, or white eyes, shirts and paper?

A picture alone cannot always tell; these rules say what is assumed. A patch is a hole (the gap
between arm and body) if all of this holds:

- it is larger than a small share of the figure,
- nothing lies inside it (an eye has a pupil),
- its border looks like the figure's outline: as inked as that, and without soft shades beside it
  (a white shirt has folds and borders on skin without the contour line),
- most of the figure is in other colours (else it is a line drawing, whose paper is its body).
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from toonset.dataset.background import difference

LEAST_HOLE_PX = 9
LEAST_ISLAND_PX = 4
LINE_ART = 0.5  # of the figure: more of it in the background's colour is a line drawing
INK_LUMA = 64  # of 255: darker is ink
SOFT_SHADE = 48  # levels from the background: nearer is a shade of it
AS_INKED = 0.5  # of the outline's share of ink
MORE_SHADES = 0.05  # of the border, beyond the outline's share of soft shades
SQUARE = np.ones((3, 3), np.uint8)
LUMA = np.array([0.299, 0.587, 0.114])  # Source: ITU-R BT.601


def open_holes(
    rgb: UInt8[np.ndarray, "height width 3"],
    mask: Bool[np.ndarray, "height width"],
    enclosed: Bool[np.ndarray, "height width"],
    background: tuple[int, int, int],
    least_share: float,
) -> tuple[Bool[np.ndarray, "height width"], int]:
    """Return the figure without its holes, and how many there were.

    Args:
        rgb: the crop of the sheet.
        mask: the figure with everything that it encloses.
        enclosed: its patches in the background's colour.
        background: that colour.
        least_share: of the figure's area; a smaller patch is no hole.
    """
    area = int(mask.sum())
    if not enclosed.any() or int(enclosed.sum()) > LINE_ART * area:
        return mask, 0
    contrast, luma = difference(rgb, background), rgb @ LUMA
    outline = _border_look(~mask, mask & ~enclosed, contrast, luma)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(
        enclosed.astype(np.uint8), connectivity=4
    )
    result, opened = mask.copy(), 0
    for number in range(1, len(stats)):
        if stats[number, cv2.CC_STAT_AREA] < max(least_share * area, LEAST_HOLE_PX):
            continue
        window = _window(stats[number], labels.shape)
        patch = labels[window] == number
        solid = (mask & ~enclosed)[window]
        look = _border_look(patch, solid, contrast[window], luma[window])
        if not _has_islands(patch) and _alike(look, outline):
            result[window] &= ~patch
            opened += 1
    return result, opened


def _border_look(
    empty: np.ndarray, solid: np.ndarray, contrast: np.ndarray, luma: np.ndarray
) -> tuple[float, float]:
    """Return the share of ink within 3 px of a patch, and of soft shades 3 to 4 px away.

    The nearer two pixels are left out of the shades: there the edge itself is soft.
    """
    reach = [
        cv2.dilate(empty.astype(np.uint8), SQUARE, iterations=steps) > 0 for steps in (2, 3, 4)
    ]
    ink = luma[reach[1] & solid] < INK_LUMA
    shades = contrast[reach[2] & ~reach[0] & solid] < SOFT_SHADE
    return _share(ink), _share(shades)


def _share(values: np.ndarray) -> float:
    return float(values.mean()) if values.size else 0.0


def _alike(hole: tuple[float, float], outline: tuple[float, float]) -> bool:
    return hole[0] >= AS_INKED * outline[0] and hole[1] <= outline[1] + MORE_SHADES


def _window(stat: np.ndarray, shape: tuple[int, int]) -> tuple[slice, slice]:
    x, y, width, height = (int(value) for value in stat[:4])
    return (
        slice(max(y - 5, 0), min(y + height + 5, shape[0])),
        slice(max(x - 5, 0), min(x + width + 5, shape[1])),
    )


def _has_islands(patch: Bool[np.ndarray, "height width"]) -> bool:
    """Return whether something lies inside the patch."""
    outside = np.pad(~patch, 1, constant_values=True).astype(np.uint8)
    _, _, stats, _ = cv2.connectedComponentsWithStats(outside, connectivity=8)
    sizes = np.sort(stats[1:, cv2.CC_STAT_AREA])[::-1]  # the largest is the surroundings
    return bool((sizes[1:] >= LEAST_ISLAND_PX).any())
