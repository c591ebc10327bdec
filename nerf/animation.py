"""Pictures as a looping GIF."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from toonset.errors import OutputError
from toonset.nerf.metrics import over_white

SECONDS_PER_TURN = 3.0
SHORTEST_MS = 20  # viewers slow shorter frames down


def encode_gif(pictures: Sequence[UInt8[np.ndarray, "height width 4"]]) -> bytes:
    """Return the pictures over white as a GIF that turns once in three seconds.

    Raises:
        OutputError: the pictures differ in size.
    """
    sizes = {picture.shape[:2] for picture in pictures}
    if len(sizes) != 1:
        raise OutputError(f"turntable.gif: pictures of {len(sizes)} sizes; pass --no-gif")
    flat = [Image.fromarray((over_white(p) * 255 + 0.5).astype(np.uint8)) for p in pictures]
    duration = max(SHORTEST_MS, round(1000 * SECONDS_PER_TURN / len(flat)))
    buffer = io.BytesIO()
    flat[0].save(
        buffer, "GIF", save_all=True, append_images=flat[1:], duration=duration, loop=0, disposal=1
    )
    return buffer.getvalue()
