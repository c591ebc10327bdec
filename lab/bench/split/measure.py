"""Splitting sheets, measured: how many come out exactly right, and whether wrong ones are told."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw, ImageFont

from lab.bench.records.record import DEFAULT, Column, Record, Recorder, methods_table
from lab.bench.split.cases import SplitCase
from lab.bench.split.methods import METHODS, Found
from lab.bench.split.score import Score, score
from toonset.view import Box, over_white

COLUMNS = (
    Column("exactly right", "right %", "{:.0f}", scale=100),
    Column("wrong in silence", "silent", "{:.0f}"),
    Column("right but warned", "false alarms %", "{:.0f}", scale=100),
    Column("mask IoU", "mask IoU", "{:.3f}"),
    Column("mask IoU", "p5", "{:.3f}", "p95"),
    Column("mask IoU at least 0.95", "masks %", "{:.0f}", scale=100),
    Column("seconds", "s/sheet", "{:.3f}"),
    Column("seconds per megapixel", "s/MP", "{:.3f}"),
)
TILE_WH = (620, 340)
TITLE_PX = 20
ACROSS = 3
TRUE, FOUND, LEFT_OUT = (0, 170, 0), (230, 30, 30), (40, 90, 230)
GREY = (70, 70, 84)

Rgb = UInt8[np.ndarray, "height width 3"]
GOOD_MASK = 0.95  # IoU: a mask without a missing shirt
LEGEND = (
    "right: all figures found, in order, every box within 2 px or IoU >= 0.97",
    "masks: share of figures whose mask has IoU >= 0.95",
    "wrong.png: true boxes green, found ones red, what was left out blue",
    "silent: wrong, without a warning, and what was missed is not shown as left out",
    "false alarms: right, but with a warning; seconds are of processor time",
)


@dataclass(frozen=True, eq=False)
class SplitBench:
    """Records per group and method, their table, and a picture of every wrongly split sheet."""

    records: list[Record]
    text: str
    wrong: tuple[UInt8[np.ndarray, "height width 3"], ...]


def bench_split(
    cases: Iterable[SplitCase], seed: int, progress: Callable[[str], None] = lambda text: None
) -> SplitBench:
    """Return how well every method splits the cases.

    Args:
        cases: sheets with their truth; each is split once and forgotten.
        seed: of synthetic cases; written into the records.
        progress: told which sheet is split.
    """
    scores: dict[tuple[str, str], list[Score]] = {}
    wrong = []
    for case in cases:
        progress(f"split {case.name}")
        for name, method in METHODS.items():
            found = method(case.rgba)
            result = score(case, found)
            scores.setdefault((case.group, name), []).append(result)
            if result.fault and name == DEFAULT:
                told = "announced" if result.announced else "SILENT"
                wrong.append(tile(case, found, f"{case.name} - {result.fault}, {told}"))
    records = [
        record
        for (group, name), results in scores.items()
        for record in _records(results, Recorder(name, group, seed))
    ]
    everything: dict[str, list[Score]] = {}
    for (_, name), results in scores.items():
        everything.setdefault(name, []).extend(results)
    more = [r for n, own in everything.items() for r in _records(own, Recorder(n, "all", seed))]
    both = [*records, *more] if len({group for group, _ in scores}) > 1 else records
    text = "\n".join([methods_table(both, COLUMNS), "", *LEGEND])
    return SplitBench(both, text, tuple(wrong))


def _records(results: Sequence[Score], recorder: Recorder) -> list[Record]:
    ious = [iou for result in results for iou in result.ious]
    wrong = [result for result in results if result.fault]
    right = [result for result in results if not result.fault]
    return [
        *recorder.share("exactly right", [not result.fault for result in results]),
        recorder.samples("mask IoU", ious, "1", "higher"),
        *recorder.share("mask IoU at least 0.95", [iou >= GOOD_MASK for iou in ious]),
        *recorder.share("wrong and announced", [result.announced for result in wrong]),
        *recorder.share("right but warned", [result.warned for result in right], "lower"),
        recorder.total("wrong in silence", [not r.announced for r in wrong] or [False], "sheets"),
        recorder.samples("seconds", [result.seconds for result in results], "s"),
        recorder.samples(
            "seconds per megapixel", [r.seconds / r.megapixels for r in results], "s/MP"
        ),
    ]


def tile(case: SplitCase, found: Found, title: str) -> Rgb:
    """Return a small picture of a sheet with boxes and a title, as high as it must be."""
    height, width = case.rgba.shape[:2]
    factor = min(TILE_WH[0] / width, (TILE_WH[1] - TITLE_PX) / height, 1.0)
    size = max(round(width * factor), 1), max(round(height * factor), 1)
    small = cv2.resize(
        (255 * over_white(case.rgba)).astype(np.uint8), size, interpolation=cv2.INTER_AREA
    )
    whole = Image.new("RGB", (TILE_WH[0], size[1] + TITLE_PX + 4), GREY)
    whole.paste(Image.fromarray(small), (0, TITLE_PX))
    pen = ImageDraw.Draw(whole)
    pen.text((3, 3), title, "white", font=ImageFont.load_default(12))
    for box in found.left_out:
        _box(pen, box, factor, LEFT_OUT, 0)
    for figure in case.figures:
        _box(pen, figure.box, factor, TRUE, 2)
    for number, figure in enumerate(found.figures):
        corner = _box(pen, figure.box, factor, FOUND, 0)
        pen.text(corner, str(number), FOUND, font=ImageFont.load_default(16))
    return np.asarray(whole)


def contact_sheet(tiles: Sequence[Rgb]) -> Rgb:
    """Return the tiles in rows; at least one is needed."""
    rows = []
    for start in range(0, len(tiles), ACROSS):
        row = tiles[start : start + ACROSS]
        strip = np.full((max(len(t) for t in row), ACROSS * TILE_WH[0], 3), GREY, np.uint8)
        for i, picture in enumerate(row):
            strip[: len(picture), i * TILE_WH[0] : (i + 1) * TILE_WH[0]] = picture
        rows.append(strip)
    return np.concatenate(rows)


def _box(
    pen: ImageDraw.ImageDraw, box: Box, factor: float, rgb: tuple[int, int, int], out: int
) -> tuple[float, float]:
    """Draw a box in the reduced sheet, `out` pixels outside of it; return its corner."""
    x, y = box[0] * factor - out, box[1] * factor + TITLE_PX - out
    right, bottom = x + box[2] * factor + 2 * out, y + box[3] * factor + 2 * out
    pen.rectangle((x, y, right, bottom), outline=rgb, width=2 if out else 1)
    return x + 3, y + 1
