"""Palettes, measured: which true colours are found, which are invented, and how long it takes.

A colour is found if it lies within 0.02 in OKLab of a true one; two found colours cannot claim the
same. Missing is a true colour of 5 % or more that nobody claims; spurious is a found colour that
claims none. A true colour of less than 5 % may be found or not. Painted sheets, whose paints have
no one colour, and cel sheets, whose paints have several, have figures of their own: see
`bench.palette.painted` and `bench.palette.cel`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from lab.bench.palette.cases import PaletteCase, palette_cases
from lab.bench.palette.cel import COLUMNS as CEL
from lab.bench.palette.cel import bench_cel
from lab.bench.palette.methods import LEAST_SHARE, METHODS, RGB
from lab.bench.palette.painted import COLUMNS as PAINTED
from lab.bench.palette.painted import bench_painted
from lab.bench.records.record import CPU_SECONDS, Column, Record, Recorder, methods_table
from toonset.palette.colors import JUST_NOTICEABLE, oklab_from_rgb

SHEETS_WH = ((150, 150), (1200, 600), (4096, 2048))
TIMED_CONDITION = "lines, png"
REPEATS = 3  # the least counts; once for what takes over a second
SLOW_S = 1.0
COLUMNS = (
    Column("F1 of colours", "F1", "{:.3f}", "mean"),
    Column("F1 of all", "F1", "{:.3f}"),
    Column("missing, in all", "missed", "{:.0f}"),
    Column("spurious, in all", "false", "{:.0f}"),
    Column("missing colours", "missed", "{:.1f}"),
    Column("spurious colours", "false", "{:.1f}"),
    Column("colour error", "error", "{:.4f}"),
    Column("colour error", "p95", "{:.4f}", "p95"),
    Column(CPU_SECONDS, "CPU s", "{:.3f}"),
)


@dataclass(frozen=True)
class Score:
    """One character's colours under one method: counts of those of 5 % and more.

    And the distance in OKLab of every found colour to its true one.
    """

    case: str
    found: int
    missing: int
    spurious: int
    errors: tuple[float, ...]


def bench_palette(
    cases: Path | None,
    seed: int,
    *,
    quick: bool = False,
    progress: Callable[[str], None] = lambda text: None,
) -> tuple[list[Record], str]:
    """Return records and a table of every method's colours and seconds.

    Args:
        cases: character folders with known colours; None for synthetic ones.
        seed: of synthetic characters.
        quick: two characters at 150 px, and no large sheet.
        progress: told what is measured.
    """
    scores: dict[tuple[str, str], list[Score]] = {}
    timed: dict[int, PaletteCase] = {}
    for case in palette_cases(cases, seed, quick=quick):
        progress(f"palette {case.name}, {case.group}")
        if case.group.endswith(TIMED_CONDITION):
            timed.setdefault(len(case.images[0]), case)
        count = int((case.shares >= LEAST_SHARE).sum())
        for name, method in METHODS.items():
            result = score(method(case.images, count), case)
            scores.setdefault((case.group, name), []).append(result)
    seconds = _all_seconds(timed, SHEETS_WH[: 2 if quick else None], progress)
    records = [r for (group, name), of in scores.items() for r in _records(of, name, group, seed)]
    records += _pooled(scores, seed)
    for (size, name), times in seconds.items():
        records.append(Recorder(name, size, seed).samples(CPU_SECONDS, times, "s"))
    records += bench_painted(cases, seed, quick=quick, progress=progress)
    records += bench_cel(cases, seed, quick=quick, progress=progress)
    return records, methods_table(records, (*COLUMNS[:-1], *PAINTED, *CEL, COLUMNS[-1]))


def score(found: Sequence[RGB], case: PaletteCase) -> Score:
    """Return which of a case's true colours were found; each goes to the first that is near."""
    true = oklab_from_rgb(case.colors)
    claimed: dict[int, float] = {}
    for rgb in found:
        away = np.linalg.norm(true - oklab_from_rgb(np.array(rgb, dtype=np.uint8)), axis=1)
        free = [int(i) for i in np.argsort(away) if int(i) not in claimed]
        if free and away[free[0]] <= JUST_NOTICEABLE:
            claimed[free[0]] = float(away[free[0]])
    wanted = set(np.flatnonzero(case.shares >= LEAST_SHARE).tolist())
    hit = len(wanted & set(claimed))
    errors = tuple(claimed.values())
    return Score(case.name, hit, len(wanted) - hit, len(found) - len(claimed), errors)


def f1(scores: Sequence[Score]) -> float:
    """Return the F1 of all colours together: 1 is all found and nothing invented."""
    found = sum(one.found for one in scores)
    wrong = sum(one.missing + one.spurious for one in scores)
    return 2 * found / max(2 * found + wrong, 1)


def sheet_of_size(
    case: PaletteCase, width: int, height: int
) -> UInt8[np.ndarray, "height width 4"]:
    """Return a sheet of the case's views, side by side and repeated, of exactly this size."""
    row = np.concatenate(case.images, axis=1)
    times = -(-height // row.shape[0]), -(-width // row.shape[1])
    return np.ascontiguousarray(np.tile(row, (*times, 1))[:height, :width])


def _all_seconds(
    timed: dict[int, PaletteCase], sizes: Sequence[tuple[int, int]], progress: Callable[[str], None]
) -> dict[tuple[str, str], list[float]]:
    """Return processor seconds per sheet and method; the largest cells that fit make a sheet."""
    seconds = {}
    for width, height in sizes:
        case = timed[max(size for size in timed if size <= height)]
        count = int((case.shares >= LEAST_SHARE).sum())
        sheet = [sheet_of_size(case, width, height)]
        for name, method in METHODS.items():
            progress(f"seconds {width} x {height}, {name}")
            times: list[float] = []
            while len(times) < REPEATS and (not times or times[-1] < SLOW_S):
                start = time.process_time()
                method(sheet, count)
                times.append(time.process_time() - start)
            seconds[f"{width} x {height}", name] = [min(times)]
    return seconds


def _pooled(scores: dict[tuple[str, str], list[Score]], seed: int) -> list[Record]:
    """Return the F1 of all pictures together, and how many colours were missed and invented."""
    everything: dict[str, list[Score]] = {}
    for (_, name), some in scores.items():
        everything.setdefault(name, []).extend(some)
    records = []
    for name, some in everything.items():
        recorder = Recorder(name, "all pictures", seed)
        totals = [(what, [getattr(one, what) for one in some]) for what in ("missing", "spurious")]
        records.append(
            replace(recorder.samples("F1 of all", [f1(some)], "", "higher"), n=len(some))
        )
        records += [recorder.samples(f"{w}, in all", [float(sum(n))], "") for w, n in totals]
    return records


def _records(scores: Sequence[Score], method: str, group: str, seed: int) -> list[Record]:
    recorder = Recorder(method, group, seed)
    by_case = {one.case: f1([one]) for one in scores}
    each = [f1([one]) for one in scores]
    errors = [error for one in scores for error in one.errors]
    return [
        recorder.samples("F1 of colours", each, "", "higher", by_case),
        recorder.samples("missing colours", [float(one.missing) for one in scores], ""),
        recorder.samples("spurious colours", [float(one.spurious) for one in scores], ""),
        *([recorder.samples("colour error", errors, "OKLab")] if errors else []),
    ]
