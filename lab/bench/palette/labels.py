"""Labels and contours, measured against drawings whose truth is known.

Right: of the pixels that are one colour, how many got it; one that was marked mixed counts as
wrong. Mixed: pixels whose bytes are no colour's own. A contour's pixel is one that ink covers by
half or more. Border: how far off the coverage of paints is where several cover a pixel, in % of it,
mean per drawing.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from lab.bench.palette.labels_cases import LabelCase, label_cases
from lab.bench.records.record import CPU_SECONDS, Column, Record, Recorder, methods_table
from toonset.palette.coverage import coverage_map
from toonset.palette.extract import paint_maps
from toonset.palette.paints.extract import pick_palette
from toonset.palette.pixels.antialias import OPAQUE
from toonset.palette.pixels.ink_lines import find_contour
from toonset.palette.pixels.labels import UNLABELLED, label_pixels, nearest_labels

Labeller = Callable[[np.ndarray, np.ndarray], np.ndarray]

LABELLERS: dict[str, Labeller] = {
    "default": lambda rgba, palette: label_pixels(rgba, palette),
    "nearest colour": lambda rgba, palette: nearest_labels(rgba, palette),
}
CONTOURS: dict[str, Callable[[LabelCase], np.ndarray]] = {
    "default": lambda case: find_contour(case.rgba, case.outline_px),
    "width unknown": lambda case: find_contour(case.rgba),
    "dark pixels": lambda case: _dark(case.rgba),
}
COVERAGES: dict[str, Callable[[LabelCase], np.ndarray]] = {
    "default": lambda case: _shares(case),
    "nearest colour": lambda case: _whole(nearest_labels(case.rgba, case.palette), case),
}
HALF = 128
REPEATS = 3
TIMED_WH = (2048, 1024)
WAYS = "recall", "precision"
COLUMNS = (
    Column("right", "right %", "{:.2f}"),
    Column("right of those labelled", "of labelled", "{:.2f}"),
    *(Column(f"mixed, {way}", f"mixed {way[:6]}", "{:.1f}") for way in WAYS),
    *(Column(f"contour {way}", f"line {way[:6]}", "{:.1f}") for way in WAYS),
    Column("border, off", "border off %", "{:.2f}"),
    Column(CPU_SECONDS, "CPU s/MP", "{:.3f}"),
    Column(f"{CPU_SECONDS}, contour", "contour s/MP", "{:.3f}"),
)

Samples = dict[tuple[str, str, str], list[float]]  # by group, method, metric


def bench_labels(
    cases: Path | None,
    seed: int,
    *,
    quick: bool = False,
    progress: Callable[[str], None] = lambda text: None,
) -> tuple[list[Record], str]:
    """Return records and their table: per condition and method, over all views.

    Args:
        cases: character folders with known colours; None for synthetic ones.
        seed: of synthetic characters and drawing errors.
        quick: two characters at 150 px.
        progress: told what is measured.
    """
    samples: Samples = defaultdict(list)
    last: LabelCase | None = None
    for case in label_cases(cases, seed, quick=quick):
        if last is None or case.group != last.group:
            progress(f"labels {case.group}")
        last = case
        for name, labeller in LABELLERS.items():
            _score_labels(samples, case, name, labeller)
        for name, coverage in COVERAGES.items():
            _score_borders(samples, case, name, coverage(case))
        if case.outline_px:
            for name, contour in CONTOURS.items():
                _score_contour(samples, case, name, contour(case))
    assert last is not None
    _time(samples, last)
    records = []
    for (group, method, metric), values in samples.items():
        unit = "s/MP" if metric.startswith(CPU_SECONDS) else "%"
        lower = metric.startswith((CPU_SECONDS, "border"))
        recorder = Recorder(method, group, seed)
        records.append(recorder.samples(metric, values, unit, "lower" if lower else "higher"))
    return records, methods_table(records, COLUMNS)


def _score_labels(samples: Samples, case: LabelCase, method: str, labeller: Labeller) -> None:
    found = labeller(case.rgba, case.palette)
    pure = case.truth != UNLABELLED
    # two entries of one colour are the same answer
    colors = np.concatenate([case.palette, np.zeros((256 - len(case.palette), 3), np.uint8)])
    right = (colors[found] == colors[case.truth]).all(axis=-1) & (found != UNLABELLED)
    samples[case.group, method, "right"].append(_percent(pure & right, pure))
    labelled = pure & (found != UNLABELLED)
    samples[case.group, method, "right of those labelled"].append(_percent(right, labelled))
    opaque = case.rgba[..., 3] >= OPAQUE
    marked, mixed = opaque & (found == UNLABELLED), opaque & ~pure
    samples[case.group, method, "mixed, recall"].append(_percent(marked & mixed, mixed))
    if marked.any():
        samples[case.group, method, "mixed, precision"].append(_percent(marked & mixed, marked))


def _score_contour(samples: Samples, case: LabelCase, method: str, found: np.ndarray) -> None:
    line, truth = found >= HALF, case.ink >= HALF
    samples[case.group, method, "contour recall"].append(_percent(line & truth, truth))
    if line.any():
        samples[case.group, method, "contour precision"].append(_percent(line & truth, line))


def _score_borders(samples: Samples, case: LabelCase, method: str, found: np.ndarray) -> None:
    covered = case.coverage.sum(axis=0)
    border = (case.rgba[..., 3] >= OPAQUE) & (case.coverage.max(axis=0) < 1) & (covered > 0)
    if border.any():
        off = np.abs(found - case.coverage)[:, border].sum(axis=0) / 2
        samples[case.group, method, "border, off"].append(100 * float(off.mean()))


def _shares(case: LabelCase) -> Float[np.ndarray, "colors cell cell"]:
    """Return how far every paint covers each pixel, as `toonset palette` writes it."""
    count = len(case.coverage)
    contour = (
        find_contour(case.rgba, case.outline_px) if case.outline_px else np.zeros_like(case.ink)
    )
    palette = pick_palette([case.rgba], case.palette, [contour >= HALF])
    (paint,) = paint_maps([case.rgba], [contour], palette)
    ranks = coverage_map(case.rgba, paint, contour, palette)
    first, second, part = ranks[..., 0], ranks[..., 1], ranks[..., 2] / 255
    colors = np.arange(count)[:, None, None]
    return (first == colors) * part + (second == colors) * (1 - part)


def _whole(labels: np.ndarray, case: LabelCase) -> Float[np.ndarray, "colors cell cell"]:
    colors = np.arange(len(case.coverage))[:, None, None]
    return (labels == colors).astype(np.float64)


def _percent(part: np.ndarray, whole: np.ndarray) -> float:
    return 100 * int((part & whole).sum()) / max(int(whole.sum()), 1)


def _dark(rgba: UInt8[np.ndarray, "height width 4"]) -> UInt8[np.ndarray, "height width"]:
    """Return as ink whatever is dark: what a threshold makes of a drawing."""
    dark = (rgba[..., :3].max(axis=-1) < HALF) & (rgba[..., 3] >= HALF)
    return np.where(dark, np.uint8(255), np.uint8(0))


def _time(samples: Samples, case: LabelCase) -> None:
    """Add processor seconds per megapixel on a sheet of the case's drawing, repeated."""
    width, height = TIMED_WH
    times = -(-height // case.rgba.shape[0]), -(-width // case.rgba.shape[1]), 1
    sheet = np.ascontiguousarray(np.tile(case.rgba, times)[:height, :width])
    group = f"{width} x {height}"
    for _ in range(REPEATS):
        for name, labeller in LABELLERS.items():
            start = time.process_time()
            labeller(sheet, case.palette)
            taken = (time.process_time() - start) / (width * height / 1e6)
            samples[group, name, CPU_SECONDS].append(taken)
        start = time.process_time()
        find_contour(sheet, max(case.outline_px, 1.0))
        taken = (time.process_time() - start) / (width * height / 1e6)
        samples[group, "default", f"{CPU_SECONDS}, contour"].append(taken)
