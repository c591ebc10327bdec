"""Draw one sheet with its figures coloured, outlined and numbered.

All but the figures is faded towards the background. Neighbouring figures have different colours,
so that a part that went to the wrong one shows. What was left out has an orange box with its kind.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from toonset.dataset.split.beside_views import LeftOut
from toonset.dataset.split_folder.tags import Corners, Costs, Line, Rgb, draw_tag
from toonset.raster import dilate
from toonset.view import View

WIDEST, HIGHEST = 2400, 3200  # pixels of a sheet in the overlay
CELL_HEIGHT = 420  # of one sheet among several
ENLARGED = 1600  # pixels: a small sheet is enlarged to at most this height
LARGEST_ZOOM = 8  # of a sprite
MARGIN, HEAD = 20, 104  # pixels round a sheet; above it, where the tags of its first row fit
OUTLINE = 2  # pixels, of the line along a mask
FADE = 0.6  # of what is not a figure, towards the background
CHECK_PX = 12  # of the chequers that stand for see-through
# tell apart with colour-blind eyes: blue, green, purple; orange is for what was left out
FIGURES: tuple[Rgb, ...] = ((0, 90, 200), (0, 135, 90), (150, 40, 160))
LEFT_OUT: Rgb = (215, 95, 0)
MOST_KINDS = 24  # the largest left-out things have their kind beside them; more would be clutter
WHITE: Rgb = (255, 255, 255)


@dataclass(frozen=True, eq=False)
class Panel:
    """One sheet of the overlay.

    Attributes:
        title: written below it.
        rgba: the sheet.
        background: its colour; None where it is transparent.
        views: what was cut from it.
        labels: one per view; "" for none.
        left_out: what was seen in it but is not a view.
    """

    title: str
    rgba: UInt8[np.ndarray, "height width 4"]
    background: Rgb | None
    views: tuple[View, ...]
    labels: tuple[str, ...]
    left_out: tuple[LeftOut, ...] = ()


def draw_panel(panel: Panel, *, alone: bool) -> UInt8[np.ndarray, "height width 3"]:
    """Return a sheet with what was found on it, larger where it is the only one.

    Boxes go behind the figures and tags beside them, so that nothing drawn is hidden.
    """
    zoom = _zoom(panel, alone=alone)
    ground, sheet = _painted(panel, zoom)
    picture, whole = _framed(ground), _framed(sheet)
    figures = [_scaled(view, zoom, sheet.shape[:2]) for view in panel.views]
    others = [_moved(_corners(thing.box, zoom), 2) for thing in panel.left_out]
    colors = [FIGURES[number % len(FIGURES)] for number in range(len(figures))]
    for box in others:
        _rectangle(picture, box, LEFT_OUT)
    for view, color in zip(panel.views, colors, strict=True):
        _rectangle(picture, _moved(_corners(view.figure_box, zoom), 2), color)
    for (left, top, right, bottom), mask in figures:
        picture[top:bottom, left:right][mask] = whole[top:bottom, left:right][mask]
    for (box, mask), color in zip(figures, colors, strict=True):
        _outline(picture, box, mask, color)
    _write_tags(picture, panel, figures, others)
    return picture


def _zoom(panel: Panel, *, alone: bool) -> float:
    """Return the size of a sheet in the overlay relative to its own; above 1 it is whole."""
    height, width = panel.rgba.shape[:2]
    highest = HIGHEST if alone else CELL_HEIGHT
    if width > WIDEST or height > highest:
        return min(WIDEST / width, highest / height)
    room = min(WIDEST // width, (ENLARGED if alone else CELL_HEIGHT) // height)
    return float(np.clip(room, 1, LARGEST_ZOOM))


def _painted(panel: Panel, zoom: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the sheet faded towards its background, and the sheet itself, enlarged alike."""
    rgba = panel.rgba
    if (rgba[..., 3] < 255).any():
        rgba = rgba.copy()
        for channel in range(3):  # colours under full transparency are anything
            rgba[..., channel] = cv2.multiply(rgba[..., channel], rgba[..., 3], scale=1 / 255)
    size = max(1, round(rgba.shape[1] * zoom)), max(1, round(rgba.shape[0] * zoom))
    method = cv2.INTER_AREA if zoom < 1 else cv2.INTER_NEAREST
    small = cv2.resize(rgba, size, interpolation=method)
    paper = _paper(panel, size, small)
    alpha = small[..., 3:] / np.float32(255)
    premultiplied = small[..., :3] if rgba is not panel.rgba else small[..., :3] * alpha
    sheet = premultiplied + (1 - alpha) * paper
    faded = sheet + FADE * (paper - sheet)
    return np.rint(faded).astype(np.uint8), np.rint(sheet).astype(np.uint8)


def _paper(panel: Panel, size_wh: tuple[int, int], small: np.ndarray) -> np.ndarray:
    """Return what lies under the figures: the background's colour, or contrasting chequers."""
    width, height = size_wh
    if panel.background is not None:
        return np.broadcast_to(np.array(panel.background, np.float32), (height, width, 3))
    opaque = small[small[..., 3] >= 128]
    is_dark = len(opaque) > 0 and float(opaque[:, :3].mean()) < 128
    light, shade = (245, 225) if is_dark else (90, 70)
    rows, columns = np.indices((height, width)) // CHECK_PX
    chequers = np.where((rows + columns) % 2, shade, light).astype(np.float32)
    return np.repeat(chequers[..., None], 3, axis=2)


def _framed(ground: np.ndarray) -> np.ndarray:
    """Return the sheet with room round it in its border's colour."""
    border = np.concatenate([ground[0], ground[-1], ground[:, 0], ground[:, -1]])
    room = np.median(border, axis=0).round().astype(np.uint8)
    height, width = ground.shape[:2]
    framed = np.empty((height + HEAD + MARGIN, width + 2 * MARGIN, 3), np.uint8)
    framed[:] = room
    framed[HEAD : HEAD + height, MARGIN : MARGIN + width] = ground
    return framed


def _corners(box: Sequence[int], zoom: float) -> Corners:
    """Return the corners of a box in the scaled sheet."""
    x, y, width, height = box
    left, top = round(x * zoom), round(y * zoom)
    right, bottom = round((x + width) * zoom), round((y + height) * zoom)
    return left, top, max(right, left + 1), max(bottom, top + 1)


def _moved(box: Corners, grown: int = 0) -> Corners:
    """Return corners in the framed sheet, some pixels farther out."""
    left, top, right, bottom = box
    return (
        left + MARGIN - grown,
        top + HEAD - grown,
        right + MARGIN + grown,
        bottom + HEAD + grown,
    )


def _scaled(
    view: View, zoom: float, shape: tuple[int, ...]
) -> tuple[Corners, Bool[np.ndarray, "_ _"]]:
    """Return a view's corners in the framed sheet and its mask there."""
    left, top, right, bottom = _corners(view.box, zoom)
    method = cv2.INTER_AREA if zoom < 1 else cv2.INTER_NEAREST
    coverage = cv2.resize(
        view.mask.astype(np.float32), (right - left, bottom - top), interpolation=method
    )
    right, bottom = min(right, shape[1]), min(bottom, shape[0])
    return _moved((left, top, right, bottom)), coverage[: bottom - top, : right - left] >= 0.5


def _outline(picture: np.ndarray, box: Corners, mask: Bool[np.ndarray, "_ _"], color: Rgb) -> None:
    """Draw a line along the outside of a mask, white beyond it so that it shows on any ground."""
    around = OUTLINE + 1
    inside = np.pad(mask, around)
    line = dilate(inside, OUTLINE)
    halo = dilate(line)
    left, top, right, bottom = box
    window = picture[top - around : bottom + around, left - around : right + around]
    window[(halo > line)] = WHITE
    window[(line > inside)] = color


def _rectangle(picture: np.ndarray, box: Corners, color: Rgb) -> None:
    left, top, right, bottom = box
    for ink, thick in ((WHITE, 3), (color, 1)):
        cv2.rectangle(picture, (left, top), (right - 1, bottom - 1), ink, thick)


def _write_tags(
    picture: np.ndarray,
    panel: Panel,
    figures: Sequence[tuple[Corners, np.ndarray]],
    others: Sequence[Corners],
) -> None:
    """Number the figures, and name what was left out where there is room for it."""
    costs = Costs(*picture.shape[:2])
    for box, thing in zip(others, panel.left_out, strict=True):
        if thing.kind != "frame":  # lines across the sheet may well be written on
            costs.add_thing(box)
    for box, mask in figures:
        costs.add_figure(box, mask)
    for number, (box, _) in enumerate(figures):
        layouts = _layouts(panel.views[number], panel.labels[number])
        draw_tag(picture, costs, box, layouts, FIGURES[number % len(FIGURES)])
    named = sorted(zip(others, panel.left_out, strict=True), key=lambda pair: -_area(pair[0]))
    for box, thing in named[:MOST_KINDS]:
        draw_tag(picture, costs, box, [(Line(thing.kind, 15),)], LEFT_OUT, must=False)


def _area(box: Corners) -> int:
    return (box[2] - box[0]) * (box[3] - box[1])


def _layouts(view: View, label: str) -> list[tuple[Line, ...]]:
    """Return what a view's tag may say, the fullest first."""
    number = Line(str(int(view.name[:-4])), 28)
    size = "{} x {} px".format(*view.figure_box[2:])
    line = f"line {view.line_width_px:.1f} px" if view.line_width_px else "no line"
    named = [Line(label, 18)] if label else []
    return [
        (number, *named, Line(f"{size}, {line}", 16)),
        (number, *named, Line(size, 16), Line(line, 16)),
        (number, *named),
        (number,),
    ]
