"""One training of the bench: what it took, and all figures of its held-out views."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import UInt8

from lab.bench.cases.cases import TrainCase
from lab.bench.train.plan import Job, PaletteChoice, subset
from toonset.camera import rotation_distance
from toonset.cli.common.host import keep_freed_memory
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.errors import ToonsetError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.options import TrainOptions
from toonset.nerf.run.folder import model_of
from toonset.nerf.score.evaluate import LAYERS, ScoredView, score_views
from toonset.nerf.score.metrics import Figures, means
from toonset.nerf.score.metrics_view import Judges, figures_of
from toonset.nerf.train.fit_field import finest_cells, fit_field
from toonset.nerf.train.labelling import drop_palette, label_scene, relabel_scene

Look = Callable[[Job, TrainedField, Sequence[ScoredView]], None]
Picture = UInt8[np.ndarray, "height width 4"]


@dataclass(frozen=True)
class RunResult:
    """Result of one job.

    Attributes:
        group: condition that it is summarised under.
        method: its name.
        case: the character.
        seed: of everything random.
        figures: means over the held-out views; those of the palette's rendering begin with
            "palette_".
        seconds: of all training, after imports: palette, hull, rays, steps.
        cpu_seconds: the same, summed over the cores; a busy machine does not change it much.
        parameters: of the field and its classifier; 0: nothing is fitted.
        model_bytes: of the saved model; 0: nothing is saved.
        note: why it failed, or nothing.
    """

    group: str
    method: str
    case: str
    seed: int
    figures: Figures
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    parameters: int = 0
    model_bytes: int = 0
    note: str = ""


def run_job(job: Job, judges: Judges, look: Look = lambda *_: None) -> RunResult:
    """Return what training and rendering of one job gives; a refusal is a result, too."""
    case, options = subset(job.case, job.views), job.way.options
    result = RunResult(job.group, job.method, job.case.name, job.seed, {})
    keep_freed_memory()  # as the command does: seconds count
    torch.set_num_threads(1)  # neither figures nor CPU seconds may depend on the machine's cores
    try:
        if options is not None:
            return _trained(result, job, case, replace(options, seed=job.seed), judges, look)
        rows = [
            figures_of(_nearest(case.train, frame), frame.rgba, judges)[0]
            for frame in case.test.frames
        ]
        return replace(result, figures=means(rows))
    except ToonsetError as error:
        return replace(result, note=str(error))


def _trained(
    result: RunResult, job: Job, case: TrainCase, options: TrainOptions, judges: Judges, look: Look
) -> RunResult:
    wall, cpu = time.perf_counter(), time.process_time()
    scene = _with_palette(case.train, job.way.palette)
    if job.way.share is not None:
        options = replace(options, resolution=round(job.way.share * finest_cells(scene)))
    training = fit_field(scene, options, field_of=job.way.field)
    seconds, cpu_seconds = time.perf_counter() - wall, time.process_time() - cpu
    views = score_views(training.result, case.test, judges)
    look(job, training.result, views)
    layers = {layer: [v.figures[layer] for v in views if layer in v.figures] for layer in LAYERS}
    figures = means(layers["rgb"])
    figures |= {f"palette_{name}": value for name, value in means(layers["palette"]).items()}
    return replace(
        result,
        figures=figures,
        seconds=seconds,
        cpu_seconds=cpu_seconds,
        parameters=training.counts["parameters"],
        model_bytes=len(model_of(training.result)),
    )


def _with_palette(scene: Scene, palette: PaletteChoice) -> Scene:
    if palette == "automatic palette":
        return label_scene(scene)[0]
    if palette == "no palette" or scene.palette is None:
        return drop_palette(scene)
    return relabel_scene(scene, scene.palette)


def _nearest(scene: Scene, frame: Frame) -> Picture:
    turns = [rotation_distance(f.camera.rotation, frame.camera.rotation) for f in scene.frames]
    nearest = scene.frames[int(np.argmin(turns))].rgba
    if nearest.shape != frame.rgba.shape:  # cells of different sizes: aligned at their corner
        blank = np.zeros_like(frame.rgba)
        height, width = np.minimum(nearest.shape[:2], blank.shape[:2])
        blank[:height, :width] = nearest[:height, :width]
        return blank
    return nearest
