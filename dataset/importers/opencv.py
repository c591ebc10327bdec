"""Read cameras from OpenCV's YAML; `toonset.dataset.exporters.opencv` says what is in it.

Of a view's `R` and `rvec` one is enough; what a view lacks (camera_matrix, image_width, ...) may
stand once at the top of the file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from toonset import frames as conventions
from toonset.camera import Camera
from toonset.dataset.bundle.camera_record import check_numbers
from toonset.dataset.bundle.transforms_schema import MAX_FRAMES
from toonset.dataset.images.picture import picture_size
from toonset.dataset.importers.paths import ImportView, find_picture
from toonset.errors import BundleError, CameraError
from toonset.read import read_whole

SUFFIXES = (".yml", ".yaml")
HEAD = b"%YAML"  # OpenCV writes it; without it, it would read the file as XML or JSON
MAX_BYTES = 32 * 2**20
ORTHONORMAL = 1e-4  # of R R^T - 1: what six digits in a text file leave


def opencv_file(path: Path) -> Path | None:
    """Return the file of cameras that a path names: itself, or cameras.yml (.yaml) in it."""
    if path.is_file():
        return path if path.suffix.lower() in SUFFIXES else None
    files = (path / f"cameras{suffix}" for suffix in SUFFIXES)
    return next((file for file in files if file.is_file()), None)


def read_opencv(file: Path) -> list[ImportView]:
    """Return every view of the file.

    Raises:
        BundleError: it is damaged, a view is incomplete or no pinhole, or a picture is missing.
    """
    data = read_whole(file, "camera", BundleError, MAX_BYTES)
    if not data.startswith(HEAD):
        raise BundleError(f"{file}: is no OpenCV YAML (does not begin with %YAML); write it again")
    try:
        flags = cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY
        storage = cv2.FileStorage(data.decode(), flags)
        root, listed = storage.root(), storage.getNode("views")
        views = [listed.at(i) for i in range(listed.size())] if listed.isSeq() else []
        if not 1 <= len(views) <= MAX_FRAMES:
            raise BundleError(
                f"{file}: {len(views)} entries in its list `views`, 1 to {MAX_FRAMES} are needed; "
                "see `toonset export --to opencv` for the layout"
            )
        return [_view(file, node, root, number) for number, node in enumerate(views)]
    except (cv2.error, UnicodeDecodeError, SystemError) as error:
        raise BundleError(
            f"{file}: is no OpenCV YAML ({_first_words(error)}); write it again"
        ) from error


def _view(file: Path, node: Any, root: Any, number: int) -> ImportView:
    where = f"{file}: view {number}"
    if not node.isMap():
        raise BundleError(f"{where}: is no map of names and values; correct the file")
    name = _get(node, root, "image")
    picture = find_picture([file.parent], name.string() if name.isString() else "", where)
    try:
        camera = _camera(node, root, picture)
    except (CameraError, BundleError) as error:
        raise BundleError(f"{where} ({picture.name}): {error}; correct the file") from error
    return ImportView(str(picture.relative_to(file.parent)), camera, picture, None)


def _camera(node: Any, root: Any, picture: Path) -> Camera:
    K = _matrix(node, root, "camera_matrix", 9).reshape(3, 3)
    if not np.allclose(K[[1, 2, 2], [0, 0, 1]], 0) or K[2, 2] != 1 or min(K[0, 0], K[1, 1]) <= 0:
        raise BundleError("camera_matrix is not [fx 0 cx; 0 fy cy; 0 0 1]")
    _refuse_distortion(node, root)
    K[:2, 2] = conventions.pixels_from_opencv(K[:2, 2])
    pose = np.eye(4)
    pose[:3, :3] = _rotation(node, root).T
    pose[:3, 3] = -pose[:3, :3] @ _matrix(node, root, "tvec", 3)
    return Camera.from_pinhole(pose, K, _size_wh(node, root, picture))


def _refuse_distortion(node: Any, root: Any) -> None:
    bent = _get(node, root, "distortion_coefficients")
    if not bent.empty() and np.any(_values(bent, "distortion_coefficients") != 0):
        raise BundleError(
            "distortion_coefficients are not 0; undistort the pictures (cv2.undistort)"
        )


def _rotation(node: Any, root: Any) -> np.ndarray:
    """Return the orthonormal rotation that is nearest to what the file says."""
    if _get(node, root, "R").empty():
        return cv2.Rodrigues(_matrix(node, root, "rvec", 3))[0]
    rotation = _matrix(node, root, "R", 9).reshape(3, 3)
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > ORTHONORMAL:
        raise BundleError("R is no rotation (R R^T is not 1)")
    u, _, v = np.linalg.svd(rotation)
    return u @ v


def _size_wh(node: Any, root: Any, picture: Path) -> tuple[int, int]:
    nodes = [_get(node, root, name) for name in ("image_width", "image_height")]
    if not all(each.isInt() for each in nodes):
        return picture_size(picture)
    return int(nodes[0].real()), int(nodes[1].real())


def _get(node: Any, root: Any, name: str) -> Any:
    own = node.getNode(name)
    return root.getNode(name) if own.empty() else own


def _matrix(node: Any, root: Any, name: str, size: int) -> np.ndarray:
    values = _values(_get(node, root, name), name)
    if values.size != size:
        raise BundleError(f"{name} has {values.size} numbers, {size} are needed")
    return values


def _values(node: Any, name: str) -> np.ndarray:
    """Return the numbers of a matrix or of a plain list."""
    found: np.ndarray | None = None
    if node.isSeq():
        items = [node.at(i) for i in range(min(node.size(), 100))]
        found = np.array([item.real() for item in items if item.isReal() or item.isInt()])
    elif node.isMap():
        found = node.mat()
    if found is None or found.dtype.kind not in "fiu":
        raise BundleError(f"{name} is missing or no matrix of numbers")
    values = found.astype(np.float64).ravel()
    if not np.isfinite(values).all():
        raise BundleError(f"{name} holds a number that is not finite")
    check_numbers(values.tolist())
    return values


def _first_words(error: Exception) -> str:
    words = " ".join(str(error.__cause__ or error).split())
    return (words.partition("error: ")[2] or words)[:80]  # OpenCV names its source file first
