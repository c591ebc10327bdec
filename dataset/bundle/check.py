"""List every problem of a bundle, or of any transforms.json folder.

Readers stop at the first problem; this goes on, so that a person sees all of them at once. A
folder without a problem here is read without an error by every stage.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from toonset.camera import Camera
from toonset.dataset.bundle.bundle import (
    CALIBRATION,
    CONTOURS,
    COVERAGE,
    IMAGES,
    LABELS,
    OVERLAY,
    TONES,
)
from toonset.dataset.bundle.calibration_file import read_calibration
from toonset.dataset.bundle.calibration_schema import CalibrationFile
from toonset.dataset.bundle.palette_files import COPIES, PALETTE_JSON, SWATCHES
from toonset.dataset.bundle.problem_log import Problem, ProblemLog
from toonset.dataset.bundle.read_scene import (
    MANNEQUIN,
    check_label_names,
    label_name,
    read_contour,
    read_coverage,
    read_labels,
    read_palette_of,
    read_picture,
    read_tones,
)
from toonset.dataset.bundle.transforms_read import (
    PosedPicture,
    check_total,
    frame_of,
    member,
    transforms_file,
)
from toonset.dataset.bundle.transforms_schema import read_records
from toonset.dataset.images.folder import picture_files
from toonset.dataset.images.picture import load_indexed_png, load_rgba
from toonset.dataset.mesh.load import load_mesh
from toonset.palette.formats.registry import parse_colors

PICTURES = {
    **dict.fromkeys((IMAGES, TONES, COVERAGE, CONTOURS), load_rgba),
    LABELS: load_indexed_png,
}
SAME_CAMERA = 1e-6  # relative: both files are written from the same numbers

Colors = UInt8[np.ndarray, "colors 3"]


@dataclass(frozen=True)
class _Frames:
    """Frames of a transforms.json.

    Attributes:
        names: file name of every frame's picture; None where the file cannot be read.
        posed: the frames whose camera and picture can be used.
    """

    names: list[str] | None
    posed: list[PosedPicture]

    @property
    def whole(self) -> bool:
        """Return whether every frame can be used."""
        return self.names is not None and len(self.posed) == len(self.names)


def bundle_problems(path: Path) -> list[Problem]:
    """Return every problem of a bundle, a transforms.json, or a folder that holds one.

    Raises:
        BundleError: there is no transforms.json to begin with.
    """
    file = transforms_file(path)
    log = ProblemLog(file.parent)
    frames = _check_frames(log, file)
    _check_colors(log, file, frames)
    _check_contours(log, frames)
    if (log.root / CALIBRATION).exists() or (log.root / CALIBRATION).is_symlink():
        _check_calibration(log, file, frames)
        _check_strays(log, IMAGES, frames.names)
    _check_alone(log, MANNEQUIN, load_mesh)
    for name in (OVERLAY, SWATCHES):
        _check_alone(log, name, load_rgba)
    return log.problems


def _check_frames(log: ProblemLog, file: Path) -> _Frames:
    content = log.attempt(file.name, read_records, file)
    if content is None:
        for folder, read in PICTURES.items():
            _check_folder(log, folder, read)
        return _Frames(None, [])
    found = [
        log.attempt(file.name, frame_of, file, content, number, need_picture=True)
        for number in range(len(content.frames))
    ]
    posed = [frame for frame in found if frame is not None]
    log.attempt(file.name, check_total, file, [frame.camera for frame in posed])
    for frame in posed:
        assert frame.picture is not None  # it is needed
        log.attempt(frame.picture.relative_to(log.root).as_posix(), read_picture, frame, file)
    return _Frames([Path(frame.file_path).name for frame in content.frames], posed)


def _check_colors(log: ProblemLog, file: Path, frames: _Frames) -> None:
    before = len(log.problems)
    palette = log.attempt(PALETTE_JSON, read_palette_of, log.root)
    if palette is None:
        if len(log.problems) == before and (log.root / LABELS).exists():
            log.add(LABELS, "is there but palette.json is not; run `toonset palette` again")
        return
    if frames.posed:
        log.attempt(file.name, check_label_names, file, frames.posed)
    count = len(palette.colors)
    _check_maps(log, LABELS, frames, lambda frame: read_labels(log.root, frame, count))
    if palette.has_tones:
        _check_maps(log, TONES, frames, lambda frame: read_tones(log.root, frame))
    elif (log.root / TONES).exists():
        log.add(TONES, "is there but palette.json has no shadow; run `toonset palette` again")
    if (log.root / COVERAGE).exists():
        _check_maps(log, COVERAGE, frames, lambda frame: read_coverage(log.root, frame, count))
    _check_copies(log, palette.rgb)


def _check_contours(log: ProblemLog, frames: _Frames) -> None:
    if (log.root / CONTOURS).exists():
        _check_maps(log, CONTOURS, frames, lambda frame: read_contour(log.root, frame))


def _check_maps(
    log: ProblemLog, folder: str, frames: _Frames, read: Callable[[PosedPicture], object]
) -> None:
    """Check the maps that a folder holds, one for every picture."""
    for frame in frames.posed:
        name, before = f"{folder}/{label_name(frame)}", len(log.problems)
        if log.attempt(name, read, frame) is None and len(log.problems) == before:
            log.add(name, "is missing; run `toonset palette` again")
    names = frames.names
    _check_strays(log, folder, names and [f"{Path(name).stem}.png" for name in names])


def _check_copies(log: ProblemLog, palette: Colors) -> None:
    """Compare the palette's copies for other programs with palette.json."""
    for name in (f"palette{end}" for end in COPIES):
        found = log.attempt(name, member, log.root, name)
        colors = log.attempt(name, parse_colors, str(found)) if found else None
        if colors is not None and set(map(tuple, colors)) != set(map(tuple, palette)):
            log.add(
                name,
                "has other colours than palette.json, which counts; run `toonset palette` with "
                f"--colors {name} to use them",
            )


def _check_calibration(log: ProblemLog, file: Path, frames: _Frames) -> None:
    found = log.attempt(CALIBRATION, member, log.root, CALIBRATION)
    content = log.attempt(CALIBRATION, read_calibration, found) if found else None
    if content is None or frames.names is None:
        return
    names, views = frames.names, [view.name for view in content.views]
    if names != views:
        odd = sorted(set(names) ^ set(views))
        which = f" ({', '.join(map(repr, odd[:3]))})" if odd else ", in another order"
        log.add(CALIBRATION, f"has other views than {file.name}{which}; calibrate again")
    elif frames.whole:
        _check_cameras(log, file, content, frames.posed)


def _check_cameras(
    log: ProblemLog, file: Path, content: CalibrationFile, posed: list[PosedPicture]
) -> None:
    for number, (frame, view) in enumerate(zip(posed, content.views, strict=True)):
        if not _same_camera(frame.camera, view.camera.camera()):
            log.add(
                CALIBRATION,
                f"view {number} ({frame.file_path!r}): its camera is not {file.name}'s, which "
                "counts; calibrate again",
            )


def _same_camera(one: Camera, other: Camera) -> bool:
    if one.size_wh != other.size_wh or one.is_orthographic != other.is_orthographic:
        return False
    pairs = (
        (one.rotation, other.rotation),
        (one.target, other.target),
        (one.center, other.center),
        ([one.scale, one.k], [other.scale, other.k]),
    )
    return all(np.allclose(a, b, rtol=SAME_CAMERA, atol=SAME_CAMERA) for a, b in pairs)


def _check_strays(log: ProblemLog, folder: str, names: Iterable[str] | None) -> None:
    """Note files of no picture, and names that differ only in case: some disks have one of them."""
    place, known = log.root / folder, set(names or ())
    if names is None or not place.is_dir():
        return
    seen: dict[str, str] = {}
    for name in sorted(entry.name for entry in place.iterdir()):
        if name.startswith(".") or name in ("Thumbs.db", "desktop.ini"):
            continue
        if name not in known:
            log.add(f"{folder}/{name}", "belongs to no picture of transforms.json; delete it")
        twin = seen.setdefault(name.casefold(), name)
        if twin != name:
            log.add(f"{folder}/{name}", f"differs from {twin} in case only; rename one")


def _check_folder(log: ProblemLog, folder: str, read: Callable[[Path], object]) -> None:
    """Check pictures alone, where it is not known which frames they belong to."""
    place = log.root / folder
    for path in picture_files(place)[0] if place.is_dir() else ():
        _check_alone(log, f"{folder}/{path.name}", read)


def _check_alone(log: ProblemLog, name: str, read: Callable[[Path], object]) -> None:
    found = log.attempt(name, member, log.root, name)
    if found is not None:
        log.attempt(name, read, found)
