"""Fitting a triplane field and a palette classifier to posed drawings.

    loss = photometric + palette_weight * cross-entropy + smoothness * total variation

Everything that does not change is computed before the first step: the hull, the samples on every
ray and their interpolation weights. A step is two sparse products, a small decoder and sums.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import torch

from toonset.dataset.scene import Frame, Scene
from toonset.errors import BundleError, SetupError
from toonset.nerf import losses
from toonset.nerf.batches import make_batches
from toonset.nerf.classifier import PaletteClassifier
from toonset.nerf.evidence import HullEvidence, choose_missing
from toonset.nerf.field import TriplaneField
from toonset.nerf.fitting import Model, Progress, Weights, fit
from toonset.nerf.hull import Hull, carve
from toonset.nerf.options import TrainOptions
from toonset.nerf.rounding import rounded
from toonset.nerf.trained import TrainedField, Training

OPAQUE = 128  # alpha from which a pixel belongs to the figure
CHANNELS, HIDDEN = 16, 32
CELLS_PER_PX, CELLS = 0.75, (48, 160)
VOXELS_PER_PX, VOXELS = 1.25, (64, 208)
STEPS_ALONG = 160  # samples that the longest side of the hull would take
MOST_SAMPLES = 24  # per ray, from its first inside the hull


def train(scene: Scene, options: TrainOptions, progress: Progress | None = None) -> Training:
    """Return the field that explains the drawings, and how it came about.

    On a CPU the same scene, options and number of threads give the same bits, unless `budget_s`
    ends the training.

    Args:
        scene: posed pictures; labels are used where the scene has them.
        options: see there.
        progress: called with a line that says where the work stands.

    Raises:
        BundleError: fewer than two usable views, or cameras that do not belong to the pictures.
        SetupError: a GPU was asked for and there is none.
    """
    tell = progress or (lambda _: None)
    clock = [time.perf_counter()]
    device = device_of(options.device)
    torch.manual_seed(options.seed)
    generator = torch.Generator().manual_seed(options.seed)
    tell("carving the hull")
    hull, evidence = hull_of(scene, options)
    clock.append(time.perf_counter())
    tell("laying out the rays")
    start = _untrained(scene, hull, options)
    batches = make_batches(scene, hull, start.field, start.step, start.samples, generator)
    if not batches:
        raise BundleError(f"{scene.name}: no drawn pixel meets the hull; the cameras are wrong")
    clock.append(time.perf_counter())
    smoothness = losses.smoothness_weight(options.smoothness, len(scene.frames))
    weights = Weights(options.palette_weight, smoothness, start.step, start.samples)
    model = Model(start.field, start.classifier).to(device)
    moved = [batch.to(device) for batch in batches]
    history, stopped = fit(model, moved, weights, options, generator, tell)
    model.to("cpu")
    clock.append(time.perf_counter())
    hull_s, rays_s, steps_s = np.diff(clock).tolist()
    seconds = {"hull": hull_s, "rays": rays_s, "steps": steps_s}
    counts = {
        "views": len(scene.frames),
        "rays": sum(len(batch.rgb) for batch in batches),
        "samples": sum(len(batch.slots) for batch in batches),
        "parameters": sum(p.numel() for p in model.parameters()),
    }
    return Training(start, options, tuple(history), stopped, evidence, seconds, counts)


def hull_of(scene: Scene, options: TrainOptions) -> tuple[Hull, HullEvidence]:
    """Return the rounded hull of a scene's masks and the evidence for its tolerance.

    Raises:
        BundleError: fewer than two views show a figure, or the views share no volume.
    """
    frames = [frame for frame in scene.frames if _figure_px(frame)]
    if len(frames) < 2:
        raise BundleError(
            f"{scene.name}: {len(frames)} picture(s) with an opaque figure; at least two views "
            "with transparent background are needed"
        )
    cameras = [frame.camera for frame in frames]
    alphas = [torch.as_tensor(frame.rgba[..., 3] / np.float32(255)) for frame in frames]
    missing = options.missing_views
    evidence = HullEvidence(missing, ()) if missing is not None else choose_missing(cameras, alphas)
    voxels = _per_px(scene, VOXELS_PER_PX, VOXELS)
    hull = rounded(carve(cameras, alphas, voxels, evidence.missing), cameras, alphas)
    # Run folders hold bytes: train on exactly what will be loaded.
    return replace(hull, support=(hull.support * 255).round() / 255), evidence


def _untrained(scene: Scene, hull: Hull, options: TrainOptions) -> TrainedField:
    cells = options.resolution or _per_px(scene, CELLS_PER_PX, CELLS)
    field = TriplaneField(hull.box, cells, CHANNELS, HIDDEN)
    colors = scene.palette
    classifier = None if colors is None else PaletteClassifier(len(colors))
    step = float(hull.box.size.max()) / STEPS_ALONG
    k, size_px = _typical_camera(scene, hull)
    return TrainedField(field, hull, step, MOST_SAMPLES, classifier, colors, k, size_px)


def _per_px(scene: Scene, factor: float, limits: tuple[int, int]) -> int:
    """Return `factor` times the size of the largest figure in pixels, within limits."""
    size = max(_figure_px(frame) for frame in scene.frames)
    return int(np.clip(round(factor * size), *limits))


def _figure_px(frame: Frame) -> int:
    """Return the longer side of a figure's box, 0 where there is none."""
    mask = frame.rgba[..., 3] >= OPAQUE
    sides = [np.flatnonzero(mask.any(axis=axis)) for axis in (0, 1)]
    return max((int(side[-1] - side[0] + 1) if len(side) else 0) for side in sides)


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
