"""Find the nearest marked pixel, its distance, and connected components."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import ndimage


def distance_to(marked: Bool[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """Return every pixel's distance to the nearest marked one, inf without any."""
    if not marked.any():
        return np.full(marked.shape, np.inf)
    return np.asarray(ndimage.distance_transform_edt(~marked))


def depth_inside(mask: Bool[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """Return how far inside a mask every pixel's centre lies; beyond the picture is outside."""
    return distance_to(np.pad(~mask, 1, constant_values=True))[1:-1, 1:-1] - 0.5


def nearest(
    marked: Bool[np.ndarray, "height width"],
) -> tuple[Int[np.ndarray, "height width"], Int[np.ndarray, "height width"]]:
    """Return row and column of the marked pixel nearest to every pixel; some must be marked."""
    places = ndimage.distance_transform_edt(~marked, return_distances=False, return_indices=True)
    rows, columns = np.asarray(places)
    return rows, columns


def parts(
    marked: Bool[np.ndarray, "height width"], connectivity: int = 8
) -> Int[np.ndarray, "height width"]:
    """Return the number of the connected part, from 1, of every marked pixel; 0 elsewhere."""
    _, numbers = cv2.connectedComponents(marked.astype(np.uint8), connectivity=connectivity)
    return np.asarray(numbers, dtype=np.int64)
