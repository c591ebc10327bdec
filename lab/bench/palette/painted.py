"""Painted sheets, measured: has every paint labels of its own, however it is lit?

Counted are pixels that are one paint's and nothing else's; those without a label count as one more
label. Index: the adjusted Rand index of labels and paints, 1 for the same parts, 0 for chance.
Balanced: how far every paint of at least 1.5 % shares its pixels with one label alone (intersection
over union), the mean. Found: a paint whose median colour some tone of the palette comes near.

Source: L. Hubert and P. Arabie, "Comparing partitions" (1985).
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from lab.bench.palette.cases import as_jpeg, characters
from lab.bench.records.record import CPU_SECONDS, Column, Direction, Record, Recorder
from toonset.dataset.synthetic.options import CONDITIONS
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.palette.colors import oklab_from_rgb
from toonset.palette.extract import extract_palette, paint_maps
from toonset.palette.names import RGB
from toonset.palette.palette import Palette
from toonset.palette.pixels.ink_lines import find_contours
from toonset.palette.pixels.labels import UNLABELLED, nearest_labels

GROUP = "painted, 300 px"
OPTIONS = replace(CONDITIONS["painted"], cell_px=300)
LARGE, SMALL = 0.05, 0.015  # of the character
NEAR = 0.09  # in OKLab: a tone that a person takes for the paint's
COLUMNS = (
    Column("index of labels", "index", "{:.3f}", "mean"),
    Column("balanced", "balanced", "{:.3f}", "mean"),
    Column("large paints found", "found", "{:.2f}", "mean"),
    Column("all paints found", "of all", "{:.2f}", "mean"),
)

Images = Sequence[UInt8[np.ndarray, "_ _ 4"]]
Labels = Sequence[UInt8[np.ndarray, "_ _"]]
Parted = tuple[list[RGB], Labels]  # a palette with its tones, and the labels


@dataclass(frozen=True, eq=False)
class PaintedCase:
    """A painted sheet's drawings, cut out along their true silhouettes, and their paints.

    Attributes:
        name: of the character.
        images: as the sheet's file has them.
        truths: number of every pixel's paint; 255: none, a line, or a mixture.
        shares: of the character that every paint covers.
    """

    name: str
    images: Images
    truths: Labels
    shares: Float[np.ndarray, " paints"]


@dataclass(frozen=True)
class PaintedScore:
    """How well a sheet's labels are its paints: see the module."""

    index: float
    balanced: float
    found: float
    found_of_all: float


def painted_cases(folder: Path | None, seed: int, *, quick: bool) -> Iterator[PaintedCase]:
    """Yield a painted sheet of every character: see `bench.palette.cases.characters`."""
    for mesh in characters(folder, seed, quick=quick):
        yield painted_case(make_turnaround(mesh, OPTIONS, seed))


def painted_case(made: Turnaround) -> PaintedCase:
    """Return a turnaround's drawings and what is true of them."""
    images = as_jpeg(made, made.options.artist.jpeg_quality)
    labels = np.concatenate([own[own != UNLABELLED] for own in made.labels])
    shares = np.bincount(labels, minlength=len(made.palette)) / len(labels)
    return PaintedCase(made.mesh.name, images, made.labels, shares)


def labelled(case: PaintedCase) -> tuple[Palette, Labels]:
    """Return the palette and labels of `toonset palette`."""
    palette = extract_palette(case.images)
    maps = paint_maps(case.images, find_contours(case.images), palette)
    return palette, [one.labels for one in maps]


def ours(case: PaintedCase) -> Parted:
    """Return the same with the palette's tones."""
    palette, labels = labelled(case)
    return [c for one in palette.colors for c in (one.rgb, *(t.rgb for t in one.tones))], labels


def k_means(case: PaintedCase) -> Parted:
    """Return scikit-learn's k-means with the true number of large paints."""
    tool = importlib.import_module("sklearn.cluster")  # untyped
    pixels = np.concatenate([image[image[..., 3] > 0][:, :3] for image in case.images])
    count = int((case.shares >= LARGE).sum())
    fitted = tool.KMeans(count, random_state=0).fit(oklab_from_rgb(pixels))
    means = [pixels[fitted.labels_ == number].mean(axis=0) for number in range(count)]
    palette = np.rint(means).astype(np.uint8)
    colors = [(int(red), int(green), int(blue)) for red, green, blue in palette]
    return colors, [nearest_labels(image, palette) for image in case.images]


METHODS: dict[str, Callable[[PaintedCase], Parted]] = {"default": ours, "k-means, true k": k_means}


def bench_painted(
    folder: Path | None,
    seed: int,
    *,
    quick: bool = False,
    progress: Callable[[str], None] = lambda text: None,
) -> list[Record]:
    """Return records of every method on painted sheets.

    Args:
        folder: character folders with known colours; None for synthetic ones.
        seed: of synthetic characters and of the drawings.
        quick: two characters.
        progress: told what is measured.
    """
    samples: dict[tuple[str, str], dict[str, float]] = {}
    for case in painted_cases(folder, seed, quick=quick):
        progress(f"palette {case.name}, painted")
        for name, method in METHODS.items():
            start = time.process_time()
            colors, labels = method(case)
            spent = time.process_time() - start
            one = score_painted(case, colors, labels)
            values = (one.index, one.balanced, one.found, one.found_of_all)
            metrics = [column.metric for column in COLUMNS]
            for metric, value in zip((*metrics, CPU_SECONDS), (*values, spent), strict=True):
                samples.setdefault((name, metric), {})[case.name] = float(value)
    records = []
    for (name, metric), by_case in samples.items():
        unit = "s" if metric == CPU_SECONDS else ""
        better: Direction = "lower" if metric == CPU_SECONDS else "higher"
        of = (metric, list(by_case.values()), unit, better, by_case)
        records.append(Recorder(name, GROUP, seed).samples(*of))
    return records


def score_painted(case: PaintedCase, colors: Sequence[RGB], labels: Labels) -> PaintedScore:
    """Return how well labels are a sheet's paints.

    Args:
        case: the sheet.
        colors: the palette's, tones included.
        labels: of every drawing.
    """
    known = [true != UNLABELLED for true in case.truths]
    own, true, rgb = (
        np.concatenate([one[mask] for one, mask in zip(of, known, strict=True)])
        for of in (labels, case.truths, [image[..., :3] for image in case.images])
    )
    shared = label_overlaps(true, own, len(case.shares))
    size = np.bincount(true, minlength=len(case.shares))
    counted = (case.shares >= SMALL) & (size > 0)
    palette = oklab_from_rgb(np.array(colors, dtype=np.uint8))
    paints = [np.median(rgb[true == number], axis=0) for number in np.flatnonzero(counted)]
    middles = oklab_from_rgb(np.rint(paints).astype(np.uint8))
    near = np.linalg.norm(middles[:, None] - palette, axis=-1).min(axis=1) < NEAR
    large = case.shares[counted] >= LARGE
    return PaintedScore(
        rand_index(true, own),
        float(shared[counted].mean()),
        float(near[large].mean()),
        float(near.mean()),
    )


def rand_index(true: UInt8[np.ndarray, " pixels"], own: UInt8[np.ndarray, " pixels"]) -> float:
    """Return the adjusted Rand index of pixels' paints and labels; 255 is one more label."""
    tool = importlib.import_module("sklearn.metrics")  # untyped
    return float(tool.adjusted_rand_score(true, own))


def label_overlaps(
    true: UInt8[np.ndarray, " pixels"], own: UInt8[np.ndarray, " pixels"], paints: int
) -> Float[np.ndarray, " paints"]:
    """Return every paint's intersection over union with the label that is most like it."""
    both = np.zeros((paints, 256))
    np.add.at(both, (true, own), 1)
    size = both.sum(axis=1, keepdims=True)
    both[:, UNLABELLED] = 0
    either = size + both.sum(axis=0, keepdims=True) - both
    return np.asarray((both / np.maximum(either, 1)).max(axis=1))
