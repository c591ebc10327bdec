"""What whole trainings take, by the size of the drawings: seconds of every part, and memory."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from toonset.cli.common.host import keep_freed_memory
from toonset.dataset.bundle.scene import Scene
from toonset.nerf.kernels.threads import SIDES, working_threads
from toonset.nerf.options import TrainOptions
from toonset.nerf.train.train import fit_field


@dataclass(frozen=True)
class Growth:
    """A whole training.

    Attributes:
        px: size of the drawings.
        figure_px: opaque pixels of all drawings.
        counts, seconds: of the training.
        cpu: seconds, which hardly depend on what else the machine does.
        peak: most bytes in use over those before the training.
    """

    px: int
    figure_px: int
    counts: dict[str, int]
    seconds: dict[str, float]
    cpu: float
    peak: int


def growths(scenes: Mapping[int, Scene], options: TrainOptions) -> Iterator[Growth]:
    """Train on scenes of some sizes, each in a process of its own, with the threads of `train`."""
    context = multiprocessing.get_context("spawn")
    for px, scene in scenes.items():
        with context.Pool(1) as pool:
            yield pool.apply(growth, (scene, px, options))


def growth(scene: Scene, px: int, options: TrainOptions) -> Growth:
    """Train in this process, which should have done nothing else, and return what it took."""
    keep_freed_memory()
    before, began = _resident_bytes("VmRSS"), time.process_time()
    with working_threads(SIDES):
        training = fit_field(scene, options)
    cpu = time.process_time() - began
    peak = _resident_bytes("VmHWM") - before
    opaque = sum(int((frame.rgba[..., 3] > 127).sum()) for frame in scene.frames)
    voxels = {"voxels": training.result.hull.support.numel()}
    return Growth(px, opaque, training.counts | voxels, training.seconds, cpu, peak)


def _resident_bytes(which: str) -> int:
    """Return the memory in use now (VmRSS) or at most (VmHWM); Linux."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(which))


def print_growth(rows: Iterable[Growth]) -> None:
    """Print trainings as a table, each as soon as it is done."""
    print("| px | figure, px | rays | samples | voxels |", end="")
    print(" hull, s | rays, s | steps, s | whole, s | CPU, s | GB |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for row in rows:
        numbers = [row.px, row.figure_px, *(row.counts[k] for k in ("rays", "samples", "voxels"))]
        stages = [
            *(row.seconds[k] for k in ("hull", "rays", "steps")),
            sum(row.seconds.values()),
            row.cpu,
        ]
        print(f"| {' | '.join(map(str, numbers))} |", end="")
        print(f" {' | '.join(f'{s:.1f}' for s in stages)} | {row.peak / 1e9:.2f} |", flush=True)
