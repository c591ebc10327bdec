"""Read cameras from COLMAP models (.bin or .txt, of COLMAP 3 or 4) with pycolmap.

Binary files are walked first: pycolmap takes counts at their word, and a hostile one hangs it.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from toonset.camera import Camera
from toonset.dataset.exporters.colmap import load_pycolmap
from toonset.dataset.importers.colmap_text import with_lines_of_points
from toonset.errors import BundleError, CameraError
from toonset.read import read_whole

PINHOLES = ("PINHOLE", "SIMPLE_PINHOLE")
MOST_BENT_PX = 0.01  # a lens whose pixels all lie nearer to a pinhole's is one
GRID = 9  # places across and down the picture where they are compared
ONLY_FATAL = 3  # pycolmap's log level; what goes wrong reaches us as an exception
MAX_BYTES = 2**30
# of each camera model by its number, as COLMAP lists them
PARAMETERS = (3, 4, 4, 5, 8, 8, 12, 5, 4, 5, 12, 16, 4, 5, 3, 4, 6, 2)
POSE = 7 * 8  # quaternion and translation
SENSOR = 4 + 4  # type and id


def read_colmap(folder: Path) -> tuple[tuple[str, Camera], ...]:
    """Return (picture name, pinhole) of every posed image, in the order of their ids.

    Args:
        folder: a dataset with `sparse/0`, or a model's own folder; .bin or .txt.

    Raises:
        BundleError: there is no model, it is damaged, or a camera is not a pinhole (a lens model
            whose coefficients are all 0 is one).
    """
    model = _load(_model_folder(folder))
    posed = [image for _, image in sorted(model.images.items()) if image.has_pose]
    if not posed:
        raise BundleError(f"{folder}: no image has a pose; give a finished reconstruction")
    return tuple((_name_of(image, folder), _camera_of(image, model, folder)) for image in posed)


def _model_folder(folder: Path) -> Path:
    for candidate in (folder / "sparse" / "0", folder / "sparse", folder):
        if any((candidate / f"cameras.{suffix}").is_file() for suffix in ("bin", "txt")):
            return candidate
    raise BundleError(
        f"{folder}: holds no COLMAP model (cameras.bin or cameras.txt, here or in sparse/0); give "
        "the folder of one"
    )


def _load(folder: Path) -> Any:
    pycolmap = load_pycolmap()
    pycolmap.logging.minloglevel = ONLY_FATAL
    check_lengths(folder)
    try:
        with with_lines_of_points(folder) as place:
            return _with_unit_quaternions(pycolmap.Reconstruction(place))
    except (RuntimeError, ValueError, IndexError, MemoryError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise BundleError(
            f"{folder}: is no complete COLMAP model ({reason}); export it again"
        ) from error


def _with_unit_quaternions(model: Any) -> Any:
    """Return the model; quaternions of any length mean the rotation of the unit one."""
    poses = [frame.rig_from_world for frame in model.frames.values() if frame.has_pose]
    for rig in model.rigs.values():
        poses += [pose for pose in rig.non_ref_sensors.values() if pose is not None]
    for pose in poses:
        if not pose.rotation.norm() > 0:
            raise ValueError("a rotation's quaternion is 0")
        pose.rotation.normalize()
    return model


def _name_of(image: Any, folder: Path) -> str:
    try:
        return str(image.name)
    except UnicodeDecodeError as error:
        raise BundleError(
            f"{folder}: the name of image {image.image_id} is no UTF-8; rename the picture"
        ) from error


def _camera_of(image: Any, model: Any, folder: Path) -> Camera:
    lens = model.cameras[image.camera_id]
    where = f"{folder}: {image.name}"
    bent = BundleError(
        f"{where} has a {lens.model.name} camera, {' or '.join(PINHOLES)} (or coefficients of 0) "
        "is needed; undistort the images"
    )
    if lens.is_spherical():
        raise bent
    pose = np.eye(4)
    pose[:3] = image.cam_from_world().inverse().matrix()
    try:
        size, K = (int(lens.width), int(lens.height)), lens.calibration_matrix()
        if not min(K[0, 0], K[1, 1]) > 0:  # NaN neither
            raise CameraError(f"camera: focal lengths {K[0, 0]:g}, {K[1, 1]:g} must be positive")
        if not _bent_px(lens, K) <= MOST_BENT_PX:
            raise bent
        return Camera.from_pinhole(pose, K, size)
    except CameraError as error:
        raise BundleError(f"{where}: {error}; export the model again") from error


def _bent_px(lens: Any, K: Float[np.ndarray, "3 3"]) -> float:
    """Return by how much a lens moves a pixel of its picture at most, against its pinhole."""
    if lens.model.name in PINHOLES:
        return 0.0
    u, v = np.meshgrid(np.linspace(0, lens.width, GRID), np.linspace(0, lens.height, GRID))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    rays = (pixels - K[:2, 2]) / K.diagonal()[:2]
    seen = lens.img_from_cam(np.c_[rays, np.ones(len(rays))])
    return float(np.abs(seen - pixels).max())


class _Walk:
    """A place in a file that moves on; past its end is an error."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def skip(self, count: int) -> None:
        self.at += count
        if self.at > len(self.data):
            raise ValueError("cut off")

    def number(self, kind: str) -> int:
        start = self.at
        self.skip(struct.calcsize(kind))
        return int(struct.unpack_from(kind, self.data, start)[0])

    def skip_text(self) -> None:
        self.at = self.data.index(b"\0", self.at) + 1


def check_lengths(folder: Path) -> None:
    """Refuse a model whose binary files do not end where their counts say.

    Raises:
        BundleError: a file is cut off, longer than it says, or damaged.
    """
    for name, walk_record in RECORDS.items():
        file = folder / f"{name}.bin"
        if file.is_file():
            _check(file, walk_record)


def _check(file: Path, walk_record: Callable[[_Walk], None]) -> None:
    walk = _Walk(read_whole(file, "COLMAP", BundleError, MAX_BYTES))
    try:
        for _ in range(walk.number("<Q")):
            walk_record(walk)
        if walk.at != len(walk.data):
            raise ValueError("too long")
    except ValueError as error:
        raise BundleError(
            f"{file}: is no complete COLMAP model (cut off or damaged); export it again"
        ) from error


def _camera(walk: _Walk) -> None:
    walk.skip(4)
    model = walk.number("<i")
    if not 0 <= model < len(PARAMETERS):
        raise ValueError("unknown model")
    walk.skip(2 * 8 + 8 * PARAMETERS[model])


def _image(walk: _Walk) -> None:
    walk.skip(4 + POSE + 4)
    walk.skip_text()
    walk.skip(walk.number("<Q") * (2 * 8 + 8))  # pixels and the point that each shows


def _point(walk: _Walk) -> None:
    walk.skip(8 + 3 * 8 + 3 + 8)
    walk.skip(walk.number("<Q") * (4 + 4))  # its track: image and keypoint


def _rig(walk: _Walk) -> None:
    walk.skip(4)
    sensors = walk.number("<I")
    if sensors:
        walk.skip(SENSOR)  # the first is where the rig is
    for _ in range(sensors - 1):
        walk.skip(SENSOR)
        walk.skip(POSE if walk.number("<B") else 0)


def _frame(walk: _Walk) -> None:
    walk.skip(4 + 4 + POSE)
    walk.skip(walk.number("<I") * (SENSOR + 8))


RECORDS: dict[str, Callable[[_Walk], None]] = {
    "cameras": _camera,
    "images": _image,
    "points3D": _point,
    "rigs": _rig,
    "frames": _frame,
}
