"""Find the character's bounding box in the world from cameras and masks alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from toonset.camera import Camera
from toonset.errors import BundleError

MARGIN = 1.1  # of the radius that the masks' boxes ask for


@dataclass(frozen=True, eq=False)
class Box:
    """An axis-aligned box in the world.

    Attributes:
        low: (3,) lowest corner, world units.
        high: (3,) highest corner, world units.
    """

    low: Float[np.ndarray, " 3"]
    high: Float[np.ndarray, " 3"]

    @property
    def size(self) -> Float[np.ndarray, " 3"]:
        """Return the edge lengths."""
        return self.high - self.low


def box_of_masks(
    cameras: Sequence[Camera], masks: Sequence[Bool[np.ndarray, "height width"]]
) -> Box:
    """Return a cube that holds whatever all masks show, for any scale and place of the world.

    The middle is the point nearest to the rays through the middles of the masks' boxes; the
    radius is the largest half box, in world units at that point's depth.

    Raises:
        BundleError: no two views look from different directions, or the middle lies behind a
            camera.
    """
    middles, halves = zip(*(_mask_box(mask) for mask in masks), strict=True)
    middle = _nearest_point(cameras, middles)
    radius = 0.0
    for camera, half in zip(cameras, halves, strict=True):
        _, depth, in_front = camera.project(middle[None])
        if not in_front[0]:
            raise BundleError(
                "cameras: the figures' common middle lies behind a camera; check the axes of "
                "transform_matrix (OpenGL: x right, y up, z back)"
            )
        units_per_px = (1 + camera.k * depth[0]) / (camera.scale * min(1.0, camera.pixel_aspect))
        radius = max(radius, float(half) * float(units_per_px))
    return Box(middle - MARGIN * radius, middle + MARGIN * radius)


def _mask_box(mask: Bool[np.ndarray, "height width"]) -> tuple[Float[np.ndarray, " 2"], float]:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    low = np.array([columns[0], rows[0]], dtype=np.float64)
    high = np.array([columns[-1] + 1, rows[-1] + 1], dtype=np.float64)
    return (low + high) / 2, float((high - low).max()) / 2


def _nearest_point(
    cameras: Sequence[Camera], pixels: Sequence[Float[np.ndarray, " 2"]]
) -> Float[np.ndarray, " 3"]:
    """Return the point with the least sum of squared distances to the rays."""
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for camera, pixel in zip(cameras, pixels, strict=True):
        origins, directions = camera.rays(pixel[None])
        across = np.eye(3) - np.outer(directions[0], directions[0])
        normal += across
        right += across @ origins[0]
    if np.linalg.eigvalsh(normal)[0] < 1e-4 * len(cameras):
        raise BundleError(
            "cameras: all views look along one line, so nothing tells how deep the figure is; "
            "at least two views from different sides are needed"
        )
    return np.linalg.solve(normal, right)
