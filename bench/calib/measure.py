"""Calibration: seconds against rotation error, per method, beside baselines.

A method is a setting of the search, or something that a person says beforehand. Seconds are those
of `calibrate` alone, in this process, after imports; with the mannequin's templates in the cache
as from its second sheet on, except where a method is about just that. Baselines start at the
nominal angles, or are told landmarks; see `bench.calib.baselines` and `soft_silhouette`.
"""

from __future__ import annotations

import math
import os
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from types import ModuleType

import numpy as np
from jaxtyping import Float

from bench.calib.baselines import BASELINES, Baseline, Placed, nominal_rotations
from bench.calib.figures import (
    NOT_PLACED,
    MeasuredSheet,
    MeasuredView,
    Recorder,
    ViewError,
    angle_between,
    error_records,
    seconds_record,
    sheet_records,
    view_error,
)
from bench.calib.sfm import METHODS as SFM_METHODS
from bench.calib.sfm import SfmResult, aligned_errors, reconstruct
from bench.cases.cases import CalibCase
from bench.records.record import Record
from toonset.calib.find_cameras import find_cameras
from toonset.calib.fit import model_selection
from toonset.calib.known import Known
from toonset.calib.options import CalibrationOptions
from toonset.calib.outline.occluding_contour import prepare_surface
from toonset.calib.search import templates
from toonset.calib.search.template_cache import load_bank
from toonset.camera import Camera, angles_from_rotation
from toonset.dataset.split_folder.view_labels import Label

__all__ = ["ViewError", "bench_calibration", "bench_colmap", "view_error"]

NOMINAL = "nominal angles"
SOFT = "Adam, soft silhouette"
NAMED = math.radians(45.0)  # people name directions in steps of this
UNJUDGED = ""


@dataclass(frozen=True)
class Method:
    """How a sheet is calibrated.

    Attributes:
        options: search effort.
        labels: the views' directions are told, to the nearest 45 degrees.
        cached: the mannequin's templates are there already.
        alone: every drawing is a sheet of its own.
        constants: what is no option, changed for this method: module, name and value.
    """

    options: CalibrationOptions = field(default_factory=CalibrationOptions)
    labels: bool = False
    cached: bool = True
    alone: bool = False
    constants: tuple[tuple[ModuleType, str, float], ...] = ()


METHODS: dict[str, Method] = {
    "default": Method(),
    "labels": Method(labels=True),
    "2 starts": Method(CalibrationOptions(starts=2)),
    "12 starts": Method(CalibrationOptions(starts=12)),
    "coarse 64, fine 120": Method(CalibrationOptions(coarse_height_px=64, fine_height_px=120)),
    "fine 500 px": Method(CalibrationOptions(fine_height_px=500)),
    "no cached templates": Method(cached=False),
    "templates every 5 deg": Method(constants=((templates, "YAW_STEP", math.radians(5)),)),
    "templates every 20 deg": Method(constants=((templates, "YAW_STEP", math.radians(20)),)),
    "each drawing alone": Method(alone=True),
    "orthographic, one scale": Method(constants=((model_selection, "BIC_MARGIN", math.inf),)),
}
QUICK = ("default", "labels", "no cached templates")
QUICK_SFM = ("COLMAP", "COLMAP 1000 px")


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
        sheets.setdefault((case.group, NOMINAL), []).append(_guessed(case))
        for method, place in _baselines(quick=quick).items():
            progress(f"{case.name}: {method}")
            found = measured_baseline(case, place(case, seed))
            sheets.setdefault((case.group, method), []).append(found)
        with own_cache():
            for method in QUICK if quick else METHODS:
                progress(f"{case.name}: {method}")
                with changed(METHODS[method].constants):
                    load_bank(prepare_surface(case.mesh))
                    measured = _calibrated(case, METHODS[method])
                sheets.setdefault((case.group, method), []).append(measured)
    return [
        record
        for (group, method), found in sheets.items()
        for record in sheet_records(found, Recorder(method, group, seed))
    ]


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
        for group in dict.fromkeys(case.group for case in cases):
            own = [case for case in cases if case.group == group]
            results = []
            for case in own:
                progress(f"{case.name}: {method}")
                results.append(reconstruct(case.views, SFM_METHODS[method], seed))
            records += _sfm_records(own, results, Recorder(method, group, seed))
    return records


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


@contextmanager
def changed(constants: Iterable[tuple[ModuleType, str, float]]) -> Iterator[None]:
    """Give constants of modules other values for a while."""
    with ExitStack() as stack:
        for module, name, value in constants:
            stack.callback(setattr, module, name, getattr(module, name))
            setattr(module, name, value)
        yield


def measured_baseline(case: CalibCase, placed: Placed) -> MeasuredSheet:
    """Return the errors of rotations that nothing judges; views without one are counted."""
    views = []
    for rotation, truth in zip(placed.rotations, case.rotations, strict=True):
        if rotation is not None:
            camera = Camera(rotation, np.zeros(3), 1.0, np.zeros(2), (1, 1))
            views.append(_measured(camera, truth, UNJUDGED, math.nan))
    missing = len(placed.rotations) - len(views)
    return MeasuredSheet(tuple(views), placed.seconds, case.name, placed.cpu_seconds, missing)


def _guessed(case: CalibCase) -> MeasuredSheet:
    rotations = tuple(nominal_rotations(len(case.views)))
    return measured_baseline(case, Placed(rotations, 0.0, 0.0))


def _baselines(*, quick: bool) -> dict[str, Baseline]:
    if quick:
        return dict(BASELINES)
    from bench.calib.soft_silhouette import by_soft_silhouette  # imports torch

    return {**BASELINES, SOFT: by_soft_silhouette}


def _calibrated(case: CalibCase, method: Method) -> MeasuredSheet:
    if not method.cached:
        with own_cache():
            return _calibrated(case, replace(method, cached=True))
    if method.alone:
        return _calibrated_alone(case, replace(method, alone=False))
    yaws = [angles_from_rotation(rotation)[0] for rotation in case.rotations]
    known = Known(labels=named_directions(yaws)) if method.labels else None
    wall, cpu = time.perf_counter(), time.process_time()
    result = find_cameras(case.views, case.mesh, method.options, known=known)
    seconds, cpu_seconds = time.perf_counter() - wall, time.process_time() - cpu
    views = tuple(
        _measured(view.camera, truth, view.verdict, view.sigmas.yaw)
        for view, truth in zip(result.views, case.rotations, strict=True)
    )
    return MeasuredSheet(views, seconds, case.name, cpu_seconds)


def _calibrated_alone(case: CalibCase, method: Method) -> MeasuredSheet:
    """Return every view's errors as a sheet of one drawing, and all their seconds."""
    pairs = zip(case.views, case.rotations, strict=True)
    sheets = [
        _calibrated(replace(case, views=(view,), rotations=rotation[None]), method)
        for view, rotation in pairs
    ]
    views = tuple(view for sheet in sheets for view in sheet.views)
    seconds, cpu = (sum(getattr(s, name) for s in sheets) for name in ("seconds", "cpu_seconds"))
    return MeasuredSheet(views, seconds, case.name, cpu)


def _measured(
    camera: Camera, truth: Float[np.ndarray, "3 3"], verdict: str, yaw_sigma: float
) -> MeasuredView:
    yaw_error = angle_between(camera.angles[0], angles_from_rotation(truth)[0])
    return MeasuredView(view_error(camera, truth, verdict), yaw_error, yaw_sigma)


def _sfm_records(
    cases: Sequence[CalibCase], results: Sequence[SfmResult], recorder: Recorder
) -> list[Record]:
    errors: list[tuple[str, list[ViewError]]] = []
    missing: list[bool] = []
    for case, found in zip(cases, results, strict=True):
        off = zip(*aligned_errors(found.rotations, case.rotations), strict=True)
        errors.append((case.name, [ViewError(raw, twin, UNJUDGED) for raw, twin in off]))
        missing += [i not in found.rotations for i in range(len(case.views))]
    taken = [(case.name, found.seconds) for case, found in zip(cases, results, strict=True)]
    return [
        *error_records(errors, recorder),
        seconds_record(taken, recorder),
        recorder.total(NOT_PLACED, missing),
        recorder.total("failed runs", [bool(found.failed) for found in results], "sheets"),
    ]
