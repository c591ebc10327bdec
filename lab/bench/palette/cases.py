"""Drawings whose colours are known: characters rendered flat, large and small, PNG and JPEG.

The truth is the mesh's: a colour's share is the area that it covers of all cells, less what the ink
covers. Public characters have `palette_srgb` in their info.json; ours are random bodies in random
paints, half of them near relations of another one.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from lab.bench.cases.bodies import random_body
from lab.bench.cases.jpeg import through_jpeg
from toonset.dataset.mesh.load import load_mesh
from toonset.dataset.synthetic.gl_render import render_labels
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, flat_palette, make_turnaround
from toonset.errors import BundleError
from toonset.mesh import Mesh
from toonset.palette.colors import oklab_from_rgb
from toonset.palette.pixels.labels import UNLABELLED

BODIES = 8
SIZES_PX = (150, 600)
OUTLINE = 0.01  # of the cell: 1.5 px at 150, 6 px at 600
JPEG_QUALITY = 80
LEAST_APART = 0.04  # in OKLab, of synthetic paints: two steps that are just noticeable
NEAR = 30  # levels per channel between near relations
INK = (0, 0, 0)
MESHES = ("posed.glb", "bind.glb")

RGB = tuple[int, int, int]
Images = tuple[UInt8[np.ndarray, "_ _ 4"], ...]


@dataclass(frozen=True, eq=False)
class PaletteCase:
    """One character's drawings under one condition.

    Attributes:
        name: of the character.
        group: the condition.
        images: the views on transparent ground.
        colors: all colours that are there, the ink's included where it is.
        shares: of the figure's area.
    """

    name: str
    group: str
    images: Images
    colors: UInt8[np.ndarray, "colors 3"]
    shares: Float[np.ndarray, " colors"]


def palette_cases(folder: Path | None, seed: int, *, quick: bool) -> Iterator[PaletteCase]:
    """Yield every character under every condition: size, lines or none, PNG or JPEG.

    Args:
        folder: character folders with info.json and a .glb; None for synthetic ones.
        seed: of the first synthetic character.
        quick: two characters, small only.

    Raises:
        BundleError: the folder holds no character with known colours.
    """
    sizes = SIZES_PX[:1] if quick else SIZES_PX
    for mesh in characters(folder, seed, quick=quick):
        for size, lined in product(sizes, (False, True)):
            options = SynthOptions(
                cell_px=size, outline_px=OUTLINE * size if lined else 0.0, elevation_deg=5
            )
            drawn = make_turnaround(mesh, options, seed)
            colors, shares = _truth(drawn)
            group = f"{size} px, {'lines' if lined else 'no lines'}"
            clean = tuple(view.rgba for view in drawn.views)
            yield PaletteCase(mesh.name, f"{group}, png", clean, colors, shares)
            yield PaletteCase(
                mesh.name,
                f"{group}, jpeg {JPEG_QUALITY}",
                as_jpeg(drawn, JPEG_QUALITY),
                colors,
                shares,
            )


def random_paints(rng: np.random.Generator, count: int) -> list[RGB]:
    """Return colours of which about half are near relations of another, none nearer than 0.04."""
    paints: list[RGB] = []
    while len(paints) < count:
        color = rng.integers(0, 256, 3)
        if paints and rng.random() < 0.5:
            color = np.clip(
                paints[rng.integers(len(paints))] + rng.integers(-NEAR, NEAR + 1, 3), 0, 255
            )
        places = oklab_from_rgb(np.array([*paints, color], dtype=np.uint8))
        if not paints or np.linalg.norm(places[:-1] - places[-1], axis=1).min() > LEAST_APART:
            red, green, blue = (int(level) for level in color)
            paints.append((red, green, blue))
    return paints


def characters(
    folder: Path | None, seed: int, *, quick: bool, count: int = BODIES
) -> Iterator[Mesh]:
    """Yield the characters of a folder, or random bodies in random paints.

    Args:
        folder: of character folders; None for bodies.
        seed: of the first body.
        quick: two characters.
        count: of bodies otherwise.

    Raises:
        BundleError: the folder holds no character with known colours.
    """
    if folder is None:
        for i in range(2 if quick else count):
            yield _painted_body(seed + i)
        return
    found = [place.parent for place in sorted(folder.glob("*/info.json"))]
    known = [place for place in found if _has_palette(place / "info.json")]
    if not known:
        raise BundleError(
            f"{folder}: holds no character whose info.json has palette_srgb; give another --cases"
        )
    for place in known[: 2 if quick else None]:
        mesh = load_mesh(next(place / name for name in MESHES if (place / name).is_file()))
        yield replace(mesh, name=place.name)


def _has_palette(info: Path) -> bool:
    content = json.loads(info.read_text())
    return isinstance(content, dict) and bool(content.get("palette_srgb"))


def _painted_body(seed: int) -> Mesh:
    body = random_body(seed)
    assert body.face_colors is not None
    own, part = np.unique(body.face_colors, axis=0, return_inverse=True)
    paints = random_paints(np.random.default_rng(seed), len(own))
    return replace(body, face_colors=np.array(paints, dtype=np.uint8)[part.reshape(-1)])


def _truth(drawn: Turnaround) -> tuple[UInt8[np.ndarray, "colors 3"], Float[np.ndarray, " colors"]]:
    """Return the colours, the ink's last where there is one, and the area that each covers."""
    colors, face_labels = flat_palette(drawn.mesh)
    areas = np.zeros(len(colors) + 1)
    for camera, ink in zip(drawn.cameras, drawn.ink, strict=True):
        labels = render_labels(drawn.mesh, face_labels, camera).labels
        seen, covered = labels != UNLABELLED, ink / 255
        areas[:-1] += np.bincount(labels[seen], 1 - covered[seen], len(colors))
        areas[-1] += covered.sum()
    if not areas[-1]:
        return colors, areas[:-1] / areas.sum()
    return np.concatenate([colors, np.array([INK], dtype=np.uint8)]), areas / areas.sum()


def as_jpeg(drawn: Turnaround, quality: int) -> Images:
    """Return the views cut from the sheet's JPEG, along the true silhouettes."""
    sheet = through_jpeg(drawn.sheet, quality)[..., :3]
    images = []
    for view in drawn.views:
        x, y, width, height = view.box
        alpha = np.where(view.rgba[..., 3:] >= 128, 255, 0).astype(np.uint8)
        images.append(np.dstack([sheet[y : y + height, x : x + width], alpha]))
    return tuple(images)
