"""Stability of calibration: how far each error of a sheet may go, and whether the tool says so.

Every step of a sweep draws its sheets, calibrates them and keeps each view's error and verdict. The
sweep of start errors is about the contour alignment alone: it pulls in from a wrong start or not.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from scipy.spatial.transform import Rotation

from toonset.bench.calib import ViewError, view_error
from toonset.bench.stability_damage import Drawn
from toonset.bench.stability_sweeps import DrawnSheet, Step, Sweep
from toonset.bench.workers import in_order
from toonset.calib.align import align
from toonset.calib.calibrate import calibrate
from toonset.calib.contour import drawn_contour
from toonset.calib.match import Drawing
from toonset.calib.pose import Pose
from toonset.calib.rim import Surface, prepare_surface
from toonset.errors import ToonsetError

NO_VERDICT = ""  # an alignment alone judges nothing
REFUSED = ViewError(math.pi, math.pi, "failed")  # no camera at all: as wrong as can be
CRASHED = ViewError(math.pi, math.pi, "crashed")
ALIGN_HEIGHT_PX = 100.0  # the height at which calibration searches
ALIGN_POINTS = 160
ALIGN_WIDTHS = np.geomspace(0.08, 0.015, 12)  # robust widths over the height, coarse to fine


@dataclass(frozen=True)
class Job:
    """One sheet of one step."""

    sweep: Sweep
    step: Step
    seed: int


@dataclass(frozen=True)
class SheetResult:
    """One sheet's views, the seconds of calibration and, if it was refused or crashed, why."""

    views: tuple[ViewError, ...]
    seconds: float
    note: str


@dataclass(frozen=True)
class StepResult:
    """All sheets of one step of a sweep."""

    sweep: str
    step: str
    sheets: tuple[SheetResult, ...]


def run_steps(
    plan: Sequence[tuple[Sweep, Step]],
    seed: int,
    count: int,
    *,
    workers: int = 1,
    progress: Callable[[str], None] = lambda text: None,
) -> Iterator[StepResult]:
    """Yield one result per step, in order, each as soon as its sheets are done.

    Args:
        plan: sweeps with the step to run.
        seed: of the first sheet; the others' follow.
        count: sheets per step.
        workers: processes; the result does not depend on them.
        progress: called with the step that is waited for.
    """
    jobs = [Job(sweep, step, seed + i) for sweep, step in plan for i in range(count)]
    done = in_order(run_sheet, jobs, min(workers, len(jobs)))
    for number, (sweep, step) in enumerate(plan, start=1):
        progress(f"{number} of {len(plan)}: {sweep.name} {step}")
        yield StepResult(sweep.name, str(step), tuple(islice(done, count)))


def run_sheet(job: Job) -> SheetResult:
    """Return how calibration did on one sheet; an exception is a result, too: that is the test."""
    sheet = job.sweep.draw(job.step, job.seed)
    start, note = time.perf_counter(), ""
    try:
        if job.sweep.from_start:
            views = align_from(sheet, math.radians(float(job.step)), job.seed)
        else:
            views = _calibrated(sheet)
    except ToonsetError as error:
        views, note = (REFUSED,) * len(sheet.drawings), str(error)
    except Exception as error:
        views, note = (CRASHED,) * len(sheet.drawings), f"{type(error).__name__}: {error}"
    return SheetResult(views, time.perf_counter() - start, note)


def align_from(sheet: DrawnSheet, error: float, seed: int) -> tuple[ViewError, ...]:
    """Return each view's error after alignment from the truth turned by `error` radians.

    The axis is random; scale and shift start at the truth. The sheet's cameras are orthographic.
    """
    surface = prepare_surface(sheet.mesh)
    axes = np.random.default_rng(seed).normal(size=(len(sheet.drawings), 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return tuple(
        _aligned(drawn, surface, error * axis)
        for drawn, axis in zip(sheet.drawings, axes, strict=True)
    )


def _aligned(drawn: Drawn, surface: Surface, turn: np.ndarray) -> ViewError:
    view, camera = drawn
    drawing = Drawing(drawn_contour(view), ALIGN_HEIGHT_PX, ALIGN_POINTS)
    rotation = Rotation.from_rotvec(turn).as_matrix() @ camera.rotation
    shift = camera.project(surface.middle[None])[0][0]
    fit = align(drawing, surface, Pose(rotation, shift, camera.scale), ALIGN_WIDTHS)
    found = fit.pose.camera(surface.middle, camera.size_wh)
    return view_error(found, camera.rotation, NO_VERDICT)


def _calibrated(sheet: DrawnSheet) -> tuple[ViewError, ...]:
    result = calibrate([view for view, _ in sheet.drawings], sheet.mesh)
    return tuple(
        view_error(found.camera, truth.rotation, found.verdict)
        for found, (_, truth) in zip(result.views, sheet.drawings, strict=True)
    )
