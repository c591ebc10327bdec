"""Render exact label and depth pictures of a mesh off-screen; the only user of pyrender.

`toonset.camera.Camera` as an OpenGL projection, for both kinds of camera at once: with the camera's
frame in the target (x right, y down, z forward), image size (w, h) and centre (cu, cv),

    clip_x = (2 / w) (s x + cu (1 + k z)) - (1 + k z)        clip_w = 1 + k z
    clip_y = (1 + k z) - (2 / h) (s a y + cv (1 + k z))      clip_z = A + B z

with A, B such that the nearest and farthest vertex lie just inside clip_z / clip_w = -1 and 1.
"""

from __future__ import annotations

import contextlib
import importlib
import os
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Float, Int, UInt8

from toonset.camera import MIN_RELATIVE_DEPTH, Camera
from toonset.errors import CameraError, SetupError
from toonset.mesh import Mesh
from toonset.palette.pixels.labels import UNLABELLED

MAX_SIDE_PX = 4096  # the 4-fold multisampled buffers of a larger picture need over half a GiB
DEPTH_MARGIN = 0.01  # of the depth range, in front of and behind the mesh
NEAR, FAR = 1.0, 3.0  # only to invert pyrender's own reading of the depth buffer
INSTALL = (
    "off-screen drawing needs EGL and Mesa, which are missing here ({reason}); "
    "install them: apt-get install -y libegl1 libgl1 libgl1-mesa-dri"
)


@dataclass(frozen=True, eq=False)
class LabelPicture:
    """Rendered labels and depth, one sample per pixel centre, hard edges.

    Attributes:
        labels: (height, width) label of the nearest face, 255 = nothing.
        depth: (height, width) world units past the target's plane; inf = nothing.
    """

    labels: UInt8[np.ndarray, "height width"]
    depth: Float[np.ndarray, "height width"]


def render_labels(
    mesh: Mesh, face_labels: Int[np.ndarray, " faces"], camera: Camera
) -> LabelPicture:
    """Return the label and the depth of the face seen at every pixel of the camera.

    Both sides of a face are drawn.

    Args:
        mesh: world coordinates.
        face_labels: 0 to 254 per face.
        camera: orthographic or pinhole, with any principal point; `size_wh` is the picture's size.

    Raises:
        CameraError: the picture is too large, or the mesh reaches behind a pinhole's centre.
        SetupError: EGL or Mesa is missing.
    """
    width, height = camera.size_wh
    if max(width, height) > MAX_SIDE_PX:
        raise CameraError(f"camera: {width} x {height} px, at most {MAX_SIDE_PX} can be drawn")
    _, depth, in_front = camera.project(mesh.vertices)
    if not in_front.all():
        raise CameraError(f"camera: {mesh.name} reaches behind the camera; move it farther away")
    ramp = _depth_ramp(float(depth.min()), float(depth.max()), camera.k)
    gl = _pyrender()
    scene = gl.Scene(bg_color=[0.0, 0.0, 0.0, 0.0])
    scene.add_node(gl.Node(camera=_gl_camera(_projection(camera, ramp)), matrix=_pose(camera)))
    colors = {}
    for label in np.unique(face_labels):
        node = gl.Node(
            mesh=_gl_mesh(mesh.vertices - camera.target, mesh.faces[face_labels == label])
        )
        scene.add_node(node)
        colors[node] = (int(label) + 1, 0, 0)
    renderer = _renderer()
    renderer.viewport_width, renderer.viewport_height = width, height
    color, read_depth = renderer.render(scene, gl.RenderFlags.SEG, colors)
    labels = np.where(color[..., 0] == 0, UNLABELLED, color[..., 0] - 1).astype(np.uint8)
    return LabelPicture(labels, _world_depth(read_depth, labels, ramp, camera.k))


def _depth_ramp(nearest: float, farthest: float, k: float) -> tuple[float, float]:
    """Return (A, B) of the module's equation."""
    margin = DEPTH_MARGIN * max(farthest - nearest, 1e-6)
    near, far = nearest - margin, farthest + margin
    if k > 0:
        near = max(near, (MIN_RELATIVE_DEPTH - 1) / k)
    slope = (2 + k * (near + far)) / (far - near)
    return -(1 + k * near) - slope * near, slope


def _projection(camera: Camera, ramp: tuple[float, float]) -> Float[np.ndarray, "4 4"]:
    (width, height), (cu, cv), k = camera.size_wh, camera.center, camera.k
    sx, sy = camera.scale, camera.scale * camera.pixel_aspect
    clip_from_camera = np.array(
        [
            [2 * sx / width, 0, k * (2 * cu / width - 1), 2 * cu / width - 1],
            [0, -2 * sy / height, k * (1 - 2 * cv / height), 1 - 2 * cv / height],
            [0, 0, ramp[1], ramp[0]],
            [0, 0, k, 1],
        ]
    )
    return clip_from_camera @ np.diag([1.0, -1.0, -1.0, 1.0])  # pyrender poses have OpenGL axes


def _pose(camera: Camera) -> Float[np.ndarray, "4 4"]:
    pose = np.eye(4)
    pose[:3, :3] = camera.rotation.T @ np.diag([1.0, -1.0, -1.0])
    return pose


def _world_depth(
    read: np.ndarray, labels: np.ndarray, ramp: tuple[float, float], k: float
) -> Float[np.ndarray, "height width"]:
    """Return depth past the target from what pyrender made of the buffer with NEAR and FAR."""
    seen = labels != UNLABELLED
    ndc = (FAR + NEAR - 2 * NEAR * FAR / np.where(seen & (read > 0), read, FAR)) / (FAR - NEAR)
    return np.where(seen, (ramp[0] - ndc) / (k * ndc - ramp[1]), np.inf)


def _gl_mesh(vertices: np.ndarray, faces: np.ndarray) -> Any:
    gl = _pyrender()
    primitive = gl.Primitive(
        positions=vertices.astype(np.float32),
        indices=np.concatenate([faces, faces[:, ::-1]]).astype(np.uint32),  # SEG culls back faces
    )
    return gl.Mesh(primitives=[primitive])


@cache
def _pyrender() -> Any:
    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")  # read at import
    # Mesa's LLVM and Triton's in one process: only this order does not crash when torch trains.
    with contextlib.suppress(ImportError):
        importlib.import_module("triton")
    try:
        pyrender: Any = importlib.import_module("pyrender")
    except ImportError as error:  # no libEGL
        if isinstance(error, ModuleNotFoundError):
            raise
        raise SetupError(INSTALL.format(reason=error)) from error
    pyrender.Mesh.bounds = property(_mesh_bounds)
    return pyrender


def _mesh_bounds(mesh: Any) -> Float[np.ndarray, "2 3"]:
    """Return what pyrender's `Mesh.bounds` would if it did not use `np.infty`, gone in numpy 2."""
    bounds = np.array([primitive.bounds for primitive in mesh.primitives])
    return np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])


def _gl_camera(projection: Float[np.ndarray, "4 4"]) -> Any:
    """Return a pyrender camera with the given projection matrix."""
    methods = {"get_projection_matrix": lambda self, width=None, height=None: projection}
    return type("ProjectionCamera", (_pyrender().Camera,), methods)(znear=NEAR, zfar=FAR)


@cache  # one live renderer per process: deleting any of several ends them all
def _renderer() -> Any:
    try:
        return _pyrender().OffscreenRenderer(64, 64)
    except SetupError:
        raise
    except Exception as error:
        # No Mesa vendor: ValueError "Invalid device ID"; no driver: an EGLError.
        if "Invalid device ID" in str(error) or "EGL" in type(error).__name__:
            raise SetupError(INSTALL.format(reason=str(error).splitlines()[0])) from error
        raise
