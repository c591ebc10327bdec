"""The sheet that all stability sweeps start from, and what goes with it."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bench.cases.bodies import random_body
from bench.stability.damage import Drawn
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.mesh import Mesh

BASE = SynthOptions(views=5, cell_px=200, yaw_jitter_deg=8, elevation_deg=10, outline_px=2)

Step = float | str
GivenBody = Literal["own", "plain", "none"]


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


def draw_sheet(
    seed: int, options: SynthOptions | None = None, mesh: Mesh | None = None
) -> DrawnSheet:
    """Return a sheet of `mesh` (default: the base sheet, of the seed's asymmetric body)."""
    made = make_turnaround(mesh or random_body(seed), options or BASE, seed)
    return DrawnSheet(made.mesh, tuple(zip(made.views, made.cameras, strict=True)))


def stream(name: str, seed: int) -> np.random.Generator:
    """Return a generator of its own for every sweep and seed, the same for all steps."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])
