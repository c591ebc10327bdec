"""Draw the overlay: every drawing with an outline over it and its camera in words.

The outline is the mannequin's, or without one that of the hull of all other drawings: where they
let a body be.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Bool, UInt8
from PIL import Image, ImageDraw, ImageFont

from toonset.calib.result import Calibration, ViewCalibration
from toonset.dataset.bundle.calibration_schema import Verdict
from toonset.dataset.mesh.rasterize import silhouette_mask
from toonset.dataset.silhouettes.hull_rays import Silhouette, depth_in_hull
from toonset.mesh import Mesh
from toonset.view import View

CELL_HEIGHT = 360  # pixels of a drawing in the overlay
CAPTION, FOOT = 82, 26
FONT_PX, GRAY = 14, (40, 40, 40)
OF_MANNEQUIN = "Lines: the mannequin's outline from each camera."
OF_HULL = "Lines: the outline that the other drawings leave room for (their visual hull)."
GAP = 14
COLUMNS = 8
LEAST_WIDTH = 150  # of a cell: its caption's
HULL_ROWS = 100  # of rays through a drawing
FINE = 4  # outlines are traced at this multiple of a pixel
# distinguishable with colour-blind eyes; the verdict is written out as well
INK: dict[Verdict, tuple[int, int, int]] = {
    "ok": (0, 114, 178),
    "weak": (230, 130, 0),
    "ambiguous": (160, 60, 150),
    "failed": (200, 30, 20),
}

Body = Bool[np.ndarray, "height width"]  # what is traced on a cell's drawing, FINE times as large


def draw_overlay(
    views: Sequence[View], mesh: Mesh | None, calibration: Calibration
) -> UInt8[np.ndarray, "height width 3"]:
    """Return the picture: drawings faded, captions, and outlines in the verdict's colour.

    Args:
        views: the drawings.
        mesh: the mannequin as it was fitted; None: the hull is traced.
        calibration: their cameras.
    """
    pairs = list(zip(views, calibration.views, strict=True))
    legend = ""
    if mesh is not None:
        legend = OF_MANNEQUIN
        bodies = [_projected(view, found, mesh) for view, found in pairs]
    elif len(views) > 1:
        legend = OF_HULL
        silhouettes = [Silhouette(view, found.camera) for view, found in pairs]
        bodies = [_hull(view, silhouettes, i) for i, view in enumerate(views)]
    else:
        bodies = [np.zeros((1, 1), dtype=bool)]
    cells = [_cell(view, found, body) for (view, found), body in zip(pairs, bodies, strict=True)]
    rows = [cells[i : i + COLUMNS] for i in range(0, len(cells), COLUMNS)]
    font = ImageFont.load_default(FONT_PX)
    width = max(sum(c.shape[1] + GAP for c in row) for row in rows) + GAP
    width = max(width, math.ceil(font.getlength(legend)) + 2 * GAP)
    height = len(rows) * (CELL_HEIGHT + CAPTION + GAP) + GAP
    picture = np.full((height + (FOOT if legend else 0), width, 3), 255, np.uint8)
    for r, row in enumerate(rows):
        x, y = GAP, GAP + r * (CELL_HEIGHT + CAPTION + GAP)
        for cell in row:
            picture[y : y + cell.shape[0], x : x + cell.shape[1]] = cell
            x += cell.shape[1] + GAP
    image = Image.fromarray(picture)
    ImageDraw.Draw(image).text((GAP, height), legend, fill=GRAY, font=font)
    return np.asarray(image)


def _cell(view: View, found: ViewCalibration, body: Body) -> UInt8[np.ndarray, "height width 3"]:
    drawn_wide, side = _widths(view)
    cell = np.full((CELL_HEIGHT + CAPTION, drawn_wide + 2 * side, 3), 255, np.uint8)
    cell[:CELL_HEIGHT, side : side + drawn_wide] = _faded(view, (drawn_wide, CELL_HEIGHT))
    _trace(cell, body, INK[found.verdict])
    return _captioned(cell, found)


def _widths(view: View) -> tuple[int, int]:
    """Return the width of a drawing in its cell, and the room at either side."""
    height, width = view.rgba.shape[:2]
    drawn_wide = max(1, round(width * CELL_HEIGHT / height))
    return drawn_wide, max(0, (LEAST_WIDTH - drawn_wide + 1) // 2)


def _projected(view: View, found: ViewCalibration, mesh: Mesh) -> Body:
    """Return the mannequin's silhouette."""
    drawn_wide, side = _widths(view)
    height, width = view.rgba.shape[:2]
    factor = (drawn_wide / width, CELL_HEIGHT / height)
    pixels = found.camera.project(mesh.vertices)[0] * factor + (side, 0)
    faces = np.ascontiguousarray(mesh.faces, dtype=np.int32)
    size = ((drawn_wide + 2 * side) * FINE, CELL_HEIGHT * FINE)
    return silhouette_mask(pixels * FINE, faces, size)


def _hull(view: View, silhouettes: Sequence[Silhouette], i: int) -> Body:
    """Return the silhouette of the other drawings' hull, as far as the picture goes."""
    drawn_wide, side = _widths(view)
    height, width = view.rgba.shape[:2]
    step = max(1.0, height / HULL_ROWS)
    columns, rows = (np.arange(step / 2, length, step) for length in (width, height))
    nodes = np.stack(np.meshgrid(columns, rows), axis=-1)
    depth = depth_in_hull(silhouettes, i, nodes.reshape(-1, 2)).reshape(nodes.shape[:2])
    u, v = (
        ((np.arange(length * FINE, dtype=np.float32) + 0.5) * size / length / FINE / step - 0.5)
        for length, size in ((drawn_wide, width), (CELL_HEIGHT, height))
    )
    x, y = np.meshgrid(u, v)
    fine = cv2.remap(
        depth.astype(np.float32), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.pad(fine > 0, ((0, 0), (side * FINE, side * FINE)))


def _faded(view: View, size_wh: tuple[int, int]) -> UInt8[np.ndarray, "height width 3"]:
    alpha = view.rgba[..., 3:].astype(np.float32) / 255
    over_white = view.rgba[..., :3] * alpha + 255 * (1 - alpha)
    smaller = size_wh[1] < view.rgba.shape[0]
    method = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
    resized = cv2.resize(over_white, size_wh, interpolation=method)
    return np.clip(255 - 0.55 * (255 - resized) + 0.5, 0, 255).astype(np.uint8)


def _trace(cell: np.ndarray, body: Body, color: tuple[int, int, int]) -> None:
    loops, _ = cv2.findContours(body.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
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
    lines = [
        (f"{found.name[:-4]}  {found.verdict}", INK[found.verdict]),
        (f"yaw {round(yaw, 1) % 360:.1f}° ± {math.degrees(sigmas.yaw):.1f}°", GRAY),
        (f"elev. {round(elevation, 1) + 0.0:.1f}° ± {math.degrees(sigmas.elevation):.1f}°", GRAY),
        (f"roll {round(roll, 1) + 0.0:.1f}° ± {math.degrees(sigmas.roll):.1f}°", GRAY),
    ]
    for i, (text, color) in enumerate(lines):
        font = ImageFont.load_default(17 if i == 0 else FONT_PX)
        pen.text((6, CELL_HEIGHT + 2 + 19 * i), text, fill=color, font=font)
    return np.array(image)
