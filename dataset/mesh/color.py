"""Colours of faces: MTL materials and textures, one sRGB colour per face."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int, UInt8

from toonset.dataset.images.picture import load_rgba
from toonset.errors import MeshError
from toonset.read import read_whole

UNKNOWN_COLOR = (204, 204, 204)  # a face whose material is not described; trimesh's and Blender's
MAX_LIBRARY_BYTES = 4 * 2**20


@dataclass(frozen=True, eq=False)
class Material:
    """A material's flat sRGB colour and, where it has one, its texture."""

    rgb: tuple[int, int, int] = UNKNOWN_COLOR
    texture: UInt8[np.ndarray, "height width 4"] | None = None


def read_materials(libraries: list[str], mesh_path: Path) -> dict[str, Material]:
    """Return the materials of MTL files that lie beside the mesh; others are not opened.

    A library or texture that is missing leaves its faces without that colour.

    Raises:
        MeshError: a library that is there but cannot be read.
        PictureError: a texture that is there but cannot be read.
    """
    materials: dict[str, Material] = {}
    for library in libraries:
        file = beside(mesh_path, library)
        if file is not None:
            data = read_whole(file, "material", MeshError, MAX_LIBRARY_BYTES)
            text = data.decode("utf-8", errors="replace")
            materials.update(_parse_library(text, mesh_path))
    return materials


def beside(mesh_path: Path, name: str) -> Path | None:
    """Return the file `name` in the mesh's own folder; None if it is elsewhere or missing."""
    folder = os.path.realpath(mesh_path.parent)
    file = os.path.realpath(os.path.join(folder, name.replace("\\", "/")))
    inside = os.path.commonpath([folder, file]) == folder
    return Path(file) if inside and os.path.isfile(file) else None


def face_colors_from_texture(
    texture: UInt8[np.ndarray, "height width 4"],
    uvs: Float[np.ndarray, "uvs 2"],
    corners: Int[np.ndarray, "faces 3"],
    fallback: UInt8[np.ndarray, "faces 3"],
) -> UInt8[np.ndarray, "faces 3"]:
    """Return the texture's colour at the middle of every face.

    Args:
        texture: sRGB picture; v = 0 is its lower edge.
        uvs: texture coordinates, repeated outside [0, 1].
        corners: index into `uvs` per face corner; out of range = the face has none.
        fallback: colour of faces without usable coordinates.
    """
    usable = ((corners >= 0) & (corners < len(uvs))).all(axis=1)
    colors = fallback.copy()
    middle = uvs[corners[usable]].mean(axis=1)
    finite = np.isfinite(middle).all(axis=1)
    height, width = texture.shape[:2]
    u, v = np.nan_to_num(middle).T % 1.0
    column = np.minimum((u * width).astype(int), width - 1)
    row = np.minimum(((1 - v) * height).astype(int), height - 1)
    colors[usable] = np.where(finite[:, None], texture[row, column, :3], fallback[usable])
    return colors


def _parse_library(text: str, mesh_path: Path) -> dict[str, Material]:
    materials: dict[str, Material] = {}
    name = ""
    for line in text.splitlines():
        words = line.split()
        if len(words) < 2:
            continue
        old = materials.get(name, Material())
        if words[0] == "newmtl":
            name = " ".join(words[1:])
            materials[name] = Material()
        elif words[0] == "Kd":
            materials[name] = Material(_rgb(words[1:4]), old.texture)
        elif words[0] == "map_Kd":
            file = beside(mesh_path, words[-1])
            texture = None if file is None else load_rgba(file)
            materials[name] = Material(old.rgb, texture)
    return materials


def _rgb(words: list[str]) -> tuple[int, int, int]:
    try:
        values = [min(max(float(word), 0.0), 1.0) for word in words]
    except ValueError:
        return UNKNOWN_COLOR
    if len(values) != 3 or any(value != value for value in values):
        return UNKNOWN_COLOR
    red, green, blue = (round(255 * value) for value in values)
    return red, green, blue
