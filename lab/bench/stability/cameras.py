"""Trying a calibration: every view's error and verdict, and a picture of the worst view.

A refusal and an exception are results, too: all its views are as wrong as can be.
"""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import UInt8

from lab.bench.calib.figures import SUCCESS, WRONG, view_error
from lab.bench.stability.sheets import DrawnSheet
from lab.bench.stability.trials import CRASHED, Drawer, Kind, Trial, Tried
from toonset.calib.calibrate import calibrate
from toonset.calib.find_cameras import find_cameras
from toonset.calib.result import Calibration
from toonset.camera import Camera
from toonset.dataset.images.picture import encode_png
from toonset.dataset.mesh.rasterize import silhouette_mask
from toonset.errors import ToonsetError
from toonset.mesh import Mesh
from toonset.options import Body
from toonset.view import View

HEIGHT_PX = 220
FINE = 4  # outlines are traced at this multiple of a pixel
TRUE, FOUND = (0, 114, 178), (213, 94, 0)  # blue, vermilion: told apart by colour-blind eyes, too
FADED = 0.45  # of the drawing's own strength
WORST_DEG = 180.0

Rgb = UInt8[np.ndarray, "height width 3"]


def try_cameras(draw: Drawer, seed: int) -> Tried:
    """Return how calibration did on a sheet, a trial per view, and a PNG of its worst view."""
    sheet: DrawnSheet = draw()
    found = None
    try:
        found = _calibrated(sheet)
        trials = tuple(
            Trial(seed, _error_deg(view.camera, truth), view.verdict, view.reason)
            for view, (_, truth) in zip(found.views, sheet.drawings, strict=True)
        )
    except ToonsetError as error:
        trials = (Trial(seed, WORST_DEG, "failed", str(error)),) * len(sheet.drawings)
    except Exception as error:
        words = f"{type(error).__name__}: {error}"
        trials = (Trial(seed, WORST_DEG, CRASHED, words),) * len(sheet.drawings)
    wrong = math.degrees(WRONG)
    badness = [(one.value > wrong and one.voice == "ok", one.value) for one in trials]
    worst = max(range(len(trials)), key=lambda i: badness[i])
    camera, body = None, sheet.mesh
    if found is not None and sheet.given == "own":
        camera, body = found.views[worst].camera, replace(body, vertices=found.mannequin)
    picture = outlines_picture(*sheet.drawings[worst], sheet.mesh, camera, body)
    return trials, encode_png(picture)


def _error_deg(camera: Camera, truth: Camera) -> float:
    return math.degrees(view_error(camera, truth.rotation, "").raw)


def _calibrated(sheet: DrawnSheet) -> Calibration:
    views = [view for view, _ in sheet.drawings]
    if sheet.given == "own":
        return find_cameras(views, sheet.mesh)
    return calibrate(views, Body.NONE if sheet.given == "none" else Body.DEFAULT)


def outlines_picture(
    view: View, truth: Camera, mannequin: Mesh, found: Camera | None, bent: Mesh
) -> Rgb:
    """Return the faded drawing, the true outline in blue, the found one in vermilion over it.

    Args:
        view: the drawing.
        truth: its camera.
        mannequin: that it was calibrated with.
        found: the camera that was found; None: none was.
        bent: the mannequin as calibration fitted its proportions.
    """
    factor = HEIGHT_PX / view.rgba.shape[0]
    size_wh = (max(1, round(view.rgba.shape[1] * factor)), HEIGHT_PX)
    alpha = FADED * view.rgba[..., 3:].astype(np.float64) / 255
    over_white = (view.rgba[..., :3] * alpha + 255 * (1 - alpha)).astype(np.uint8)
    way = cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR
    picture = cv2.resize(over_white, size_wh, interpolation=way)
    cameras = [(truth, mannequin, TRUE, 3)]
    if found is not None:
        cameras.append((found, bent, FOUND, 2))
    for camera, body, color, width in cameras:
        pixels = camera.project(body.vertices)[0] * (size_wh[0] / view.rgba.shape[1], factor)
        faces = np.ascontiguousarray(body.faces, dtype=np.int32)
        fine_wh = (size_wh[0] * FINE, size_wh[1] * FINE)
        mask = silhouette_mask(pixels * FINE, faces, fine_wh).astype(np.uint8)
        loops, _ = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        fixed = [np.round(((loop + 0.5) / FINE - 0.5) * 16).astype(np.int32) for loop in loops]
        cv2.polylines(picture, fixed, True, color, width, cv2.LINE_AA, 4)  # bits of a fraction
    return np.asarray(picture)


CALIBRATION = Kind(
    *("calibration", "views", "rotation error", "deg"),
    *(math.degrees(SUCCESS), math.degrees(WRONG), WORST_DEG),
    *(("ok",), try_cameras),
    rule="A view is fine within 5 degrees of the truth and has failed beyond 15; it is announced "
    "if its verdict is not ok.",
    pictures="the worst view of a step, its mannequin's outline as it is in blue, as it was found "
    "in vermilion.",
    logarithmic=True,
    many=True,
)
