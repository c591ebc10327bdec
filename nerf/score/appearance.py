"""Score appearance where PSNR misleads: shift-tolerant block PSNR, dirt, sharpness.

PSNR likes blur: a crisp edge a pixel beside the true one costs more than a soft one.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float

from toonset.nerf.score.metrics import MOST_SHIFT_PX, psnr_of

BLOCK_PX = 16  # a side, with a shift of its own
FLAT = 0.12  # gradient (Sobel) below which a drawing is flat
FLAT_PX = 4  # all round, for dirt to be looked for
LUMA = np.array([0.299, 0.587, 0.114])

Picture = Float[np.ndarray, "height width 3"]
Mask = Bool[np.ndarray, "height width"]


def block_psnr(rendered: Picture, drawn: Picture) -> float:
    """Return the PSNR with the best shift, by up to 2 whole pixels, of every block of 16 px."""
    m, (height, width) = MOST_SHIFT_PX, drawn.shape[:2]
    padded = np.pad(rendered, ((m, m), (m, m), (0, 0)), constant_values=1.0)
    rows, columns = -(-height // BLOCK_PX), -(-width // BLOCK_PX)
    room = ((0, rows * BLOCK_PX - height), (0, columns * BLOCK_PX - width))
    best = np.full((rows, columns), np.inf)
    for y in range(2 * m + 1):
        for x in range(2 * m + 1):
            error = ((padded[y : y + height, x : x + width] - drawn) ** 2).mean(axis=-1)
            blocks = np.pad(error, room).reshape(rows, BLOCK_PX, columns, BLOCK_PX)
            best = np.minimum(best, blocks.sum(axis=(1, 3)))
    return psnr_of(float(best.sum()) / (height * width))


def sharpness(rendered: Picture, drawn: Picture, figure: Mask) -> float | None:
    """Return the mean gradient inside the figure over the drawing's; None of a flat drawing."""
    wanted = float(_gradient(drawn)[figure].mean()) if figure.any() else 0.0
    return float(_gradient(rendered)[figure].mean()) / wanted if wanted > 0 else None


def dirt(rendered: Picture, drawn: Picture, figure: Mask) -> float | None:
    """Return the mean gradient, levels per pixel, where the drawing is flat for 4 px all round.

    Weave, specks and smears are there; None where the drawing is flat nowhere.
    """
    square = np.ones((2 * FLAT_PX + 1,) * 2, np.uint8)
    flat = figure & (cv2.dilate(_gradient(drawn), square) < FLAT)
    return 255 / 8 * float(_gradient(rendered)[flat].mean()) if flat.any() else None


def _gradient(picture: Picture) -> Float[np.ndarray, "height width"]:
    """Return the length of Sobel's gradient of luma, 8 times the change per pixel."""
    luma = (picture @ LUMA).astype(np.float32)
    across, down = (cv2.Sobel(luma, cv2.CV_32F, *axis) for axis in ((1, 0), (0, 1)))
    return np.hypot(across, down)
