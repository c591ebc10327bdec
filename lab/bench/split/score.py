"""How well a sheet was split.

A box is right if all its sides lie within 2 px of the true ones or the two overlap by IoU >= 0.97.
Both are drawn around half coverage, and again around any coverage: faint rims may be in or out. A
sheet is right if it has the right number of figures, in the right order, each with a right box. A
wrong sheet is announced if the method warns, or shows every figure that it misses as left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lab.bench.split.cases import Drawn, SplitCase, drawn_at
from lab.bench.split.methods import Found
from toonset.view import Box

NEAR_PX = 2
NEAR_IOU = 0.97
HALF = 128
COVERED = 0.5  # of a missed figure's box that something left out must cover to show it


@dataclass(frozen=True)
class Score:
    """One sheet, one method.

    Attributes:
        fault: "" if it is right, else "number", "order" or "boxes".
        ious: per true figure, overlap of its mask with the best found one's at half coverage.
        announced: it is wrong and the method says so, or shows what it left out.
        warned: the method warned, rightly or not.
        seconds: of processor time.
        megapixels: of the sheet.
    """

    fault: str
    ious: tuple[float, ...]
    announced: bool
    warned: bool
    seconds: float
    megapixels: float


def score(case: SplitCase, found: Found) -> Score:
    """Return how well a sheet was split."""
    fault = _fault(case.figures, found.figures)
    missed = [t for t in case.figures if not any(same_box(t, f) for f in found.figures)]
    shown = bool(missed) and all(_is_shown(figure.box, found.left_out) for figure in missed)
    return Score(
        fault,
        tuple(_best_iou(figure, found.figures) for figure in case.figures),
        bool(fault) and (found.warned or shown),
        found.warned,
        found.seconds,
        case.rgba.shape[0] * case.rgba.shape[1] / 1e6,
    )


def same_box(true: Drawn, found: Drawn) -> bool:
    """Return whether a found figure's box is right, at half or at any coverage."""
    return _close(true.box, found.box) or _close(_half_box(true), _half_box(found))


def mask_iou(a: Drawn, b: Drawn) -> float:
    """Return intersection over union of two figures' masks at half coverage."""
    left, top, width, height = _common(a.box, b.box)
    both = 0
    if width > 0 and height > 0:
        ours, theirs = (
            d.alpha[top - d.box[1] : top - d.box[1] + height, left - d.box[0] :][:, :width] >= HALF
            for d in (a, b)
        )
        both = int((ours & theirs).sum())
    return both / max(int((a.alpha >= HALF).sum() + (b.alpha >= HALF).sum()) - both, 1)


def _fault(true: Sequence[Drawn], found: Sequence[Drawn]) -> str:
    if len(true) != len(found):
        return "number"
    if all(same_box(t, f) for t, f in zip(true, found, strict=True)):
        return ""
    return "order" if all(any(same_box(t, f) for f in found) for t in true) else "boxes"


def _close(a: Box, b: Box) -> bool:
    sides_a, sides_b = (np.array((x, y, x + w, y + h)) for x, y, w, h in (a, b))
    if np.abs(sides_a - sides_b).max() <= NEAR_PX:
        return True
    _, _, width, height = _common(a, b)
    both = max(width, 0) * max(height, 0)
    return both >= NEAR_IOU * (a[2] * a[3] + b[2] * b[3] - both)


def _half_box(figure: Drawn) -> Box:
    half = np.where(figure.alpha >= HALF, figure.alpha, np.uint8(0))
    return drawn_at(half, *figure.box[:2]).box if half.any() else figure.box


def _best_iou(true: Drawn, found: Sequence[Drawn]) -> float:
    return max((mask_iou(true, figure) for figure in found), default=0.0)


def _is_shown(box: Box, left_out: Sequence[Box]) -> bool:
    areas = [max(w, 0) * max(h, 0) for _, _, w, h in (_common(box, other) for other in left_out)]
    return max(areas, default=0) >= COVERED * box[2] * box[3]


def _common(a: Box, b: Box) -> Box:
    """Return the intersection; its width or height is below 1 where there is none."""
    left, top = max(a[0], b[0]), max(a[1], b[1])
    right, bottom = min(a[0] + a[2], b[0] + b[2]), min(a[1] + a[3], b[1] + b[3])
    return left, top, right - left, bottom - top
