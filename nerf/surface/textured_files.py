"""Write a textured surface as GLB or OBJ, with an inverted hull as its outline.

GLB   one unlit material with the picture, and one per variant. With an outline the surface is
      moved in by half the line's width, and a second mesh, without its small bumps, lies as far
      outside of it, inside out, in the ink's colour. Viewers that leave out back faces, as its
      material asks, show of it only what sticks out behind the figure.
OBJ   the same without outline, with NAME.mtl and NAME.png beside it
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int, UInt8

from toonset.dataset.images.picture import encode_png
from toonset.dataset.mesh.gltf_write import Gltf
from toonset.errors import OutputError
from toonset.nerf.surface.color import neighbour_mean, vertex_normals
from toonset.nerf.surface.files import (
    NAME,
    Surface,
    add_mesh,
    add_variants,
    check_mesh_files,
    companions,
    hex_colors,
    material_text,
    obj_text,
    write_mesh_files,
)
from toonset.nerf.surface.unwrap import Atlas
from toonset.palette.colors import linear_from_srgb

TEXTURED = (".glb", ".obj")
OUTLINED = (".glb",)
SMOOTHINGS = 5  # of the hull
INWARDS, OUTWARDS = 0.5, -0.53


@dataclass(frozen=True)
class Pen:
    """The line round a surface.

    Attributes:
        rgb: sRGB.
        width: world units.
    """

    rgb: tuple[int, int, int]
    width: float


@dataclass(frozen=True, eq=False)
class TexturedSurface:
    """A surface with a picture.

    Attributes:
        surface: closed; its labels are those of the field.
        atlas: where its faces lie on the picture.
        picture: (height, width, 3) sRGB.
        source: (faces,) number of the drawing that paints each; -1: the field does.
        pen: draws its outline; None: there is none.
        others: pictures of the surface's variants.
    """

    surface: Surface
    atlas: Atlas
    picture: UInt8[np.ndarray, "height width 3"]
    source: Int[np.ndarray, " faces"]
    pen: Pen | None = None
    others: tuple[UInt8[np.ndarray, "height width 3"], ...] = ()

    def save(self, path: str | Path, *, force: bool = False) -> dict[str, int]:
        """Write a .glb or .obj file and what belongs to it; return the sizes by name.

        Raises:
            OutputError: the name says no kind of mesh that holds a picture (and the outline), a
                file is there and `force` is off, or the place cannot be written.
        """
        path = Path(path)
        shown = {"outline": self.pen is not None, "variants": bool(self.others)}
        check_textured_files(path, **shown, force=force)
        files = encode_textured_files(self, path)
        write_mesh_files(files, path, force=force)
        return {name: len(data) for name, data in files.items()}


def check_textured_files(path: Path, *, outline: bool, force: bool, variants: bool = False) -> None:
    """Refuse, before any work, files that cannot hold it, or must not be written or replaced.

    Raises:
        OutputError: see `TexturedSurface.save`.
    """
    check_mesh_files(path, force=force, variants=variants)
    kind = path.suffix.lower()
    if kind not in TEXTURED:
        raise OutputError(f"{path}: holds no texture; end -o in {', '.join(TEXTURED)}")
    if outline and kind not in OUTLINED:
        raise OutputError(f"{path}: cannot leave out back faces; end -o in .glb for --outline")


def encode_textured_files(textured: TexturedSurface, path: Path) -> dict[str, bytes]:
    """Return the files of a textured mesh, by name: that of `path` first."""
    if path.suffix.lower() == ".glb":
        return {path.name: encode_textured_glb(textured)}
    material, picture = companions(path)
    uv = textured.atlas.uv / textured.atlas.size_wh * [1, -1] + [0, 1]  # OBJ's v runs up
    return {
        path.name: obj_text(textured.surface, uv, textured.atlas.faces, material, "drawn"),
        material: material_text("drawn", picture),
        picture: encode_png(textured.picture),
    }


def encode_textured_glb(textured: TexturedSurface) -> bytes:
    """Return a textured surface as a self-contained GLB."""
    surface, atlas = textured.surface, textured.atlas
    file = Gltf()
    pictures = [textured.picture, *textured.others]
    drawn = add_variants(file, surface, "drawn", pictures, doubleSided=False)
    half = 0.0 if textured.pen is None else textured.pen.width / 2
    body = _moved(surface.vertices, surface.faces, -half)[atlas.vertex]
    add_mesh(file, NAME, drawn, body, atlas.faces, TEXCOORD_0=atlas.uv / atlas.size_wh)
    if textured.pen is not None:
        ink = linear_from_srgb(np.array(textured.pen.rgb) / 255).tolist()
        color: dict[str, object] = {"baseColorFactor": [*ink, 1.0]}
        outline = [file.add_material("outline", color, doubleSided=False)] * len(drawn)
        hull = _moved(_smooth(surface.vertices, surface.faces), surface.faces, half)
        add_mesh(file, "outline", outline, hull, surface.faces[:, ::-1])
    return file.encode({"palette": hex_colors(surface.palette)})


def _moved(
    vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"], outwards: float
) -> Float[np.ndarray, "v 3"]:
    return vertices + outwards * vertex_normals(vertices, faces)


def _smooth(
    vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"]
) -> Float[np.ndarray, "v 3"]:
    """Return vertices without bumps as small as faces, which would draw lines of their own.

    Source: Taubin, "A signal processing approach to fair surface design", 1995.
    """
    mean = neighbour_mean(faces, len(vertices))
    for _ in range(SMOOTHINGS):
        for share in (INWARDS, OUTWARDS):
            vertices = vertices + share * (mean @ vertices - vertices)
    return vertices
