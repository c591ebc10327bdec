"""Place drawings in a 3D scene: in register with the mannequin, as their cameras see them.

The drawings form a wide ring around mannequin and cameras, each behind the mannequin as its camera
sees it. So no drawing stands between another camera and the mannequin, and neighbours stay out of
each other's view.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from toonset.camera import Camera
from toonset.dataset.exporters.common import ExportView
from toonset.dataset.exporters.pinhole import square_pixels
from toonset.mesh import Mesh

STAND_OFF = 2.0  # radii of what is seen from the target to an orthographic camera
RING = 4.0  # such radii from the target to the drawings: 22.5 degrees apart they do not meet
PAST_PINHOLE = 3.0  # distances of a pinhole: the drawing opposite hangs behind it


def plane_corners(
    view: ExportView, views: Sequence[ExportView], mesh: Mesh | None
) -> Float[np.ndarray, "4 3"]:
    """Return the world corners of a drawing: top left, then counter-clockwise.

    Seen through the view's camera every pixel of the plane covers that pixel of the picture.
    """
    width, height = view.camera.size_wh
    corners = np.array([[0, 0], [0, height], [width, height], [width, 0]], dtype=np.float64)
    return view.camera.unproject(corners, np.full(4, ring_radius(views, mesh)))


def ring_radius(views: Sequence[ExportView], mesh: Mesh | None) -> float:
    """Return how far behind its target every drawing hangs."""
    far = [PAST_PINHOLE / view.camera.k for view in views if not view.camera.is_orthographic]
    return max([RING * max(seen_radius(view, mesh) for view in views), *far])


def seen_radius(view: ExportView, mesh: Mesh | None) -> float:
    """Return a radius around the target that holds the mannequin and what the picture shows."""
    camera = view.camera
    farthest = np.abs(np.array([camera.center, np.array(camera.size_wh) - camera.center])).max(0)
    shown = float(np.linalg.norm(farthest)) / camera.scale
    if mesh is None:
        return shown
    return max(shown, float(np.linalg.norm(mesh.vertices - camera.target, axis=1).max()))


def stand(view: ExportView, mesh: Mesh | None) -> Float[np.ndarray, "4 4"]:
    """Return world_from_camera (OpenCV axes) of a place from which a 3D program sees the view.

    A pinhole stands where it is; an orthographic camera anywhere before the mannequin.
    """
    pose = view.camera.world_from_camera
    if view.camera.is_orthographic:
        pose[:3, 3] -= STAND_OFF * seen_radius(view, mesh) * view.camera.rotation[2]
    return pose


def clip_range(
    view: ExportView, views: Sequence[ExportView], mesh: Mesh | None
) -> tuple[float, float]:
    """Return depths from `stand` between which mannequin and drawing lie."""
    radius = seen_radius(view, mesh)
    distance = STAND_OFF * radius if view.camera.is_orthographic else 1 / view.camera.k
    return max(distance - radius, distance / 1000) / 2, 1.1 * (distance + ring_radius(views, mesh))


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
