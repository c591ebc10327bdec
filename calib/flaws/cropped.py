"""Detect figures that are cropped: sides that end in a straight, opaque row or column.

At the picture's own edge everybody sees it. But a picture that was cut out of a larger one keeps
the cut when it is laid on a sheet, with paper beyond. There the drawing is opaque to the last
pixel, along a row or column, while a drawn outline is mixed with paper wherever it does not lie
between two pixels by chance (hard pixels end like this everywhere: only smooth drawings are looked
at). A flat sole may do so, too, as a whole figure may touch the picture's edge; so the mannequin
decides (`toonset.calib.flaws.cropped_evidence`): it ends at a sole and goes on beyond a cut.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from toonset.calib.outline.occluding_contour import Surface, mask_at
from toonset.calib.outline.pose import Pose, project
from toonset.calib.result import SIDES, Calibration, FlatSide, ViewCalibration
from toonset.camera import Camera
from toonset.dataset.bundle.calibration_schema import Side
from toonset.view import NO_ENDS, VISIBLE, View

OPPOSITE: dict[Side, Side] = {"bottom": "top", "top": "bottom", "left": "right", "right": "left"}

CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)
OPAQUE = 250  # alpha of a pixel that no paper shows through
SOFT = 0.2  # mixed pixels over the outline's length: of a smooth drawing
SHORTEST_PX = 3
INWARDS = 2  # rows: there a figure that ends roundly, between two pixels by chance, is far wider
BLUNT = 0.5  # times that width, at least, of what is cut off
LEAST_LENGTH = 0.02  # of the figure's height, along all of a side
MOST_LOST = 0.4  # of the figure's height: how far beyond a side is looked


def flat_sides(view: View) -> tuple[FlatSide, ...]:
    """Return the sides on which a drawing may have been cut off."""
    flats = tuple(_flat(view))
    touched = {flat.side for flat in flats if flat.at_edge}
    return tuple(f for f in flats if not f.at_edge or OPPOSITE[f.side] not in touched)


def _flat(view: View) -> Iterator[FlatSide]:
    alpha = view.rgba[..., 3]
    mixed = (alpha >= VISIBLE) & (alpha < OPAQUE)
    inner = cv2.erode(view.mask.view(np.uint8), CROSS, borderValue=0) > 0
    is_smooth = mixed.sum() >= SOFT * (view.mask & ~inner).sum()
    sides: tuple[tuple[Side, UInt8[np.ndarray, "rows columns"]], ...] = (
        ("bottom", alpha),
        ("right", alpha.T),
        ("top", alpha[::-1]),
        ("left", alpha.T[::-1]),
    )
    for side, turned in sides:
        last = int(np.flatnonzero((turned >= VISIBLE).any(axis=1))[-1])
        at_edge = last + 1 == len(turned)
        spans = _runs(turned[last] >= OPAQUE)
        if not at_edge:
            spans = _blunt(spans, turned[max(last - INWARDS, 0)] >= OPAQUE)
        long = sum(b - a for a, b in spans) >= LEAST_LENGTH * view.figure_box[3]
        if long and (at_edge or is_smooth):
            at = last + 1 if side in ("bottom", "right") else len(turned) - last - 1
            yield FlatSide(side, at, spans, at_edge)


def _blunt(
    spans: tuple[tuple[int, int], ...], inner: Bool[np.ndarray, " n"]
) -> tuple[tuple[int, int], ...]:
    """Return the spans that are about as wide as the figure is a little further in."""
    wide = _runs(inner)
    widths = [max((d - c for c, d in wide if c < b and d > a), default=0) for a, b in spans]
    return tuple(s for s, width in zip(spans, widths, strict=True) if s[1] - s[0] >= BLUNT * width)


def _runs(row: Bool[np.ndarray, " n"]) -> tuple[tuple[int, int], ...]:
    changes = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(np.int8), [0]])))
    runs = zip(changes[::2].tolist(), changes[1::2].tolist(), strict=True)
    return tuple((first, last) for first, last in runs if last - first >= SHORTEST_PX)


def beyond_px(flat: FlatSide, surface: Surface, pose: Pose, view: View) -> float:
    """Return how far the mannequin goes on beyond a flat side, the median along it.

    Args:
        flat: of the view.
        surface: the mannequin.
        pose: of its camera, pixels of the view.
        view: the drawing.
    """
    height, width = view.mask.shape
    pad = int(np.ceil(MOST_LOST * view.figure_box[3]))
    moved = replace(pose, shift=pose.shift + pad)
    mask = mask_at(surface, moved, (width + 2 * pad, height + 2 * pad))
    turned = mask if flat.axis == 1 else mask.T
    at = flat.at + pad
    outwards = turned[at:] if flat.side in ("bottom", "right") else turned[:at][::-1]
    along = np.concatenate([np.arange(*span) + pad for span in flat.spans])
    beyond = outwards[:pad, along]
    return float(np.median(np.where(beyond.all(axis=0), pad, beyond.argmin(axis=0))))


def overhang_px(side: Side, surface: Surface, pose: Pose, view: View) -> float:
    """Return how far the mannequin goes beyond the figure's outermost pixel on a side."""
    axis = SIDES.index(side) % 2
    x, y, width, height = view.figure_box
    first = (x, y)[axis] - view.box[axis]
    reach = project(pose, surface.vertices)[:, axis]
    if side in ("left", "top"):
        return float(first - reach.min())
    return float(reach.max() - first - (width, height)[axis])


def ending_at(view: View, flat: FlatSide) -> View:
    """Return the drawing, cut off at a side."""
    ends = list(view.ends)
    ends[SIDES.index(flat.side)] = float(flat.at)
    left, top, right, bottom = ends
    return replace(view, ends=(left, top, right, bottom))


def at_cuts(
    views: Sequence[View], calibration: Calibration
) -> tuple[tuple[View, ...], Calibration]:
    """Return drawings and cameras with every picture ending where its figure is cut off.

    What lies beyond a picture's edge is unknown to whoever reads it, paper within it is not.
    """
    pairs = [
        _cropped(view, fit, [cut.flat for cut in calibration.cuts if cut.view == view.name])
        for view, fit in zip(views, calibration.views, strict=True)
    ]
    shown, fits = zip(*pairs, strict=True)
    return shown, replace(calibration, views=fits)


def _cropped(
    view: View, fit: ViewCalibration, sides: Sequence[FlatSide]
) -> tuple[View, ViewCalibration]:
    if not sides:
        return view, fit
    rows, columns = view.mask.shape
    at: dict[Side, int] = {flat.side: flat.at for flat in sides}
    whole = (0, 0, columns, rows)
    left, top, right, bottom = (at.get(side, end) for side, end in zip(SIDES, whole, strict=True))
    x, y, _, _ = view.box
    size = (right - left, bottom - top)
    kept = replace(
        view, rgba=view.rgba[top:bottom, left:right], box=(x + left, y + top, *size), ends=NO_ENDS
    )

    def moved(camera: Camera) -> Camera:
        return camera.moved((left, top), size)

    others = tuple(replace(other, camera=moved(other.camera)) for other in fit.alternatives)
    return kept, replace(fit, camera=moved(fit.camera), twin=moved(fit.twin), alternatives=others)
