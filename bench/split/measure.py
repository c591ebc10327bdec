"""Splitting sheets, measured: how many come out exactly right, and whether wrong ones are told."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from bench.calib.figures import Recorder
from bench.records.record import Record, aligned
from bench.split.cases import SplitCase
from bench.split.methods import METHODS
from bench.split.picture import tile
from bench.split.score import Score, score

DEFAULT = "default"
TABLE_HEAD = (
    "group",
    "method",
    "right",
    "of",
    "mask IoU",
    "p5",
    "masks",
    "s/sheet",
    "s/MP",
    "silent",
    "false alarms",
)
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
    """What came of it.

    Attributes:
        records: per group and method.
        text: their table.
        wrong: a picture of every sheet that the default splits wrongly.
    """

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
    return SplitBench(records, _table(scores), tuple(wrong))


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
        recorder.samples("seconds", [result.seconds for result in results], "s"),
        recorder.samples(
            "seconds per megapixel", [r.seconds / r.megapixels for r in results], "s/MP"
        ),
    ]


def _table(scores: dict[tuple[str, str], list[Score]]) -> str:
    """Return a row per group and method, and of several groups together."""
    whole: dict[tuple[str, str], list[Score]] = dict(scores)
    if len({group for group, _ in scores}) > 1:
        for (_, name), results in scores.items():
            whole.setdefault(("all", name), []).extend(results)
    rows = [TABLE_HEAD, *(_row(group, name, results) for (group, name), results in whole.items())]
    return "\n".join([*aligned(rows, words=2), "", *LEGEND])


def _row(group: str, name: str, results: Sequence[Score]) -> tuple[str, ...]:
    ious = [iou for result in results for iou in result.ious]
    right = [result for result in results if not result.fault]
    silent = [result for result in results if result.fault and not result.announced]
    return (
        group,
        name,
        str(len(right)),
        str(len(results)),
        f"{np.median(ious):.3f}",
        f"{np.percentile(ious, 5):.3f}",
        f"{np.mean([iou >= GOOD_MASK for iou in ious]):.0%}",
        f"{np.median([r.seconds for r in results]):.3f}",
        f"{np.median([r.seconds / r.megapixels for r in results]):.3f}",
        str(len(silent)),
        str(sum(result.warned for result in right)),
    )
