"""What is said of calibrated views: errors, verdicts and whether the sigmas are right, as records.

Wrong is more than 15 degrees off. A view is flipped if it is wrong and its mirror twin is not. A
wrong view is announced if its verdict is anything but ok. The spread of yaw's z-scores (error over
reported sigma, root mean square, of views that are not far off) is 1 where sigmas are right.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from bench.records.record import CPU_SECONDS, Direction, Record, summarise
from toonset.calib.result import SEVERITY
from toonset.camera import Camera, rotation_distance

WRONG = math.radians(15.0)
SUCCESS = math.radians(5.0)
NOT_PLACED = "views not placed"


@dataclass(frozen=True)
class ViewError:
    """One view's rotation error in radians, raw and modulo the mirror twin, and its verdict."""

    raw: float
    modulo_twin: float
    verdict: str


@dataclass(frozen=True)
class MeasuredView:
    """One view's error, and its yaw's error and reported sigma (nan: none) in radians."""

    error: ViewError
    yaw_error: float
    yaw_sigma: float


@dataclass(frozen=True)
class MeasuredSheet:
    """One sheet's views that have a camera, and what they took.

    Attributes:
        views: with a camera.
        seconds: wall time.
        case: the sheet's name.
        cpu_seconds: of this process; None: not measured.
        not_placed: number of views without a camera.
    """

    views: tuple[MeasuredView, ...]
    seconds: float
    case: str = ""
    cpu_seconds: float | None = None
    not_placed: int = 0


@dataclass(frozen=True)
class Recorder:
    """Makes the records of one method under one condition."""

    method: str
    group: str
    seed: int

    def samples(
        self,
        metric: str,
        values: Sequence[float],
        unit: str = "deg",
        direction: Direction = "lower",
        by_case: Mapping[str, float] | None = None,
    ) -> Record:
        """Return the record of at least one sample."""
        return summarise(
            values,
            method=self.method,
            metric=metric,
            unit=unit,
            direction=direction,
            seed=self.seed,
            group=self.group,
            by_case=by_case,
        )

    def total(self, metric: str, hits: Sequence[bool], unit: str = "views") -> Record:
        """Return how many of at least one it is; median and p95 are the same number."""
        return self._single(metric, float(sum(hits)), len(hits), unit, "lower")

    def share(
        self, metric: str, hits: Sequence[bool], direction: Direction = "higher"
    ) -> list[Record]:
        """Return which share it is, 0 to 1; nothing of no samples."""
        if not hits:
            return []
        return [self._single(metric, sum(hits) / len(hits), len(hits), "1", direction)]

    def verdicts(self, verdicts: Sequence[str]) -> list[Record]:
        """Return the share of every verdict; nothing where no verdict was given."""
        judged = [verdict for verdict in verdicts if verdict in SEVERITY]
        return [
            record
            for name in SEVERITY
            for record in self.share(
                name, [v == name for v in judged], "higher" if name == "ok" else "lower"
            )
        ]

    def _single(self, metric: str, value: float, n: int, unit: str, direction: Direction) -> Record:
        return replace(self.samples(metric, [value], unit, direction), n=n)


def view_error(camera: Camera, true_rotation: Float[np.ndarray, "3 3"], verdict: str) -> ViewError:
    """Return the error of one camera against the true camera_from_world rotation."""
    raw = rotation_distance(camera.rotation, true_rotation)
    mirrored = rotation_distance(camera.twin().rotation, true_rotation)
    return ViewError(raw, min(raw, mirrored), verdict)


def angle_between(a: float, b: float) -> float:
    """Return a - b in [-pi, pi)."""
    return (a - b + math.pi) % (2 * math.pi) - math.pi


def error_records(
    cases: Sequence[tuple[str, Sequence[ViewError]]], recorder: Recorder
) -> list[Record]:
    """Return errors, successes, flips and, where views were judged, what verdicts are worth.

    Args:
        cases: names of the sheets and their views that have a camera.
        recorder: of the method.
    """
    errors = [error for _, own in cases for error in own]
    if not errors:
        return []
    wrong = [e for e in errors if e.raw > WRONG]
    records = [
        _degrees("rotation error", cases, lambda e: e.raw, recorder),
        _degrees("rotation error modulo twin", cases, lambda e: e.modulo_twin, recorder),
        *recorder.share("within 5 deg", [e.raw < SUCCESS for e in errors]),
        *recorder.share("within 5 deg modulo twin", [e.modulo_twin < SUCCESS for e in errors]),
        recorder.total("flipped views", [e.raw > WRONG > e.modulo_twin for e in errors]),
    ]
    if any(e.verdict in SEVERITY for e in errors):
        silent = [e.raw > WRONG and e.verdict == "ok" for e in errors]
        records.append(recorder.total("wrong but ok", silent))
        records += recorder.share("wrong and announced", [e.verdict != "ok" for e in wrong])
    return records + recorder.verdicts([e.verdict for e in errors])


def sheet_records(sheets: Sequence[MeasuredSheet], recorder: Recorder) -> list[Record]:
    """Return all records of the sheets that one method has calibrated."""
    views = [view for sheet in sheets for view in sheet.views]
    cpu = {sheet.case: sheet.cpu_seconds for sheet in sheets if sheet.cpu_seconds is not None}
    missing = sum(sheet.not_placed for sheet in sheets)
    records = [
        *error_records([(s.case, [v.error for v in s.views]) for s in sheets], recorder),
        *_spread(views, recorder),
        seconds_record([(sheet.case, sheet.seconds) for sheet in sheets], recorder),
    ]
    if cpu:
        records.append(recorder.samples(CPU_SECONDS, list(cpu.values()), "s", by_case=cpu))
    if missing:
        placed = [False] * len(views) + [True] * missing
        records.append(recorder.total(NOT_PLACED, placed))
    return records


def seconds_record(sheets: Sequence[tuple[str, float]], recorder: Recorder) -> Record:
    """Return the record of the seconds that each sheet took, given with its name."""
    return recorder.samples("seconds", [taken for _, taken in sheets], "s", by_case=dict(sheets))


def _degrees(
    metric: str,
    cases: Sequence[tuple[str, Sequence[ViewError]]],
    read: Callable[[ViewError], float],
    recorder: Recorder,
) -> Record:
    """Return the record of an angle over all views, and its median in every sheet."""
    found = [(name, [math.degrees(read(error)) for error in errors]) for name, errors in cases]
    medians = {name: float(np.median(own)) for name, own in found if own}
    return recorder.samples(metric, [angle for _, own in found for angle in own], by_case=medians)


def _spread(views: Sequence[MeasuredView], recorder: Recorder) -> list[Record]:
    near = [v for v in views if abs(v.yaw_error) < WRONG and math.isfinite(v.yaw_sigma)]
    if not near:
        return []
    scores = np.abs([v.yaw_error / v.yaw_sigma for v in near])
    record = recorder.samples("yaw z-score", scores.tolist(), "1")
    return [replace(record, value=float(np.sqrt(np.mean(scores**2))))]
