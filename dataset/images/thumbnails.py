"""Make small pictures of large ones, for pages that show thousands."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from toonset.dataset.images.picture import load_rgba
from toonset.errors import PictureError

OVERLAY_WH, TURN_PX = (480, 240), 120  # at most
MOST_FRAMES, FRAME_MS = 12, 160
QUALITY = 70


def thumbnail(picture: Path) -> bytes:
    """Return a picture as a small WebP over white.

    Raises:
        PictureError: it cannot be read.
    """
    return _encoded([_small(load_rgba(picture), *OVERLAY_WH)])


def turn_thumbnail(folder: Path) -> bytes:
    """Return a turntable's pictures, 000.png and so on, as a small animated WebP over white.

    Raises:
        PictureError: one cannot be read, or there is none.
    """
    files = sorted(path for path in folder.glob("*.png") if path.stem.isdecimal())
    if not files:
        raise PictureError(f"{folder}: has no 000.png; run `toonset render` with one --layer")
    step = -(-len(files) // MOST_FRAMES)
    frames = [_small(load_rgba(file), TURN_PX, TURN_PX) for file in files[::step]]
    return _encoded(frames)


def _small(rgba: UInt8[np.ndarray, "height width 4"], width: int, height: int) -> Image.Image:
    """Return a picture over white that fits into a size."""
    factor = min(1.0, width / rgba.shape[1], height / rgba.shape[0])
    size = (max(1, round(rgba.shape[1] * factor)), max(1, round(rgba.shape[0] * factor)))
    image = Image.fromarray(rgba).resize(size, Image.Resampling.BOX)  # premultiplies by itself
    paper = Image.new("RGBA", size, "white")
    paper.alpha_composite(image)
    return paper.convert("RGB")


def _encoded(frames: Sequence[Image.Image]) -> bytes:
    first, *others = frames
    kept = io.BytesIO()
    more = {"save_all": True, "append_images": others, "duration": FRAME_MS, "loop": 0}
    first.save(kept, "WEBP", quality=QUALITY, method=2, **(more if others else {}))
    return kept.getvalue()
