"""Write a coloured surface as GLB, OBJ or PLY.

    GLB   one mesh, one unlit material whose texture holds the palette: flat colours as drawn, one
          draw call; another palette is another texture of 8 x 8 px per colour, which variants
          hold (KHR_materials_variants)
    OBJ   the same, with NAME.mtl and NAME.png beside it; vertices shared, so it opens closed
    PLY   vertex colours; a vertex between two colours comes once for each, at the same place

World axes are glTF's own: +Y up, the character faces +Z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int, UInt8

from toonset.dataset.images.picture import encode_png
from toonset.dataset.mesh.gltf_write import ELEMENT_ARRAY_BUFFER, Gltf
from toonset.errors import OutputError
from toonset.mesh import split_by_face
from toonset.nerf.options import ORIGINAL
from toonset.palette.names import hex_of
from toonset.write import check_new_file, new_files, write_bytes

KINDS = (".glb", ".obj", ".ply")
CELL_PX = 8  # of the palette's texture: neighbours do not bleed into a colour's middle
NAME = "figure"


@dataclass(frozen=True, eq=False)
class Variant:
    """Other colours of a surface.

    Attributes:
        name: for people.
        palette: (colors, 3) sRGB.
    """

    name: str
    palette: UInt8[np.ndarray, "colors 3"]


@dataclass(frozen=True, eq=False)
class Surface:
    """A closed, oriented triangle surface in the mesh frame (+Y up, the character faces +Z).

    Attributes:
        vertices: (n, 3) world coordinates.
        faces: (m, 3) counter-clockwise as seen from outside; no two vertices at one place.
        labels: (m,) palette colour of every face.
        palette: (colors, 3) sRGB.
        variants: other colours that a GLB offers besides.
    """

    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "faces 3"]
    labels: Int[np.ndarray, " faces"]
    palette: UInt8[np.ndarray, "colors 3"]
    variants: tuple[Variant, ...] = ()

    def save(self, path: str | Path, *, force: bool = False) -> dict[str, int]:
        """Write a .glb, .obj or .ply file and what belongs to it; return the sizes by name.

        Raises:
            OutputError: the name says no kind of mesh, a file is there and `force` is off, or the
                place cannot be written.
        """
        path = Path(path)
        check_mesh_files(path, force=force, variants=bool(self.variants))
        files = mesh_files(self, path)
        write_mesh_files(files, path, force=force)
        return {name: len(data) for name, data in files.items()}


def mesh_files(surface: Surface, path: Path) -> dict[str, bytes]:
    """Return the files of a mesh, by name: that of `path` first, then those that belong to it.

    `path` ends in .glb, .obj or .ply, see `check_mesh_files`.
    """
    kind = path.suffix.lower()
    if kind == ".glb":
        return {path.name: encode_glb(surface)}
    if kind == ".ply":
        return {path.name: encode_ply(surface)}
    material, texture = companions(path)
    count = len(surface.palette)
    labels = np.repeat(surface.labels[:, None], 3, axis=1)
    return {
        path.name: obj_text(surface, _uv(np.arange(count), count), labels, material, "palette"),
        material: material_text("palette", texture),
        texture: encode_png(palette_texture(surface.palette)),
    }


def check_mesh_files(path: Path, *, force: bool, variants: bool = False) -> None:
    """Refuse, before any work, files that must not be written or replaced.

    Raises:
        OutputError: the name says no kind of mesh, or none that holds variants, or a file is there
            and `force` is off, or a folder is.
    """
    kind = path.suffix.lower()
    if kind not in KINDS:
        raise OutputError(f"{path}: is no mesh file's name; end -o in {', '.join(KINDS)}")
    if variants and kind != ".glb":
        raise OutputError(f"{path}: holds no variants; end -o in .glb for --variants")
    beside = companions(path) if kind == ".obj" else ()
    for file in (path, *(path.with_name(name) for name in beside)):
        check_new_file(file, force=force)


def write_mesh_files(files: dict[str, bytes], path: Path, *, force: bool) -> None:
    """Write what `mesh_files` returned beside each other, all of it or nothing.

    Raises:
        OutputError: the place cannot be written, or `force` is off and a file is there.
    """
    with new_files(path, force=force) as folder:
        for name, data in files.items():
            write_bytes(folder / name, data)


def encode_glb(surface: Surface) -> bytes:
    """Return the surface as a self-contained GLB."""
    vertices, labels, faces = split_by_label(surface)
    file = Gltf()
    palettes = [surface.palette, *(one.palette for one in surface.variants)]
    materials = add_variants(file, surface, "palette", [palette_texture(p) for p in palettes])
    uv = _uv(labels, len(surface.palette)) * [1, -1] + [0, 1]  # glTF's v runs down
    add_mesh(file, NAME, materials, vertices, faces, TEXCOORD_0=uv)
    return file.encode({"palette": hex_colors(surface.palette)})


def add_mesh(
    file: Gltf,
    name: str,
    materials: list[int],
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    **more: np.ndarray,
) -> None:
    """Add a mesh to the scene, with its own look's material and that of every variant."""
    arrays = {"POSITION": vertices, **more}
    attributes = {kind: file.add_array(array) for kind, array in arrays.items()}
    indices = file.add_array(faces.ravel(), ELEMENT_ARRAY_BUFFER)
    primitive = {"attributes": attributes, "indices": indices, "material": materials[0]}
    primitive |= file.mappings(materials)
    mesh = file.add("meshes", name=name, primitives=[primitive])
    file.roots.append(file.add("nodes", name=name, mesh=mesh))


def add_variants(
    file: Gltf,
    surface: Surface,
    name: str,
    pictures: Sequence[UInt8[np.ndarray, "height width 3"]],
    **more: Any,
) -> list[int]:
    """Return the material of a surface's own look and of every variant; equal ones are one.

    Args:
        file: gets the materials, and the names of the variants where there are any.
        surface: whose variants they are.
        name: of its own material.
        pictures: of its own look and of every variant.
        more: of the materials.
    """
    looks = [Variant(ORIGINAL, surface.palette), *surface.variants]
    if surface.variants:
        file.variants += [
            {"name": one.name, "extras": {"palette": hex_colors(one.palette)}} for one in looks
        ]
    known: dict[bytes, int] = {}
    files = [encode_png(picture) for picture in pictures]
    for number, png in enumerate(files):
        called = f"{name} {looks[number].name}" if number else name
        if png not in known:
            texture = {"index": file.add_texture(png, called)}
            known[png] = file.add_material(called, {"baseColorTexture": texture}, **more)
    return [known[png] for png in files]


def hex_colors(palette: UInt8[np.ndarray, "colors 3"]) -> list[str]:
    """Return the colours of a palette as "#rrggbb"."""
    return [hex_of((r, g, b)) for r, g, b in palette.tolist()]


def encode_ply(surface: Surface) -> bytes:
    """Return the surface as binary PLY with vertex colours."""
    from trimesh import Trimesh
    from trimesh.exchange.ply import export_ply

    vertices, labels, faces = split_by_label(surface)
    colors = surface.palette[labels]
    mesh = Trimesh(vertices, faces, vertex_colors=colors, process=False)
    return bytes(export_ply(mesh, vertex_normal=False))


def palette_texture(palette: UInt8[np.ndarray, "colors 3"]) -> UInt8[np.ndarray, "height width 3"]:
    """Return the palette as a row of squares."""
    return np.tile(np.repeat(palette, CELL_PX, axis=0), (CELL_PX, 1, 1))


def split_by_label(
    surface: Surface,
) -> tuple[Float[np.ndarray, "v 3"], Int[np.ndarray, " v"], Int[np.ndarray, "f 3"]]:
    """Return vertices, their labels, and faces: a vertex of two labels comes twice."""
    vertex, label, faces = split_by_face(surface.faces, surface.labels)
    return surface.vertices[vertex], label, faces


def material_text(name: str, texture: str) -> bytes:
    """Return the MTL file of one unlit material with a picture."""
    return f"# toonset\nnewmtl {name}\nKd 1 1 1\nKs 0 0 0\nillum 0\nmap_Kd {texture}\n".encode()


def companions(path: Path) -> tuple[str, str]:
    """Return the names of an OBJ's material and texture; OBJ ends a name at a space."""
    word = "_".join(path.stem.split())
    return f"{word}.mtl", f"{word}.png"


def obj_text(
    surface: Surface,
    uv: Float[np.ndarray, "t 2"],
    uv_faces: Int[np.ndarray, "f 3"],
    library: str,
    material: str,
) -> bytes:
    """Return a surface as OBJ; `uv_faces` says where on the picture each face's corners lie."""
    lines = ["# toonset", f"mtllib {library}", f"o {NAME}"]
    lines += [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in surface.vertices.tolist()]
    lines += [f"vt {u:.7g} {v:.7g}" for u, v in uv.tolist()]
    lines.append(f"usemtl {material}")
    corners = np.dstack([surface.faces, uv_faces]).reshape(-1, 6) + 1
    lines += [f"f {a}/{i} {b}/{j} {c}/{k}" for a, i, b, j, c, k in corners.tolist()]
    return ("\n".join(lines) + "\n").encode()


def _uv(labels: Int[np.ndarray, " n"], colors: int) -> Float[np.ndarray, "n 2"]:
    """Return the middle of each label's square; v runs up, as OBJ's does."""
    return np.stack([(labels + 0.5) / colors, np.full(len(labels), 0.5)], axis=1)
