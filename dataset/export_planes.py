"""Where drawings hang in a 3D scene: in register with the mannequin, seen by their cameras."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from toonset.camera import Camera
from toonset.dataset.export_lens import square_pixels
from toonset.dataset.export_views import ExportView
from toonset.mesh import Mesh

GAP = 0.05  # of the mannequin's radius between it and the plane behind it
STAND_OFF = 3.0  # radii of what is seen from the target to an orthographic camera


def plane_corners(view: ExportView, mesh: Mesh | None) -> Float[np.ndarray, "4 3"]:
    """Return the world corners of a drawing behind the mannequin: top left, then counter-clockwise.

    Seen through the view's camera every pixel of the plane covers that pixel of the picture.
    """
    camera = view.camera
    width, height = camera.size_wh
    corners = np.array([[0, 0], [0, height], [width, height], [width, 0]], dtype=np.float64)
    return camera.unproject(corners, np.full(4, _depth_behind(camera, mesh)))


def reach(view: ExportView, mesh: Mesh | None) -> float:
    """Return a radius around the target that holds mannequin and drawing."""
    corners = np.linalg.norm(plane_corners(view, mesh) - view.camera.target, axis=1).max()
    if mesh is None:
        return float(corners)
    body = np.linalg.norm(mesh.vertices - view.camera.target, axis=1).max()
    return float(max(corners, body))


def stand(view: ExportView, mesh: Mesh | None) -> Float[np.ndarray, "4 4"]:
    """Return world_from_camera (OpenCV axes) of a place from which a 3D program sees the view.

    A pinhole stands where it is; an orthographic camera anywhere before the mannequin.
    """
    pose = view.camera.world_from_camera
    if view.camera.is_orthographic:
        pose[:3, 3] -= STAND_OFF * reach(view, mesh) * view.camera.rotation[2]
    return pose


def clip_range(view: ExportView, mesh: Mesh | None) -> tuple[float, float]:
    """Return depths from `stand` between which everything lies."""
    radius = reach(view, mesh)
    distance = STAND_OFF * radius if view.camera.is_orthographic else 1 / view.camera.k
    return max(distance - 2 * radius, distance / 1000), distance + 2 * radius


def scene_views(views: Sequence[ExportView]) -> tuple[ExportView, ...]:
    """Return the views with square pixels: 3D programs have no others."""
    return tuple(square_pixels(view) for view in views)


def window_wh(views: Sequence[ExportView]) -> tuple[int, int]:
    """Return the size in pixels that holds every view around its picture's middle."""
    return (
        max(view.camera.size_wh[0] for view in views),
        max(view.camera.size_wh[1] for view in views),
    )


def centred_window_wh(views: Sequence[ExportView]) -> tuple[int, int]:
    """Return the size that holds every view around its optical axis (free where orthographic)."""
    sizes = [_around_axis(view.camera) for view in views]
    return max(size[0] for size in sizes), max(size[1] for size in sizes)


def _around_axis(camera: Camera) -> tuple[int, int]:
    if camera.is_orthographic:
        return camera.size_wh
    pairs = zip(camera.center, camera.size_wh, strict=True)
    width, height = (math.ceil(2 * max(c, size - c)) for c, size in pairs)
    return width, height


def _depth_behind(camera: Camera, mesh: Mesh | None) -> float:
    if mesh is None:
        return max(camera.size_wh) / 2 / camera.scale
    depths = camera.project(mesh.vertices)[1]
    return float(depths.max()) + GAP * mesh.radius
