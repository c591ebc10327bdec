"""Measure one cell: how its cameras are found, and how new views look from either side."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lab.bench.cases.cases import scene_of
from lab.bench.records.record import CPU_SECONDS, DEFAULT, Record, Recorder
from lab.bench.stability.cameras import try_cameras
from lab.bench.stability.sheets import cut_out
from lab.bench.studio.grid import Cell, draw, train_options
from lab.bench.verdict.measure import needed_flip
from toonset.dataset.synthetic.turnaround import Turnaround
from toonset.nerf.render.layers import default_layer
from toonset.nerf.render.views import render
from toonset.nerf.score.metrics import silhouette_iou
from toonset.nerf.training import train
from toonset.view import over_white

NO_MIRROR = "no mirror images"
CAMERAS = "rotation error"
IOU, FLIP = "IoU", "FLIP"
SIDES = ("drawn side", "other side")


@dataclass(frozen=True)
class Seen:
    """What one sheet of a cell came to.

    Attributes:
        cell: its place in the grid.
        seed: of body and drawings.
        iou: of held-out outlines with the true ones, mean over the drawn side and the other.
        flip: of held-out views, the same.
        cpu_s: of the training.
        cameras_deg: how far each camera is off that was found without a mannequin; empty where none
            was looked for.
    """

    cell: Cell
    seed: int
    iou: tuple[float, float]
    flip: tuple[float, float]
    cpu_s: float
    cameras_deg: tuple[float, ...]


def measure(cell: Cell, seed: int) -> Seen:
    """Return what a sheet comes to; it is trained on with its true cameras.

    Cameras do not depend on mirroring: they are looked for where there is some.
    """
    made, exact = draw(cell, seed)
    began = time.process_time()
    run = train(scene_of(made), train_options(cell, seed), threads=1)
    spent = time.process_time() - began
    flip, layer = needed_flip(), default_layer(run.field)
    figures = []
    for frame in scene_of(exact).frames:
        shown = render(run.field, frame.camera).picture(layer)
        error = flip(over_white(frame.rgba), over_white(shown))
        figures.append((silhouette_iou(shown, frame.rgba) or 0.0, float(error.mean())))
    drawn, other = (half.mean(axis=0) for half in np.split(np.array(figures), 2))
    found = cameras_off(made, seed) if cell.mirrored else ()
    iou, of_flip = ((float(drawn[k]), float(other[k])) for k in (0, 1))
    return Seen(cell, seed, iou, of_flip, spent, found)


def cameras_off(made: Turnaround, seed: int) -> tuple[float, ...]:
    """Return how far cameras are off, degrees, that are found on a sheet without a mannequin."""
    sheet = replace(cut_out(made, made.sheet), given="none")
    trials, _ = try_cameras(lambda: sheet, seed)
    return tuple(trial.value for trial in trials)


def records_of(found: Iterable[Seen]) -> list[Record]:
    """Return the records of all cells: a group per sheet, with and without mirror images."""
    by_cell: dict[Cell, list[Seen]] = {}
    for seen in found:
        by_cell.setdefault(seen.cell, []).append(seen)
    return [record for cell, own in by_cell.items() for record in _records(cell, own)]


def _records(cell: Cell, own: Sequence[Seen]) -> list[Record]:
    method = DEFAULT if cell.mirrored else NO_MIRROR
    recorder = Recorder(method, cell.sheet, own[0].seed)
    records = []
    for k, side in enumerate(SIDES):
        iou, flip = [seen.iou[k] for seen in own], [seen.flip[k] for seen in own]
        records.append(recorder.samples(f"{IOU}, {side}", iou, "1", "higher"))
        records.append(recorder.samples(f"{FLIP}, {side}", flip, "1"))
    records.append(recorder.samples(CPU_SECONDS, [seen.cpu_s for seen in own], "s"))
    cameras = [off for seen in own for off in seen.cameras_deg]
    return [*records, recorder.samples(CAMERAS, cameras)] if cameras else records
