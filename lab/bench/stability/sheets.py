"""Sheets of the pages about cameras and labels: one thing changes per page, all else stays.

The base sheet has five views of an asymmetric body on 200 px cells, turned wrongly by up to 8
degrees, seen from 10 degrees above, drawn without other error. An artist's sheet is the condition
`artist` of `toonset synth`, cut out of its JPEG file.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal, cast

import cv2
import numpy as np
from jaxtyping import UInt8

from lab.bench.cases.bodies import HAIR, random_body
from lab.bench.cases.cases import STRANGER
from lab.bench.cases.jpeg import through_jpeg
from lab.bench.stability.bodies import EARS, vase, with_ears
from lab.bench.stability.damage import Drawn, mirrored, with_ball, without_pieces
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.synthetic.options import CONDITIONS, SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.errors import SheetError
from toonset.mesh import Mesh

BASE = SynthOptions(views=5, cell_px=200, yaw_jitter_deg=8, elevation_deg=10, outline_px=2)
ARTIST = replace(CONDITIONS["artist"], cell_px=200, outline_px=2)
STUDIO = replace(CONDITIONS["studio"], cell_px=200, outline_px=2)
PAINTED = replace(CONDITIONS["painted"], cell_px=200)
LOSSLESS, HARD, OTHER = "lossless", "hard", "other body"

Step = float | str
GivenBody = Literal["own", "plain", "none"]
Rgba = UInt8[np.ndarray, "height width 4"]


@dataclass(frozen=True, eq=False)
class DrawnSheet:
    """Drawings with their exact cameras, and the mannequin they are calibrated with.

    Attributes:
        mesh: the mannequin; where it is not given, the body that was drawn.
        drawings: with their cameras.
        given: "own": the mannequin is; "plain": none is, a body made by code stands in, as without
            --mesh; "none": none at all, as with --mesh none.
    """

    mesh: Mesh
    drawings: tuple[Drawn, ...]
    given: GivenBody = "own"


def draw_sheet(seed: int, mesh: Mesh | None = None, **changes: Any) -> DrawnSheet:
    """Return a sheet of a mesh (the seed's asymmetric body): the base options with changes."""
    made = make_turnaround(mesh or random_body(seed), replace(BASE, **changes), seed)
    return DrawnSheet(made.mesh, tuple(zip(made.views, made.cameras, strict=True)))


def stream(name: str, seed: int) -> np.random.Generator:
    """Return a generator of its own for every page and seed, the same for all steps."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def each(name: str, seed: int, change: Callable[[Drawn, int], Drawn]) -> DrawnSheet:
    """Return the base sheet with every drawing changed, to one of two sides."""
    sheet = draw_sheet(seed)
    sides = stream(name, seed).choice([-1, 1], len(sheet.drawings))
    pairs = zip(sheet.drawings, sides, strict=True)
    return replace(sheet, drawings=tuple(change(drawn, int(side)) for drawn, side in pairs))


def of_body(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of a body with this symmetry."""
    body = vase() if step == "vase" else random_body(seed, symmetric=step == "symmetric")
    return draw_sheet(seed, body)


def of_other(seed: int, change: Callable[[Mesh], Mesh]) -> DrawnSheet:
    """Return a sheet of a changed body that is calibrated with the unchanged one."""
    body = random_body(seed)
    return replace(draw_sheet(seed, change(body)), mesh=body)


def with_hair(share: float, seed: int) -> DrawnSheet:
    """Return a sheet of figures with a ball of hair round the top of the head."""
    sheet = draw_sheet(seed)
    top = sheet.mesh.vertices[sheet.mesh.vertices[:, 1].argmax()]
    radius = share * sheet.mesh.height
    hairy = tuple(with_ball(*d, top, radius, HAIR) for d in sheet.drawings)
    return replace(sheet, drawings=hairy)


def with_following_ears(share: float, seed: int) -> DrawnSheet:
    """Return a sheet of figures with ears that face the viewer; the mannequin's face the front."""
    body = random_body(seed)
    eared = with_ears(body, share * body.height)
    return draw_sheet(seed, eared, following_parts=EARS if share else ())


def with_mirrored(count: int, seed: int) -> DrawnSheet:
    """Return a sheet with some drawings flipped left to right."""
    sheet = draw_sheet(seed)
    flipped = stream("mirror", seed).permutation(len(sheet.drawings))[:count]
    drawings = (mirrored(*d) if i in flipped else d for i, d in enumerate(sheet.drawings))
    return replace(sheet, drawings=tuple(drawings))


def fragmented(share: float, seed: int) -> DrawnSheet:
    """Return a sheet of figures that lack a share of their area."""
    sheet = draw_sheet(seed)
    generators = stream("fragments", seed).spawn(len(sheet.drawings))
    pairs = zip(sheet.drawings, generators, strict=True)
    return replace(sheet, drawings=tuple(without_pieces(*d, share, g) for d, g in pairs))


def blurred(options: SynthOptions, step: Step, seed: int) -> DrawnSheet:
    """Return a sheet without anti-aliasing, or blurred by `step` px, as it is cut out of a file."""
    options = replace(options, supersample=1) if step == HARD else options
    made = make_turnaround(random_body(seed), options, seed)
    blur = 0.0 if step == HARD else float(step)
    sheet = np.asarray(cv2.GaussianBlur(made.sheet, (0, 0), blur)) if blur else made.sheet
    return cut_out(made, sheet)


def compressed(options: SynthOptions, step: Step, seed: int) -> DrawnSheet:
    """Return a sheet as it is cut out of a JPEG file of quality `step`."""
    made = make_turnaround(random_body(seed), options, seed)
    sheet = made.sheet if step == LOSSLESS else through_jpeg(made.sheet, int(step))
    return cut_out(made, sheet)


def cut_out(made: Turnaround, sheet: Rgba) -> DrawnSheet:
    """Return the drawings as they are found on a sheet of the turnaround, with their true cameras.

    Raises:
        SheetError: other than the drawn number of views was found.
    """
    found = split_picture(sheet).views
    if len(found) != len(made.views):
        raise SheetError(f"split into {len(found)} views, {len(made.views)} were drawn")
    drawings = []
    for view, drawn, camera in zip(found, made.views, made.cameras, strict=True):
        offset = (view.box[0] - drawn.box[0], view.box[1] - drawn.box[1])
        drawings.append((view, camera.moved(offset, view.rgba.shape[1::-1])))
    return DrawnSheet(made.mesh, tuple(drawings))


def artists(seed: int, **habits: Any) -> Turnaround:
    """Return an artist's sheet of the seed's body with changed habits."""
    options = replace(ARTIST, artist=replace(ARTIST.artist, **habits))
    return make_turnaround(random_body(seed), options, seed)


def painters(seed: int, body: Mesh | None = None, **brush: float) -> Turnaround:
    """Return a painter's sheet of a body (the seed's) with a changed brush."""
    artist = replace(PAINTED.artist, brush=replace(PAINTED.artist.brush, **brush))
    return make_turnaround(body or random_body(seed), replace(PAINTED, artist=artist), seed)


def of_studio(seed: int, views: int = 4, pose: float = 1.0) -> DrawnSheet:
    """Return a studio's sheet of the seed's body, to be calibrated without a mannequin.

    Args:
        seed: of the body and its drawings.
        views: drawings of one side.
        pose: how far their bodies differ, times a studio's.
    """
    artist = replace(STUDIO.artist, body=STUDIO.artist.body.scaled(pose))
    made = make_turnaround(random_body(seed), replace(STUDIO, views=views, artist=artist), seed)
    return replace(as_cut_out(made), given="none")


def as_cut_out(made: Turnaround) -> DrawnSheet:
    """Return the drawings of a sheet as they are found in its file, with their true cameras."""
    quality = made.options.artist.jpeg_quality
    return cut_out(made, through_jpeg(made.sheet, quality) if quality else made.sheet)


def of_mannequin(step: Step, seed: int) -> DrawnSheet:
    """Return an artist's sheet with its own body, another one, a plain one, or none."""
    sheet = as_cut_out(artists(seed))
    if step == OTHER:
        return replace(sheet, mesh=random_body(seed + STRANGER, symmetric=True))
    return replace(sheet, given=cast(GivenBody, step))


def without_mannequin(views: int, seed: int) -> DrawnSheet:
    """Return an artist's sheet of some drawings, to be calibrated without a mannequin."""
    made = make_turnaround(random_body(seed), replace(ARTIST, views=views), seed)
    return replace(as_cut_out(made), given="none")
