"""Calibration: seconds against rotation error, per setting, with the nominal angles as baseline."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from toonset.bench.cases import CalibCase
from toonset.bench.record import Record, summarise
from toonset.bench.sfm import METHODS as SFM_METHODS
from toonset.bench.sfm import SfmResult, aligned_errors, reconstruct
from toonset.calib.calibrate import CalibrationOptions, calibrate
from toonset.camera import Camera, rotation_distance, rotation_from_angles

NOMINAL = "nominal angles"
NOMINAL_ELEVATION = math.radians(5.0)
WRONG = math.radians(15.0)

SETTINGS: dict[str, CalibrationOptions] = {
    "default": CalibrationOptions(),
    "2 starts": CalibrationOptions(starts=2),
    "12 starts": CalibrationOptions(starts=12),
    "coarse 64 px, fine 120 px": CalibrationOptions(coarse_height_px=64, fine_height_px=120),
    "fine 500 px": CalibrationOptions(fine_height_px=500),
}
QUICK = ("default", "2 starts")
QUICK_SFM = ("COLMAP", "COLMAP 1000 px")


@dataclass(frozen=True)
class ViewError:
    """One view's rotation error in radians, raw and modulo the mirror twin, and its verdict."""

    raw: float
    modulo_twin: float
    verdict: str


def bench_calibration(
    cases: Sequence[CalibCase],
    seed: int,
    *,
    quick: bool,
    progress: Callable[[str], None] = lambda text: None,
) -> list[Record]:
    """Return records of error, flips, silent errors and seconds per setting and condition."""
    records: list[Record] = []
    groups = sorted({case.group for case in cases})
    for method in [NOMINAL, *(QUICK if quick else SETTINGS)]:
        for group in groups:
            errors, seconds = [], []
            for case in (c for c in cases if c.group == group):
                progress(f"{method}: {case.name}")
                found, took = _run(method, case)
                errors.extend(found)
                seconds.append(took)
            records.extend(_records(method, group, errors, seconds, seed))
    return records


def bench_colmap(
    cases: Sequence[CalibCase],
    seed: int,
    *,
    quick: bool,
    progress: Callable[[str], None] = lambda text: None,
) -> list[Record]:
    """Return the same records of structure from motion, where it has placed a view at all.

    Errors are after the best alignment with the truth; views that are not placed and runs that
    failed are counted.
    """
    records: list[Record] = []
    for method in QUICK_SFM if quick else SFM_METHODS:
        for group in sorted({case.group for case in cases}):
            own = [case for case in cases if case.group == group]
            results = []
            for case in own:
                progress(f"{method}: {case.name}")
                results.append(reconstruct(case.views, SFM_METHODS[method], seed))
            records += _sfm_records(method, group, own, results, seed)
    return records


def view_error(camera: Camera, true_rotation: np.ndarray, verdict: str) -> ViewError:
    """Return the error of one camera against the true camera_from_world rotation."""
    raw = rotation_distance(camera.rotation, true_rotation)
    mirrored = rotation_distance(camera.twin().rotation, true_rotation)
    return ViewError(raw, min(raw, mirrored), verdict)


def _run(method: str, case: CalibCase) -> tuple[list[ViewError], float]:
    start = time.perf_counter()
    if method == NOMINAL:
        turns = np.arange(len(case.views)) * 2 * math.pi / len(case.views)
        flat = Camera(np.eye(3), np.zeros(3), 1.0, np.zeros(2), (1, 1))
        cameras = [
            replace(flat, rotation=rotation_from_angles(t, NOMINAL_ELEVATION, 0.0)) for t in turns
        ]
        verdicts = ["guess"] * len(cameras)
    else:
        result = calibrate(case.views, case.mesh, SETTINGS[method])
        cameras = [view.camera for view in result.views]
        verdicts = [view.verdict for view in result.views]
    took = time.perf_counter() - start
    return [
        view_error(c, r, v) for c, r, v in zip(cameras, case.rotations, verdicts, strict=True)
    ], took


def _records(
    method: str, group: str, errors: list[ViewError], seconds: list[float], seed: int
) -> list[Record]:
    def one(metric: str, samples: Sequence[float], unit: str) -> Record:
        return summarise(
            samples,
            method=method,
            metric=metric,
            unit=unit,
            direction="lower",
            seed=seed,
            group=group,
        )

    if not errors:  # no view has a camera
        return [one("seconds", seconds, "s")]
    silent = [e.verdict == "ok" and e.raw > WRONG for e in errors]
    return [
        one("rotation error", [math.degrees(e.raw) for e in errors], "deg"),
        one("rotation error modulo twin", [math.degrees(e.modulo_twin) for e in errors], "deg"),
        _count("flipped views", [e.raw > math.pi / 2 for e in errors], method, group, seed),
        _count("wrong but ok", silent, method, group, seed),
        one("seconds", seconds, "s"),
    ]


def _sfm_records(
    method: str, group: str, cases: list[CalibCase], results: list[SfmResult], seed: int
) -> list[Record]:
    errors: list[ViewError] = []
    missing: list[bool] = []
    for case, found in zip(cases, results, strict=True):
        raw, modulo_twin = aligned_errors(found.rotations, case.rotations)
        errors += [ViewError(a, b, "placed") for a, b in zip(raw, modulo_twin, strict=True)]
        missing += [i not in found.rotations for i in range(len(case.views))]
    failed = [bool(found.failed) for found in results]
    return [
        *_records(method, group, errors, [found.seconds for found in results], seed),
        _count("views not placed", missing, method, group, seed),
        _count("failed runs", failed, method, group, seed, "sheets"),
    ]


def _count(
    metric: str, hits: Sequence[bool], method: str, group: str, seed: int, unit: str = "views"
) -> Record:
    record = summarise(
        [float(hit) for hit in hits],
        method=method,
        metric=metric,
        unit=unit,
        direction="lower",
        seed=seed,
        group=group,
    )
    total = float(sum(hits))
    return replace(record, value=total, median=total, p95=total)
