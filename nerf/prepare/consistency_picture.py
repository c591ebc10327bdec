"""The consistency report as one picture: drawings in grey, what no shared shape explains in red."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from toonset.dataset.bundle.scene import Frame
from toonset.nerf.prepare.consistency import Consistency, ViewReport

CELL = 300  # px a side of a view's cell
TEXT = 54  # px below it
COLUMNS = 4
WORST = 0.05  # of the picture's longer side: a miss that is painted fully red
PALE = 0.45  # how much of a drawing is left under the heat
FONT = cv2.FONT_HERSHEY_SIMPLEX


def consistency_picture(found: Consistency) -> UInt8[np.ndarray, "height width 3"]:
    """Return all views' heat maps with their numbers, RGB."""
    cells = [
        _cell(frame, heat, view, view.name in found.odd)
        for frame, heat, view in zip(found.frames, found.heat_px, found.views, strict=True)
    ]
    columns = min(COLUMNS, len(cells))
    blank = np.full_like(cells[0], 255)
    cells += [blank] * (-len(cells) % columns)
    rows = [np.concatenate(cells[i : i + columns], axis=1) for i in range(0, len(cells), columns)]
    return np.concatenate(rows)


def _cell(
    frame: Frame, heat: Float[np.ndarray, "height width"], view: ViewReport, odd: bool
) -> UInt8[np.ndarray, "height width 3"]:
    heated = _heated(frame, heat)
    height, width = heat.shape
    factor = CELL / max(height, width)
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    small = cv2.resize(heated, size, interpolation=cv2.INTER_AREA if factor < 1 else 1)
    cell = np.full((CELL + TEXT, CELL, 3), 255, dtype=np.uint8)
    top, left = (CELL - size[1]) // 2, (CELL - size[0]) // 2
    cell[top : top + size[1], left : left + size[0]] = small
    dx, dy = view.shift_px
    lines = (
        f"{view.name}  IoU {view.agreement[0]:.3f} > {view.agreement[1]:.3f}",
        f"shift {dx:+.1f} {dy:+.1f} px   size {100 * (view.scale - 1):+.1f} %",
        f"bend {view.bend_rms_px:.1f} px, at most {view.bend_most_px:.1f}",
    )
    ink = (190, 20, 20) if odd else (40, 40, 40)
    for row, line in enumerate(lines):
        place = (8, CELL + 14 + 16 * row)
        cv2.putText(cell, line, place, FONT, 0.4, ink, 1, cv2.LINE_AA)
    return cell


def _heated(
    frame: Frame, heat: Float[np.ndarray, "height width"]
) -> UInt8[np.ndarray, "height width 3"]:
    """Return the drawing in pale grey with its faults from yellow to red."""
    alpha = frame.rgba[..., 3:] / 255
    grey = (frame.rgba[..., :3] @ np.array([0.3, 0.6, 0.1]) / 255)[..., None]
    pale = alpha * (1 - PALE + PALE * grey) + (1 - alpha)
    strength = np.clip(heat / (WORST * max(heat.shape)), 0, 1)[..., None]
    color = np.concatenate([np.ones_like(strength), 0.85 * (1 - strength), 0 * strength], axis=-1)
    cover = np.clip(4 * strength, 0, 0.9)
    return ((pale * (1 - cover) + color * cover) * 255 + 0.5).astype(np.uint8)
