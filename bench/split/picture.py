"""Wrongly split sheets in one picture: true boxes green, found ones red, what was left out blue.

Found boxes are numbered from 0, as in the overlay of `toonset split`.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw, ImageFont

from bench.split.cases import SplitCase
from bench.split.methods import Found
from toonset.view import Box

TILE_WH = (620, 340)
TITLE_PX = 20
COLUMNS = 3
TRUE, FOUND, LEFT_OUT = (0, 170, 0), (230, 30, 30), (40, 90, 230)
GREY = (70, 70, 84)
LIGHT, DARK, SQUARE_PX = 225, 200, 12  # checks under transparent sheets

Rgb = UInt8[np.ndarray, "height width 3"]


def tile(case: SplitCase, found: Found, title: str) -> Rgb:
    """Return a small picture of a sheet with boxes and a title, as high as it must be."""
    height, width = case.rgba.shape[:2]
    factor = min(TILE_WH[0] / width, (TILE_WH[1] - TITLE_PX) / height, 1.0)
    size = max(round(width * factor), 1), max(round(height * factor), 1)
    small = cv2.resize(_over_checks(case.rgba), size, interpolation=cv2.INTER_AREA)
    whole = Image.new("RGB", (TILE_WH[0], size[1] + TITLE_PX + 4), GREY)
    whole.paste(Image.fromarray(small), (0, TITLE_PX))
    pen = ImageDraw.Draw(whole)
    pen.text((3, 3), title, "white", font=ImageFont.load_default(12))
    for box in found.left_out:
        _box(pen, box, factor, LEFT_OUT, 0)
    for figure in case.figures:
        _box(pen, figure.box, factor, TRUE, 2)
    for number, figure in enumerate(found.figures):
        corner = _box(pen, figure.box, factor, FOUND, 0)
        pen.text(corner, str(number), FOUND, font=ImageFont.load_default(16))
    return np.asarray(whole)


def contact_sheet(tiles: Sequence[Rgb]) -> Rgb:
    """Return the tiles in rows; at least one is needed."""
    rows = []
    for start in range(0, len(tiles), COLUMNS):
        row = tiles[start : start + COLUMNS]
        strip = np.full((max(len(t) for t in row), COLUMNS * TILE_WH[0], 3), GREY, np.uint8)
        for i, picture in enumerate(row):
            strip[: len(picture), i * TILE_WH[0] : (i + 1) * TILE_WH[0]] = picture
        rows.append(strip)
    return np.concatenate(rows)


def _box(
    pen: ImageDraw.ImageDraw, box: Box, factor: float, rgb: tuple[int, int, int], out: int
) -> tuple[float, float]:
    """Draw a box in the reduced sheet, `out` pixels outside of it; return its corner."""
    x, y = box[0] * factor - out, box[1] * factor + TITLE_PX - out
    right, bottom = x + box[2] * factor + 2 * out, y + box[3] * factor + 2 * out
    pen.rectangle((x, y, right, bottom), outline=rgb, width=2 if out else 1)
    return x + 3, y + 1


def _over_checks(rgba: UInt8[np.ndarray, "height width 4"]) -> Rgb:
    y, x = np.ogrid[: rgba.shape[0], : rgba.shape[1]]
    checks = np.where((y // SQUARE_PX + x // SQUARE_PX) % 2, LIGHT, DARK)[..., None]
    alpha = rgba[..., 3:] / np.float32(255)
    blended: Rgb = (rgba[..., :3] * alpha + checks * (1 - alpha)).astype(np.uint8)
    return blended
