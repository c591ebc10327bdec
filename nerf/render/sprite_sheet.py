"""Pack a turn into a sprite sheet: one picture of equal cells, and a JSON for game engines.

The JSON is the "hash" layout of TexturePacker and Aseprite: `frames` by name with frame, size,
duration and pivot, and in `meta` the picture and a frame tag; `animations` names the frames of the
turn in order. Read as it is by PixiJS, Phaser, Godot and Unity importers; as cells are equal, any
engine can also cut the picture into `columns` x `rows`.

Source: Aseprite's docs, "Sprite sheet export"; TexturePacker's JSON hash; PixiJS `Spritesheet`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import UInt8

from toonset import __version__
from toonset.camera import Camera
from toonset.errors import OutputError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.render.animation import check_one_size, duration_ms
from toonset.nerf.render.turntable import filled_box

MARGIN_PX = 1  # empty, all round a cell: nothing bleeds from its neighbours
LARGEST_SIDE = 8192  # that common GPUs take as a texture
ANIMATION = "turn"


@dataclass(frozen=True, eq=False)
class SpriteSheet:
    """A sheet of equal cells, row by row.

    Attributes:
        rgba: the picture.
        columns, rows: cells; the last row may be short.
        cell_wh: size of a cell in pixels.
        crop_xy: pixel of the rendered pictures at which a cell begins.
        count: how many cells are used.
    """

    rgba: UInt8[np.ndarray, "height width 4"]
    columns: int
    rows: int
    cell_wh: tuple[int, int]
    crop_xy: tuple[int, int]
    count: int


def sprite_sheet(pictures: Sequence[UInt8[np.ndarray, "height width 4"]]) -> SpriteSheet:
    """Return the pictures as a nearly square sheet, all cut to what any of them shows.

    Raises:
        OutputError: the pictures differ in size, or the sheet is larger than GPUs take.
    """
    check_one_size(pictures, "turntable sprites")
    left, top, right, bottom = _common_box(pictures)
    width, height = right - left + 2 * MARGIN_PX, bottom - top + 2 * MARGIN_PX
    columns = max(1, min(len(pictures), round(math.sqrt(len(pictures) * height / width))))
    rows = -(-len(pictures) // columns)
    if max(columns * width, rows * height) > LARGEST_SIDE:
        raise OutputError(
            f"turntable sprites: {columns * width} x {rows * height} px, at most {LARGEST_SIDE} "
            "fit into a texture; use a smaller --size or fewer views"
        )
    sheet = np.zeros((rows * height, columns * width, 4), dtype=np.uint8)
    for number, picture in enumerate(pictures):
        x, y = number % columns * width + MARGIN_PX, number // columns * height + MARGIN_PX
        sheet[y : y + bottom - top, x : x + right - left] = picture[top:bottom, left:right]
    crop = (left - MARGIN_PX, top - MARGIN_PX)
    return SpriteSheet(sheet, columns, rows, (width, height), crop, len(pictures))


def sprite_json(
    sheet: SpriteSheet, picture_name: str, pivots: Sequence[tuple[float, float]]
) -> dict[str, Any]:
    """Return the sheet's description.

    Args:
        sheet: as `sprite_sheet` returns it.
        picture_name: file name of its picture, beside the JSON.
        pivots: where the figure stands in every rendered picture, pixels, see `feet`.
    """
    width, height = sheet.cell_wh
    names = [f"{ANIMATION}_{number:03d}" for number in range(sheet.count)]
    frames = {}
    for number, (name, pivot) in enumerate(zip(names, pivots, strict=True)):
        x, y = number % sheet.columns * width, number // sheet.columns * height
        frames[name] = {
            "frame": {"x": x, "y": y, "w": width, "h": height},
            "rotated": False,
            "trimmed": False,
            "spriteSourceSize": {"x": 0, "y": 0, "w": width, "h": height},
            "sourceSize": {"w": width, "h": height},
            "duration": duration_ms(sheet.count),
            "pivot": {
                "x": round((pivot[0] - sheet.crop_xy[0]) / width, 5),
                "y": round((pivot[1] - sheet.crop_xy[1]) / height, 5),
            },
        }
    tag = {"name": ANIMATION, "from": 0, "to": sheet.count - 1, "direction": "forward"}
    meta = {
        "app": "toonset",
        "version": __version__,
        "image": picture_name,
        "format": "RGBA8888",
        "size": {"w": sheet.columns * width, "h": sheet.rows * height},
        "scale": "1",
        "frameTags": [tag],
        "columns": sheet.columns,
        "rows": sheet.rows,
    }
    return {"frames": frames, "animations": {ANIMATION: names}, "meta": meta}


def feet(trained: TrainedField, camera: Camera) -> tuple[float, float]:
    """Return the pixel below the figure's middle on the ground that it stands on."""
    low, high = filled_box(trained.hull)
    middle = (low + high) / 2
    (pixel,), _, _ = camera.project(np.array([[middle[0], low[1], middle[2]]]))
    return float(pixel[0]), float(pixel[1])


def _common_box(
    pictures: Sequence[UInt8[np.ndarray, "height width 4"]],
) -> tuple[int, int, int, int]:
    """Return left, top, right, bottom of what any picture shows; all of it if none does."""
    shown = np.any([picture[..., 3] > 0 for picture in pictures], axis=0)
    if not shown.any():
        return 0, 0, shown.shape[1], shown.shape[0]
    rows, columns = np.nonzero(shown.any(axis=1))[0], np.nonzero(shown.any(axis=0))[0]
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
