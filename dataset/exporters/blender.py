"""Write a Python script that rebuilds cameras, drawings and body inside Blender.

    import_cameras.py    run it in Blender: blender --python import_cameras.py, or Scripting > Open
    scene.glb            the mannequin, and every drawing on a plane behind it
    body.glb             the character's body, painted, where there is one
    images/000.png       the drawings, RGBA
    toonset.json         the exact cameras

Blender has orthographic cameras and lens shift: every view is exact. A scene has one render size:
all cameras get the same window (in their own pixels) with the drawing in its middle, where it is
the camera's background image. Every view is bound to its own frame of the timeline; a camera turns
round the character in the frames after them. Blender's world has +Z up: the script turns ours.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toonset import __version__
from toonset import frames as conventions
from toonset.dataset.exporters.blender_script import SCRIPT
from toonset.dataset.exporters.common import ExportView, write_views
from toonset.dataset.exporters.gltf import SCENE, add_mannequin, add_plane
from toonset.dataset.exporters.view_planes import (
    STAND_OFF,
    clip_range,
    plane_corners,
    scene_views,
    seen_radius,
    stand,
    window_wh,
)
from toonset.dataset.mesh.gltf_write import Gltf
from toonset.mesh import Mesh
from toonset.write import new_folder, write_bytes

SCRIPT_NAME, BODY = "import_cameras.py", "body.glb"
FRAMES = 72  # of a turn: 3 s as Blender plays them


def write_blender_script(
    folder: Path,
    views: Sequence[ExportView],
    mesh: Mesh | None = None,
    *,
    body: bytes | None = None,
    force: bool = False,
) -> tuple[ExportView, ...]:
    """Write import_cameras.py and what it reads; the folder appears whole or not at all.

    Args:
        folder: to write.
        views: the drawings with their cameras.
        mesh: the mannequin; world frame.
        body: a GLB of the character's body; world frame.
        force: replace what was exported there before.

    Returns:
        The views as they were written: with square pixels.

    Raises:
        OutputError: the folder exists, or cannot be written.
    """
    written = scene_views(views)
    pictures = [f"images/{view.name}" for view in written]
    records = [_record(view, written, mesh) for view in written]
    file = Gltf()
    file.roots += [] if mesh is None else [add_mannequin(file, mesh)]
    file.roots += [add_plane(file, view, plane_corners(view, written, mesh)) for view in written]
    text = SCRIPT.replace("@VERSION@", __version__)
    text = text.replace("@WINDOW@", repr(window_wh(written)))
    text = text.replace("@TURN@", json.dumps(_turntable(written, mesh), allow_nan=False))
    text = text.replace("@VIEWS@", json.dumps(records, indent=1, allow_nan=False))
    with new_folder(folder, force=force) as temporary:
        write_bytes(temporary / SCRIPT_NAME, text.encode())
        write_bytes(temporary / SCENE, file.encode({}))
        if body is not None:
            write_bytes(temporary / BODY, body)
        write_views(temporary, "blender", written, pictures, mesh)
    return written


def _record(view: ExportView, views: Sequence[ExportView], mesh: Mesh | None) -> dict[str, Any]:
    camera, window = view.camera, window_wh(views)
    width, height = camera.size_wh
    near, far = clip_range(view, views, mesh)
    # Blender measures lens shift in widths of the window, to the right and up
    right = (width / 2 - float(camera.center[0])) / window[0]
    up = (float(camera.center[1]) - height / 2) / window[0]
    return {
        "name": view.name,
        "orthographic": camera.is_orthographic,
        "world_from_camera": conventions.opengl_pose_from_opencv(stand(view, mesh)).tolist(),
        "width_world": window[0] / camera.scale,
        "focal_widths": 0.0 if camera.is_orthographic else float(camera.K[0, 0]) / window[0],
        "shift": [right, up],
        "clip": [near, far],
        "of_window": max(width / window[0], height / window[1]),  # of a picture that is fitted in
    }


def _turntable(views: Sequence[ExportView], mesh: Mesh | None) -> dict[str, Any]:
    """Return an orthographic camera's way round what all views show, as high as most of them."""
    cameras = [view.camera for view in views]
    away = STAND_OFF * max(seen_radius(view, mesh) for view in views)
    corners = [np.maximum(one.center, one.size_wh - one.center) / one.scale for one in cameras]
    width, height = 2 * np.max(corners, axis=0)
    window = window_wh(views)
    return {
        "frames": FRAMES,
        "target": np.mean([camera.target for camera in cameras], axis=0).tolist(),
        "elevation": float(np.median([camera.angles[1] for camera in cameras])),
        "width_world": float(max(width, height * window[0] / window[1])),
        "distance": away,
        "clip": [away / 1000, 2 * away],
    }
