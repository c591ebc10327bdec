"""The sweeps of `toonset bench stability`: one thing about a sheet changes, all else stays.

Sheets differ by their seed (body, jitter); a sweep's steps share their sheets, so that a change
from step to step is the step's effect. The base sheet has five views of an asymmetric body on 200
px cells, turned wrongly by up to 8 degrees, seen from 10 degrees above, drawn without other error.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from toonset.bench.stability_damage import (
    Drawn,
    mirrored,
    rolled,
    with_capsule,
    without_feet,
    without_pieces,
)
from toonset.dataset.bodies import HAIR, random_body
from toonset.dataset.synth_options import SynthOptions
from toonset.dataset.synthetic import make_turnaround
from toonset.mesh import Mesh

BASE = SynthOptions(views=5, cell_px=200, yaw_jitter_deg=8, elevation_deg=10, outline_px=2)
STAFF_RADIUS = 0.02  # of the body's height
VASE = ((0, 0), (0.35, 0), (0.2, 0.15), (0.45, 0.9), (0.5, 1.2), (0.2, 1.6), (0.3, 1.8), (0, 1.8))

Step = float | str


@dataclass(frozen=True, eq=False)
class DrawnSheet:
    """Drawings with their exact cameras, and the mannequin they are calibrated with."""

    mesh: Mesh
    drawings: tuple[Drawn, ...]


@dataclass(frozen=True)
class Sweep:
    """One property of a sheet and its steps.

    Attributes:
        name: for --only and the table.
        axis: what the steps are, with unit, for the picture.
        steps: from harmless to extreme, mostly.
        quick: those of a quick run.
        draw: step and seed to a sheet.
        from_start: align every view from a start that is wrong by `step` degrees, no search.
    """

    name: str
    axis: str
    steps: tuple[Step, ...]
    quick: tuple[Step, ...]
    draw: Callable[[Step, int], DrawnSheet]
    from_start: bool = False


def draw_sheet(
    seed: int, options: SynthOptions | None = None, mesh: Mesh | None = None
) -> DrawnSheet:
    """Return a sheet of `mesh` (default: the base sheet, of the seed's asymmetric body)."""
    made = make_turnaround(mesh or random_body(seed), options or BASE, seed)
    return DrawnSheet(made.mesh, tuple(zip(made.views, made.cameras, strict=True)))


def vase() -> Mesh:
    """Return a surface of revolution as tall as a body: nothing tells its yaw."""
    import trimesh

    shape = trimesh.creation.revolve(np.array(VASE, dtype=float), sections=96)
    x, y, z = shape.vertices.T  # turned round z there, round y here
    return Mesh(np.stack([x, z, -y], axis=1), np.asarray(shape.faces), name="vase")


def chosen(only: str, *, quick: bool) -> list[tuple[Sweep, Step]]:
    """Return the steps to run of the sweeps whose name contains `only`."""
    picked = (sweep for sweep in SWEEPS if only in sweep.name)
    return [(sweep, step) for sweep in picked for step in (sweep.quick if quick else sweep.steps)]


def _without_lines(step: Step, seed: int) -> DrawnSheet:
    """Return the base sheet without lines: an alignment alone does not know their width."""
    return draw_sheet(seed, replace(BASE, outline_px=0))


def _warped(step: Step, seed: int) -> DrawnSheet:
    return draw_sheet(seed, replace(BASE, warp_percent=float(step)))


def _outlined(step: Step, seed: int) -> DrawnSheet:
    return draw_sheet(seed, replace(BASE, outline_px=float(step)))


def _misscaled(step: Step, seed: int) -> DrawnSheet:
    return draw_sheet(seed, replace(BASE, scale_error_percent=float(step)))


def _near(step: Step, seed: int) -> DrawnSheet:
    return draw_sheet(seed, replace(BASE, distance_heights=float(step)))


def _numbered(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of so many views; few views still come from all directions over the seeds."""
    views = int(step)
    return draw_sheet(seed, replace(BASE, views=views, yaw_jitter_deg=180 / views))


def _sized(step: Step, seed: int) -> DrawnSheet:
    outline = BASE.outline_px * float(step) / BASE.cell_px
    return draw_sheet(seed, replace(BASE, cell_px=int(step), outline_px=outline))


def _of_body(step: Step, seed: int) -> DrawnSheet:
    bodies = {
        "asymmetric": lambda: random_body(seed),
        "symmetric": lambda: random_body(seed, symmetric=True),
        "vase": vase,
    }
    return draw_sheet(seed, mesh=bodies[str(step)]())


def _rolled(step: Step, seed: int) -> DrawnSheet:
    sheet = draw_sheet(seed)
    turns = math.radians(float(step)) * _stream("roll", seed).choice([-1, 1], len(sheet.drawings))
    pairs = zip(sheet.drawings, turns, strict=True)
    return replace(sheet, drawings=tuple(rolled(*d, float(turn)) for d, turn in pairs))


def _cropped(step: Step, seed: int) -> DrawnSheet:
    sheet = draw_sheet(seed)
    cut = tuple(without_feet(*d, float(step) / 100) for d in sheet.drawings)
    return replace(sheet, drawings=cut)


def _with_hair(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of figures with a ball of hair round the top of the head."""
    sheet = draw_sheet(seed)
    top = sheet.mesh.vertices[sheet.mesh.vertices[:, 1].argmax()]
    return _with_extra(sheet, np.stack([top, top]), float(step) / 100 * sheet.mesh.height)


def _with_staff(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of figures with an upright staff in the right hand."""
    sheet = draw_sheet(seed)
    hand = sheet.mesh.vertices[sheet.mesh.vertices[:, 0].argmin()]
    half = np.array([0, float(step) / 200 * sheet.mesh.height, 0])
    radius = STAFF_RADIUS * sheet.mesh.height if step else 0.0
    return _with_extra(sheet, np.stack([hand - half, hand + half]), radius)


def _with_extra(sheet: DrawnSheet, ends: np.ndarray, radius: float) -> DrawnSheet:
    more = tuple(with_capsule(*d, ends, radius, HAIR) for d in sheet.drawings)
    return replace(sheet, drawings=more)


def _mirrored(step: Step, seed: int) -> DrawnSheet:
    sheet = draw_sheet(seed)
    flipped = _stream("mirror", seed).permutation(len(sheet.drawings))[: int(step)]
    drawings = (mirrored(*d) if i in flipped else d for i, d in enumerate(sheet.drawings))
    return replace(sheet, drawings=tuple(drawings))


def _fragmented(step: Step, seed: int) -> DrawnSheet:
    sheet = draw_sheet(seed)
    generators = _stream("fragments", seed).spawn(len(sheet.drawings))
    pairs = zip(sheet.drawings, generators, strict=True)
    broken = tuple(without_pieces(*d, float(step) / 100, g) for d, g in pairs)
    return replace(sheet, drawings=broken)


def _stream(name: str, seed: int) -> np.random.Generator:
    """Return a generator of its own for every sweep and seed, the same for all steps."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


SWEEPS = (
    Sweep(
        "start",
        "start error, degrees",
        (0, 5, 10, 15, 20, 30, 45, 60),
        (0, 10, 20, 30, 45, 60),
        _without_lines,
        from_start=True,
    ),
    Sweep("warp", "outline warp, % of cell", (0, 0.5, 1, 2, 4), (0, 1, 2, 4), _warped),
    Sweep("line", "line width, px", (0, 1, 2, 4, 6, 8), (0, 4, 8), _outlined),
    Sweep("scale", "scale error per view, ± %", (0, 2.5, 5, 7.5, 10), (0, 5, 10), _misscaled),
    Sweep("roll", "roll per view, ± degrees", (0, 2.5, 5, 7.5, 10), (0, 5, 10), _rolled),
    Sweep("feet", "feet cropped, % of height", (0, 5, 10, 15, 20, 30), (0, 5, 10, 30), _cropped),
    Sweep(
        "hair",
        "hair ball, radius % of height",
        (0, 10, 15, 20, 25, 30),
        (0, 10, 20, 30),
        _with_hair,
    ),
    Sweep("prop", "staff, % of height", (0, 30, 60, 100, 150), (0, 60, 150), _with_staff),
    Sweep("mirror", "mirrored views of 5", (0, 1, 2), (0, 1, 2), _mirrored),
    Sweep(
        "body",
        "body's symmetry",
        ("asymmetric", "symmetric", "vase"),
        ("asymmetric", "symmetric", "vase"),
        _of_body,
    ),
    Sweep("distance", "camera distance, heights", (20, 10, 5, 3, 2.5, 2), (20, 5, 3, 2), _near),
    Sweep("fragments", "missing, % of area", (0, 2, 5, 10, 20, 40), (0, 5, 20, 40), _fragmented),
    Sweep("views", "views", (8, 7, 6, 5, 4, 3, 2, 1), (8, 4, 2, 1), _numbered),
    Sweep("resolution", "cell, px", (600, 400, 200, 120, 80, 60, 40), (600, 120, 60, 40), _sized),
)
