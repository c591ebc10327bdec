"""Write transforms.json folders for nerfstudio and instant-ngp.

    transforms.json    a lens per frame; orthographic views as such, or as far pinholes
    images/000.png     RGBA, straight alpha: both programs blend it over a background of their own
    sparse_pc.ply      coloured points of the mannequin, for nerfstudio's splatfacto
    toonset.json       the exact cameras

The world stays the mannequin's (+Y up, its own units). instant-ngp is told by `scale`, `offset` and
`up` where the character stands: it then fills the unit cube, and `aabb_scale` 1 is enough. There is
no `mask_path`: nerfstudio samples no rays outside of a mask, so it would never learn that the
background is empty; alpha says so.

nerfstudio has one camera model for all frames. Where all views are orthographic it is ORTHOPHOTO:
parallel rays that start on a plane before the figure, fl_x and fl_y pixels per world unit. So its
poses must not be scaled (`--auto-scale-poses False`): focal lengths are not scaled with them. A far
pinhole's rays reach the figure after 100 heights, where few samples are left. Splatfacto knows
pinholes only, and refuses others; instant-ngp has no orthographic camera.
Source: nerfstudio's nerfstudio_dataparser.py and instant-ngp's nerf_loader.cu.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from toonset import frames as conventions
from toonset.dataset.bundle.transforms_camera import ORTHOGRAPHIC
from toonset.dataset.exporters.common import ExportView, write_views
from toonset.dataset.exporters.points import TrackedPoints, encode_ply
from toonset.mesh import Mesh
from toonset.write import new_folder, write_bytes, write_json

POINTS = "sparse_pc.ply"
BOX_MARGIN = 1.1  # of the character's largest extent: drawn hair and hats exceed the mannequin


def write_transforms(
    folder: Path,
    views: Sequence[ExportView],
    points: TrackedPoints | None = None,
    mesh: Mesh | None = None,
    *,
    instant_ngp: bool = False,
    pinholes: bool = False,
    force: bool = False,
) -> None:
    """Write a folder for nerfstudio, or for instant-ngp.

    Args:
        folder: where.
        views: drawings with their cameras.
        points: for sparse_pc.ply; instant-ngp uses none.
        mesh: the mannequin; says where the character stands.
        instant_ngp: write scale, offset, aabb_scale and up for it.
        pinholes: write far pinholes for orthographic views, as instant-ngp has them anyway.
        force: replace an existing folder.

    Raises:
        OutputError: the folder exists, or cannot be written.
    """
    parallel = not (instant_ngp or pinholes) and all_orthographic(views)
    content: dict[str, Any] = {"camera_model": ORTHOGRAPHIC if parallel else "OPENCV"}
    if instant_ngp:
        content |= _box(views, mesh)
    elif points is not None:
        content["ply_file_path"] = POINTS
    pictures = [f"images/{view.name}" for view in views]
    frame = _orthographic_frame if parallel else _frame
    content["frames"] = [frame(v, p) for v, p in zip(views, pictures, strict=True)]
    with new_folder(folder, force=force) as temporary:
        if "ply_file_path" in content and points is not None:
            write_bytes(temporary / POINTS, encode_ply(points))
        write_json(temporary / "transforms.json", content)
        kind = "instant-ngp" if instant_ngp else "nerfstudio"
        write_views(temporary, kind, views, pictures, mesh)


def transform_matrix(view: ExportView) -> list[list[float]]:
    """Return world_from_camera of the view's pinhole, OpenGL axes."""
    pose = view.pinhole.world_from_camera
    return conventions.opengl_pose_from_opencv(pose).tolist()


def _frame(view: ExportView, picture: str) -> dict[str, Any]:
    K = view.pinhole.K
    return {
        "file_path": picture,
        "transform_matrix": transform_matrix(view),
        "fl_x": float(K[0, 0]),
        "fl_y": float(K[1, 1]),
        "cx": float(K[0, 2]),
        "cy": float(K[1, 2]),
        "w": view.camera.size_wh[0],
        "h": view.camera.size_wh[1],
    }


def all_orthographic(views: Sequence[ExportView]) -> bool:
    """Return whether nerfstudio can be told of these views as orthographic ones."""
    return all(view.camera.is_orthographic for view in views)


def _orthographic_frame(view: ExportView, picture: str) -> dict[str, Any]:
    """Return a frame of nerfstudio's ORTHOPHOTO: the pose stands in the plane of the rays' starts.

    It is as far before the target as the picture is large, or twice the body's radius.
    """
    camera = view.camera
    before = max(max(camera.size_wh) / camera.scale, 2 * view.radius)
    pose = camera.world_from_camera
    pose[:3, 3] -= before * camera.rotation[2]
    return {
        "file_path": picture,
        "transform_matrix": conventions.opengl_pose_from_opencv(pose).tolist(),
        "fl_x": float(camera.scale_uv[0]),
        "fl_y": float(camera.scale_uv[1]),
        "cx": float(camera.center[0]),
        "cy": float(camera.center[1]),
        "w": camera.size_wh[0],
        "h": camera.size_wh[1],
    }


def _box(views: Sequence[ExportView], mesh: Mesh | None) -> dict[str, Any]:
    """Return instant-ngp's keys: its unit cube is scale * world + offset."""
    low, high = _bounds(views) if mesh is None else mesh.bounds
    scale = 1 / (BOX_MARGIN * float((high - low).max()))
    offset = 0.5 - scale * (low + high) / 2
    return {"aabb_scale": 1, "scale": scale, "offset": offset.tolist(), "up": [0.0, 1.0, 0.0]}


def _bounds(views: Sequence[ExportView]) -> Float[np.ndarray, "2 3"]:
    """Return the box of the balls that the pictures show around their middles."""
    corners = []
    for view in views:
        size = np.array(view.camera.size_wh)
        middle = view.camera.unproject(size[None] / 2, np.zeros(1))[0]
        radius = float(size.max()) / 2 / view.camera.scale
        corners += [middle - radius, middle + radius]
    return np.stack([np.min(corners, axis=0), np.max(corners, axis=0)])
