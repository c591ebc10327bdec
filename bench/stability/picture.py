"""A drawing with the mannequin's outline where it was found and where it belongs."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import UInt8

from toonset.calib.outline.occluding_contour import silhouette_mask
from toonset.camera import Camera
from toonset.mesh import Mesh
from toonset.view import View

HEIGHT_PX = 220
FINE = 4  # outlines are traced at this multiple of a pixel
TRUE, FOUND = (0, 114, 178), (213, 94, 0)  # blue, vermilion: told apart by colour-blind eyes, too
FADED = 0.45  # of the drawing's own strength

Rgb = UInt8[np.ndarray, "height width 3"]


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
        _trace(picture, pixels, body, color, width)
    return np.asarray(picture)


def _trace(
    picture: Rgb, pixels: np.ndarray, body: Mesh, color: tuple[int, int, int], width: int
) -> None:
    height, wide = picture.shape[:2]
    faces = np.ascontiguousarray(body.faces, dtype=np.int32)
    mask = silhouette_mask(pixels * FINE, faces, (wide * FINE, height * FINE)).astype(np.uint8)
    loops, _ = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    bits = 4  # of a pixel's fraction; centres of fine pixels to OpenCV's integer centres
    fixed = [np.round(((loop + 0.5) / FINE - 0.5) * (1 << bits)).astype(np.int32) for loop in loops]
    cv2.polylines(picture, fixed, True, color, width, cv2.LINE_AA, bits)
