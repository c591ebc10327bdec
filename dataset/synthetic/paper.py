"""Rule a sheet's paper, and add title, captions and grain."""

from __future__ import annotations

import re
from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw, ImageFont

from toonset.dataset.synthetic.layout import CellGrid

NAMES = ("FRONT", "3/4", "SIDE", "3/4 BACK", "BACK", "3/4 BACK", "SIDE", "3/4")  # by 45 degrees
LETTERS, CAPITALS = 0.04, 0.07  # of the cell: height of a caption's letters, of the title's
INDENT = 0.1  # of the cell: the title's left margin
LONGEST = 40  # letters of a title
FILE_TYPE = re.compile(r"\.\w{2,5}$")
INK = (72, 70, 68)
RULE = (186, 188, 192)
RULE_WIDTH = 0.004  # of the cell
BLOTCH_PX = 4  # of the grain's coarser half

Sheet = UInt8[np.ndarray, "height width 4"]


def ruled(
    ground: UInt8[np.ndarray, "height width 3"],
    grid: CellGrid,
    figures: Sequence[tuple[int, int, int, int]],
    count: int,
) -> UInt8[np.ndarray, "height width 3"]:
    """Return the ground with `count` level lines per row, from its figures' soles to their tops.

    Args:
        ground: of the sheet.
        grid: of its cells.
        figures: (x, y, width, height) of every figure in the sheet.
        count: lines; of one, it is the ground line.
    """
    picture, width = ground.copy(), max(1, round(RULE_WIDTH * grid.cell_px))
    for start in range(0, grid.count, grid.columns):
        own = figures[start : start + grid.columns]
        top, soles = min(y for _, y, _, _ in own), max(y + high for _, y, _, high in own)
        for y in np.linspace(soles, top, count).round().astype(int):
            picture[y : y + width] = RULE
    return picture


def with_title(sheet: Sheet, grid: CellGrid, title: str) -> Sheet:
    """Return an opaque sheet with a mesh's name in the strip above its cells."""
    picture = Image.fromarray(np.ascontiguousarray(sheet[..., :3]))
    font = ImageFont.load_default(size=max(CAPITALS * grid.cell_px, 6))
    place = (INDENT * grid.cell_px, grid.title_px / 2)
    text = FILE_TYPE.sub("", title).replace("_", " ").upper()[:LONGEST]
    ImageDraw.Draw(picture).text(place, text, fill=INK, font=font, anchor="lm")
    return np.dstack([np.asarray(picture), sheet[..., 3]])


def with_captions(sheet: Sheet, grid: CellGrid, yaws_deg: Sequence[float]) -> Sheet:
    """Return an opaque sheet with the name of each view in the strip under its cell."""
    picture = Image.fromarray(np.ascontiguousarray(sheet[..., :3]))
    pen = ImageDraw.Draw(picture)
    font = ImageFont.load_default(size=max(LETTERS * grid.cell_px, 6))
    for index, yaw in enumerate(yaws_deg):
        x, y, width, height = grid.box(index)
        place = (x + width / 2, y + height + grid.caption_px / 2)
        name = NAMES[round(yaw / 45) % 8]
        pen.text(place, name, fill=INK, font=font, anchor="mm")
    return np.dstack([np.asarray(picture), sheet[..., 3]])


def with_grain(sheet: Sheet, levels: float, generator: np.random.Generator) -> Sheet:
    """Return an opaque sheet with grey noise of deviation `levels`, half of it in blotches."""
    if not levels:
        return sheet
    shape = sheet.shape[:2]
    fine, coarse = (generator.standard_normal(shape).astype(np.float32) for _ in range(2))
    coarse = cv2.GaussianBlur(coarse, (0, 0), BLOTCH_PX)
    grain = fine / fine.std() + coarse / coarse.std()
    noisy = sheet[..., :3] + (levels / np.sqrt(2) * grain)[..., None]
    return np.dstack([np.rint(np.clip(noisy, 0, 255)).astype(np.uint8), sheet[..., 3]])
