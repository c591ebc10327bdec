"""Add captions and paper grain to a sheet."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw, ImageFont

from toonset.dataset.synthetic.layout import CellGrid

NAMES = ("FRONT", "3/4", "SIDE", "3/4 BACK", "BACK", "3/4 BACK", "SIDE", "3/4")  # by 45 degrees
LETTERS = 0.04  # of the cell: height of a caption's letters
INK = (72, 70, 68)
BLOTCH_PX = 4  # of the grain's coarser half

Sheet = UInt8[np.ndarray, "height width 4"]


def with_captions(sheet: Sheet, grid: CellGrid) -> Sheet:
    """Return an opaque sheet with the name of each view in the strip under its cell."""
    picture = Image.fromarray(np.ascontiguousarray(sheet[..., :3]))
    pen = ImageDraw.Draw(picture)
    font = ImageFont.load_default(size=max(LETTERS * grid.cell_px, 6))
    for index in range(grid.count):
        x, y, width, height = grid.box(index)
        place = (x + width / 2, y + height + grid.caption_px / 2)
        name = NAMES[round(8 * index / grid.count) % 8]
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
