"""What saving a sheet as JPEG does to it."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from toonset.dataset.images.picture import decode_rgba


def through_jpeg(
    sheet: UInt8[np.ndarray, "height width channels"], quality: int
) -> UInt8[np.ndarray, "height width 4"]:
    """Return an opaque sheet after it was a JPEG file, colours at half resolution as usual."""
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(sheet[..., :3])).save(file, "JPEG", quality=quality)
    return decode_rgba(file.getvalue(), Path("sheet.jpg"))
