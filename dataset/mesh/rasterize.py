"""Rasterise triangles with OpenCV: depth, normal, cover and number at every pixel centre.

The rasteriser is a pinhole that looks into the middle of the picture. Points are handed to it as

    (u, v) away, away       away = the distance to a pinhole's centre; for an orthographic camera,
                            and for pinholes still farther off, FAR_OFF times the mesh's depth, past
                            its nearest point

so that depth is interpolated as the camera does it: as 1 / distance or, so far off, linearly.
Triangles that reach behind a pinhole are not seen: the rasteriser does not cut them. Triangles that
are placed in a picture already lie at depth 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.camera import Camera

FAR_OFF = 1000.0  # depth is then linear within 3e-4 of the mesh's, single precision included
ROOM = 0.02  # of the mesh's depth: clipping planes lie so much nearer and farther
BEHIND = 9.0  # the far plane of triangles at depth 1
NEAREST = 1e-3  # of the far plane's distance: the near one's, where the mesh is round the pinhole

Depth = Float[np.ndarray, "height width"]


def depth_map(
    vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"], camera: Camera
) -> Depth:
    """Return how deep the nearest surface lies past the camera's target; inf where none is."""
    placed = _Placed.of(vertices, camera)
    corners = np.ascontiguousarray(faces, dtype=np.int32)
    cv2.triangleRasterizeDepth(placed.eye, corners, placed.shown, *placed.lens, _settings())
    return placed.past_target()


def depth_and_normals(
    vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"], camera: Camera
) -> tuple[Depth, Float[np.ndarray, "height width 3"]]:
    """Return `depth_map`, and the unit normals of the faces seen; 0 where none is.

    Normals are in camera axes and point towards the viewer, however faces are wound.
    """
    placed = _Placed.of(vertices, camera)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    ways = camera.rotation[2] + camera.k * ((a + b + c) / 3 - camera.target)
    normal = np.where((normal * ways).sum(axis=1, keepdims=True) > 0, -normal, normal)
    tint = np.repeat((normal @ camera.rotation.T + 1) / 2, 3, axis=0).astype(np.float32)
    each = np.arange(3 * len(faces), dtype=np.int32).reshape(-1, 3)
    color = np.zeros((*placed.shown.shape, 3), dtype=np.float32)
    settings = _settings(cv2.RASTERIZE_SHADING_FLAT)
    corners = placed.eye[faces.reshape(-1)]
    cv2.triangleRasterize(corners, each, tint, color, placed.shown, *placed.lens, settings)
    depth = placed.past_target()
    return depth, np.where(np.isfinite(depth)[..., None], 2 * color - 1, 0)


def silhouette_mask(
    pixels: Float[np.ndarray, "vertices 2"],
    faces: Int[np.ndarray, "faces 3"],
    size_wh: tuple[int, int],
) -> Bool[np.ndarray, "height width"]:
    """Return which pixel centres projected triangles cover."""
    width, height = size_wh
    shown = np.full((height, width), BEHIND, dtype=np.float32)
    cv2.triangleRasterizeDepth(_flat(pixels, size_wh), faces, shown, *_ahead(), _settings())
    return shown < BEHIND - 0.1


def face_numbers(
    corners: Float[np.ndarray, "faces 3 2"], size_wh: tuple[int, int]
) -> Int[np.ndarray, "height width"]:
    """Return the number of the triangle that covers a pixel centre, -1 where none does.

    Args:
        corners: in pixels; triangles do not overlap.
        size_wh: of the picture.
    """
    width, height = size_wh
    count = len(corners)
    number = np.repeat((np.arange(count) + 1) / (count + 1), 3).astype(np.float32)
    shown = np.zeros((height, width, 3), dtype=np.float32)
    cv2.triangleRasterizeColor(
        _flat(corners.reshape(-1, 2), size_wh),
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        np.repeat(number[:, None], 3, axis=1),
        shown,
        *_ahead(),
        _settings(cv2.RASTERIZE_SHADING_FLAT),
    )
    return np.rint(shown[..., 0] * (count + 1)).astype(np.int64) - 1


@dataclass(frozen=True, eq=False)
class _Placed:
    """A mesh before the rasteriser.

    Attributes:
        eye: (v, 3) its points.
        shown: (height, width) the empty depth buffer.
        start: where the buffer's depth begins, past the camera's target.
        lens: the rasteriser's pose, field of view, near and far plane.
    """

    eye: Float[np.ndarray, "v 3"]
    shown: Depth
    start: float
    lens: tuple[Float[np.ndarray, "4 4"], float, float, float]

    @classmethod
    def of(cls, vertices: Float[np.ndarray, "v 3"], camera: Camera) -> _Placed:
        width, height = camera.size_wh
        local = (np.asarray(vertices, dtype=np.float64) - camera.target) @ camera.rotation.T
        depth = local[:, 2]
        low, high = float(depth.min()), float(depth.max())
        extent = max(high - low, 1e-6 * height / camera.scale)
        pinhole = -1 / camera.k > low - FAR_OFF * extent if camera.k else False
        start = -1 / camera.k if pinhole else low - FAR_OFF * extent
        away = (depth - start)[:, None]
        # of a pinhole, away / (1 + k z) is 1 / k: corners beside it divide nothing by 0
        shrunk = 1 / camera.k if pinhole else away / (1 + camera.k * depth[:, None])
        place = camera.center * away + camera.scale_uv * local[:, :2] * shrunk
        place = (2 * place - np.array(camera.size_wh) * away) * [1, -1] / height
        eye = np.column_stack([place, -away]).astype(np.float32)
        far = max(high - start, 0.0) + ROOM * extent
        near = max(low - start - ROOM * extent, NEAREST * far)
        shown = np.full((height, width), far, dtype=np.float32)
        return cls(eye, shown, start, (np.eye(4, dtype=np.float32), np.pi / 2, near, far))

    def past_target(self) -> Depth:
        """Return what the filled buffer says, past the camera's target; inf where it is empty."""
        near, far = self.lens[2:]
        empty = self.shown >= far - ROOM / 4 * (far - near)
        return np.where(empty, np.inf, self.shown.astype(np.float64) + self.start)


def _flat(pixels: Float[np.ndarray, "n 2"], size_wh: tuple[int, int]) -> Float[np.ndarray, "n 3"]:
    """Return points of a picture as the rasteriser takes them, at depth 1."""
    width, height = size_wh
    found = np.full((len(pixels), 3), -1, dtype=np.float32)
    found[:, 0] = (pixels[:, 0] * 2 - width) / height
    found[:, 1] = 1 - pixels[:, 1] * (2 / height)
    return found


@cache
def _ahead() -> tuple[Float[np.ndarray, "4 4"], float, float, float]:
    """Return the rasteriser's pose, field of view, near and far plane for points at depth 1."""
    return np.eye(4, dtype=np.float32), np.pi / 2, 0.1, BEHIND


@cache
def _settings(shading: int | None = None) -> Any:
    settings = cv2.TriangleRasterizeSettings()
    settings.setCullingMode(cv2.RASTERIZE_CULLING_NONE)
    if shading is not None:
        settings.setShadingType(shading)
    return settings
