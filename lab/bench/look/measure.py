"""Look against CPU seconds: figures of held-out views and of a turn, per look and sheet.

Compared are the default look, and it without each of its parts.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
import torch

from lab.bench.look.cases import LookCase
from lab.bench.records.drawing import Panel
from lab.bench.records.record import CPU_SECONDS, DEFAULT, Column, Direction, Record, Recorder
from toonset.camera import Camera
from toonset.cli.common.host import keep_freed_memory
from toonset.dataset.bundle.scene import Scene
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.look.asked import flanking
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.options import TrainOptions
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.layers import Picture, Rendering
from toonset.nerf.render.views import render
from toonset.nerf.score.evaluate import label_figures
from toonset.nerf.score.metrics import Figures, means
from toonset.nerf.score.metrics_view import Judges, figures_of, load_judges
from toonset.nerf.train.fit_field import fit_field
from toonset.nerf.train.labelling import label_scene
from toonset.nerf.training import add_drawings
from toonset.view import over_white

Layer = Literal["drawn", "rgb", "palette"]
Part = Literal["", "flow", "vote"]


@dataclass(frozen=True)
class Recipe:
    """A training that looks share: its options, and whether bends make paint agree."""

    options: TrainOptions = TrainOptions()
    paint: bool = True


@dataclass(frozen=True)
class Look:
    """One way to show new views.

    Attributes:
        layer: that is shown.
        recipe: of the field.
        without: the part of the drawn look that is left out: the flow between drawings, or the
            vote: the nearest drawing alone is shown.
    """

    layer: Layer = "drawn"
    recipe: Recipe = Recipe()
    without: Part = ""


NO_MANNEQUIN = Recipe(TrainOptions(mannequin=False))
FIELD = "field only"
LOOKS: dict[str, Look] = {
    DEFAULT: Look(),
    "without the mannequin": Look(recipe=NO_MANNEQUIN),
    "without paint agreement": Look(recipe=Recipe(paint=False)),
    "without flow": Look(without="flow"),
    "nearest drawing": Look(without="vote"),
    FIELD: Look("rgb"),
    "field only, no mannequin": Look("rgb", NO_MANNEQUIN),
    "palette layer": Look("palette"),
}


class Variant:
    """The drawings of a run, as a look has them for a view."""

    def __init__(self, drawings: Drawings, without: Part) -> None:
        """Take the drawings and what the look leaves out."""
        self._whole = replace(drawings, flows=()) if without == "flow" else drawings
        one = [replace(drawings, views=(view,), flows=()) for view in drawings.views]
        self._alone = one if without == "vote" else []

    def seen_by(self, camera: Camera) -> Drawings:
        """Return the drawings to put a view together from."""
        if not self._alone:
            return self._whole
        nearest, _, _ = flanking([view.camera for view in self._whole.views], camera)
        return self._alone[nearest]


VIEWS = 16  # whose rendering counts as a cost, beside the training's
FLICKER, VIEW_S = "flicker", "view_s"


@dataclass(frozen=True, eq=False)
class LookResult:
    """Scores of one look of one sheet.

    Attributes:
        case: the character.
        group: condition.
        look: a key of `LOOKS`.
        seed: of the training.
        figures: means over the held-out views; FLICKER over the truth's, VIEW_S CPU seconds per
            view.
        cpu_seconds: of training, of laying the drawings over the field, of VIEWS views.
        pictures: the held-out views.
    """

    case: LookCase
    look: str
    seed: int
    figures: Figures
    cpu_seconds: float
    pictures: tuple[Picture, ...]


def bench_look(
    cases: Iterable[LookCase],
    seed: int,
    looks: Sequence[str] = tuple(LOOKS),
    progress: Callable[[str], None] = lambda text: None,
) -> list[LookResult]:
    """Return what every look of every case is worth, case by case."""
    keep_freed_memory()  # as the command does: seconds count
    torch.set_num_threads(1)  # neither figures nor CPU seconds may depend on the machine's cores
    judges = load_judges()
    found = []
    for case in cases:
        recipes = dict.fromkeys(LOOKS[name].recipe for name in looks)
        for recipe in recipes:
            own = [name for name in looks if LOOKS[name].recipe == recipe]
            progress(f"{case.name}, {case.group}: {', '.join(own)}")
            laid = _laid(case.train, recipe, seed)
            found += _results(case, own, laid, seed, judges)
    order = list(LOOKS)
    return sorted(found, key=lambda one: order.index(one.look))


def _laid(scene: Scene, recipe: Recipe, seed: int) -> tuple[TrainedField, float, float]:
    """Return a field with its drawings, and CPU seconds: of the fit, of the drawings."""
    began = time.process_time()
    ready, _ = label_scene(scene)
    training = fit_field(ready, replace(recipe.options, seed=seed), agree=recipe.paint)
    fitted = time.process_time()
    trained = add_drawings(training, ready)
    return trained, fitted - began, time.process_time() - fitted


def _results(
    case: LookCase,
    names: Sequence[str],
    laid: tuple[TrainedField, float, float],
    seed: int,
    judges: Judges,
) -> list[LookResult]:
    """Return the results of looks that share a training; every view is rendered once for all."""
    trained, fit_s, lay_s = laid
    baked = Baked.of(trained)
    shown = {name: _shower(trained.drawings, LOOKS[name]) for name in names}
    views, spent = _shown(baked, case.test, shown)
    turns = _shown(baked, case.turn, shown)[0] if case.turn else {}
    results = []
    for name in names:
        rows = []
        for frame, (picture, labels) in zip(case.test.frames, views[name], strict=True):
            figures, _ = figures_of(picture, frame.rgba, judges)
            rows.append(figures | label_figures(trained, case.test, frame, labels))
        pictures = tuple(picture for picture, _ in views[name])
        more: Figures = {
            FLICKER: _flicker(case.turn, [picture for picture, _ in turns.get(name, ())]),
            VIEW_S: spent[name],
        }
        cost = fit_s + lay_s * (LOOKS[name].layer == "drawn") + VIEWS * spent[name]
        results.append(LookResult(case, name, seed, means(rows) | more, cost, pictures))
    return results


_Shower = Callable[[Rendering], tuple[Picture, np.ndarray | None]]


def _shower(drawings: Drawings | None, look: Look) -> _Shower:
    """Return what shows a rendering in a look: its picture and labels."""
    if look.layer != "drawn" or drawings is None:
        layer = "rgb" if look.layer == "drawn" else look.layer
        return lambda view: (view.picture(layer), view.labels)
    return partial(_drawn, Variant(drawings, look.without))


def _drawn(variant: Variant, view: Rendering) -> tuple[Picture, np.ndarray | None]:
    own = replace(view, field=replace(view.field, drawings=variant.seen_by(view.camera)))
    return own.picture("drawn"), own.drawn.palette_labels(len(variant.seen_by(view.camera).palette))


def _shown(
    baked: Baked, scene: Scene, shown: dict[str, _Shower]
) -> tuple[dict[str, list[tuple[Picture, np.ndarray | None]]], dict[str, float]]:
    """Return every look's pictures of the scene's cameras, and its median CPU seconds of one."""
    pictures: dict[str, list[tuple[Picture, np.ndarray | None]]] = {name: [] for name in shown}
    seconds: dict[str, list[float]] = {name: [] for name in shown}
    for frame in scene.frames:
        began = time.process_time()
        view = render(baked, frame.camera)
        of_field = time.process_time() - began
        for name, show in shown.items():
            began = time.process_time()
            pictures[name].append(show(view))
            seconds[name].append(of_field + time.process_time() - began)
    return pictures, {name: float(np.median(spent)) for name, spent in seconds.items()}


def _flicker(truth: Scene | None, turn: list[Picture]) -> float | None:
    """Return how much a turn flickers, over the truth's own."""
    if truth is None:
        return None
    own = flicker([over_white(frame.rgba) for frame in truth.frames])
    return flicker([over_white(picture) for picture in turn]) / own


def flicker(turn: Sequence[np.ndarray]) -> float:
    """Return the mean absolute second difference of consecutive pictures, three or more."""
    return float(np.abs(np.diff(np.stack(turn), n=2, axis=0)).mean())


# of the figures: name, metric, unit, which is better, heading in the table, form of the number
METRICS: tuple[tuple[str, str, str, Direction, str, str], ...] = (
    ("flip", "FLIP", "1", "lower", "FLIP", "{:.4f}"),
    ("dirt", "dirt", "levels/px", "lower", "dirt", "{:.2f}"),
    ("sharpness", "sharpness", "1", "higher", "sharp", "{:.2f}"),
    ("ink_f1", "ink F1", "1", "higher", "lines", "{:.3f}"),
    ("label_miou_shift", "label mIoU", "1", "higher", "mIoU", "{:.3f}"),
    ("psnr_blocks", "block PSNR", "dB", "higher", "blocks dB", "{:.2f}"),
    ("psnr", "PSNR", "dB", "higher", "PSNR dB", "{:.2f}"),
    (FLICKER, "flicker", "1", "lower", "flicker", "{:.2f}"),
    (VIEW_S, "seconds per view, CPU", "s", "lower", "s a view", "{:.3f}"),
)
COLUMNS = (
    *(Column(metric, heading, form, "mean") for _, metric, _, _, heading, form in METRICS),
    Column(CPU_SECONDS, "CPU s", "{:.1f}"),
)
PANELS = ("FLIP", "dirt", "sharpness", "ink F1", "label mIoU", "block PSNR", "flicker")
IDEAL = {"sharpness": 1.0, "flicker": 1.0}  # as the truth's


def records_of(results: Sequence[LookResult], seed: int) -> list[Record]:
    """Return the records of all groups and looks."""
    records = []
    for group in dict.fromkeys(one.case.group for one in results):
        for name in LOOKS:
            own = [one for one in results if (one.case.group, one.look) == (group, name)]
            recorder = Recorder(name, group, seed)
            for figure, metric, unit, direction, *_ in METRICS:
                figures = {one.case.name: one.figures[figure] for one in own}
                by_case = {case: value for case, value in figures.items() if value is not None}
                if by_case:
                    values = list(by_case.values())
                    records.append(recorder.samples(metric, values, unit, direction, by_case))
            spent = {one.case.name: one.cpu_seconds for one in own}
            if own:
                records.append(recorder.samples(CPU_SECONDS, [*spent.values()], "s", by_case=spent))
    return records


def panels_of(records: Sequence[Record]) -> list[Panel]:
    """Return a small chart per metric: every look's mean over all sheets, over its CPU seconds."""
    means: dict[tuple[str, str], list[Record]] = {}
    for record in records:
        means.setdefault((record.metric, record.method), []).append(record)

    def mean(metric: str, look: str) -> float:
        return float(np.mean([record.mean for record in means[metric, look]]))

    panels = []
    for metric in (m for m in PANELS if (m, DEFAULT) in means):
        first = means[metric, DEFAULT][0]
        arrow = "\N{DOWNWARDS ARROW}" if first.direction == "lower" else "\N{UPWARDS ARROW}"
        better = "dashed: the truth's" if metric in IDEAL else f"{arrow} is better"
        unit = f", {first.unit}" if first.unit != "1" else ""
        looks = [name for name in LOOKS if (metric, name) in means]
        points = {name: [(mean(CPU_SECONDS, name), mean(metric, name))] for name in looks}
        panels.append(Panel(f"{metric}{unit} ({better})", points, IDEAL.get(metric)))
    return panels
