"""Texture a surface with the drawn look: an atlas put together from the drawings.

Every texel lies on a face, every face is painted by one drawing (`choose`), by the field where no
drawing shows it. Beside a seam the next drawing's colour is mixed in where it has the same label.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from toonset.dataset.mesh.rasterize import depth_map
from toonset.errors import BundleError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.look.places import Places, sample_picture
from toonset.nerf.options import MeshOptions
from toonset.nerf.surface.choose import chosen, merits
from toonset.nerf.surface.files import Surface
from toonset.nerf.surface.paint import Paint, paint_of
from toonset.nerf.surface.surface import surface_of
from toonset.nerf.surface.textured_files import Pen, TexturedSurface
from toonset.nerf.surface.unwrap import (
    Atlas,
    check_xatlas,
    parts_of,
    texel_faces,
    texel_places,
    unwrap,
)

FINE = 2.0  # texels per pixel of the drawings
LEAST_SHARE = 0.01  # of a drawing in a texel, to be asked
OWN_SHARE = 0.1  # of the drawing that paints a face, at least
ROW = 1024  # points that are looked up together: a picture's row
NO_DRAWINGS = "run: holds no drawings to paint the mesh with; train again, or leave --texture out"
NO_OUTLINE = "run: its drawings have no outline; leave --outline out"


def texture_surface(
    trained: TrainedField,
    faces: int | None = MeshOptions.faces,
    progress: Callable[[str, float], None] = lambda step, done: None,
    *,
    outline: bool = False,
    variants: Sequence[tuple[str, TrainedField]] = (),
) -> TexturedSurface:
    """Return the surface of a trained field, painted as its drawings are.

    Args:
        trained: a field with palette and drawings.
        faces: at most so many triangles; None: all.
        progress: told what is done now, and which share of it.
        outline: with the pen that draws the sheet's outlines; for GLB files only.
        variants: the same field in other colours, by name; for GLB files only.

    Raises:
        BundleError: the run holds no drawings, or none with an outline, or shows nothing.
        PaletteError: the run was trained without palette.
        SetupError: xatlas is not installed.
        UsageError: fewer than 100 triangles asked for.
    """
    drawings = trained.drawings
    if drawings is None:
        raise BundleError(NO_DRAWINGS)
    if outline and drawings.pen is None:
        raise BundleError(NO_OUTLINE)
    check_xatlas()
    surface = surface_of(trained, faces, progress, variants=variants)
    progress("painting", 0.0)
    looks = [field.drawings for _, field in variants if field.drawings is not None]
    return painted(surface, drawings, outline=outline, others=looks)


def painted(
    surface: Surface, drawings: Drawings, *, outline: bool = False, others: Sequence[Drawings] = ()
) -> TexturedSurface:
    """Return a surface with the paint of drawings, in the colours that they show.

    Args:
        surface: to be painted.
        drawings: of the character.
        outline: with their pen.
        others: the same drawings in the colours of the surface's variants; every patch is painted
            by the same one in all of them.

    Raises:
        SetupError: xatlas is not installed.
    """
    vertices, faces = surface.vertices, surface.faces
    scale = float(np.median([view.camera.scale for view in drawings.views]))
    paints = []
    for texture in drawings.textures:
        depth = depth_map(vertices, faces, texture.camera)
        seen = np.where(np.isfinite(depth), depth, np.nan)
        paints.append(paint_of(texture, seen, drawings))
    merit = merits(vertices, faces, paints, drawings.height)
    source = chosen(vertices, faces, merit, paints, drawings.height)
    atlas = unwrap(vertices, faces, parts_of(vertices, faces, surface.labels), FINE * scale)
    picture = _picture(surface, atlas, paints, source, merit > 0)
    pictures = []
    for variant, look in zip(surface.variants, others, strict=True):
        pairs = zip(paints, look.textures, strict=True)
        again = [paint.in_colors_of(texture) for paint, texture in pairs]
        colored = replace(surface, palette=variant.palette)
        pictures.append(_picture(colored, atlas, again, source, merit > 0))
    pen = drawings.pen if outline else None
    return TexturedSurface(
        surface,
        atlas,
        picture,
        np.where(source < len(paints), source, -1),
        None if pen is None else Pen(pen.rgb, pen.width_px / scale),
        tuple(pictures),
    )


def _picture(
    surface: Surface,
    atlas: Atlas,
    paints: Sequence[Paint],
    source: Int[np.ndarray, " f"],
    shows: np.ndarray,
) -> UInt8[np.ndarray, "height width 3"]:
    """Return the colours of all texels; beyond the gutters those of the nearest.

    Args:
        surface: to be painted.
        atlas: its own.
        paints: of the drawings.
        source: which of them paints each face; their number: none.
        shows: (f, drawings) whether they show each face.
    """
    under, near, nearest_of = texel_faces(atlas)
    face = under[near]
    bary = texel_places(atlas, under)[near]
    points = np.einsum("nc,ncx->nx", bary, surface.vertices[surface.faces[face]])
    bary = bary.clip(0, 1)
    shares = _shares(surface, source, len(paints))[surface.faces]
    winner = np.zeros(len(face), dtype=np.int64)
    looks = []
    for number, paint in enumerate(paints):
        share = (bary * shares[face, :, number]).sum(axis=1) * shows[face, number]
        mine = source[face] == number
        share = np.maximum(share, OWN_SHARE * mine)
        use = np.flatnonzero(share > LEAST_SHARE)
        color, label = _looked_up(paint, points[use])
        winner[use[mine[use]]] = label[mine[use]]
        looks.append((use, share[use], color, label))
    total = np.where(source[face] == len(paints), 1.0, 0.0)
    mixed = total[:, None] * (surface.palette[surface.labels[face]] / 255.0)
    for use, share, color, label in looks:
        weight = share * ((label == winner[use]) & (source[face[use]] < len(paints)))
        mixed[use] += weight[:, None] * color
        total[use] += weight
    picture = np.zeros((*under.shape, 3), dtype=np.uint8)
    picture[near] = np.rint(255 * (mixed / total[:, None]).clip(0, 1))
    return picture[nearest_of]


def _shares(
    surface: Surface, source: Int[np.ndarray, " f"], count: int
) -> Float[np.ndarray, "v sources"]:
    """Return which part of the faces round every vertex each source paints."""
    own = np.eye(count + 1)[source]
    total = np.zeros((len(surface.vertices), count + 1))
    for corner in range(3):
        np.add.at(total, surface.faces[:, corner], own)
    return total / total.sum(axis=1, keepdims=True)


def _looked_up(
    paint: Paint, points: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "n 3"], UInt8[np.ndarray, " n"]]:
    """Return a drawing's colour and label at points of the world."""
    pixels, _, _ = paint.texture.camera.project(points)
    count = len(points)
    padded = np.zeros((max(1, -(-count // ROW)), ROW, 2), dtype=np.float32)
    padded.reshape(-1, 2)[:count] = np.nan_to_num(pixels - 0.5, nan=-1e4)
    places: Places = (padded[..., 0].copy(), padded[..., 1].copy())
    color = sample_picture(paint.texture.paint, places, cv2.INTER_CUBIC).clip(0, 1)
    label = sample_picture(paint.texture.labels, places, cv2.INTER_NEAREST)
    return color.reshape(-1, 3)[:count], label.ravel()[:count]
