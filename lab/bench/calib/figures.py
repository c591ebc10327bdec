"""What is said of calibrated views: errors, verdicts and whether the sigmas are right, as records.

Wrong is more than 15 degrees off. A view is flipped if it is wrong and its mirror twin is not. A
wrong view is announced if its verdict is anything but ok. The spread of yaw's z-scores (error over
reported sigma, root mean square, of views that are not far off) is 1 where sigmas are right.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from lab.bench.records.record import CPU_SECONDS, Record, Recorder
from toonset.calib.result import SEVERITY
from toonset.camera import Camera, angles_from_rotation, rotation_distance

WRONG = math.radians(15.0)
SUCCESS = math.radians(5.0)
NOT_PLACED = "views not placed"


@dataclass(frozen=True)
class ViewError:
    """One view's rotation error in radians, raw and modulo the mirror twin, its verdict, its yaw's.

    Of yaw the error and the reported sigma (nan: none), radians, too.
    """

    raw: float
    modulo_twin: float
    verdict: str
    yaw: float = 0.0
    yaw_sigma: float = math.nan


@dataclass(frozen=True)
class MeasuredSheet:
    """One sheet's views that have a camera, its name, wall and CPU seconds, and views without."""

    views: tuple[ViewError, ...]
    case: str
    seconds: float
    cpu_seconds: float
    not_placed: int = 0


def view_error(
    camera: Camera,
    true_rotation: Float[np.ndarray, "3 3"],
    verdict: str,
    yaw_sigma: float = math.nan,
) -> ViewError:
    """Return the error of one camera against the true camera_from_world rotation."""
    raw = rotation_distance(camera.rotation, true_rotation)
    mirrored = rotation_distance(camera.twin().rotation, true_rotation)
    yaw = angle_between(camera.angles[0], angles_from_rotation(true_rotation)[0])
    return ViewError(raw, min(raw, mirrored), verdict, yaw, yaw_sigma)


def angle_between(a: float, b: float) -> float:
    """Return a - b in [-pi, pi)."""
    return (a - b + math.pi) % (2 * math.pi) - math.pi


def verdict_records(verdicts: Sequence[str], recorder: Recorder) -> list[Record]:
    """Return the share of every verdict; empty if no verdict was given."""
    judged = [verdict for verdict in verdicts if verdict in SEVERITY]
    return [
        record
        for name in SEVERITY
        for record in recorder.share(
            name, [v == name for v in judged], "higher" if name == "ok" else "lower"
        )
    ]


def sheet_records(sheets: Sequence[MeasuredSheet], recorder: Recorder) -> list[Record]:
    """Return all records of the sheets that one method has calibrated."""
    views = [view for sheet in sheets for view in sheet.views]
    records = _error_records(sheets, views, recorder) if views else []
    near = [v for v in views if abs(v.yaw) < WRONG and math.isfinite(v.yaw_sigma)]
    if near:
        scores = np.abs([v.yaw / v.yaw_sigma for v in near])
        record = recorder.samples("yaw z-score", scores.tolist(), "1")
        records.append(replace(record, value=float(np.sqrt(np.mean(scores**2)))))
    records.append(seconds_record([(sheet.case, sheet.seconds) for sheet in sheets], recorder))
    cpu = {sheet.case: sheet.cpu_seconds for sheet in sheets}
    records.append(recorder.samples(CPU_SECONDS, [*cpu.values()], "s", by_case=cpu))
    if missing := sum(sheet.not_placed for sheet in sheets):
        records.append(recorder.total(NOT_PLACED, [False] * len(views) + [True] * missing))
    return records


def seconds_record(sheets: Sequence[tuple[str, float]], recorder: Recorder) -> Record:
    """Return the record of the seconds that each sheet took, given with its name."""
    return recorder.samples("seconds", [taken for _, taken in sheets], "s", by_case=dict(sheets))


def _error_records(
    sheets: Sequence[MeasuredSheet], views: Sequence[ViewError], recorder: Recorder
) -> list[Record]:
    """Return errors, successes, flips and, where views were judged, what verdicts are worth."""

    def degrees(metric: str, read: Callable[[ViewError], float]) -> Record:
        found = {s.case: [math.degrees(read(view)) for view in s.views] for s in sheets if s.views}
        medians = {case: float(np.median(own)) for case, own in found.items()}
        return recorder.samples(metric, [math.degrees(read(v)) for v in views], by_case=medians)

    wrong = [view.raw > WRONG for view in views]
    records = [
        degrees("rotation error", lambda view: view.raw),
        degrees("rotation error modulo twin", lambda view: view.modulo_twin),
        *recorder.share("within 5 deg", [view.raw < SUCCESS for view in views]),
        *recorder.share("within 5 deg modulo twin", [v.modulo_twin < SUCCESS for v in views]),
        recorder.total("flipped views", [view.raw > WRONG > view.modulo_twin for view in views]),
    ]
    if any(view.verdict in SEVERITY for view in views):
        ok = [view.verdict == "ok" for view in views]
        pairs = list(zip(wrong, ok, strict=True))
        records.append(recorder.total("wrong but ok", [both == (True, True) for both in pairs]))
        records += recorder.share("wrong and announced", [not o for w, o in pairs if w])
    return records + verdict_records([view.verdict for view in views], recorder)
