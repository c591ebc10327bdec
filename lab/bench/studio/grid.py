"""The grid of the bench: drawings, how far their bodies differ, mirroring on or off."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

from lab.bench.cases.bodies import random_body
from lab.bench.look.cases import EYE_RADIUS
from lab.bench.stability.bodies import with_eyes
from toonset.dataset.synthetic.options import CONDITIONS, SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.nerf.options import TrainOptions

SHEET = replace(CONDITIONS["studio"], cell_px=150, outline_px=1.25)
VIEWS, QUICK_VIEWS = (8, 7, 6, 5, 4, 3, 2), (8, 4, 3)
POSES, QUICK_POSES = (0.0, 1.0, 2.0), (1.0,)  # times as large as `STUDIO.body`
HELD_OUT = 12  # views, the first half of the side that is drawn
STEPS = 100  # of training: shape is settled by then, and so is the drawn look


@dataclass(frozen=True)
class Cell:
    """A place in the grid.

    Attributes:
        views: drawings.
        pose: how far their bodies differ, times a studio's.
        mirrored: whether the other side may be the mirror image.
    """

    views: int
    pose: float
    mirrored: bool

    @property
    def sheet(self) -> str:
        """Return what its sheets are, in words."""
        return f"{self.views} drawings, pose {self.pose:g}"


def grid(*, quick: bool) -> list[Cell]:
    """Return all cells, many drawings first; both ways of mirroring beside each other."""
    views, poses = (QUICK_VIEWS, QUICK_POSES) if quick else (VIEWS, POSES)
    return [Cell(*place) for place in itertools.product(views, poses, (True, False))]


def train_options(cell: Cell, seed: int) -> TrainOptions:
    """Return the options of a cell's training; mirroring is named here alone."""
    return TrainOptions(steps=STEPS, seed=seed, symmetric="auto" if cell.mirrored else "off")


def draw(cell: Cell, seed: int) -> tuple[Turnaround, Turnaround]:
    """Return the sheet of a symmetric body, and held-out views of it."""
    body = random_body(seed, symmetric=True)
    body = with_eyes(body, EYE_RADIUS * body.height)
    made = make_turnaround(body, sheet_options(cell.views, cell.pose), seed)
    return made, make_turnaround(body, made.options.without_error(HELD_OUT), seed)


def sheet_options(views: int, pose: float) -> SynthOptions:
    """Return a studio's options with so many drawings, of bodies that differ so far."""
    artist = replace(SHEET.artist, body=SHEET.artist.body.scaled(pose))
    return replace(SHEET, views=views, artist=artist)
