"""One training of the bench: seconds, a curve of held-out PSNR while it went on, all figures."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from bench.cases.cases import TrainCase
from bench.train.mannequin_fit import fitted_mannequin
from bench.train.mannequin_views import mannequin_view, paint_mannequin
from bench.train.peers import run_peer
from bench.train.plan import Job, PaletteChoice, Preparation, subset
from toonset.camera import rotation_distance
from toonset.cli.common.host import keep_freed_memory
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.errors import BundleError, ToonsetError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.options import TrainOptions
from toonset.nerf.render.layers import color_picture
from toonset.nerf.render.views import render
from toonset.nerf.run.folder import model_of
from toonset.nerf.score.evaluate import LAYERS, ScoredView, score_views
from toonset.nerf.score.metrics import Figures, means, psnr_of
from toonset.nerf.score.metrics_view import Judges, figures_of
from toonset.nerf.train.box_rays import without_empty_space
from toonset.nerf.train.labelling import labelled, relabelled, without_palette
from toonset.nerf.train.loop import Moment
from toonset.nerf.train.loss import Model
from toonset.nerf.train.result import Training
from toonset.nerf.train.train import finest_cells, fit_field
from toonset.view import over_white

CURVE_VIEWS = 4  # held-out views that every point of the curves is the mean of
Look = Callable[[Job, TrainCase, TrainedField, Sequence[ScoredView]], None]
# Seconds of fitting before the first snapshot, and of a snapshot's over those of the one before
FIRST_LOOK_S, LOOK_FACTOR = 0.25, 2**0.5


@dataclass(frozen=True)
class Seen:
    """How near some held-out views were at a moment of a training."""

    seconds: float
    cpu_seconds: float
    psnr: float


@dataclass(frozen=True)
class RunResult:
    """What one job found.

    Attributes:
        group: condition that it is summarised under.
        method: its name.
        case: the character.
        seed: of everything random.
        figures: means over the held-out views; those of the palette's rendering begin with
            "palette_".
        seconds: of all training, after imports: palette, hull, rays, steps.
        cpu_seconds: the same, summed over the cores; a busy machine does not change it much.
        render_seconds: per view.
        parameters: of the field and its classifier.
        curve: PSNR in dB of some held-out views while the training went on, where the job asks for
            it, and at its end; empty where it failed.
        acted: the steps that found something to do.
        model_bytes: of the saved model; 0: nothing is saved.
        note: why it failed, or nothing.
    """

    group: str
    method: str
    case: str
    seed: int
    figures: Figures
    seconds: float
    cpu_seconds: float
    render_seconds: float
    parameters: int
    curve: tuple[Seen, ...]
    acted: tuple[Preparation, ...] = ()
    note: str = ""
    model_bytes: int = 0


def run_job(job: Job, judges: Judges, look: Look = lambda *_: None) -> RunResult:
    """Return what training and rendering of one job gives; a refusal is a result, too."""
    case, method = subset(job.case, job.views), job.way
    keep_freed_memory()  # as the command does: seconds count
    torch.set_num_threads(1)  # neither figures nor CPU seconds may depend on the machine's cores
    try:
        if job.peer is not None:
            done = run_peer(job.peer, case.train, case.test)
            return _untrained(job, case, judges, done.pictures, (done.seconds, done.cpu_seconds, 0))
        if method.mannequin:
            return _colored_mannequin(job, case, judges)
        if method.options is None:
            return _nearest_drawing(job, case, judges)
        return _trained(job, case, replace(method.options, seed=job.seed), judges, look)
    except ToonsetError as error:
        return RunResult(*_named(job), {}, 0.0, 0.0, 0.0, 0, (), note=str(error))


def _trained(
    job: Job, case: TrainCase, options: TrainOptions, judges: Judges, look: Look
) -> RunResult:
    first_look_s = FIRST_LOOK_S if job.curve else np.inf
    watch = Snapshots(
        time.perf_counter(), time.process_time(), first_look_s=first_look_s, carved=options.carve
    )
    scene = _with_palette(case.train, job.way.palette)
    share = job.way.share
    if share is not None:
        options = replace(options, resolution=round(share * finest_cells(scene)))
    training = fit_field(scene, options, watch=watch, field_of=job.way.field)
    seconds, cpu_seconds = watch.spent()
    sample = curve_frames(case.test)
    curve = [Seen(*spent, _psnr(trained, sample)) for spent, trained in watch.states()]
    began = time.perf_counter()
    curve.append(Seen(seconds, cpu_seconds, _psnr(training.result, sample)))
    render_seconds = (time.perf_counter() - began) / len(sample)
    views = score_views(training.result, case.test, judges)
    look(job, case, training.result, views)
    layers = {layer: [v.figures[layer] for v in views if layer in v.figures] for layer in LAYERS}
    figures = means(layers["rgb"])
    figures |= {f"palette_{name}": value for name, value in means(layers["palette"]).items()}
    return RunResult(
        *_named(job),
        figures,
        seconds,
        cpu_seconds,
        render_seconds,
        training.counts["parameters"],
        tuple(curve),
        acted_in(training),
        model_bytes=len(model_of(training.result)),
    )


def acted_in(training: Training) -> tuple[Preparation, ...]:
    """Return the steps that found something to do: without the others, it is the same training."""
    ready, symmetry = training.prepared, training.symmetry
    found: list[Preparation] = []
    if any(step and step.applied for step in (ready.turning, ready.registration, ready.unbending)):
        found.append("alignment")
    if symmetry and symmetry.mirrored:
        found.append("symmetry")
    return tuple(found)


def _with_palette(scene: Scene, palette: PaletteChoice) -> Scene:
    if palette == "automatic palette":
        return labelled(scene)[0]
    if palette == "no palette" or scene.palette is None:
        return without_palette(scene)
    return relabelled(scene, scene.palette)


@dataclass
class Snapshots:
    """Watches a training and keeps its parameters after 1, 1.4, 2, ... times the first look.

    Attributes:
        began: when the training's seconds began to count, as `time.perf_counter` says.
        cpu_began: and the processor's, as `time.process_time` says.
        first_look_s: of fitting before the first snapshot; infinite: none are kept.
        carved: the field fills a hull, not a whole box.
        kept: seconds, processor's seconds and parameters of each snapshot.
    """

    began: float
    cpu_began: float
    first_look_s: float = FIRST_LOOK_S
    carved: bool = True
    kept: list[tuple[tuple[float, float], dict[str, Tensor]]] = field(default_factory=list)

    def spent(self) -> tuple[float, float]:
        """Return the seconds and processor's seconds until now, without those of looking."""
        return time.perf_counter() - self.began, time.process_time() - self.cpu_began

    def begin(self, trained: TrainedField) -> None:
        """Take the field that will be fitted, from its beginning."""
        self._trained = trained
        self._fits_from, self._next = self.spent()[0], self.first_look_s

    def look(self, moment: Moment) -> str:
        """Keep a snapshot when its time has come."""
        before = self.spent()
        fitted_s = before[0] - self._fits_from
        if fitted_s >= self._next:
            self.kept.append((before, _copied(dict(self._model().named_parameters()))))
            while self._next <= fitted_s:
                self._next *= LOOK_FACTOR
            after = self.spent()  # what looking took is not the training's
            self.began += after[0] - before[0]
            self.cpu_began += after[1] - before[1]
        return ""

    def _model(self) -> Model:
        return Model(self._trained.field, self._trained.classifier)

    def states(self) -> Iterator[tuple[tuple[float, float], TrainedField]]:
        """Yield each snapshot's seconds and itself as a field that can be rendered."""
        for spent, parameters in self.kept:
            model = copy.deepcopy(self._model()).to("cpu")
            model.load_state_dict(parameters, strict=False)
            hull = self._trained.hull
            hull = hull if self.carved else without_empty_space(hull, model.field)
            fitted = replace(self._trained, field=model.field, classifier=model.classifier)
            yield spent, replace(fitted, hull=hull)


def curve_frames(test: Scene) -> tuple[Frame, ...]:
    """Return some held-out views, evenly taken from all."""
    count = min(CURVE_VIEWS, len(test.frames))
    return tuple(test.frames[round(i * len(test.frames) / count)] for i in range(count))


def reached(curve: Sequence[Seen], psnr: float) -> Seen | None:
    """Return when a curve comes to a PSNR for good, straight lines between; None: it does not."""
    if curve[-1].psnr < psnr:
        return None
    for before, after in reversed(list(pairwise(curve))):
        if before.psnr < psnr:
            share = (psnr - before.psnr) / (after.psnr - before.psnr)
            wall = before.seconds + share * (after.seconds - before.seconds)
            cpu = before.cpu_seconds + share * (after.cpu_seconds - before.cpu_seconds)
            return Seen(wall, cpu, psnr)
    return curve[0]


def _named(job: Job) -> tuple[str, str, str, int]:
    return job.group, job.method, job.case.name, job.seed


def _nearest_drawing(job: Job, case: TrainCase, judges: Judges) -> RunResult:
    views = [_nearest(case.train, frame) for frame in case.test.frames]
    return _untrained(job, case, judges, views)


def _colored_mannequin(job: Job, case: TrainCase, judges: Judges) -> RunResult:
    mesh = case.mannequin
    if mesh is None:
        raise BundleError(f"{case.name}: has no mannequin")
    paint_mannequin(mesh, case.train)  # loads what draws, which is not timed, as imports are not
    wall, cpu = time.perf_counter(), time.process_time()
    painted = paint_mannequin(fitted_mannequin(mesh, case.train), case.train)
    seconds, cpu_seconds = time.perf_counter() - wall, time.process_time() - cpu
    began = time.perf_counter()
    views = [mannequin_view(painted, frame.camera) for frame in case.test.frames]
    render_seconds = (time.perf_counter() - began) / len(views)
    return _untrained(job, case, judges, views, (seconds, cpu_seconds, render_seconds))


def _untrained(
    job: Job,
    case: TrainCase,
    judges: Judges,
    views: Sequence[UInt8[np.ndarray, "height width 4"]],
    spent: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> RunResult:
    """Return the result of pictures of all held-out views, and what was spent on them."""
    pairs = list(zip(views, case.test.frames, strict=True))
    figures = means([_figures(view, frame.rgba, judges) for view, frame in pairs])
    sample = curve_frames(case.test)
    psnr = _mean_psnr((view, frame) for view, frame in pairs if frame in sample)
    return RunResult(*_named(job), figures, *spent, 0, (Seen(*spent[:2], psnr),))


def _figures(
    view: UInt8[np.ndarray, "height width 4"],
    drawn: UInt8[np.ndarray, "height width 4"],
    judges: Judges,
) -> Figures:
    """Return the figures of a picture; one that is opaque all over has no outline to compare."""
    figures, _ = figures_of(view, drawn, judges)
    return figures | {"silhouette_iou": None} if (view[..., 3] == 255).all() else figures


def _nearest(scene: Scene, frame: Frame) -> UInt8[np.ndarray, "height width 4"]:
    turns = [rotation_distance(f.camera.rotation, frame.camera.rotation) for f in scene.frames]
    nearest = scene.frames[int(np.argmin(turns))].rgba
    if nearest.shape != frame.rgba.shape:  # cells of different sizes: aligned at their corner
        blank = np.zeros_like(frame.rgba)
        height, width = np.minimum(nearest.shape[:2], blank.shape[:2])
        blank[:height, :width] = nearest[:height, :width]
        return blank
    return nearest


def _psnr(trained: TrainedField, frames: Sequence[Frame]) -> float:
    views = ((render(trained, frame.camera), frame) for frame in frames)
    return _mean_psnr((color_picture(view.rgb, view.alpha), frame) for view, frame in views)


def _mean_psnr(pairs: Iterator[tuple[np.ndarray, Frame]]) -> float:
    errors = [((over_white(p) - over_white(f.rgba)) ** 2).mean() for p, f in pairs]
    return float(np.mean([psnr_of(float(error)) for error in errors]))


def _copied(parameters: dict[str, Tensor]) -> dict[str, Tensor]:
    return {name: values.detach().clone() for name, values in parameters.items()}
