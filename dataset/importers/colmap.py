"""Reading cameras from COLMAP models (.bin or .txt, of COLMAP 3 or 4) with pycolmap."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from toonset.camera import Camera
from toonset.dataset.importers.colmap_check import check_lengths
from toonset.errors import BundleError, CameraError

MODELS = ("PINHOLE", "SIMPLE_PINHOLE")
ONLY_FATAL = 3  # pycolmap's log level; what goes wrong reaches us as an exception


def read_colmap(folder: Path) -> tuple[tuple[str, Camera], ...]:
    """Return (picture name, pinhole) of every posed image, in the order of their ids.

    Args:
        folder: a dataset with `sparse/0`, or a model's own folder; .bin or .txt.

    Raises:
        BundleError: there is no model, it is damaged, or a camera is no pinhole.
    """
    model = _load(_model_folder(folder))
    posed = [image for _, image in sorted(model.images.items()) if image.has_pose]
    if not posed:
        raise BundleError(f"{folder}: no image has a pose; give a finished reconstruction")
    return tuple((image.name, _camera_of(image, model, folder)) for image in posed)


def _model_folder(folder: Path) -> Path:
    for candidate in (folder / "sparse" / "0", folder / "sparse", folder):
        if any((candidate / f"cameras.{suffix}").is_file() for suffix in ("bin", "txt")):
            return candidate
    raise BundleError(
        f"{folder}: holds no COLMAP model (cameras.bin or cameras.txt, here or in sparse/0); give "
        "the folder of one"
    )


def _load(folder: Path) -> Any:
    import pycolmap

    pycolmap.logging.minloglevel = ONLY_FATAL
    check_lengths(folder)
    try:
        return pycolmap.Reconstruction(folder)
    except (RuntimeError, ValueError, IndexError, MemoryError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise BundleError(
            f"{folder}: is no complete COLMAP model ({reason}); export it again"
        ) from error


def _camera_of(image: Any, model: Any, folder: Path) -> Camera:
    lens = model.cameras[image.camera_id]
    if lens.model.name not in MODELS:
        raise BundleError(
            f"{folder}: {image.name} has a {lens.model.name} camera, {' or '.join(MODELS)} is "
            "needed; undistort the images"
        )
    pose = np.eye(4)
    pose[:3] = image.cam_from_world().inverse().matrix()
    try:
        size, K = (int(lens.width), int(lens.height)), lens.calibration_matrix()
        if not min(K[0, 0], K[1, 1]) > 0:  # NaN neither
            raise CameraError(f"camera: focal lengths {K[0, 0]:g}, {K[1, 1]:g} must be positive")
        return Camera.from_pinhole(pose, K, size)
    except CameraError as error:
        raise BundleError(f"{folder}: {image.name}: {error}; export the model again") from error
