"""Score a rendering's lines: F1 of dark pixels, with a tolerance of some pixels.

Hair and boots as dark as ink count, too: where they end is a line to the eye. But only drawings
with dark lines round their figures are asked.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from toonset.dataset.silhouettes.mask import mask_of
from toonset.raster import distance_to
from toonset.view import over_white

TOLERANCE_PX, OF_PX = 2.0, 260.0  # that a line may be off; of a figure so tall
INK = 0.2  # luma over white below which a pixel is dark
SEEN = 0.3  # opacity from which a pixel shows
DARK = 110 / 255  # luma of a line
CONTRAST = 0.2  # luma that a line is below what lies on both sides
WIDEST, LEAST_WIDE_PX = 0.04, 6  # a line's widest, of the figure's height
# share of the rim beside a line: 0.4 and more in drawings with lines, else 0.27 at most
OUTLINED = 1 / 3
LUMA = np.array([0.299, 0.587, 0.114])


def line_f1(
    rendered: UInt8[np.ndarray, "height width 4"], drawn: UInt8[np.ndarray, "height width 4"]
) -> float | None:
    """Return the harmonic mean of precision and recall of the dark pixels.

    What is off by no more than `tolerance_px` is right. None where the drawing has no dark outline:
    what is dark there is no line, or the figure is as dark as its lines.
    """
    wanted, found = _dark(drawn), _dark(rendered)
    if not wanted.any() or not _is_outlined(drawn, line_pixels(drawn)):
        return None
    if not found.any():
        return 0.0
    near = tolerance_px(drawn)
    precision = float((distance_to(wanted)[found] <= near).mean())
    recall = float((distance_to(found)[wanted] <= near).mean())
    return 2 * precision * recall / (precision + recall) if precision + recall else 0.0


def tolerance_px(drawn: UInt8[np.ndarray, "height width 4"]) -> int:
    """Return how far ink may be off: 2 px of a figure of 260 px, whole pixels, at least 1."""
    return max(1, round(TOLERANCE_PX * _height(drawn) / OF_PX))


def line_pixels(rgba: UInt8[np.ndarray, "height width 4"]) -> Bool[np.ndarray, "height width"]:
    """Return which pixels are dark and part of something thin, over white.

    Thin is what a morphological closing fills (the black-hat transform).
    """
    reach = max(LEAST_WIDE_PX, round(WIDEST * _height(rgba))) // 2
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    luma = np.pad(over_white(rgba) @ LUMA, reach, constant_values=1.0)
    depth = cv2.morphologyEx(luma, cv2.MORPH_CLOSE, disc) - luma
    lines: Bool[np.ndarray, "height width"] = (depth >= CONTRAST) & (luma < DARK)
    return lines[reach:-reach, reach:-reach]


def _dark(rgba: UInt8[np.ndarray, "height width 4"]) -> Bool[np.ndarray, "height width"]:
    dark: Bool[np.ndarray, "height width"] = over_white(rgba) @ LUMA < INK
    return dark & (rgba[..., 3] > SEEN * 255)


def _height(rgba: UInt8[np.ndarray, "height width 4"]) -> int:
    rows = np.flatnonzero(mask_of(rgba).any(axis=1))
    return int(rows[-1] - rows[0] + 1) if len(rows) else 0


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
