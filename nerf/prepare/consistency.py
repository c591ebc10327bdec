"""Report how well a sheet's drawings agree: which view is off, and where.

Per drawing: the shift and size that its outline asks for, its bend, and how well the shape that
all drawings share explains its mask; and a map of what no shared shape explains: how far a ray
through a figure's pixel misses the nearest point that all other drawings show as figure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.silhouettes.alignment import FEWEST_VIEWS
from toonset.dataset.silhouettes.displacement import ShiftAndScale
from toonset.dataset.silhouettes.mask import alpha_of, has_figure
from toonset.dataset.silhouettes.outlines import Outlines, outlines_of
from toonset.dataset.silhouettes.tangency import Placed, touch
from toonset.errors import BundleError
from toonset.nerf.prepare.prepare import aligned
from toonset.nerf.prepare.registration import Registration
from toonset.nerf.prepare.unwarp import Unwarping, Warp

UNEXPLAINED = 0.01  # of the figure's size: a ray that misses the shared shape by more is a fault
ODD = 0.03  # share of a figure that may still be so after shift, size and bend
CELL = 300  # px a side of a view's cell
TEXT = 54  # px below it
COLUMNS = 4
WORST = 0.05  # of the picture's longer side: a miss that is painted fully red
PALE = 0.45  # how much of a drawing is left under the heat
FONT = cv2.FONT_HERSHEY_SIMPLEX


@dataclass(frozen=True, eq=False)
class ViewReport:
    """Report of how one drawing fits the others.

    Attributes:
        name: of the picture.
        shift_px: it sits too far right and down by this, in the mean over its figure.
        scale: it is drawn so much larger than the others.
        bend_rms_px: how far it must be bent, over its figure, beside shift and size.
        bend_most_px: the longest of these displacements.
        agreement: intersection over union of its mask and the outline of the shared shape: as
            drawn, and after shift, size and bend are taken out.
        unexplained: share of the figure that no shared shape explains, before and after.
    """

    name: str
    shift_px: tuple[float, float]
    scale: float
    bend_rms_px: float
    bend_most_px: float
    agreement: tuple[float, float]
    unexplained: tuple[float, float]

    def to_json(self) -> dict[str, Any]:
        """Return the numbers, rounded to what they mean."""
        return {
            "name": self.name,
            "shift_px": [round(value, 2) for value in self.shift_px],
            "scale": round(self.scale, 4),
            "bend_rms_px": round(self.bend_rms_px, 2),
            "bend_most_px": round(self.bend_most_px, 2),
            "agreement_iou": [round(value, 4) for value in self.agreement],
            "unexplained_share": [round(value, 4) for value in self.unexplained],
        }


@dataclass(frozen=True, eq=False)
class Consistency:
    """Report of how well a sheet's drawings agree.

    Attributes:
        views: of the drawings that show a figure.
        frames: those drawings, as drawn.
        heat_px: per drawing (height, width) by how many pixels its ray misses the shared shape, 0
            outside of the figure; as drawn.
        registration: of all drawings of the scene.
        unwarping: of all drawings of the scene.
        odd: names of the drawings that no shift, size and bend reconciles with the others.
    """

    views: tuple[ViewReport, ...]
    frames: tuple[Frame, ...]
    heat_px: tuple[Float[np.ndarray, "height width"], ...]
    registration: Registration
    unwarping: Unwarping
    odd: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the report as plain numbers."""
        return {
            "schema": "toonset-consistency",
            "version": 1,
            "views": [view.to_json() for view in self.views],
            "odd": list(self.odd),
            "registration": self.registration.to_json(),
            "bends": self.unwarping.to_json(),
        }


def consistency_of(scene: Scene) -> Consistency:
    """Return how well the drawings of a scene agree.

    Raises:
        BundleError: fewer than FEWEST_VIEWS drawings show a figure, or the cameras do not belong
            together.
    """
    drawn = [i for i, frame in enumerate(scene.frames) if has_figure(frame)]
    if len(drawn) < FEWEST_VIEWS:
        raise BundleError(
            f"{scene.name}: {len(drawn)} picture(s) with an opaque figure; at least "
            f"{FEWEST_VIEWS} are needed to say whether they agree"
        )
    fitted, registration, unwarping = aligned(scene)
    assert registration is not None
    assert unwarping is not None
    before, after = (_missed([s.frames[i] for i in drawn]) for s in (scene, fitted))
    reports = [
        _report(scene.frames[i], fitted.frames[i], unwarping.warps[i], before[n], after[n])
        for n, i in enumerate(drawn)
    ]
    odd = tuple(report.name for report in reports if report.unexplained[1] > ODD)
    frames = tuple(scene.frames[i] for i in drawn)
    return Consistency(tuple(reports), frames, tuple(before), registration, unwarping, odd)


def _report(
    drawn: Frame,
    fitted: Frame,
    warp: Warp,
    before: Float[np.ndarray, "height width"],
    after: Float[np.ndarray, "height width"],
) -> ViewReport:
    figures = [alpha_of(frame) >= 0.5 for frame in (drawn, fitted)]
    pixels = drawn.camera.pixel_grid()[figures[0]]
    ratio = fitted.camera.scale / drawn.camera.scale
    place = fitted.camera.center + ratio * (pixels - drawn.camera.center)
    shift, growth, bend = _parts(pixels, place - pixels + warp.at(place))
    length = np.linalg.norm(bend, axis=-1)
    return ViewReport(
        name=drawn.name,
        shift_px=(float(shift[0]), float(shift[1])),
        scale=1 + growth,
        bend_rms_px=float(np.sqrt((length**2).mean())),
        bend_most_px=float(length.max()),
        agreement=(_explained(before, figures[0]), _explained(after, figures[1])),
        unexplained=(_share(before, figures[0]), _share(after, figures[1])),
    )


def _parts(
    pixels: Float[np.ndarray, "n 2"], moves: Float[np.ndarray, "n 2"]
) -> tuple[Float[np.ndarray, " 2"], float, Float[np.ndarray, "n 2"]]:
    """Return the shift and the growth that are nearest to displacements, and what they leave."""
    away, shift = pixels - pixels.mean(axis=0), moves.mean(axis=0)
    growth = float((away * moves).sum() / max(1.0, (away**2).sum()))
    return shift, growth, moves - shift - growth * away


def _explained(
    missed: Float[np.ndarray, "height width"], figure: Bool[np.ndarray, "height width"]
) -> float:
    """Return the IoU of a mask and the shared shape's outline, which never leaves the mask."""
    return float(((missed < 0.5) & figure).sum() / figure.sum())


def _share(
    missed: Float[np.ndarray, "height width"], figure: Bool[np.ndarray, "height width"]
) -> float:
    rows, columns = (np.flatnonzero(figure.any(axis=axis)) for axis in (1, 0))
    size = max(rows[-1] - rows[0], columns[-1] - columns[0]) + 1
    return float((missed[figure] > max(1.0, UNEXPLAINED * size)).mean())


def _missed(frames: Sequence[Frame]) -> list[Float[np.ndarray, "height width"]]:
    """Return per drawing by how many of its pixels each figure pixel's ray misses the others."""
    outlines = outlines_of([f.camera for f in frames], [alpha_of(f) for f in frames])
    ratio = outlines.ratio(frames[0].camera)
    moves = ShiftAndScale.expected()
    placed = Placed.of(outlines, moves, np.zeros((len(frames), len(moves.covariance))))
    return [_missed_in(placed, view, outlines, frame, ratio) for view, frame in enumerate(frames)]


def _missed_in(
    placed: Placed, view: int, outlines: Outlines, frame: Frame, ratio: float
) -> Float[np.ndarray, "height width"]:
    outline = outlines.views[view]
    inside = outline.distance[0] > 0
    found = touch(placed, view, outline.camera.pixel_grid()[inside])
    small = np.zeros(inside.shape, dtype=np.float32)
    small[inside] = found.apart / ratio
    size = frame.camera.size_wh
    large = small if outline.camera.size_wh == size else cv2.resize(small, size)
    return np.where(alpha_of(frame) >= 0.5, large, 0)


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
