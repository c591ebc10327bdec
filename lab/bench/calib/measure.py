"""Calibration: seconds against rotation error, per method, beside baselines.

A method is a setting of the search, or something that a person says beforehand. Seconds are those
of `calibrate` alone, in this process, after imports; with the mannequin's templates in the cache
as from its second sheet on, except where a method is about just that. Baselines start at the
nominal angles, or are told landmarks; see `bench.calib.baselines`.
"""

from __future__ import annotations

import math
import os
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from lab.bench.calib.baselines import BASELINES, Baseline
from lab.bench.calib.figures import NOT_PLACED, MeasuredSheet, sheet_records, view_error
from lab.bench.cases.cases import CalibCase
from lab.bench.records.record import CPU_SECONDS, Column, Record, Recorder, methods_table
from toonset.calib.find_cameras import find_cameras
from toonset.calib.known import Known
from toonset.calib.options import CalibrationOptions
from toonset.calib.outline.occluding_contour import prepare_surface
from toonset.calib.result import SEVERITY
from toonset.calib.search.template_cache import load_bank
from toonset.calib.verdict.checks import CHECKS
from toonset.camera import Camera, angles_from_rotation
from toonset.dataset.split_folder.view_labels import Label

NAMED = math.radians(45.0)  # people name directions in steps of this
UNJUDGED = ""
COLUMNS = (
    Column("rotation error", "deg", "{:.2f}", "median"),
    Column("rotation error", "p95", "{:.1f}", "p95"),
    Column("rotation error modulo twin", "twin", "{:.1f}", "p95"),
    Column("within 5 deg", "<5 deg", "{:.0f}", scale=100),
    Column("flipped views", "flip", "{:.0f}"),
    Column("wrong but ok", "bad", "{:.0f}"),
    Column("wrong and announced", "said", "{:.0f}", scale=100),
    Column("yaw z-score", "z", "{:.2f}"),
    *(Column(name, name[:4], "{:.0f}", scale=100) for name in SEVERITY),
    Column(NOT_PLACED, "lost", "{:.0f}"),
    Column("seconds", "s", "{:.2f}"),
    Column(CPU_SECONDS, "CPU", "{:.2f}"),
)
LEGEND = """
deg, p95: rotation error, median and 95th percentile. twin: p95 modulo the mirror twin. <5 deg: %.
flip: views over 15 deg off, their twin less. bad: views over 15 deg off with verdict ok. said: % of
views so far off that are not ok. z: spread of yaw error / sigma, 1 is right. ok to fail: verdicts,
%. lost: views without a camera. s, CPU: seconds per sheet."""


@dataclass(frozen=True)
class Method:
    """A way of calibrating a sheet.

    Attributes:
        options: search effort.
        labels: the views' directions are told, to the nearest 45 degrees.
        cached: the mannequin's templates are there already.
    """

    options: CalibrationOptions = field(default_factory=CalibrationOptions)
    labels: bool = False
    cached: bool = True


METHODS: dict[str, Method] = {
    "default": Method(),
    "labels": Method(labels=True),
    "2 starts": Method(CalibrationOptions(starts=2)),
    "12 starts": Method(CalibrationOptions(starts=12)),
    "coarse 64, fine 120": Method(CalibrationOptions(coarse_height_px=64, fine_height_px=120)),
    "fine 500 px": Method(CalibrationOptions(fine_height_px=500)),
    "no cached templates": Method(cached=False),
    **{f"without {name}": Method(CalibrationOptions(without=(name,))) for name in CHECKS},
}
QUICK = ("default", "labels", "no cached templates")


def bench_calibration(
    cases: Iterable[CalibCase],
    seed: int,
    *,
    quick: bool,
    progress: Callable[[str], None] = lambda text: None,
) -> list[Record]:
    """Return records of errors, verdicts, sigmas and seconds per condition and method."""
    sheets: dict[tuple[str, str], list[MeasuredSheet]] = {}
    for case in cases:
        for method, baseline in BASELINES.items():
            progress(f"{case.name}: {method}")
            found = measured_baseline(case, seed, baseline)
            sheets.setdefault((case.group, method), []).append(found)
        with own_cache():
            for method in QUICK if quick else METHODS:
                progress(f"{case.name}: {method}")
                load_bank(prepare_surface(case.mesh))
                measured = _calibrated(case, METHODS[method])
                sheets.setdefault((case.group, method), []).append(measured)
    return [
        record
        for (group, method), own in sheets.items()
        for record in sheet_records(own, Recorder(method, group, seed))
    ]


def sheets_table(records: Sequence[Record]) -> str:
    """Return the table of `python -m lab.bench calib`; a line has 120 characters at most."""
    return f"{methods_table(records, COLUMNS)}\n{LEGEND}"


def named_directions(yaws: Iterable[float]) -> tuple[Label, ...]:
    """Return what a person would call these yaws (radians): the nearest 45 degrees, one each."""
    return tuple((round(yaw / NAMED) * NAMED % (2 * math.pi),) for yaw in yaws)


@contextmanager
def own_cache() -> Iterator[None]:
    """Give calibration an empty cache of its own: the user's one neither helps nor is filled."""
    before = os.environ.get("TOONSET_CACHE")
    with tempfile.TemporaryDirectory(prefix="toonset-bench-") as folder:
        os.environ["TOONSET_CACHE"] = folder
        try:
            yield
        finally:
            del os.environ["TOONSET_CACHE"]
            if before is not None:
                os.environ["TOONSET_CACHE"] = before


def measured_baseline(case: CalibCase, seed: int, baseline: Baseline) -> MeasuredSheet:
    """Return the errors of rotations that nothing judges; views without one are counted."""
    wall, cpu = time.perf_counter(), time.process_time()
    rotations = baseline(case, seed)
    spent = time.perf_counter() - wall, time.process_time() - cpu
    views = [
        view_error(Camera(rotation, np.zeros(3), 1.0, np.zeros(2), (1, 1)), truth, UNJUDGED)
        for rotation, truth in zip(rotations, case.rotations, strict=True)
        if rotation is not None
    ]
    return MeasuredSheet(tuple(views), case.name, *spent, len(rotations) - len(views))


def _calibrated(case: CalibCase, method: Method) -> MeasuredSheet:
    if not method.cached:
        with own_cache():
            return _calibrated(case, replace(method, cached=True))
    yaws = [angles_from_rotation(rotation)[0] for rotation in case.rotations]
    known = Known(labels=named_directions(yaws)) if method.labels else None
    wall, cpu = time.perf_counter(), time.process_time()
    result = find_cameras(case.views, case.mesh, method.options, known=known)
    spent = time.perf_counter() - wall, time.process_time() - cpu
    views = tuple(
        view_error(view.camera, truth, view.verdict, view.sigmas.yaw)
        for view, truth in zip(result.views, case.rotations, strict=True)
    )
    return MeasuredSheet(views, case.name, *spent)
