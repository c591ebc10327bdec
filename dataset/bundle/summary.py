"""Summarise a bundle or any transforms.json folder as plain data, without decoding pictures.

A broken part is named under `damaged` and left out; `toonset.dataset.bundle.check` looks at all.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from toonset.camera import Camera
from toonset.dataset.bundle.bundle import CALIBRATION, CONTOURS, COVERAGE, LABELS, TONES
from toonset.dataset.bundle.calibration_file import read_calibration
from toonset.dataset.bundle.calibration_schema import CalibrationFile, ViewRecord
from toonset.dataset.bundle.problem_log import ProblemLog
from toonset.dataset.bundle.read_scene import MANNEQUIN, label_name
from toonset.dataset.bundle.transforms_read import (
    PosedPicture,
    member,
    read_frames,
    transforms_file,
)
from toonset.dataset.mesh.load import load_mesh
from toonset.palette.formats.json import read_palette_json, to_json

RUN_FILES = ("config.json", "model.safetensors")


def summarise(path: Path) -> dict[str, Any]:
    """Return what a bundle, a transforms.json or a folder that holds one is made of.

    Raises:
        BundleError: there is no transforms.json, or its cameras cannot be read.
    """
    file = transforms_file(path)
    root = file.parent
    frames = read_frames(file, need_pictures=False)
    log = ProblemLog(root)
    calibration = _optional(log, CALIBRATION, read_calibration)
    palette = _optional(log, "palette.json", read_palette_json)
    mesh = _optional(log, MANNEQUIN, load_mesh)
    return {
        "kind": "bundle" if (root / CALIBRATION).exists() else "cameras",
        "path": str(path),
        "file": file.name,
        **_calibration(calibration),
        "views": _views(frames, calibration),
        "pictures": sum(frame.picture is not None for frame in frames),
        "palette": None if palette is None else to_json(palette),
        "labels": _count(root / LABELS, frames),
        "tones": _count(root / TONES, frames),
        "coverage": _count(root / COVERAGE, frames),
        "contours": _count(root / CONTOURS, frames),
        "mannequin": mesh and {"vertices": len(mesh.vertices), "faces": len(mesh.faces)},
        "bytes": sizes(root),
        "damaged": [f"{problem.where}: {problem.what}" for problem in log.problems],
    }


def runs_of(root: Path) -> list[Path]:
    """Return the trained runs in a folder."""
    folders = [entry for entry in root.iterdir() if entry.is_dir() and not entry.is_symlink()]
    return sorted(f for f in folders if all((f / name).is_file() for name in RUN_FILES))


def sizes(root: Path) -> dict[str, int]:
    """Return the bytes of every file of a folder and, together, of every folder in it."""
    found = {}
    for entry in sorted(root.iterdir()):
        below = entry.rglob("*") if entry.is_dir() and not entry.is_symlink() else [entry]
        files = [path for path in below if path.is_file() and not path.is_symlink()]
        found[entry.name + "/" * entry.is_dir()] = sum(path.stat().st_size for path in files)
    return found


def _optional(log: ProblemLog, name: str, read: Any) -> Any:
    file = log.attempt(name, member, log.root, name)
    return None if file is None else log.attempt(name, read, file)


def _calibration(found: CalibrationFile | None) -> dict[str, Any]:
    """Return the sheet's calibration summary; empty for other programs' cameras."""
    if found is None:
        return {}
    content = found.model_dump(mode="json")
    named = ("verdict", "reason", "camera_model", "seed", "versions", "inputs", "options")
    return {name: content[name] for name in named}


def _views(frames: list[PosedPicture], calibration: CalibrationFile | None) -> list[dict[str, Any]]:
    judged = {view.name: view for view in calibration.views} if calibration else {}
    return [
        _camera(frame.camera, Path(frame.file_path).name)
        | _judgement(judged.get(Path(frame.file_path).name))
        for frame in frames
    ]


def _camera(camera: Camera, name: str) -> dict[str, Any]:
    yaw, elevation, roll = (math.degrees(angle) for angle in camera.angles)
    place = camera.world_from_camera[:3, 3].tolist()
    field = 2 * math.atan(camera.size_wh[0] * camera.k / camera.scale / 2)
    return {
        "name": name,
        "size_wh": list(camera.size_wh),
        "yaw_deg": yaw % 360,
        "elevation_deg": elevation,
        "roll_deg": roll,
        "orthographic": camera.is_orthographic,
        "position": None if camera.is_orthographic else place,
        "field_of_view_deg": None if camera.is_orthographic else math.degrees(field),
    }


def _judgement(view: ViewRecord | None) -> dict[str, Any]:
    if view is None:
        return {}
    return {
        "yaw_sigma_deg": view.sigma.yaw_deg,
        "elevation_sigma_deg": view.sigma.elevation_deg,
        "p_flip": view.p_flip,
        "verdict": view.verdict,
        "reason": view.reason,
        "line_width_px": view.line_width_px,
    }


def _count(folder: Path, frames: list[PosedPicture]) -> int:
    return sum((folder / label_name(frame)).is_file() for frame in frames)
