"""Write a mannequin: NAME.obj with its parts, and NAME.landmarks.json beside it."""

from __future__ import annotations

from pathlib import Path

from toonset.dataset.mannequin.landmark_formats import SCHEMA
from toonset.dataset.mannequin.make import Mannequin
from toonset.dataset.mesh.load import save_obj
from toonset.errors import OutputError
from toonset.write import check_new_file, new_files, write_bytes, write_json


def landmarks_path(mesh_path: Path) -> Path:
    """Return where the landmarks of a mannequin's file lie."""
    return mesh_path.with_suffix(".landmarks.json")


def check_files(mesh_path: Path, *, force: bool) -> None:
    """Refuse, before any work, files that must not be written or replaced.

    Args:
        mesh_path: the OBJ file to write.
        force: replace existing files.

    Raises:
        OutputError: the name is not an OBJ file's, or a file is there and `force` is off, or a
            folder is.
    """
    if mesh_path.suffix.lower() != ".obj":
        raise OutputError(f"{mesh_path}: a mannequin is written as .obj; choose another -o")
    for path in (mesh_path, landmarks_path(mesh_path)):
        check_new_file(path, force=force)


def write_mannequin(mannequin: Mannequin, mesh_path: Path, *, force: bool) -> None:
    """Write both files, or none.

    Raises:
        OutputError: the place cannot be written, or `force` is off and a file is there.
    """
    points = {name: point.tolist() for name, point in mannequin.landmarks.items()}
    landmarks = {"schema": SCHEMA, "units": "world", "points": points}
    with new_files(mesh_path, force=force) as folder:
        write_bytes(folder / mesh_path.name, save_obj(mannequin.mesh))
        write_json(folder / landmarks_path(mesh_path).name, landmarks)
