"""Fit a triplane field and a palette classifier to posed drawings.

    loss = photometric + palette_weight * cross-entropy + smoothness * total variation

Hull and samples on every ray are found before the first step, interpolation weights once it shows
which samples count. A step is two sparse products, a small decoder and sums.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import torch

from toonset.dataset.bundle.scene import Scene
from toonset.dataset.silhouettes.mask import check_cut_out
from toonset.errors import BundleError, SetupError
from toonset.nerf.fields.base import Field
from toonset.nerf.fields.classifier import PaletteClassifier
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.fields.triplane import TriplaneField
from toonset.nerf.hull.hull import Hull
from toonset.nerf.hull.mannequin_volume import hull_of_shape
from toonset.nerf.hull.march import surface_depth
from toonset.nerf.hull.scene_hull import VOXELS, VOXELS_PER_PX, as_stored, hull_of, per_px
from toonset.nerf.hull.tolerance import HullEvidence
from toonset.nerf.kernels import loss_terms as terms
from toonset.nerf.kernels.threads import SIDES
from toonset.nerf.options import STEPS_ON_SECTIONS, STEPS_ON_SHAPE, USUAL_STEPS, TrainOptions
from toonset.nerf.prepare.paint_agreement import Depths
from toonset.nerf.prepare.prepare import Prepared, agree_on_paint, prepare
from toonset.nerf.prepare.smaller import at_most
from toonset.nerf.prepare.symmetry import Symmetry, add_mirrored_views, find_symmetry
from toonset.nerf.train.batches import make_batches
from toonset.nerf.train.box_rays import (
    BINS,
    CLEARER,
    BoxRays,
    any_backdrop,
    open_box,
    without_empty_space,
)
from toonset.nerf.train.carved_rays import FixedRays, TrainingRays
from toonset.nerf.train.loop import Progress, Watch, fit
from toonset.nerf.train.loss import Model, Weights
from toonset.nerf.train.plane_choice import FieldChoice
from toonset.nerf.train.plane_search import Ground, choose_cells
from toonset.nerf.train.result import Training

CHANNELS, HIDDEN = 16, 32
CELLS_PER_PX, CELLS = 1.0, (48, 256)
FITTED_PX = float(CELLS[1])  # height of the largest figure: the planes are no finer
STEPS_ALONG = 200  # samples that the longest side of the hull would take
MOST_SAMPLES = 30  # per ray, from its first inside the hull; twice as deep, surfaces turn to mist
TRIAL_STRIDE = 2  # times the samples' distance: the order of fields is the same, in half the time
PARTS: tuple[str, ...] = ("drawings", "hull", "planes", "rays")  # before the steps, in order
NO_EVIDENCE = HullEvidence(0, ())
FieldOf = Callable[[Scene, Hull], Field]


def fit_field(
    scene: Scene,
    options: TrainOptions,
    progress: Progress | None = None,
    watch: Watch | None = None,
    *,
    agree: bool = True,
    field_of: FieldOf | None = None,
) -> Training:
    """Return the field that explains the drawings, and how it came about.

    On a CPU the same scene, options and number of threads give the same bits, unless `budget_s`
    ends the training.

    Args:
        scene: posed pictures; labels are used where the scene has them.
        options: see there.
        progress: called with a line that says what is prepared.
        watch: looks on while the field is fitted.
        agree: bend drawings that were bent further until their paint agrees (off: to compare).
        field_of: returns what is fitted, to compare with; None: planes.

    Raises:
        BundleError: fewer than two usable views, a picture that is opaque all over, or cameras that
            do not belong to the pictures.
        SetupError: a GPU was asked for and there is none.
    """
    tell = progress or (lambda _: None)
    clock = [time.perf_counter()]
    device = device_of(options.device)
    check_cut_out(scene)
    torch.default_generator.manual_seed(options.seed)
    generator = torch.Generator().manual_seed(options.seed)
    tell("comparing the drawings")
    ready = prepare(scene, options)
    usual = STEPS_ON_SHAPE if ready.shape else USUAL_STEPS
    if not ready.compared:
        usual = STEPS_ON_SECTIONS
    options = replace(options, steps=usual if options.steps is None else options.steps)
    symmetry = find_symmetry(ready.scene, options.symmetric or scene.symmetric)
    clock.append(time.perf_counter())
    tell("carving the hull" if options.carve else "placing the box")
    hull, evidence = _hull(options, ready, symmetry)
    if options.carve and agree:
        ready = agree_on_paint(ready, _depths(ready, hull), _height(hull))
    scene = at_most(add_mirrored_views(ready.fitted, symmetry), FITTED_PX)
    clock.append(time.perf_counter())
    weights, choice = _weights(options, len(scene.frames), agree=ready.agree), None
    if options.field == "auto" and options.resolution is None and field_of is None:
        tell("choosing the planes")
        choice = _choice(ready, hull, weights, options, device)
    cells = choice.cells if choice else options.resolution or finest_cells(scene)
    clock.append(time.perf_counter())
    tell("laying out the rays")
    field = field_of(scene, hull) if field_of else planes_of(hull, cells)
    start = _untrained(field, scene, hull, options)
    rays, counts = _rays(scene, start, options, generator, device)
    clock.append(time.perf_counter())
    model = Model(start.field, start.classifier).to(device)
    if watch:
        watch.begin(start)
    spent_s = clock[-1] - clock[0]
    history, stopped = fit(model, rays, weights, options, generator, watch, spent_s)
    model.to("cpu")
    seconds = dict(zip(PARTS, np.diff(clock).tolist(), strict=True))
    seconds["steps"] = history[-1].seconds if history else 0.0  # without what the watch has taken
    counts |= {"views": len(scene.frames), "parameters": sum(p.numel() for p in model.parameters())}
    said = (evidence, seconds, counts, symmetry, choice)
    return Training(_finished(start, options), options, tuple(history), stopped, ready, *said)


def _hull(
    options: TrainOptions, ready: Prepared, symmetry: Symmetry | None
) -> tuple[Hull, HullEvidence]:
    """Return the field's hull, and the evidence for how drawings carve it.

    Mirror images do not carve: they lack what one side alone has. Sections mirror what they need
    by themselves: a side's outline is the other side's.
    """
    scene = ready.scene
    if not options.carve:
        return open_box(scene), NO_EVIDENCE
    if ready.shape is None:
        plane_x = symmetry.plane_x if symmetry and symmetry.mirrored else None
        return hull_of(scene, options, ready.apart_px, plane_x)
    extent = float(np.ptp(ready.shape.vertices, axis=0).max())
    hull = hull_of_shape(ready.shape, extent / per_px(scene, VOXELS_PER_PX, VOXELS))
    return as_stored(hull), NO_EVIDENCE


def _depths(ready: Prepared, hull: Hull) -> Depths:
    """Return how deep the body is that drawings show."""
    shape = ready.shape
    if shape is None:
        return partial(surface_depth, hull)
    return lambda camera: shape.seen(camera).depth


def _height(hull: Hull) -> float:
    return float(hull.inside.any(dim=2).any(dim=0).sum()) * hull.voxel


def _choice(
    ready: Prepared, hull: Hull, weights: Weights, options: TrainOptions, device: torch.device
) -> FieldChoice:
    """Return how fine the planes are that this scene needs; the seed is set anew."""
    scene, samples = at_most(ready.fitted, FITTED_PX), MOST_SAMPLES // TRIAL_STRIDE
    step = TRIAL_STRIDE * float(hull.box.size.max()) / STEPS_ALONG
    ground = Ground(scene, hull, step, samples, weights, options, device)
    planes = partial(planes_of, hull)
    choice = choose_cells(ground, finest_cells(scene), planes, agree=ready.agree)
    torch.default_generator.manual_seed(options.seed)
    return choice


def planes_of(hull: Hull, cells: int) -> TriplaneField:
    """Return untrained planes of so many cells round a hull."""
    return TriplaneField(hull.box, cells, CHANNELS, HIDDEN)


def finest_cells(scene: Scene) -> int:
    """Return the cells along the longest side of the finest planes that a scene is given."""
    return per_px(scene, CELLS_PER_PX, CELLS)


def _rays(
    scene: Scene,
    start: TrainedField,
    options: TrainOptions,
    generator: torch.Generator,
    device: torch.device,
) -> tuple[TrainingRays, dict[str, int]]:
    """Return where the steps' batches come from, and how many rays and samples there are."""
    parts = 1 if device.type == "cuda" else SIDES  # small kernels would leave a GPU idle
    if not options.carve:
        box_rays = BoxRays(scene, start.hull, options.seed, generator, parts)
        return box_rays.to(device), {"rays": box_rays.rays, "samples": box_rays.rays * BINS}
    sampling = (start.step, start.samples)
    steps = make_batches(scene, start.hull, *sampling, generator, parts=parts)
    batches = [batch for step in steps for batch in step]
    if not batches:
        raise BundleError(f"{scene.name}: no drawn pixel meets the hull; the cameras are wrong")
    counts = {
        "rays": sum(len(batch.rgb) for batch in batches),
        "samples": sum(len(batch.ray) for batch in batches),
    }
    there = [tuple(batch.to(device) for batch in step) for step in steps]
    assert options.steps is not None
    return FixedRays(there, start.field, options.steps), counts


def _weights(options: TrainOptions, views: int, *, agree: bool) -> Weights:
    smoothness = terms.smoothness_weight(options.smoothness, views, agree=agree)
    if options.carve:
        return Weights(options.palette_weight, smoothness)
    return any_backdrop(options.palette_weight, smoothness)


def _untrained(field: Field, scene: Scene, hull: Hull, options: TrainOptions) -> TrainedField:
    if not options.carve:
        field.thin(CLEARER)
    colors = scene.palette
    classifier = None if colors is None else PaletteClassifier(len(colors))
    along, most = (STEPS_ALONG, MOST_SAMPLES) if options.carve else (BINS, 2 * BINS)
    step = float(hull.box.size.max()) / along
    k, size_px = _typical_camera(scene, hull)
    return TrainedField(field, hull, step, most, classifier, colors, k, size_px)


def _finished(trained: TrainedField, options: TrainOptions) -> TrainedField:
    """Return the field as it is rendered: without a hull, its own empty space is skipped."""
    if options.carve:
        return trained
    return replace(trained, hull=without_empty_space(trained.hull, trained.field))


def _typical_camera(scene: Scene, hull: Hull) -> tuple[float, int]:
    middle = (hull.box.low + hull.box.high) / 2
    cameras = [frame.camera for frame in scene.frames]
    # k at another depth of the same pinhole: 1 / (distance to that depth).
    ks = [c.k / (1 + c.k * float(c.project(middle[None])[1][0])) for c in cameras]
    return float(np.median(ks)), max(max(c.size_wh) for c in cameras)


def device_of(name: str) -> torch.device:
    """Return the device of "auto", "cpu" or "cuda".

    Raises:
        SetupError: a GPU is asked for and there is none.
    """
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() else "cpu"
    if name == "cuda" and not torch.cuda.is_available():
        raise SetupError("--device cuda: torch sees no GPU here; use --device cpu")
    return torch.device(name)
