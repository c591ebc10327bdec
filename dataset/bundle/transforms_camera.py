"""Read the camera of a transforms.json's frame exactly, or refuse it by name."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from toonset import frames as conventions
from toonset.camera import Camera
from toonset.dataset.bundle.camera_record import check_numbers, check_range
from toonset.dataset.bundle.transforms_schema import FrameRecord, Intrinsics
from toonset.dataset.images.picture import picture_size
from toonset.errors import BundleError

FAR_HEIGHTS = 100.0  # body heights to the far pinhole that stands for an orthographic view
ORTHOGRAPHIC = "ORTHOPHOTO"  # as nerfstudio calls it: fl_x and fl_y are pixels per world unit
PINHOLES = ("", "PINHOLE", "SIMPLE_PINHOLE")
BENT_PINHOLES = ("OPENCV", "FULL_OPENCV", "RADIAL", "SIMPLE_RADIAL")  # pinholes where all k are 0
SAME_VIEW_PX = 0.5  # a pinhole may differ this much from the exact camera beside it
DISTORTION_KEYS = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "distortion_params")
NO_BEND = 1e-9  # of a coefficient: moves no pixel by a thousandth


def camera_of(defaults: Intrinsics, frame: FrameRecord, picture: Path | None) -> Camera:
    """Return a frame's camera: the exact one where it has one, else what its other keys say.

    Args:
        defaults: what the file says for all frames.
        frame: what the frame says.
        picture: its file, for the size where neither says one.

    Raises:
        CameraError, BundleError: no camera, or none that can be honoured.
    """
    camera = _told_camera(defaults, frame, picture)
    if frame.toonset is None:
        check_range(camera)
        return camera
    native = frame.toonset.camera()
    if native.size_wh != camera.size_wh:
        raise BundleError(
            f"w and h are {camera.size_wh}, the `toonset` camera's are {native.size_wh}; make "
            "them equal"
        )
    if not shows_same_view(native, camera, frame.toonset.pinhole_error_px):
        raise BundleError(
            "transform_matrix and its `toonset` camera disagree; remove the `toonset` key of a "
            "frame whose matrix you changed"
        )
    return native


def shows_same_view(native: Camera, pinhole: Camera, error_px: float) -> bool:
    """Return whether a far pinhole shows what the native camera does, around the target.

    Args:
        native: the exact camera.
        pinhole: what stands for it.
        error_px: by how much it may miss the exact one, beside rounding.
    """
    reach = 0.1 * max(native.size_wh) / native.scale
    points = native.target + reach * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    off = np.abs(native.project(points)[0] - pinhole.project(points)[0])
    return bool(np.nan_to_num(off, nan=np.inf).max() <= error_px + SAME_VIEW_PX)


def far_pinhole_of(camera: Camera, frame: FrameRecord) -> tuple[float, float]:
    """Return how far away an orthographic camera's pinhole is, and the bound of its error in px.

    The file says both; where it has no pinhole, for its cameras are orthographic themselves, the
    figure is taken to be as tall as its picture.
    """
    if frame.toonset is None:
        height = camera.size_wh[1] / float(camera.scale_uv[1])
        return FAR_HEIGHTS * height, camera.pinhole_error_px(FAR_HEIGHTS * height, height / 2)
    centre = conventions.opencv_pose_from_opengl(np.array(frame.transform_matrix))[:3, 3]
    return float(camera.rotation[2] @ (camera.target - centre)), frame.toonset.pinhole_error_px


def _told_camera(defaults: Intrinsics, frame: FrameRecord, picture: Path | None) -> Camera:
    _refuse_distortion(defaults, frame)
    values = {
        name: getattr(frame, name) if getattr(frame, name) is not None else getattr(defaults, name)
        for name in Intrinsics.model_fields
    }
    model = (values["camera_model"] or "").upper()
    if model not in (*PINHOLES, *BENT_PINHOLES, ORTHOGRAPHIC):
        raise BundleError(
            f"camera_model {values['camera_model'][:40]!r} is not supported; undistort to PINHOLE"
        )
    matrix = np.array(frame.transform_matrix, dtype=np.float64)
    if not np.allclose(matrix[3], [0, 0, 0, 1], 0, 1e-6):
        raise BundleError("transform_matrix must be 4 x 4 with last row 0 0 0 1")
    check_numbers(list(matrix.flat))
    matrix[:3, :3] = conventions.nearest_rotation(matrix[:3, :3])
    size = _size_wh(values, picture)
    fx = _focal_px(values, size[0])
    fy = fx if values["fl_y"] is None else float(values["fl_y"])
    cx = size[0] / 2 if values["cx"] is None else values["cx"]
    cy = size[1] / 2 if values["cy"] is None else values["cy"]
    check_numbers([fx, fy, 1 / fx, 1 / fy, cx, cy])
    pose = conventions.opencv_pose_from_opengl(matrix)
    if model == ORTHOGRAPHIC:  # the target is at the world origin's depth, as that of a pinhole
        forward, plane = pose[:3, 2], pose[:3, 3]
        target = plane - (plane @ forward) * forward
        return Camera(pose[:3, :3].T, target, fx, np.array([cx, cy]), size, 0.0, fy / fx)
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    return Camera.from_pinhole(pose, K, size)


def _refuse_distortion(*records: Intrinsics) -> None:
    for record in records:
        others = record.model_extra or {}
        if others.get("is_fisheye"):
            raise BundleError("a fisheye lens is not supported; undistort")
        if bent := [k for k in DISTORTION_KEYS if not _is_zero(others.get(k))]:
            raise BundleError(f"lens distortion {', '.join(bent)} is not supported; undistort")


def _is_zero(value: Any) -> bool:
    """Return whether a coefficient, or a list of them, is missing or 0."""
    values = value if isinstance(value, list) else [value]
    return all(
        one is None or (isinstance(one, int | float) and abs(one) < NO_BEND) for one in values
    )


def _size_wh(values: dict[str, Any], picture: Path | None) -> tuple[int, int]:
    width, height = values["w"], values["h"]
    if width is not None and height is not None:
        return width, height
    if picture is None:
        raise BundleError("has neither w and h nor a picture to read them from")
    return picture_size(picture)


def _focal_px(values: dict[str, Any], width: int) -> float:
    if values["fl_x"] is not None:
        return float(values["fl_x"])
    angle = values["camera_angle_x"]
    if angle is None:
        raise BundleError("has neither fl_x nor a camera_angle_x")
    return width / (2 * math.tan(angle / 2))
