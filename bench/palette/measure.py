"""Palettes, measured: which true colours are found, which are invented, and how long it takes.

A colour is found if it lies within 0.02 in OKLab of a true one; two found colours cannot claim the
same. Missing is a true colour of 5 % or more that nobody claims; spurious is a found colour that
claims none. A true colour of less than 5 % may be found or not.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from bench.palette.cases import PaletteCase, palette_cases
from bench.palette.methods import LEAST_SHARE, METHODS, RGB
from bench.records.record import CPU_SECONDS, Direction, Record, summarise
from toonset.palette.colors import JUST_NOTICEABLE, oklab_from_rgb

SHEETS_WH = ((150, 150), (1200, 600), (4096, 2048))
TIMED_CONDITION = "lines, png"
REPEATS = 3  # the least counts; once for what takes over a second
SLOW_S = 1.0


@dataclass(frozen=True)
class Score:
    """One character's colours under one method.

    Attributes:
        case: the character's name.
        found: true colours of 5 % and more that were found.
        missing: those that were not.
        spurious: found colours that are not there.
        errors: distance in OKLab of every found colour to its true one.
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
    records += [
        summarise(
            times,
            method=name,
            metric=CPU_SECONDS,
            unit="s",
            direction="lower",
            seed=seed,
            group=size,
        )
        for (size, name), times in seconds.items()
    ]
    return records, f"{_accuracy_table(scores)}\n\n{_seconds_table(seconds)}"


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
    """Return processor seconds per sheet and method, from a decoded picture on.

    Args:
        timed: a character by the size of its cells; the largest that fit make a sheet.
        sizes: of the sheets.
        progress: told what is measured.
    """
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


def _records(scores: Sequence[Score], method: str, group: str, seed: int) -> list[Record]:
    def record(samples: Sequence[float], metric: str, unit: str, *, higher: bool = False) -> Record:
        direction: Direction = "higher" if higher else "lower"
        return summarise(
            samples,
            method=method,
            metric=metric,
            unit=unit,
            direction=direction,
            seed=seed,
            group=group,
        )

    errors = [error for one in scores for error in one.errors]
    return [
        replace(
            record([f1([one]) for one in scores], "F1 of colours", "", higher=True),
            by_case={one.case: f1([one]) for one in scores},
        ),
        record([float(one.missing) for one in scores], "missing colours", ""),
        record([float(one.spurious) for one in scores], "spurious colours", ""),
        *([record(errors, "colour error", "OKLab")] if errors else []),
    ]


def _accuracy_table(scores: dict[tuple[str, str], list[Score]]) -> str:
    head = f"{'group':28s} {'method':22s} {'F1':>6s} {'found':>6s} {'missing':>8s} {'spurious':>9s}"
    lines = [f"{head} {'error':>7s} {'p95':>7s} {'n':>3s}"]
    everything: dict[str, list[Score]] = {}
    for (_, name), some in scores.items():
        everything.setdefault(name, []).extend(some)
    rows = [*scores.items(), *((("all", name), some) for name, some in everything.items())]
    for (group, name), some in rows:
        errors = [error for one in some for error in one.errors] or [float("nan")]
        counts = [
            sum(getattr(one, what) for one in some) for what in ("found", "missing", "spurious")
        ]
        lines.append(
            f"{group:28s} {name:22s} {f1(some):6.3f} {counts[0]:6d} {counts[1]:8d} {counts[2]:9d} "
            f"{np.median(errors):7.4f} {np.percentile(errors, 95):7.4f} {len(some):3d}"
        )
    return "\n".join(lines)


def _seconds_table(seconds: dict[tuple[str, str], list[float]]) -> str:
    lines = [f"{'sheet':14s} {'method':22s} {'s':>8s} {'times ours':>11s}"]
    for (size, name), times in seconds.items():
        ratio = times[0] / max(seconds[size, "default"][0], 1e-9)
        lines.append(f"{size:14s} {name:22s} {times[0]:8.3f} {ratio:11.1f}")
    return "\n".join(lines)
