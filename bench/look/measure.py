"""Look against CPU seconds: figures of held-out views and of a turn, per look and sheet."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby

import numpy as np
import torch

from bench.charts.chart import DEFAULT
from bench.look.cases import LookCase
from bench.look.eyes import EyeCheck, check_eyes, eye_look
from bench.look.plan import FIELD, LOOKS, Look, Recipe, Variant
from bench.records.record import CPU_SECONDS, Direction, Record, aligned, summarise
from toonset.camera import Camera
from toonset.cli.common.host import keep_freed_memory
from toonset.dataset.bundle.scene import Scene
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.look.build import drawings_of
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.look.paint_flow import pair_flows
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.layers import Picture, Rendering
from toonset.nerf.render.views import render
from toonset.nerf.score.evaluate import label_figures
from toonset.nerf.score.metrics import Figures, means
from toonset.nerf.score.metrics_view import Judges, figures_of, load_judges
from toonset.nerf.train.labelling import labelled
from toonset.nerf.train.train import fit_field
from toonset.view import over_white

VIEWS = 16  # whose rendering counts as a cost, beside the training's
FLICKER, VIEW_S, EYES, SEEING = "flicker", "view_s", "eyes", "eye_views"


@dataclass(frozen=True, eq=False)
class LookResult:
    """What one look of one sheet is worth.

    Attributes:
        case: the character.
        group: condition.
        look: a key of `LOOKS`.
        seed: of the training.
        figures: means over the held-out views; FLICKER over the truth's, VIEW_S CPU seconds per
            view, EYES views that keep the right number of whole eyes, of SEEING that show any.
        cpu_seconds: of training, of laying the drawings over the field, of VIEWS views.
        pictures: the held-out views.
        checks: of the eyes in each; none where they are not known.
    """

    case: LookCase
    look: str
    seed: int
    figures: Figures
    cpu_seconds: float
    pictures: tuple[Picture, ...]
    checks: tuple[EyeCheck, ...]


@dataclass(frozen=True, eq=False)
class _Laid:
    """A trained field with its drawings, and CPU seconds: of the fit, the drawings, their flows."""

    trained: TrainedField
    drawings: Drawings | None
    fit_s: float
    lay_s: float
    flow_s: float


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


def _laid(scene: Scene, recipe: Recipe, seed: int) -> _Laid:
    began = time.process_time()
    ready, _ = labelled(scene)
    training = fit_field(ready, replace(recipe.options, seed=seed), agree=recipe.paint)
    fitted = time.process_time()
    baked = Baked.of(training.result)

    def depth_of(camera: Camera) -> np.ndarray:
        return render(baked, camera).depth

    drawn = [frame.rgba for frame in ready.frames]
    prepared = training.prepared
    drawings = drawings_of(prepared.scene, drawn, depth_of, prepared.shape, bent=prepared.bent)
    laid, again = time.process_time(), 0.0
    if drawings is not None:
        assert drawings.textures  # made here, not while flows are timed
        again = time.process_time()
        pair_flows(drawings, depth_of)
        again = time.process_time() - again
    return _Laid(training.result, drawings, fitted - began, laid - fitted, again)


def _results(
    case: LookCase, names: Sequence[str], laid: _Laid, seed: int, judges: Judges
) -> list[LookResult]:
    """Return the results of looks that share a training; every view is rendered once for all."""
    baked = Baked.of(laid.trained)
    shown = {name: _shower(laid, LOOKS[name]) for name in names}
    views, spent = _shown(baked, case.test, shown)
    turns = _shown(baked, case.turn, shown)[0] if case.turn else {}
    eyes = eye_look(case.eyes, case.test)
    results = []
    for name in names:
        rows = []
        for frame, (picture, labels) in zip(case.test.frames, views[name], strict=True):
            figures, _ = figures_of(picture, frame.rgba, judges)
            rows.append(figures | label_figures(laid.trained, case.test, frame, labels))
        pictures = tuple(picture for picture, _ in views[name])
        pairs = zip(case.test.frames, pictures, strict=True)
        checks = tuple(check_eyes(eyes, *pair) for pair in pairs) if eyes else ()
        seeing = [check for check in checks if check.expected]
        more: Figures = {
            FLICKER: _flicker(case.turn, [picture for picture, _ in turns.get(name, ())]),
            VIEW_S: spent[name],
            EYES: float(sum(not check.faults for check in seeing)) if eyes else None,
            SEEING: float(len(seeing)) if eyes else None,
        }
        cost = laid.fit_s + _lay_s(laid, LOOKS[name]) + VIEWS * spent[name]
        results.append(LookResult(case, name, seed, means(rows) | more, cost, pictures, checks))
    return results


_Shower = Callable[[Rendering], tuple[Picture, np.ndarray | None]]


def _shower(laid: _Laid, look: Look) -> _Shower:
    """Return what shows a rendering in a look: its picture and labels."""
    if look.layer != "drawn" or laid.drawings is None:
        layer = "rgb" if look.layer == "drawn" else look.layer
        return lambda view: (view.picture(layer), view.labels)
    return partial(_drawn, Variant(laid.drawings, look.without))


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


def _lay_s(laid: _Laid, look: Look) -> float:
    if look.layer != "drawn":
        return 0.0
    return laid.lay_s - (laid.flow_s if look.without else 0.0)


def _flicker(truth: Scene | None, turn: list[Picture]) -> float | None:
    """Return how much a turn flickers, over the truth's own."""
    if truth is None:
        return None
    own = flicker([over_white(frame.rgba) for frame in truth.frames])
    return flicker([over_white(picture) for picture in turn]) / own


def flicker(turn: Sequence[np.ndarray]) -> float:
    """Return the mean absolute second difference of consecutive pictures, three or more."""
    return float(np.abs(np.diff(np.stack(turn), n=2, axis=0)).mean())


@dataclass(frozen=True)
class Column:
    """A figure of a look: its name in `LookResult.figures`, among records and in the table."""

    name: str
    metric: str
    unit: str
    direction: Direction
    heading: str
    form: str = "{:.3f}"


COLUMNS = (
    Column("flip", "FLIP", "1", "lower", "FLIP", "{:.4f}"),
    Column("dirt", "dirt", "levels/px", "lower", "dirt", "{:.2f}"),
    Column("sharpness", "sharpness", "1", "higher", "sharp", "{:.2f}"),
    Column("ink_f1", "ink F1", "1", "higher", "lines"),
    Column("label_miou_shift", "label mIoU", "1", "higher", "mIoU"),
    Column("psnr_blocks", "block PSNR", "dB", "higher", "blocks dB", "{:.2f}"),
    Column("psnr", "PSNR", "dB", "higher", "PSNR dB", "{:.2f}"),
    Column(FLICKER, "flicker", "1", "lower", "flicker", "{:.2f}"),
    Column(VIEW_S, "seconds per view, CPU", "s", "lower", "s a view"),
)
COST = Column("", CPU_SECONDS, "s", "lower", "")
RIGHT_EYES = Column("", "views with the right eyes", "1", "higher", "")


def records_of(results: Sequence[LookResult], seed: int) -> list[Record]:
    """Return the records of all groups and looks."""
    records = []
    for (group, name), found in _grouped(results):
        columns: list[tuple[Column, Callable[[LookResult], float | None]]] = [
            *((column, partial(_figure, column.name)) for column in COLUMNS),
            (COST, lambda one: one.cpu_seconds),
            (RIGHT_EYES, _right_eyes),
        ]
        for column, value in columns:
            figures = {one.case.name: value(one) for one in found}
            by_case = {case: figure for case, figure in figures.items() if figure is not None}
            if by_case:
                records.append(
                    summarise(
                        list(by_case.values()),
                        method=name,
                        metric=column.metric,
                        unit=column.unit,
                        direction=column.direction,
                        seed=seed,
                        group=group,
                        by_case=by_case,
                    )
                )
    return records


def _figure(name: str, one: LookResult) -> float | None:
    return one.figures[name]


def _right_eyes(one: LookResult) -> float | None:
    seeing = one.figures[SEEING]
    return (one.figures[EYES] or 0.0) / seeing if seeing else None


def table_of(results: Sequence[LookResult]) -> str:
    """Return means over the cases, medians of seconds and counts of eyes, a text per group."""
    lines: list[str] = []
    for group, listed in groupby(_grouped(results), key=lambda entry: entry[0][0]):
        headings = [column.heading for column in COLUMNS]
        rows: list[tuple[str, ...]] = [("look", "n", "CPU s", *headings, "eyes")]
        for (_, name), found in listed:
            spent = f"{np.median([one.cpu_seconds for one in found]):.1f}"
            cells = [_cell(column, found) for column in COLUMNS]
            rows.append((name, str(len(found)), spent, *cells, _eyes(found)))
        lines += ["", group, *aligned(rows, words=1)]
    return "\n".join(lines[1:])


def eyes_text(results: Sequence[LookResult]) -> str:
    """Return what is wrong with the eyes of every character's default and field, a line each."""
    lines = []
    for one in results:
        seeing = [check for check in one.checks if check.expected]
        if seeing and one.look in (DEFAULT, FIELD):
            names = (frame.name for frame in one.case.test.frames)
            wrong = [
                f"{name} {'+'.join(check.faults)}"
                for name, check in zip(names, one.checks, strict=True)
                if check.faults
            ]
            kept = f"{len(seeing) - len(wrong)} of {len(seeing)}"
            words = f"; {', '.join(wrong)}" if wrong else ""
            lines.append(f"{one.case.name}, {one.case.group}, {one.look}: {kept}{words}")
    return "\n".join(["eyes", *lines]) if lines else ""


def _cell(column: Column, found: Sequence[LookResult]) -> str:
    values = [v for v in (one.figures[column.name] for one in found) if v is not None]
    return column.form.format(np.mean(values)) if values else "-"


def _eyes(found: Sequence[LookResult]) -> str:
    seeing = sum(one.figures[SEEING] or 0 for one in found)
    kept = sum(one.figures[EYES] or 0 for one in found)
    return f"{kept:.0f} of {seeing:.0f}" if seeing else "-"


def _grouped(results: Sequence[LookResult]) -> list[tuple[tuple[str, str], list[LookResult]]]:
    groups = list(dict.fromkeys(one.case.group for one in results))
    return [
        ((group, name), own)
        for group in groups
        for name in LOOKS
        if (own := [one for one in results if (one.case.group, one.look) == (group, name)])
    ]
