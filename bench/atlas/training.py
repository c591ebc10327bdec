"""Trying a training: how near held-out views come, and what `toonset train` says of the run.

It refuses, or calls the run weak; or it warns of the palette that it extracts; or it says what it
did to drawings that disagreed: cameras turned, drawings moved, sized or bent back. That a repair
was needed is no alarm: whether it was enough, the verdict says.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from jaxtyping import Bool, UInt8

from bench.atlas.scenes import DrawnScene, draw_scene
from bench.stability.page import Page
from bench.stability.sheet import Step
from toonset.cli.common.host import keep_freed_memory
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.images.picture import encode_png
from toonset.errors import ToonsetError
from toonset.nerf.kernels.threads import use_threads
from toonset.nerf.options import TrainOptions
from toonset.nerf.prepare.consistency import consistency_of
from toonset.nerf.run.report import figures_of, pictures_of
from toonset.nerf.score.evaluation_picture import tile_of
from toonset.nerf.score.metrics import psnr_of
from toonset.nerf.score.verdict import WEAK, Picture, Verdict, verdict_of
from toonset.nerf.train.labelling import labelled
from toonset.nerf.train.result import Training
from toonset.nerf.train.train import fit_field
from toonset.palette.palette import Palette
from toonset.view import over_white

STEPS = TrainOptions().steps  # of the optimiser: the verdict is on what users get
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
        figure: the larger the better: dB of the held-out views, or percent of what was to be found.
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
    use_threads(1)  # figures must not depend on the machine's cores
    scene: DrawnScene | None = None
    try:
        scene = draw()
        ready, palette = labelled(scene.train)
        training = fit_field(ready, TrainOptions(steps=STEPS, seed=seed))
        views = pictures_of(training.result, scene.test)
        fitted = pictures_of(training.result, training.prepared.scene)
        verdict = verdict_of(training, fitted)
        voice, words = _said(training, verdict, palette)
        evidence = _evidence(scene.train, training, fitted) | _shares(verdict)
    except ToonsetError as error:
        views, voice, words, evidence = [], REFUSED, str(error), {}
    except Exception as error:
        views, voice, words, evidence = [], CRASHED, f"{type(error).__name__}: {error}", {}
    if scene is None:
        return Tried(seed, 0.0, voice, words), b""
    views = views or [np.zeros_like(frame.rgba) for frame in scene.test.frames]  # nothing is shown
    figures = [_psnr(scene, i, view) for i, view in enumerate(views)]
    worst = int(np.nanargmin(figures))
    picture = _side_by_side(scene.test.frames[worst], views[worst])
    seconds = time.perf_counter() - began
    return Tried(seed, float(np.nanmean(figures)), voice, words, evidence, seconds), picture


def _psnr(scene: DrawnScene, index: int, view: UInt8[np.ndarray, "height width 4"]) -> float:
    """Return a view's PSNR in dB; nan where no pixel counts."""
    drawn = scene.test.frames[index].rgba
    error = ((over_white(view) - over_white(drawn)) ** 2).mean(axis=-1)
    counted: Bool[np.ndarray, "height width"] = np.ones(error.shape, dtype=bool)
    if scene.where is not None:
        counted = scene.where[index]
    return psnr_of(float(error[counted].mean())) if counted.any() else math.nan


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


def _shares(verdict: Verdict) -> dict[str, float]:
    """Return what the verdict rests on."""
    off = verdict.off
    return {"off": off.both, "off_outlines": off.outlines, "off_pictures": off.pictures}


def _evidence(scene: Scene, training: Training, fitted: Sequence[Picture]) -> dict[str, float]:
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
