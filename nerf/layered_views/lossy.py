"""Encode pictures for the page, and decode them as it will."""

from __future__ import annotations

import io

import numpy as np
from jaxtyping import UInt8
from PIL import Image

QUALITY = 80  # of WebP pictures


def webp(
    picture: UInt8[np.ndarray, "height width _"], quality: int = QUALITY, alpha_quality: int = 100
) -> bytes:
    """Return a WebP file."""
    file = io.BytesIO()
    Image.fromarray(picture).save(
        file, "WEBP", quality=quality, alpha_quality=alpha_quality, method=4
    )
    return file.getvalue()


def rgb_of_webp(file: bytes) -> UInt8[np.ndarray, "height width 3"]:
    """Return what a page reads of a WebP file: every other pixel's hue, for one."""
    return np.asarray(Image.open(io.BytesIO(file)).convert("RGB"))
