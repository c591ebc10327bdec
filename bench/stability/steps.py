"""Stability of calibration: how far each error of a sheet may go, and whether the tool says so.

Every sheet of a sweep is drawn and calibrated; each view's error, verdict and reason are kept. The
sweep of start errors is about the contour alignment alone: it pulls in from a wrong start or not.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from bench.calib.figures import WRONG
from bench.calib.measure import ViewError, view_error
from bench.stability.damage import Drawn
from bench.stability.picture import outlines_picture
from bench.stability.sheet import DrawnSheet, Step, draw_sheet
from bench.stability.sweeps import Sweep
from toonset.calib.calibrate import calibrate
from toonset.calib.find_cameras import find_cameras
from toonset.calib.fit.align import align
from toonset.calib.outline.correspondences import Drawing
from toonset.calib.outline.occluding_contour import Surface, prepare_surface
from toonset.calib.outline.pose import Pose
from toonset.calib.result import Calibration
from toonset.camera import Camera
from toonset.dataset.images.picture import encode_png
from toonset.dataset.silhouettes.contour import drawn_contour
from toonset.errors import ToonsetError
from toonset.mesh import Mesh

NO_VERDICT = ""  # an alignment alone judges nothing
REFUSED = ViewError(math.pi, math.pi, "failed")  # no camera at all: as wrong as can be
CRASHED = ViewError(math.pi, math.pi, "crashed")
ALIGN_HEIGHT_PX = 100.0  # the height at which calibration searches
ALIGN_POINTS = 160
ALIGN_WIDTHS = np.geomspace(0.08, 0.015, 12)  # robust widths over the height, coarse to fine


@dataclass(frozen=True)
class SheetResult:
    """One sheet's views, the seconds of calibration and, if it was refused or crashed, why.

    Attributes:
        views: errors and verdicts.
        seconds: of calibration.
        note: why there are no cameras; "" where there are.
        reasons: of the verdicts, one per view; "" of those that are ok.
    """

    views: tuple[ViewError, ...]
    seconds: float
    note: str
    reasons: tuple[str, ...] = ()


@dataclass(frozen=True)
class StepResult:
    """All sheets of one step of a sweep."""

    sweep: str
    step: str
    sheets: tuple[SheetResult, ...]


def run_sheet(sweep: Sweep, step: Step, seed: int) -> tuple[SheetResult, bytes]:
    """Return how calibration did on one sheet, and a PNG of its worst view.

    A refusal and an exception are results, too: that is the test.
    """
    return _base_tried(seed) if step == sweep.base else _tried(sweep, step, seed)


@cache
def _base_tried(seed: int) -> tuple[SheetResult, bytes]:
    about = "The sheet that others are compared with."
    return _tried(Sweep("base", "", (0,), (0,), about, None, lambda _, s: draw_sheet(s)), 0, seed)


def _tried(sweep: Sweep, step: Step, seed: int) -> tuple[SheetResult, bytes]:
    try:
        sheet = sweep.draw(step, seed)
    except ToonsetError as error:  # what is drawn cannot be cut out again
        return SheetResult((REFUSED,), 0.0, str(error)), b""
    start, note, found = time.perf_counter(), "", None
    try:
        if sweep.from_start:
            views = align_from(sheet, math.radians(float(step)), seed)
        else:
            found = _calibrated(sheet)
            views = _errors(found, sheet)
    except ToonsetError as error:
        views, note = (REFUSED,) * len(sheet.drawings), str(error)
    except Exception as error:
        views, note = (CRASHED,) * len(sheet.drawings), f"{type(error).__name__}: {error}"
    seconds = time.perf_counter() - start
    worst = worst_view(views)
    camera, body = _found_body(sheet, found, worst)
    picture = encode_png(outlines_picture(*sheet.drawings[worst], sheet.mesh, camera, body))
    reasons = () if found is None else tuple(view.reason for view in found.views)
    return SheetResult(views, seconds, note, reasons), picture


def _calibrated(sheet: DrawnSheet) -> Calibration:
    views = [view for view, _ in sheet.drawings]
    if sheet.given == "own":
        return find_cameras(views, sheet.mesh)
    return calibrate(views, "none" if sheet.given == "none" else None)


def _found_body(
    sheet: DrawnSheet, found: Calibration | None, view: int
) -> tuple[Camera | None, Mesh]:
    """Return the camera and the body to show what was found of a view.

    Without a mannequin of the drawn body, it is turned as was found, where it is in truth.
    """
    if found is None:
        return None, sheet.mesh
    camera = found.views[view].camera
    if sheet.given == "own":
        return camera, replace(sheet.mesh, vertices=found.mannequin)
    return replace(sheet.drawings[view][1], rotation=camera.rotation), sheet.mesh


def worst_view(views: Sequence[ViewError]) -> int:
    """Return the number of the view to look at: wrong but ok before the largest error."""
    return max(range(len(views)), key=lambda i: badness(views[i]))


def badness(view: ViewError) -> tuple[bool, float]:
    """Return what sorts views by how bad they are."""
    return view.raw > WRONG and view.verdict == "ok", view.raw


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


def _errors(found: Calibration, sheet: DrawnSheet) -> tuple[ViewError, ...]:
    return tuple(
        view_error(view.camera, truth.rotation, view.verdict)
        for view, (_, truth) in zip(found.views, sheet.drawings, strict=True)
    )
