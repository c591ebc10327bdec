"""Training: seconds against held-out PSNR, per setting, with the nearest drawing as baseline."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from toonset.bench.cases import TrainCase
from toonset.bench.record import Direction, Record, summarise
from toonset.camera import rotation_distance
from toonset.dataset.scene import Frame, Scene
from toonset.nerf.labelling import labelled, without_palette
from toonset.nerf.layers import color_picture
from toonset.nerf.metrics import compare
from toonset.nerf.options import TrainOptions
from toonset.nerf.trained import TrainedField
from toonset.nerf.training import train
from toonset.nerf.views import render

NEAREST = "nearest drawing"


@dataclass(frozen=True)
class Setting:
    """One point of the chart."""

    options: TrainOptions
    palette: bool = True


SETTINGS: dict[str, Setting] = {
    "75 steps": Setting(TrainOptions(steps=75)),
    "150 steps": Setting(TrainOptions(steps=150)),
    "default": Setting(TrainOptions()),
    "600 steps": Setting(TrainOptions(steps=600)),
    "no palette": Setting(TrainOptions(), palette=False),
}
QUICK = ("75 steps", "default")


@dataclass(frozen=True)
class Outcome:
    """One case's figures: means over the held-out views, seconds of training and of one view."""

    psnr: float
    psnr_mask: float
    ssim: float
    seconds: float
    render_seconds: float


def bench_training(
    cases: Iterable[TrainCase],
    seed: int,
    *,
    quick: bool,
    progress: Callable[[str], None] = lambda text: None,
) -> list[Record]:
    """Return records of held-out quality and seconds per setting and condition."""
    outcomes: dict[tuple[str, str], list[Outcome]] = {}
    for case in cases:
        for method in [NEAREST, *(QUICK if quick else SETTINGS)]:
            progress(f"{case.name}: {method}")
            key = (case.group, method)
            outcomes.setdefault(key, []).append(_run(method, case, seed))
    return [
        record
        for (group, method), found in outcomes.items()
        for record in _records(method, group, found, seed)
    ]


def _run(method: str, case: TrainCase, seed: int) -> Outcome:
    if method == NEAREST:
        return _outcome(case, lambda frame: _nearest(case.train, frame), 0.0)
    setting = SETTINGS[method]
    options = TrainOptions(steps=setting.options.steps, seed=seed)
    start = time.perf_counter()
    scene = labelled(case.train)[0] if setting.palette else without_palette(case.train)
    trained = train(scene, options).result
    seconds = time.perf_counter() - start
    return _outcome(case, lambda frame: _picture(trained, frame), seconds)


def _picture(trained: TrainedField, frame: Frame) -> UInt8[np.ndarray, "height width 4"]:
    rendering = render(trained, frame.camera)
    return color_picture(rendering.rgb, rendering.alpha)


def _nearest(scene: Scene, frame: Frame) -> UInt8[np.ndarray, "height width 4"]:
    turns = [rotation_distance(f.camera.rotation, frame.camera.rotation) for f in scene.frames]
    nearest = scene.frames[int(np.argmin(turns))].rgba
    if nearest.shape != frame.rgba.shape:  # cells of different sizes: aligned at their corner
        blank = np.zeros_like(frame.rgba)
        height, width = np.minimum(nearest.shape[:2], blank.shape[:2])
        blank[:height, :width] = nearest[:height, :width]
        return blank
    return nearest


def _outcome(case: TrainCase, picture_of: Callable[[Frame], np.ndarray], seconds: float) -> Outcome:
    start = time.perf_counter()
    pictures = [picture_of(frame) for frame in case.test.frames]
    each = (time.perf_counter() - start) / len(pictures)
    found = [compare(p, f.rgba) for p, f in zip(pictures, case.test.frames, strict=True)]

    def mean(name: str) -> float:
        return float(np.mean([v for v in (figures[name] for figures in found) if v is not None]))

    return Outcome(mean("psnr"), mean("psnr_mask"), mean("ssim"), seconds, each)


def _records(method: str, group: str, found: Sequence[Outcome], seed: int) -> list[Record]:
    rows: list[tuple[str, str, Direction, list[float]]] = [
        ("held-out PSNR", "dB", "higher", [o.psnr for o in found]),
        ("held-out PSNR in mask", "dB", "higher", [o.psnr_mask for o in found]),
        ("held-out SSIM", "1", "higher", [o.ssim for o in found]),
        ("seconds", "s", "lower", [o.seconds for o in found]),
        ("seconds per rendered view", "s", "lower", [o.render_seconds for o in found]),
    ]
    return [
        summarise(
            samples,
            method=method,
            metric=metric,
            unit=unit,
            direction=direction,
            seed=seed,
            group=group,
        )
        for metric, unit, direction, samples in rows
    ]
