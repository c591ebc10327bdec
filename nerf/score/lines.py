"""How well a rendering's dark lines lie on the drawing's: F1 with a tolerance of 2 px."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from toonset.dataset.silhouettes.mask import mask_of
from toonset.view import over_white

TOLERANCE_PX = 2
DARK = 110 / 255  # luma of ink, over white
CONTRAST = 64 / 255  # luma that ink is below what lies on both sides
WIDEST, LEAST_WIDE_PX = 0.04, 6  # a line's widest, of the figure's height
# share of the rim beside a line: 0.4 and more in drawings with lines of 1 px, else 0.27 at most
OUTLINED = 1 / 3
LUMA = np.array([0.299, 0.587, 0.114])


def line_f1(
    rendered: UInt8[np.ndarray, "height width 4"], drawn: UInt8[np.ndarray, "height width 4"]
) -> float | None:
    """Return the harmonic mean of precision and recall of the line pixels, 2 px off is right.

    None where the drawing has no dark outline: what is dark and thin there is no line, or the
    figure is as dark as its lines.
    """
    wanted, found = line_pixels(drawn), line_pixels(rendered)
    if not _is_outlined(drawn, wanted):
        return None
    if not found.any():
        return 0.0
    precision = float(_grown(wanted, TOLERANCE_PX)[found].mean())
    recall = float(_grown(found, TOLERANCE_PX)[wanted].mean())
    return 2 * precision * recall / (precision + recall) if precision + recall else 0.0


def line_pixels(rgba: UInt8[np.ndarray, "height width 4"]) -> Bool[np.ndarray, "height width"]:
    """Return which pixels are dark and part of something thin, over white.

    Thin is what a morphological closing fills (the black-hat transform).
    """
    rows = np.flatnonzero(mask_of(rgba).any(axis=1))
    height = rows[-1] - rows[0] + 1 if len(rows) else 0
    reach = max(LEAST_WIDE_PX, round(WIDEST * height)) // 2
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    luma = np.pad(over_white(rgba) @ LUMA, reach, constant_values=1.0)
    depth = cv2.morphologyEx(luma, cv2.MORPH_CLOSE, disc) - luma
    lines: Bool[np.ndarray, "height width"] = (depth >= CONTRAST) & (luma < DARK)
    return lines[reach:-reach, reach:-reach]


def _is_outlined(
    drawn: UInt8[np.ndarray, "height width 4"], lines: Bool[np.ndarray, "height width"]
) -> bool:
    figure = mask_of(drawn)
    rim = figure & _grown(~np.pad(figure, 1), 1)[1:-1, 1:-1]
    return bool(rim.any()) and float(_grown(lines, 1)[rim].mean()) >= OUTLINED


def _grown(mask: Bool[np.ndarray, "height width"], radius: int) -> Bool[np.ndarray, "height width"]:
    side = 2 * radius + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    return cv2.dilate(mask.astype(np.uint8), disc) > 0
