"""Trying a training: how held-out views look, and what `toonset train` says of the run.

What people are shown is looked at, the drawn look or the field's colours: FLIP of the worst view,
as of a move by percent of the height (see `bench.verdict.measure`).

It refuses, or calls the run weak; or it warns of the palette that it extracts; or it says what it
did to drawings that disagreed: cameras turned, drawings moved, sized or bent back. That a repair
was needed is no alarm: whether it was enough, the verdict says.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import torch
from jaxtyping import Bool, UInt8

from bench.atlas.scenes import DrawnScene, draw_scene
from bench.stability.page import Page
from bench.stability.sheet import Step
from bench.verdict.measure import by_pixel, needed_flip
from toonset.cli.common.host import keep_freed_memory
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.images.picture import encode_png
from toonset.dataset.silhouettes.mask import figure_px
from toonset.errors import ToonsetError
from toonset.nerf.options import TrainOptions
from toonset.nerf.prepare.consistency import consistency_of
from toonset.nerf.render.layers import default_layer
from toonset.nerf.render.views import render
from toonset.nerf.run.report import figures_of, pictures_of
from toonset.nerf.score.evaluation_picture import tile_of
from toonset.nerf.score.verdict import WEAK, Verdict, verdict_of
from toonset.nerf.train.labelling import labelled
from toonset.nerf.train.result import Training
from toonset.nerf.train.train import fit_field
from toonset.nerf.training import with_drawings
from toonset.palette.palette import Palette
from toonset.view import over_white

STEPS: int | None = None  # of the optimiser: what users get
SILENT, REPAIRED, REFUSED, CRASHED = "silent", "repaired", "refused", "crashed"
WARNED = "palette warned"


@dataclass(frozen=True)
class TrainPage(Page):
    """A page about training.

    Attributes:
        draw: step and seed to a scene.
    """

    draw: Callable[[Step, int], DrawnScene]

    @property
    def reference(self) -> Step:
        """Return the step that others are compared with."""
        return self.steps[0] if self.base is None else self.base


@dataclass(frozen=True)
class Tried:
    """What became of one scene.

    Attributes:
        seed: of the body.
        figure: the larger the better: minus the worst held-out view's look in % of the
            height, or percent of what was to be found.
        voice: the loudest of what was said.
        words: what was said, most important first.
        evidence: further numbers that training writes into its report.
        seconds: of all of it.
    """

    seed: int
    figure: float
    voice: str
    words: str
    evidence: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0


def try_training(page: TrainPage, step: Step, seed: int) -> tuple[Tried, bytes]:
    """Return how a training did and a PNG of its worst held-out view, with truth and error."""
    if step == page.base:
        return _base_tried(seed)
    return _tried(lambda: page.draw(step, seed), seed)


@cache
def _base_tried(seed: int) -> tuple[Tried, bytes]:
    return _tried(lambda: draw_scene(seed), seed)


def _tried(draw: Callable[[], DrawnScene], seed: int) -> tuple[Tried, bytes]:
    began = time.perf_counter()
    keep_freed_memory()
    torch.set_num_threads(1)  # figures must not depend on the machine's cores
    scene: DrawnScene | None = None
    try:
        scene = draw()
        ready, palette = labelled(scene.train)
        training = fit_field(ready, TrainOptions(steps=STEPS, seed=seed))
        training = replace(training, result=with_drawings(training, ready))
        field, layer = training.result, default_layer(training.result)
        views = [render(field, frame.camera).picture(layer) for frame in scene.test.frames]
        fitted = pictures_of(field, training.prepared.scene)
        verdict = verdict_of(training, ready)
        voice, words = _said(training, verdict, palette)
        evidence = _evidence(scene.train, training, fitted) | {"off": verdict.off}
    except ToonsetError as error:
        views, voice, words, evidence = [], REFUSED, str(error), {}
    except Exception as error:
        views, voice, words, evidence = [], CRASHED, f"{type(error).__name__}: {error}", {}
    if scene is None:
        return Tried(seed, 0.0, voice, words), b""
    views = views or [np.zeros_like(frame.rgba) for frame in scene.test.frames]  # nothing is shown
    figures = [_look(scene, i, view) for i, view in enumerate(views)]
    worst = int(np.nanargmin(figures))
    picture = _side_by_side(scene.test.frames[worst], views[worst])
    seconds = time.perf_counter() - began
    return Tried(seed, float(np.nanmin(figures)), voice, words, evidence, seconds), picture


def _look(scene: DrawnScene, index: int, view: UInt8[np.ndarray, "height width 4"]) -> float:
    """Return minus a view's look in percent of the height; nan where no pixel counts."""
    frame, flip = scene.test.frames[index], needed_flip()
    truth = over_white(frame.rgba)
    counted: Bool[np.ndarray, "height width"] = np.ones(truth.shape[:2], dtype=bool)
    if scene.where is not None:
        counted = scene.where[index]
    per_px = float(by_pixel(flip, truth)[counted].sum())
    if not per_px:
        return math.nan
    error = float(flip(truth, over_white(view))[counted].sum())
    return -100 * error / per_px / figure_px(frame)


def _said(training: Training, verdict: Verdict, palette: Palette) -> tuple[str, str]:
    """Return what `toonset train` said: why the run is weak, of the palette, what was set right."""
    ready = training.prepared
    repairs = [
        f"{what}: outlines {step.apart_px[0]:.2f} px apart, {step.apart_px[1]:.2f} px after"
        for step, what in (
            (ready.turning, "cameras turned"),
            (ready.registration, "drawings moved and sized"),
            (ready.unbending, "drawings bent back"),
        )
        if step is not None and step.applied
    ]
    calm = REPAIRED if repairs else SILENT
    loud = WARNED if palette.warnings else calm
    words = "; ".join([*verdict.reasons, *palette.warnings, *repairs])
    return WEAK if verdict.verdict == WEAK else loud, words


def _evidence(
    scene: Scene, training: Training, fitted: Sequence[UInt8[np.ndarray, "height width 4"]]
) -> dict[str, float]:
    """Return what the report holds besides, and what `toonset consistency` finds."""
    ready, ious = training.prepared, training.evidence.left_out_iou
    fit = figures_of(fitted, ready.scene)
    found = {"fit_psnr": fit["psnr"] or 0.0, "fit_psnr_mask": fit["psnr_mask"] or 0.0}
    found |= {"left_out_iou": max(ious)} if ious else {}
    step = ready.unbending
    if step is not None:
        found["apart_px"] = step.apart_px[0]
    found["apart_after_px"] = ready.apart_px
    try:
        report = consistency_of(scene)
    except ToonsetError:  # fewer than three drawings
        return {name: float(value) for name, value in found.items()}
    found["odd_views"] = float(len(report.odd))
    found["unexplained"] = float(np.mean([view.unexplained[0] for view in report.views]))
    found["unexplained_after"] = float(np.mean([view.unexplained[1] for view in report.views]))
    return {name: float(value) for name, value in found.items()}


def _side_by_side(frame: Frame, view: UInt8[np.ndarray, "height width 4"]) -> bytes:
    """Return the truth, the rendering and their difference in a row, as PNG."""
    from matplotlib import colormaps

    truth, shown = over_white(frame.rgba), over_white(view)
    heat = colormaps["magma"](np.abs(truth - shown).max(axis=-1))[..., :3]
    tiles: Sequence[np.ndarray] = [tile_of(picture) for picture in (truth, shown, heat)]
    return encode_png(np.concatenate(tiles, axis=1))
