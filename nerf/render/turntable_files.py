"""A turn's pictures as files, by the names of formats."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence

from toonset.camera import Camera
from toonset.dataset.images.picture import encode_png
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.render.animation import Pictures, encode_gif, encode_mp4, encode_webp
from toonset.nerf.render.sprite_sheet import feet, sprite_json, sprite_sheet

FORMATS = ("gif", "webp", "mp4", "sprites")
ANIMATIONS = {"gif": encode_gif, "webp": encode_webp, "mp4": encode_mp4}
SPRITES = "sprites"


def turntable_files(
    formats: Iterable[str], pictures: Pictures, trained: TrainedField, cameras: Sequence[Camera]
) -> dict[str, bytes]:
    """Return turntable.gif, .webp, .mp4 and sprites.png with sprites.json, by name.

    Args:
        formats: names out of FORMATS.
        pictures: one per camera, in the order of the turn.
        trained: what they show.
        cameras: that saw them.

    Raises:
        OutputError: the pictures differ in size or do not fit into a texture.
        SetupError: "mp4" without its extra.
    """
    files = {}
    for name in formats:
        if name == SPRITES:
            sheet = sprite_sheet(pictures)
            about = sprite_json(sheet, f"{SPRITES}.png", [feet(trained, c) for c in cameras])
            files[f"{SPRITES}.png"] = encode_png(sheet.rgba)
            files[f"{SPRITES}.json"] = json.dumps(about, indent=2, allow_nan=False).encode() + b"\n"
        else:
            files[f"turntable.{name}"] = ANIMATIONS[name](pictures)
    return files
