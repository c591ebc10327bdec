"""Write transforms.json: nerfstudio / instant-ngp / Blender-style files and cameras.

A frame holds `transform_matrix` (world_from_camera, OpenGL axes) and pinhole intrinsics, its own or
the file's. An orthographic view is written as a far pinhole with the bound of its error in pixels;
the exact native camera stands under the frame's `toonset` key and is preferred on reading.
Here is the writing; `transforms_read` has the cameras, `read_scene` the pictures.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from toonset import frames as conventions
from toonset.camera import Camera
from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.dataset.bundle.transforms_camera import FAR_HEIGHTS
from toonset.dataset.bundle.transforms_schema import SCHEMA, VERSION


def transforms_dict(
    cameras: Iterable[tuple[str, Camera]], body_height: float, body_radius: float
) -> dict[str, Any]:
    """Return the content of a transforms.json.

    Args:
        cameras: (file path relative to the json, camera) in frame order.
        body_height: world units; orthographic views become pinholes 100 of these away.
        body_radius: world units around each camera's target that the error bound covers.
    """
    distance = FAR_HEIGHTS * body_height
    records = [_frame_dict(path, camera, distance, body_radius) for path, camera in cameras]
    return {"schema": f"{SCHEMA}/{VERSION}", "camera_model": "OPENCV", "frames": records}


def _frame_dict(path: str, camera: Camera, distance: float, radius: float) -> dict[str, Any]:
    pinhole = camera.as_pinhole(distance)
    error_px = camera.pinhole_error_px(distance, radius)
    return {
        "file_path": path,
        "transform_matrix": conventions.opengl_pose_from_opencv(pinhole.world_from_camera).tolist(),
        "fl_x": pinhole.K[0, 0],
        "fl_y": pinhole.K[1, 1],
        "cx": float(pinhole.center[0]),
        "cy": float(pinhole.center[1]),
        "w": camera.size_wh[0],
        "h": camera.size_wh[1],
        "toonset": NativeCamera.of(camera, error_px).model_dump(mode="json"),
    }
