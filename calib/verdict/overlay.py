"""The overlay: every drawing with the mannequin's outline on it and what was found, for people."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw, ImageFont

from toonset.calib.outline.occluding_contour import silhouette_mask
from toonset.calib.result import Calibration, Verdict, ViewCalibration
from toonset.mesh import Mesh
from toonset.view import View

CELL_HEIGHT = 360  # pixels of a drawing in the overlay
CAPTION = 82
GAP = 14
COLUMNS = 8
FINE = 4  # outlines are traced at this multiple of a pixel
# distinguishable with colour-blind eyes; the verdict is written out as well
INK: dict[Verdict, tuple[int, int, int]] = {
    "ok": (0, 114, 178),
    "weak": (230, 130, 0),
    "ambiguous": (160, 60, 150),
    "failed": (200, 30, 20),
}


def draw_overlay(
    views: Sequence[View], mesh: Mesh | None, calibration: Calibration
) -> UInt8[np.ndarray, "height width 3"]:
    """Return the picture: drawings faded, captions, and outlines in the verdict's colour.

    Args:
        views: the drawings.
        mesh: the mannequin as it was fitted; None: none is traced.
        calibration: their cameras.
    """
    cells = [_cell(view, mesh, found) for view, found in zip(views, calibration.views, strict=True)]
    rows = [cells[i : i + COLUMNS] for i in range(0, len(cells), COLUMNS)]
    width = max(sum(c.shape[1] + GAP for c in row) for row in rows) + GAP
    picture = np.full((len(rows) * (CELL_HEIGHT + CAPTION + GAP) + GAP, width, 3), 255, np.uint8)
    for r, row in enumerate(rows):
        x, y = GAP, GAP + r * (CELL_HEIGHT + CAPTION + GAP)
        for cell in row:
            picture[y : y + cell.shape[0], x : x + cell.shape[1]] = cell
            x += cell.shape[1] + GAP
    return picture


def _cell(
    view: View, mesh: Mesh | None, found: ViewCalibration
) -> UInt8[np.ndarray, "height width 3"]:
    height, width = view.rgba.shape[:2]
    factor = CELL_HEIGHT / height
    drawn_wide = max(1, round(width * factor))
    cell_wide = max(drawn_wide, 150)
    left = (cell_wide - drawn_wide) // 2
    cell = np.full((CELL_HEIGHT + CAPTION, cell_wide, 3), 255, np.uint8)
    cell[:CELL_HEIGHT, left : left + drawn_wide] = _faded(view, (drawn_wide, CELL_HEIGHT))
    if mesh is not None:
        pixels = found.camera.project(mesh.vertices)[0] * (drawn_wide / width, factor) + (left, 0)
        _trace(cell, pixels, mesh, INK[found.verdict])
    return _captioned(cell, found)


def _faded(view: View, size_wh: tuple[int, int]) -> UInt8[np.ndarray, "height width 3"]:
    alpha = view.rgba[..., 3:].astype(np.float32) / 255
    over_white = view.rgba[..., :3] * alpha + 255 * (1 - alpha)
    smaller = size_wh[1] < view.rgba.shape[0]
    method = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
    resized = cv2.resize(over_white, size_wh, interpolation=method)
    return np.clip(255 - 0.55 * (255 - resized) + 0.5, 0, 255).astype(np.uint8)


def _trace(cell: np.ndarray, pixels: np.ndarray, mesh: Mesh, color: tuple[int, int, int]) -> None:
    size = (cell.shape[1] * FINE, CELL_HEIGHT * FINE)
    faces = np.ascontiguousarray(mesh.faces, dtype=np.int32)
    mask = silhouette_mask(pixels * FINE, faces, size).astype(np.uint8)
    loops, _ = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    # contour pixels are centres (+0.5 of a fine pixel); OpenCV draws at integer centres (-0.5)
    shift_bits = 4
    fixed = [
        np.round(((loop + 0.5) / FINE - 0.5) * (1 << shift_bits)).astype(np.int32) for loop in loops
    ]
    cv2.polylines(cell[:CELL_HEIGHT], fixed, True, color, 2, cv2.LINE_AA, shift_bits)


def _captioned(
    cell: UInt8[np.ndarray, "height width 3"], found: ViewCalibration
) -> UInt8[np.ndarray, "height width 3"]:
    image = Image.fromarray(cell)
    pen = ImageDraw.Draw(image)
    yaw, elevation, roll = (math.degrees(angle) for angle in found.camera.angles)
    sigmas = found.sigmas
    gray = (40, 40, 40)
    lines = [
        (f"{found.name[:-4]}  {found.verdict}", INK[found.verdict]),
        (f"yaw {round(yaw, 1) % 360:.1f}° ± {math.degrees(sigmas.yaw):.1f}°", gray),
        (f"elev. {elevation:.1f}° ± {math.degrees(sigmas.elevation):.1f}°", gray),
        (f"roll {roll:.1f}° ± {math.degrees(sigmas.roll):.1f}°", gray),
    ]
    for i, (text, color) in enumerate(lines):
        font = ImageFont.load_default(17 if i == 0 else 14)
        pen.text((6, CELL_HEIGHT + 2 + 19 * i), text, fill=color, font=font)
    return np.array(image)
