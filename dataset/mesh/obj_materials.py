"""Colour the faces of an OBJ file as its materials do, and find what of them is seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.dataset.images.picture import load_rgba
from toonset.dataset.mesh.mtl import UNKNOWN_COLOR, Map, Material, beside, library_names, read_mtl
from toonset.dataset.mesh.texture import Cut, Texture, cut_away, whole
from toonset.errors import MeshError
from toonset.read import read_whole

MAX_LIBRARY_BYTES = 4 * 2**20
LEAST_OPACITY = 8 / 255  # a material with less is not seen
OPAQUE_TEXEL = 0.5  # of an opacity texture: as much is seen; glTF's and most viewers' cutoff


@dataclass(frozen=True, eq=False)
class Paint:
    """A material with its textures.

    Attributes:
        color: sRGB, where no texture is.
        texture: of the colour; None without one.
        opacity: 0 to 1.
        opacity_texture: its alpha is the opacity; None without one.
    """

    color: tuple[int, ...]
    texture: Texture | None
    opacity: float
    opacity_texture: Texture | None


@dataclass(frozen=True, eq=False)
class Library:
    """What the material files of a mesh say.

    Attributes:
        paints: of the materials that faces have, by name.
        missing: names of files that are not beside the mesh.
    """

    paints: dict[str, Paint]
    missing: tuple[str, ...]


def read_library(lines: Sequence[str], used: Sequence[str], mesh_path: Path) -> Library:
    """Return the materials that faces have of the files that a mesh names; others are not opened.

    Args:
        lines: what follows `mtllib`, comments and all.
        used: the faces' materials, as `usemtl` has them.
        mesh_path: the files lie beside it.

    Raises:
        MeshError, PictureError: a file that is there but cannot be read.
    """
    read = _Reader(mesh_path)
    known: dict[str, Material] = {}
    for line in lines:
        for name in library_names(line, lambda name: beside(mesh_path, name) is not None):
            file = read.find(name)
            if file is not None:
                known |= read_mtl(read_whole(file, "material", MeshError, MAX_LIBRARY_BYTES))
    alike = {name.casefold(): name for name in reversed(known)}
    paints = {}
    for name in used:
        plain = name.split(" #")[0].strip()
        own = next((each for each in (name, plain) if each in known), alike.get(plain.casefold()))
        if own is not None:
            paints[name] = read.paint(known[own])
    return Library(paints, tuple(read.missing))


def shown_pieces(
    library: Library,
    materials: Sequence[str],
    of_face: Int[np.ndarray, " faces"],
    uvs: Float[np.ndarray, "faces 3 2"],
) -> Cut | None:
    """Return the pieces of the faces that are not transparent; None if all of them are seen.

    A mesh that would vanish altogether is seen: its opacity was written the other way round.

    Args:
        library: the materials.
        materials: their names.
        of_face: the number of every face's material.
        uvs: texture coordinates of the corners.
    """
    paints = [library.paints.get(name) for name in materials]
    if not any(_may_be_cut(paint) for paint in paints):
        return None
    texels = np.zeros(len(of_face))
    for number, paint in enumerate(paints):
        if paint is not None and paint.opacity_texture is not None:
            chosen = of_face == number
            texels[chosen] = paint.opacity_texture.texels_along(uvs[chosen])

    def seen(
        faces: Int[np.ndarray, " places"], weights: Float[np.ndarray, "places 3"]
    ) -> Bool[np.ndarray, " places"]:
        found = np.ones(len(faces), dtype=bool)
        for number, paint in enumerate(paints):
            if _may_be_cut(paint) and paint is not None:
                chosen = of_face[faces] == number
                found[chosen] = _seen(paint, _places(uvs, faces[chosen], weights[chosen]))
        return found

    cut = cut_away(texels, seen)
    return cut if cut is None or len(cut.parents) else None


def paint_pieces(
    library: Library,
    materials: Sequence[str],
    of_face: Int[np.ndarray, " faces"],
    uvs: Float[np.ndarray, "faces 3 2"],
    cut: Cut | None,
) -> UInt8[np.ndarray, "pieces 3"]:
    """Return the sRGB colour in the middle of every piece."""
    pieces = whole(len(of_face)) if cut is None else cut
    colors = np.full((len(pieces.parents), 3), UNKNOWN_COLOR, dtype=np.uint8)
    number_of = of_face[pieces.parents]
    middles = pieces.middles
    for number, name in enumerate(materials):
        chosen, paint = number_of == number, library.paints.get(name)
        if paint is None:
            continue
        colors[chosen] = paint.color
        if paint.texture is not None:
            at = _places(uvs, pieces.parents[chosen], middles[chosen])
            texels, known = paint.texture.at(at)
            colors[chosen] = np.where(known[:, None], texels[:, :3], colors[chosen])
    return colors


@dataclass
class _Reader:
    """Opens what materials name, each file once."""

    mesh_path: Path
    missing: dict[str, None] = field(default_factory=dict)
    _pictures: dict[Path, UInt8[np.ndarray, "height width 4"]] = field(default_factory=dict)

    def find(self, name: str) -> Path | None:
        """Return the file beside the mesh; a name that leads to none is noted."""
        file = beside(self.mesh_path, name)
        if file is None:
            self.missing[name] = None
        return file

    def paint(self, material: Material) -> Paint:
        """Return a material with its textures."""
        return Paint(
            material.shown_color,
            self._texture(material.shown_map, as_opacity=False),
            1.0 if material.opacity is None else material.opacity,
            self._texture(material.map_of("d"), as_opacity=True),
        )

    def _texture(self, named: Map | None, *, as_opacity: bool) -> Texture | None:
        file = None if named is None else self.find(named.name)
        if named is None or file is None:
            return None
        if file not in self._pictures:
            self._pictures[file] = load_rgba(file)
        rgba = self._pictures[file]
        if as_opacity and (rgba[..., 3] == 255).all():
            rgba = rgba[..., [0, 1, 2, 0]]  # a grey picture says it
        return Texture(rgba, np.diag(named.scale), np.array(named.offset))


def _may_be_cut(paint: Paint | None) -> bool:
    if paint is None:
        return False
    return paint.opacity < LEAST_OPACITY or paint.opacity_texture is not None


def _seen(paint: Paint, at: Float[np.ndarray, "places 2"]) -> Bool[np.ndarray, " places"]:
    if paint.opacity < LEAST_OPACITY:
        return np.zeros(len(at), dtype=bool)
    if paint.opacity_texture is None:
        return np.ones(len(at), dtype=bool)
    texels, known = paint.opacity_texture.at(at)
    return (texels[:, 3] >= 255 * OPAQUE_TEXEL) | ~known


def _places(
    uvs: Float[np.ndarray, "faces 3 2"],
    faces: Int[np.ndarray, " places"],
    weights: Float[np.ndarray, "places 3"],
) -> Float[np.ndarray, "places 2"]:
    return np.asarray(np.einsum("pi,piw->pw", weights, uvs[faces]))
