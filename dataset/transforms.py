"""transforms.json, both ways: nerfstudio / instant-ngp / Blender-style files and cameras.

A frame holds `transform_matrix` (world_from_camera, OpenGL axes) and pinhole intrinsics, its own or
the file's. An orthographic view is written as a far pinhole with the bound of its error in pixels;
the exact native camera stands under the frame's `toonset` key and is preferred on reading.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from toonset import frames as conventions
from toonset.camera import Camera
from toonset.dataset.picture import MAX_PIXELS, load_indexed_png, load_rgba, picture_size
from toonset.dataset.scene import Frame, Scene
from toonset.errors import BundleError, CameraError
from toonset.palette.files import read_palette_json

FAR_HEIGHTS = 100.0  # body heights to the far pinhole that stands for an orthographic view
MAX_JSON_BYTES = 32 * 2**20
MAX_FRAMES = 10_000
LARGEST = 1e9  # world units, pixels, and pixels per unit either way: float32 still tells
PINHOLE_MODELS = (None, "OPENCV", "PINHOLE", "SIMPLE_PINHOLE")
SAME_VIEW_PX = 0.5  # a pinhole may differ this much from the exact camera beside it
DISTORTION_KEYS = ("k1", "k2", "k3", "k4", "p1", "p2")


class NativeCamera(BaseModel):
    """The exact camera of `toonset.camera.Camera`, OpenCV axes."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    model: str
    rotation: list[list[float]]
    target: list[float]
    scale: float
    center: list[float]
    k: float
    pixel_aspect: float = 1.0
    size_wh: tuple[int, int]
    pinhole_error_px: float = 0.0

    @classmethod
    def of(cls, camera: Camera, pinhole_error_px: float = 0.0) -> NativeCamera:
        """Return the record of a camera."""
        return cls(
            model="orthographic" if camera.is_orthographic else "pinhole",
            rotation=camera.rotation.tolist(),
            target=camera.target.tolist(),
            scale=camera.scale,
            center=camera.center.tolist(),
            k=camera.k,
            pixel_aspect=camera.pixel_aspect,
            size_wh=camera.size_wh,
            pinhole_error_px=pinhole_error_px,
        )

    def camera(self) -> Camera:
        """Return the camera of the record.

        Raises:
            CameraError: the record is no camera.
        """
        try:
            rotation = np.array(self.rotation, dtype=np.float64)
        except ValueError as error:
            raise CameraError("camera: rotation rows differ in length") from error
        target, center = np.array(self.target), np.array(self.center)
        return Camera(rotation, target, self.scale, center, self.size_wh, self.k, self.pixel_aspect)


class _Intrinsics(BaseModel):
    model_config = ConfigDict(extra="allow", allow_inf_nan=False)
    w: float | None = None
    h: float | None = None
    fl_x: float | None = None
    fl_y: float | None = None
    cx: float | None = None
    cy: float | None = None
    camera_angle_x: float | None = None
    camera_model: str | None = None


class _FrameRecord(_Intrinsics):
    file_path: str
    transform_matrix: list[list[float]]
    toonset: NativeCamera | None = None


class _TransformsFile(_Intrinsics):
    frames: list[_FrameRecord] = Field(min_length=1, max_length=MAX_FRAMES)


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
    return {"camera_model": "OPENCV", "frames": records}


def read_cameras(path: Path) -> tuple[tuple[str, Camera], ...]:
    """Return (file name, camera) of every frame of a transforms.json or its folder.

    Raises:
        BundleError: the file is missing, broken or describes no usable camera.
    """
    file = transforms_file(path)
    return tuple(
        (frame.file_path, camera) for frame, camera, _ in _read_frames(file, need_pictures=False)
    )


def picture_paths(path: Path) -> tuple[Path, ...]:
    """Return the picture of every frame of a transforms.json or its folder; all exist.

    Raises:
        BundleError: the file is missing or broken, or a picture is missing or outside the folder.
    """
    records = _read_frames(transforms_file(path), need_pictures=True)
    return tuple(picture for _, _, picture in records if picture is not None)


def read_scene(path: Path) -> Scene:
    """Return the posed pictures of a bundle, a transforms.json, or a folder that holds one.

    Labels and palette are read where the folder has `palette.json` and `labels/`.

    Raises:
        BundleError: a file is missing, broken, of another size than its camera says, or outside
            of the folder.
        PictureError: a picture cannot be read.
    """
    file = transforms_file(path)
    root = file.parent
    palette_file = root / "palette.json"
    palette = read_palette_json(palette_file).rgb if palette_file.is_file() else None
    loaded = []
    for record, camera, picture in _read_frames(file, need_pictures=True):
        assert picture is not None  # need_pictures
        rgba = load_rgba(picture)
        if rgba.shape[1::-1] != camera.size_wh:
            raise BundleError(
                f"{picture}: is {rgba.shape[1]} x {rgba.shape[0]} px, {file.name} says "
                f"{camera.size_wh[0]} x {camera.size_wh[1]}; make them equal"
            )
        labels = None if palette is None else _read_labels(root, picture, rgba.shape[:2], palette)
        loaded.append(Frame(Path(record.file_path).name, camera, rgba, labels))
    return Scene(tuple(loaded), palette, str(path))


def transforms_file(path: Path) -> Path:
    """Return the transforms.json that a path names: itself, or the one in the folder.

    Raises:
        BundleError: there is none.
    """
    if path.is_dir():
        names = ("transforms.json", "transforms_train.json")
        found = next((path / name for name in names if (path / name).is_file()), None)
        if found is None:
            raise BundleError(f"{path}: holds no transforms.json; run `toonset calibrate` first")
        return found
    if not path.is_file():
        raise BundleError(f"{path}: does not exist; give a bundle folder or a transforms.json")
    return path


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


def _read_frames(
    file: Path, *, need_pictures: bool
) -> list[tuple[_FrameRecord, Camera, Path | None]]:
    content = read_json(file)
    try:
        parsed = _TransformsFile.model_validate(content)
    except ValidationError as error:
        raise BundleError(f"{file}: {validation_reason(error)}") from error
    result = []
    for index, frame in enumerate(parsed.frames):
        where = f"{file}: frame {index} ({frame.file_path!r})"
        picture = _picture_path(file.parent, frame.file_path, where, must_exist=need_pictures)
        try:
            camera = _camera_of(parsed, frame, picture)
        except (CameraError, BundleError) as error:
            raise BundleError(f"{where}: {error}; correct the file") from error
        result.append((frame, camera, picture))
    return result


def read_json(file: Path) -> Any:
    """Return the content of a JSON file of bounded size.

    Raises:
        BundleError: the file cannot be read, is too large, or is no JSON.
    """
    try:
        if file.stat().st_size > MAX_JSON_BYTES:
            raise BundleError(f"{file}: larger than {MAX_JSON_BYTES >> 20} MiB; not a camera file")
        return json.loads(file.read_bytes().decode("utf-8-sig"))
    except OSError as error:
        raise BundleError(f"{file}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise BundleError(f"{file}: is no valid JSON ({error}); write it again") from error


def validation_reason(error: ValidationError) -> str:
    """Return where and what the first problem of a schema check is."""
    first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"])
    where = f"field {place}" if place else "the whole"
    return f"{where}: {first['msg']} ({error.error_count()} problem(s)); correct the file"


def _picture_path(root: Path, file_path: str, where: str, *, must_exist: bool) -> Path | None:
    candidates = [root / file_path]
    if not Path(file_path).suffix:
        candidates.append(root / f"{file_path}.png")
    for candidate in candidates:
        try:
            inside = candidate.resolve().is_relative_to(root.resolve())
            is_file = candidate.is_file()
        except (OSError, ValueError) as error:  # too long, a loop of links, a NUL
            raise BundleError(f"{where}: is no file name; correct file_path") from error
        if not inside:
            raise BundleError(f"{where}: lies outside of the folder; pictures must be inside it")
        if is_file:
            return candidate
    if must_exist:
        raise BundleError(f"{where}: the picture does not exist; put it there")
    return None


def _camera_of(defaults: _Intrinsics, frame: _FrameRecord, picture: Path | None) -> Camera:
    camera = _pinhole_of(defaults, frame, picture)
    if frame.toonset is None:
        _check_range(camera)
        return camera
    native = frame.toonset.camera()
    _check_range(native)
    if not _same_view(native, camera, frame.toonset.pinhole_error_px):
        raise BundleError(
            "transform_matrix and its `toonset` camera disagree; remove the `toonset` key of a "
            "frame whose matrix you changed"
        )
    return native


def _same_view(native: Camera, pinhole: Camera, error_px: float) -> bool:
    """Return whether a far pinhole shows what the native camera does, around the target."""
    reach = 0.1 * max(native.size_wh) / native.scale
    points = native.target + reach * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    off = np.abs(native.project(points)[0] - pinhole.project(points)[0])
    return bool(np.nan_to_num(off, nan=np.inf).max() <= error_px + SAME_VIEW_PX)


def _pinhole_of(defaults: _Intrinsics, frame: _FrameRecord, picture: Path | None) -> Camera:
    for record in (defaults, frame):
        bent = [k for k in DISTORTION_KEYS if (record.model_extra or {}).get(k)]
        if bent:
            raise BundleError(f"lens distortion {', '.join(bent)} is not supported; undistort")
    values = {
        name: getattr(frame, name) if getattr(frame, name) is not None else getattr(defaults, name)
        for name in _Intrinsics.model_fields
    }
    if values["camera_model"] not in PINHOLE_MODELS:
        raise BundleError(
            f"camera_model {values['camera_model']!r} is not supported; undistort to PINHOLE"
        )
    rows = frame.transform_matrix
    if [len(row) for row in rows] != [4] * 4 or not np.allclose(rows[3], [0, 0, 0, 1], 0, 1e-6):
        raise BundleError("transform_matrix must be 4 x 4 with last row 0 0 0 1")
    matrix = np.array(rows, dtype=np.float64)
    size = _size_wh(values, picture)
    fx = _focal_px(values, size[0])
    fy = fx if values["fl_y"] is None else float(values["fl_y"])
    if fx <= 0 or fy <= 0:
        raise BundleError(f"fl_x {fx:g} and fl_y {fy:g} must be positive")
    cx = size[0] / 2 if values["cx"] is None else values["cx"]
    cy = size[1] / 2 if values["cy"] is None else values["cy"]
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    return Camera.from_pinhole(conventions.opencv_pose_from_opengl(matrix), K, size)


def _check_range(camera: Camera) -> None:
    numbers = np.abs([*camera.target, *camera.center, camera.scale, camera.k, 1 / camera.scale])
    if numbers.max() > LARGEST:
        raise BundleError(f"camera: {numbers.max():.3g}, at most {LARGEST:g} is computed with")
    width, height = camera.size_wh
    if width * height > MAX_PIXELS:
        raise BundleError(
            f"size {width:.3g} x {height:.3g} px, at most {MAX_PIXELS / 1e6:g} megapixels are drawn"
        )


def _size_wh(values: dict[str, Any], picture: Path | None) -> tuple[int, int]:
    if values["w"] is not None and values["h"] is not None:
        return int(values["w"]), int(values["h"])
    if picture is None:
        raise BundleError("has neither w and h nor a picture to read them from")
    return picture_size(picture)


def _focal_px(values: dict[str, Any], width: int) -> float:
    if values["fl_x"] is not None:
        if values["fl_x"] <= 0:
            raise BundleError(f"fl_x is {values['fl_x']:g}, a positive number is needed")
        return float(values["fl_x"])
    angle = values["camera_angle_x"]
    if angle is None or not 0 < angle < math.pi:
        raise BundleError("has neither fl_x nor a camera_angle_x between 0 and pi")
    return width / (2 * math.tan(angle / 2))


def _read_labels(
    root: Path, picture: Path, shape: tuple[int, int], palette: np.ndarray
) -> np.ndarray | None:
    file = root / "labels" / f"{picture.stem}.png"
    if not file.is_file():
        return None
    labels = load_indexed_png(file)
    if labels.shape != shape:
        raise BundleError(f"{file}: size {labels.shape[::-1]} differs from its picture's")
    used = labels[labels != 255]
    if used.size and used.max() >= len(palette):
        raise BundleError(f"{file}: label {used.max()} but the palette has {len(palette)} colours")
    return labels
