"""What a training costs, beside what its arithmetic and its traffic with memory cost at least.

    python -m bench.train.floor [PX ...]      sizes of the drawings, default 150 300 600

prints two tables: a step's parts at the first size, after samples behind surfaces are dropped; and
whole trainings at all sizes, each in a process of its own, with their peak of memory. A part's
floor is the longer of its operations at the speed of a large matrix product and of its bytes at the
speed of a copy as large as the planes, both measured in the same run, in one thread; whole
trainings take two, as `toonset train` does.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import torch
from torch import Tensor

from bench.cases.cases import train_cases
from bench.train.growth import growths, print_growth
from toonset.cli.common.host import keep_freed_memory
from toonset.dataset.bundle.scene import Scene
from toonset.nerf.fields.classifier import HIDDEN as CLASSIFIER_WIDTH
from toonset.nerf.fields.classifier import PaletteClassifier
from toonset.nerf.fields.triplane import TriplaneField
from toonset.nerf.hull.scene_hull import hull_of, per_px
from toonset.nerf.kernels.adam import Adam, Group
from toonset.nerf.kernels.compositing import composite_packed
from toonset.nerf.kernels.decoder import two_layers
from toonset.nerf.kernels.interpolation import Operator
from toonset.nerf.options import TrainOptions
from toonset.nerf.train.batches import Batch, make_batches
from toonset.nerf.train.carved_rays import PRUNE_AFTER, FixedRays
from toonset.nerf.train.labelling import labelled
from toonset.nerf.train.loop import BETAS, TABLES_RATE
from toonset.nerf.train.loss import CLASSIFIED, Model, Weights, loss_terms
from toonset.nerf.train.train import (
    CELLS,
    CELLS_PER_PX,
    CHANNELS,
    HIDDEN,
    MOST_SAMPLES,
    STEPS_ALONG,
)

SIZES = (150, 300, 600)
TRIALS = 50  # the fastest counts: other programs only ever slow a part down
FLOAT = 4  # bytes; of row numbers, too
TAPS = 12
GEMM = 512


@dataclass(frozen=True)
class Part:
    """A part of a step: what it has to do, and how long it took.

    Attributes:
        name: what it is.
        operations: multiplications and additions.
        bytes: read and written if every array is touched once.
        seconds: measured.
    """

    name: str
    operations: float
    bytes: float
    seconds: float


def scene_of(px: int) -> Scene:
    """Return the labelled drawings of a synthetic body, eight views."""
    (case,) = train_cases(None, 0, 1, px=px)
    return labelled(case.train)[0]


def step_parts(scene: Scene, options: TrainOptions) -> list[Part]:
    """Return the parts of a step after pruning, the whole step last."""
    torch.manual_seed(options.seed)
    hull, _ = hull_of(scene, options)
    assert scene.palette is not None
    field = TriplaneField(hull.box, per_px(scene, CELLS_PER_PX, CELLS), CHANNELS, HIDDEN)
    model = Model(field, PaletteClassifier(len(scene.palette)))
    assert model.classifier is not None
    along = float(hull.box.size.max()) / STEPS_ALONG
    generator = torch.Generator().manual_seed(options.seed)
    rays = FixedRays(make_batches(scene, hull, along, MOST_SAMPLES, generator), field)
    weights = Weights(options.palette_weight, options.smoothness)
    others = [*field.hidden.parameters(), *field.out.parameters(), *model.classifier.parameters()]
    groups = [Group([field.planes], TABLES_RATE), Group(others, field.decoder_rate)]
    adam = Adam(groups, BETAS)

    def step(batch: Batch) -> None:
        torch.stack(loss_terms(model, batch, weights)).sum().backward()
        adam.step()

    for number in range(PRUNE_AFTER):
        step(*rays.batches(number % len(rays), number))
        rays.after(number, model)
    (batch,) = rays.batches(0, PRUNE_AFTER)
    whole = _fastest(lambda: step(batch))
    parts = [*_parts_of(model, batch), _adam(model, lambda: adam.step())]
    return [*parts, Part("whole step", _total(parts, "operations"), _total(parts, "bytes"), whole)]


def _parts_of(model: Model, batch: Batch) -> list[Part]:
    field, operator, classifier = model.field, batch.constants, model.classifier
    assert classifier is not None
    assert isinstance(field, TriplaneField)
    assert isinstance(operator, Operator)
    n, rays, table = len(batch.ray), batch.rays, field.planes.numel()
    pixels = len(batch.rgb) // CLASSIFIED
    features = operator(field.planes).detach().requires_grad_()
    depth, rgb = (part.detach().requires_grad_() for part in field.decode(features))
    depth = (depth.detach() * batch.length).requires_grad_()
    decoder = CHANNELS * HIDDEN + HIDDEN * 4
    labels = 3 * CLASSIFIER_WIDTH + CLASSIFIER_WIDTH * len(classifier.out.bias)
    seen = torch.rand(pixels, 3, requires_grad=True)
    jobs: list[tuple[str, Callable[[], Tensor], list[Tensor], float, float]] = [
        (
            "interpolation",
            lambda: operator(field.planes),
            [field.planes],
            2 * n * TAPS * CHANNELS,
            FLOAT * (n * (2 * TAPS + CHANNELS) + table),
        ),
        (
            "decoder",
            lambda: two_layers(features, field.hidden, field.out),
            [features, *field.hidden.parameters(), *field.out.parameters()],
            2 * n * decoder,
            FLOAT * n * (CHANNELS + HIDDEN + 4),
        ),
        (
            "compositing",
            lambda: composite_packed(depth, rgb, batch.ray, rays)[0],
            [depth, rgb],
            20 * n,
            FLOAT * n * (2 * 4 + 2),
        ),
        (
            "classifier",
            lambda: classifier(seen),
            [seen, *classifier.parameters()],
            2 * pixels * labels,
            FLOAT * pixels * (3 + CLASSIFIER_WIDTH),
        ),
        ("total variation", field.roughness, [field.planes], 6 * table, FLOAT * 2 * table),
    ]
    parts = []
    for name, forward, inputs, operations, size in jobs:
        back = partial(_gradient, forward(), inputs)
        parts += [
            Part(name, operations, size, _fastest(forward)),
            Part(f"{name}, gradient", 2 * operations, 2 * size, _fastest(back)),
        ]
    return parts


def _gradient(result: Tensor, inputs: Sequence[Tensor]) -> tuple[Tensor, ...]:
    return torch.autograd.grad(result, inputs, torch.ones_like(result), retain_graph=True)


def _adam(model: Model, step: Callable[[], None]) -> Part:
    size = sum(p.numel() for p in model.parameters())
    gradients = [torch.randn_like(p) for p in model.parameters()]

    def work() -> None:
        for parameter, gradient in zip(model.parameters(), gradients, strict=True):
            parameter.grad = gradient
        step()

    return Part("Adam", 12 * size, FLOAT * 7 * size, _fastest(work))


def _fastest(work: Callable[[], object]) -> float:
    times = []
    for _ in range(TRIALS):
        began = time.process_time()  # of one thread: waiting for others does not count
        work()
        times.append(time.process_time() - began)
    return min(times)


def _total(parts: list[Part], what: str) -> float:
    return sum(getattr(part, what) for part in parts)


def speeds(table: int) -> tuple[float, float]:
    """Return operations and bytes per second: of a matrix product, of copying `table` floats."""
    square, values = torch.rand(GEMM, GEMM), torch.rand(table)
    into = torch.empty_like(values)
    product, copy = _fastest(lambda: square @ square), _fastest(lambda: into.copy_(values))
    return 2 * GEMM**3 / product, 2 * FLOAT * table / copy


def _print_parts(parts: list[Part], rates: tuple[float, float]) -> None:
    by_second, bytes_by_second = rates
    print(f"{by_second / 1e9:.0f} GFLOP/s, {bytes_by_second / 1e9:.1f} GB/s\n")
    print("| part | MFLOP | MB | floor, ms | CPU, ms | times the floor |")
    print("|---|---|---|---|---|---|")
    for part in parts:
        floor = max(part.operations / by_second, part.bytes / bytes_by_second)
        numbers = (part.operations / 1e6, part.bytes / 1e6, 1e3 * floor, 1e3 * part.seconds)
        text = " | ".join(f"{number:.2f}" for number in numbers)
        print(f"| {part.name} | {text} | {part.seconds / floor:.1f} |")


def main(sizes: tuple[int, ...]) -> None:
    """Measure and print both tables."""
    torch.set_num_threads(1)
    keep_freed_memory()
    scenes = {px: scene_of(px) for px in sizes}
    options = replace(TrainOptions(), device="cpu")
    parts = step_parts(scenes[sizes[0]], options)
    _print_parts(parts, speeds(int(parts[-2].bytes / FLOAT / 7)))
    print()
    print_growth(growths(scenes, options))


if __name__ == "__main__":
    main(tuple(int(word) for word in sys.argv[1:]) or SIZES)
