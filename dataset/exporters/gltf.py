"""Write cameras, mannequin and drawings as one GLB file that Blender and viewers open.

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

import numpy as np
from jaxtyping import Float, Int

from toonset import frames as conventions
from toonset.camera import Camera
from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.dataset.exporters.common import ExportView, write_views
from toonset.dataset.exporters.pinhole import middle_chosen
from toonset.dataset.exporters.view_planes import (
    centred_window_wh,
    clip_range,
    plane_corners,
    scene_views,
    stand,
)
from toonset.dataset.images.picture import encode_png
from toonset.dataset.mesh.gltf_write import ELEMENT_ARRAY_BUFFER, Gltf
from toonset.mesh import Mesh, split_by_face
from toonset.palette.colors import linear_from_srgb
from toonset.write import new_folder, write_bytes

SCENE = "scene.glb"
GREY = [0.6, 0.6, 0.6, 1.0]  # linear, of a mannequin without colours
PLANE_UV = np.array([[0, 0], [0, 1], [1, 1], [1, 0]])  # glTF's v runs down the picture
PLANE_FACES = np.array([[0, 1, 2], [0, 2, 3]])  # counter-clockwise as the camera sees it


def write_gltf(
    folder: Path, views: Sequence[ExportView], mesh: Mesh | None = None, *, force: bool = False
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


def add_mannequin(file: Gltf, mesh: Mesh) -> int:
    """Return the node of the mannequin, with its face colours as vertex colours."""
    vertices, faces, colors = _vertex_colored(mesh)
    attributes = {"POSITION": file.add_array(vertices)}
    if colors is not None:
        attributes["COLOR_0"] = file.add_array(colors)
    base = GREY if colors is None else [1.0] * 4
    material = file.add_material(
        "mannequin", {"baseColorFactor": base}, unlit=False, doubleSided=True
    )
    indices = file.add_array(faces.ravel(), ELEMENT_ARRAY_BUFFER)
    primitive = {"attributes": attributes, "indices": indices, "material": material}
    return file.add("nodes", name="mannequin", mesh=file.add("meshes", primitives=[primitive]))


def add_plane(file: Gltf, view: ExportView, corners: Float[np.ndarray, "4 3"]) -> int:
    """Return the node of a drawing's plane: unlit, seen from its front only."""
    texture = file.add_texture(encode_png(view.rgba), view.name)
    material = file.add_material(
        view.name, {"baseColorTexture": {"index": texture}}, alphaMode="BLEND"
    )
    middle = corners.mean(axis=0)  # vertices near 0 keep more digits in float32
    primitive = {
        "attributes": {
            "POSITION": file.add_array(corners - middle),
            "TEXCOORD_0": file.add_array(PLANE_UV),
        },
        "indices": file.add_array(PLANE_FACES.ravel(), ELEMENT_ARRAY_BUFFER),
        "material": material,
    }
    shape = file.add("meshes", name=view.name, primitives=[primitive])
    return file.add("nodes", name=f"drawing {view.name}", mesh=shape, translation=middle.tolist())


def _vertex_colored(
    mesh: Mesh,
) -> tuple[Float[np.ndarray, "v 3"], Int[np.ndarray, "f 3"], Float[np.ndarray, "v 3"] | None]:
    """Return vertices, faces and linear vertex colours; a vertex of two colours comes twice."""
    if mesh.face_colors is None:
        return mesh.vertices, mesh.faces, None
    palette, color = np.unique(mesh.face_colors, axis=0, return_inverse=True)
    vertex, color, faces = split_by_face(mesh.faces, color.ravel())
    return mesh.vertices[vertex], faces, linear_from_srgb(palette / 255.0)[color]
