"""Read transforms.json: check every frame, and that every path stays inside the folder."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from toonset.camera import Camera
from toonset.dataset.bundle.transforms_camera import camera_of
from toonset.dataset.bundle.transforms_schema import FrameRecord, TransformsFile, read_records
from toonset.dataset.images.folder import ENDINGS
from toonset.errors import BundleError, CameraError
from toonset.lock import settle

NAMES = ("transforms.json", "transforms_train.json")
BELOW = ("test", "views", "bundle")  # folders with cameras in what `synth` and `batch` write
MAX_SCENE_PIXELS = 2_000_000_000  # of all pictures together: 8 GB in memory


class PosedPicture(NamedTuple):
    """One frame: its path with forward slashes, its camera, and where its picture is."""

    file_path: str
    camera: Camera
    picture: Path | None


def read_cameras(path: Path) -> tuple[tuple[str, Camera], ...]:
    """Return (file name, camera) of every frame of a transforms.json or its folder.

    Raises:
        BundleError: the file is missing, broken or describes no usable camera.
    """
    posed = read_frames(transforms_file(path), need_pictures=False)
    return tuple((frame.file_path, frame.camera) for frame in posed)


def picture_paths(path: Path) -> tuple[Path, ...]:
    """Return the picture of every frame of a transforms.json or its folder; all exist.

    Raises:
        BundleError: the file is missing or broken, or a picture is missing or outside the folder.
    """
    posed = read_frames(transforms_file(path), need_pictures=True)
    return tuple(frame.picture for frame in posed if frame.picture is not None)


def transforms_file(path: Path) -> Path:
    """Return the transforms.json that a path names: itself, or the one in the folder.

    Raises:
        BundleError: there is none, or it is a link out of the folder.
    """
    try:
        if path.is_dir():
            found = next(filter(None, (member(path, name) for name in NAMES)), None)
            if found is None:
                raise BundleError(f"{path}: holds no transforms.json; {_instead(path)}")
            path = found
        if not path.exists():
            raise BundleError(f"{path}: does not exist; give a bundle folder or a transforms.json")
        if path.suffix.lower() in ENDINGS:
            raise BundleError(f"{path}: is a picture; run `toonset calibrate {path}` first")
    except (OSError, ValueError) as error:  # too long, a loop of links, a NUL
        raise BundleError(f"{str(path)[:80]}: is no file name; correct it") from error
    settle(path.with_name("palette.json"))  # and its maps
    return path


def _instead(folder: Path) -> str:
    """Return what to do about a folder without cameras: `synth` writes those of a sheet below."""
    below = [name for name in BELOW if any((folder / name / file).is_file() for file in NAMES)]
    if below:
        return f"did you mean {' or '.join(str(folder / name) for name in below)}?"
    return "run `toonset calibrate` first"


def read_frames(file: Path, *, need_pictures: bool) -> list[PosedPicture]:
    """Return every frame of a transforms.json, in file order.

    Raises:
        BundleError: of the first frame that is broken, or whose picture is needed and missing.
    """
    content = read_records(file)
    frames = [
        frame_of(file, content, number, need_picture=need_pictures)
        for number in range(len(content.frames))
    ]
    if need_pictures:
        check_total(file, [frame.camera for frame in frames])
    return frames


def frame_of(
    file: Path, content: TransformsFile, number: int, *, need_picture: bool
) -> PosedPicture:
    """Return one frame.

    Raises:
        BundleError: its camera is invalid, its picture lies outside, or is needed and missing.
    """
    frame = content.frames[number]
    where = f"{file}: frame {number} ({frame.file_path[:80]!r})"
    picture = _picture_path(file.parent, frame, where)
    if picture is None and need_picture:
        raise BundleError(f"{where}: the picture does not exist; put it there")
    try:
        path = spellings(frame.file_path)[-1]
        return PosedPicture(path, camera_of(content, frame, picture), picture)
    except (CameraError, BundleError) as error:
        raise BundleError(f"{where}: {error}; correct the file") from error


def check_total(file: Path, cameras: list[Camera]) -> None:
    """Refuse more pixels than fit the memory of any usual machine.

    Raises:
        BundleError: the pictures have more than 2 gigapixels together.
    """
    pixels = sum(camera.size_wh[0] * camera.size_wh[1] for camera in cameras)
    if pixels > MAX_SCENE_PIXELS:
        raise BundleError(
            f"{file}: {len(cameras)} pictures of {pixels / 1e6:.0f} megapixels together, at most "
            f"{MAX_SCENE_PIXELS / 1e6:g} are read; use fewer or smaller ones"
        )


def is_inside(root: Path, path: Path) -> bool:
    """Return whether a path, links followed, stays in a folder.

    Raises:
        OSError, ValueError: the path is not a file name (too long, a loop of links, a NUL).
    """
    return path.resolve().is_relative_to(root.resolve())


def member(root: Path, name: str) -> Path | None:
    """Return a file of a folder by its name, None where it is not there.

    Raises:
        BundleError: it is a link that leads out of the folder, or nowhere.
    """
    path = place_in(root, name)
    return path if path.exists() else None


def place_in(root: Path, name: str) -> Path:
    """Return where a folder's file is, or would be.

    Raises:
        BundleError: it is a link that leads out of the folder, or nowhere.
    """
    path = root / name
    try:
        if is_inside(root, path) and (path.exists() or not path.is_symlink()):
            return path
    except (OSError, RuntimeError) as error:  # a loop of links
        raise BundleError(f"{path}: is a link to itself; put the file there") from error
    raise BundleError(f"{path}: is a link out of the folder or to nothing; put the file there")


def spellings(name: str) -> tuple[str, ...]:
    """Return a path as a file has it, and as it is here if Windows wrote it."""
    return (name, name.replace("\\", "/")) if "\\" in name else (name,)


def _picture_path(root: Path, frame: FrameRecord, where: str) -> Path | None:
    candidates = [root / name for name in spellings(frame.file_path)]
    candidates += [Path(f"{one}.png") for one in candidates if not one.suffix]
    try:
        if not frame.file_path.isprintable():
            raise ValueError("control characters")
        for candidate in candidates:
            if not is_inside(root, candidate):
                raise BundleError(
                    f"{where}: lies outside of the folder; pictures must be inside it"
                )
            if candidate.is_file():
                return candidate
    except (OSError, ValueError, RuntimeError) as error:  # RuntimeError: a loop of links
        raise BundleError(f"{where}: is no file name; correct file_path") from error
    return None
