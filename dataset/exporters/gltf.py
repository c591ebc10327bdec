"""Writing cameras, mannequin and drawings as one GLB file that Blender and viewers open.

    scene.glb          a node per view with its camera; the drawing on a plane behind the mannequin
    images/000.png     the drawings, RGBA
    toonset.json       the exact cameras

glTF has orthographic cameras: such views are exact. It has no lens shift. An orthographic camera
moves sideways instead; a pinhole sees a window that is wider than its drawing, with the principal
point in its middle, and the plane hangs off-centre in it. All cameras get one window (in their own
pixels), so that one render size fits them all: `extras.window_px` of the scene. A drawing's back is
not shown, else the views from behind would see the front's plane.
Source: Khronos glTF 2.0 specification.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from toonset import frames as conventions
from toonset.camera import Camera
from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.dataset.exporters.common import ExportView, write_views
from toonset.dataset.exporters.gltf_mesh import add_mannequin, add_plane
from toonset.dataset.exporters.pinhole import middle_chosen
from toonset.dataset.exporters.view_planes import (
    centred_window_wh,
    clip_range,
    plane_corners,
    scene_views,
    stand,
)
from toonset.dataset.mesh.gltf_write import Gltf
from toonset.mesh import Mesh
from toonset.write import new_folder, write_bytes

SCENE = "scene.glb"


def write_gltf(
    folder: Path,
    views: Sequence[ExportView],
    mesh: Mesh | None = None,
    *,
    force: bool = False,
) -> tuple[ExportView, ...]:
    """Write a GLB scene; the folder appears whole or not at all.

    Returns:
        The views as they were written: with square pixels.

    Raises:
        OutputError: the folder exists, or cannot be written.
    """
    written = scene_views(views)
    pictures = [f"images/{view.name}" for view in written]
    data = _scene(written, mesh)
    with new_folder(folder, force=force) as temporary:
        write_bytes(temporary / SCENE, data)
        write_views(temporary, "gltf", written, pictures, mesh)
    return written


def _scene(views: Sequence[ExportView], mesh: Mesh | None) -> bytes:
    file = Gltf()
    if mesh is not None:
        file.roots.append(add_mannequin(file, mesh))
    window = centred_window_wh(views)
    for view in views:
        camera = _add_camera(file, view, mesh, window, clip_range(view, views, mesh))
        file.roots += [camera, add_plane(file, view, plane_corners(view, views, mesh))]
    return file.encode({"window_px": list(window)})


def _add_camera(
    file: Gltf,
    view: ExportView,
    mesh: Mesh | None,
    window: tuple[int, int],
    near_far: tuple[float, float],
) -> int:
    exact = NativeCamera.of(view.camera).model_dump(mode="json")
    if view.camera.is_orthographic:
        view, lens = middle_chosen(view), _orthographic(view.camera, window)
    else:
        lens = _perspective(view.camera, window)
    kind = str(lens["type"])
    lens[kind] |= dict(zip(("znear", "zfar"), near_far, strict=True))
    matrix = conventions.opengl_pose_from_opencv(stand(view, mesh))
    return file.add(
        "nodes",
        name=f"camera {view.name}",
        camera=file.add("cameras", name=view.name, **lens),
        matrix=matrix.T.ravel().tolist(),  # glTF lists columns
        extras={"toonset": exact},
    )


def _orthographic(camera: Camera, window: tuple[int, int]) -> dict[str, Any]:
    half = {f"{axis}mag": n / 2 / camera.scale for axis, n in zip("xy", window, strict=True)}
    return {"type": "orthographic", "orthographic": half}


def _perspective(camera: Camera, window: tuple[int, int]) -> dict[str, Any]:
    width, height = window
    angle = 2 * math.atan(height / 2 / float(camera.K[1, 1]))
    return {"type": "perspective", "perspective": {"yfov": angle, "aspectRatio": width / height}}
