"""Where world points lie in a picture, and what it shows there."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float, Shaped

from toonset.camera import Camera

Places = tuple[Float[np.ndarray, "h w"], Float[np.ndarray, "h w"]]


def places_in(
    camera: Camera, points: Float[np.ndarray, "h w 3"]
) -> tuple[Places, Float[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
    """Return where world points lie in a picture, their depth, and which are in front.

    The first pixel's centre is at 0; points behind a pinhole lie far beyond the picture.
    """
    pixels, depth, front = camera.project_grid(points)
    x, y = (pixels - 0.5).astype(np.float32)
    if not front.all():
        x, y = (np.nan_to_num(at, nan=-1e4) for at in (x, y))
    return (x, y), depth, front


def sample_picture(
    picture: Shaped[np.ndarray, "height width *channels"], places: Places, mode: int
) -> Shaped[np.ndarray, "h w *channels"]:
    """Return a picture's values at places; beyond its edges those of the edge."""
    return cv2.remap(picture, *places, mode, borderMode=cv2.BORDER_REPLICATE)
