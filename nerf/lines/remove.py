"""Drawings without their contour lines, and how those lines were drawn.

A contour line is no paint: it lies where the viewer's direction touches the figure, so it moves
over the surface from view to view. A mouth or a brow stays where it is. What lies under a contour
gets the colour and label of the nearest pixel beside it; the silhouette is kept, for the line
belongs to the figure. A stroke counts as contour where something else explains a line:

    outline        the figure's rim
    depth jump     the silhouettes' common hull steps back there
    colour border  the two colours beside it have a line between them nearly everywhere

All other strokes are drawn features and stay. Doubt keeps a stroke.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, UInt8

from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.lines.explain import Hints, Pairs, depth_hints, lined_pairs, on_borders
from toonset.nerf.lines.nearest import distance_to, nearest, parts
from toonset.nerf.lines.strokes import (
    FEWEST_OUTLINED,
    Lines,
    Strokes,
    drawn_by_pen,
    ink_color,
    lines_of,
    mean_width,
    outline_width,
    rims_px,
    strokes_of,
    strokes_px,
)
from toonset.palette.pixels.labels import UNLABELLED

EXPLAINED = 0.5  # of a stroke's pixels, for the stroke to be a contour
INKED = 0.5  # of the hull's depth jumps, for the sheet to draw lines there
OPAQUE = 250
BREAK_PX = 2  # between a stroke and the outline that it begins at


@dataclass(frozen=True)
class InkStyle:
    """How a sheet's contour lines are drawn.

    Attributes:
        rgb: the ink, sRGB.
        outline_px: width of the line along the silhouette, pixels of the drawings.
        inner_px: width of the lines within the figure, pixels of the drawings.
        views_px: width of the outline in every view, 0 where there is none.
        px_per_unit: pixels of the drawings per world unit.
        jump: smallest step in depth that is drawn, world units; None: they are not drawn.
        borders: pairs of palette labels, smaller first, with a line between them.
    """

    rgb: tuple[int, int, int]
    outline_px: float
    inner_px: float
    views_px: tuple[float, ...]
    px_per_unit: float
    jump: float | None
    borders: Pairs


def without_ink(scene: Scene, as_drawn: Scene | None = None) -> tuple[Scene, InkStyle | None]:
    """Return the scene with paint under its contour lines, and the lines' style.

    Alpha is kept. A scene without outlines is returned as it is, with None.

    Args:
        scene: posed drawings of one character; colour borders are known only with labels.
        as_drawn: the same before drawings were bent, if they were: bending blurs outlines, which
            then look up to five times as wide.

    Raises:
        BundleError: the views share no volume.
    """
    widths = [outline_width(frame.rgba) for frame in (as_drawn or scene).frames]
    outlined = [width for width in widths if width > 0]
    if not outlined or len(outlined) < FEWEST_OUTLINED * len(widths):
        return scene, None
    width = float(np.median(outlined))
    lines = [lines_of(frame.rgba, width) for frame in scene.frames]
    hints, jump = depth_hints(scene, width)
    pairs = zip(scene.frames, lines, strict=True)
    ink = ink_color(frame.rgba[line.rim][:, :3] for frame, line in pairs)
    drawings = [_read(*each, ink) for each in zip(scene.frames, lines, hints, strict=True)]
    style = InkStyle(
        rgb=ink,
        outline_px=_width_px(drawings, [np.zeros_like(line.inner) for line in lines], ink),
        inner_px=0.0,
        views_px=tuple(widths),
        px_per_unit=float(np.median([frame.camera.scale for frame in scene.frames])),
        jump=jump if _inked_share(drawings) >= INKED else None,
        borders=lined_pairs([d.bare for d in drawings], [d.pen for d in drawings], lines, hints),
    )
    contours = [_contour(drawing, style.borders) for drawing in drawings]
    frames = tuple(_cleaned(*each) for each in zip(scene.frames, lines, contours, strict=True))
    inner = _width_px(drawings, contours, ink) or style.outline_px
    return replace(scene, frames=frames), replace(style, inner_px=inner)


@dataclass(frozen=True, eq=False)
class _Drawing:
    """A frame; the same with paint under all its lines; its lines; those of the outline's pen."""

    frame: Frame
    bare: Frame
    lines: Lines
    pen: Strokes
    hints: Hints


def _read(frame: Frame, lines: Lines, hints: Hints, ink: tuple[int, int, int]) -> _Drawing:
    bare = _cleaned(frame, lines, lines.inner)
    strokes = strokes_of(lines)
    pen = strokes.only(drawn_by_pen(strokes, lines, frame.rgba, bare.rgba, ink))
    return _Drawing(frame, bare, lines, pen, hints)


def _contour(drawing: _Drawing, pairs: Pairs) -> Bool[np.ndarray, "height width"]:
    """Return the pen's strokes that depth jumps or colour borders explain.

    They begin at the outline: what hangs together without it is a drawn feature.
    """
    pen, hints = drawing.pen, drawing.hints
    explained = hints.to_jump <= hints.reach_px
    if drawing.bare.labels is not None:
        to_border = distance_to(on_borders(drawing.bare.labels, pairs))
        explained |= to_border <= drawing.lines.width_px
    size = np.bincount(pen.number.ravel(), minlength=pen.count)
    known = np.bincount(pen.number[explained], minlength=pen.count)
    contour = pen.only((known >= EXPLAINED * size) & ~pen.dots).number > 0
    part = parts(contour)
    begun = np.unique(part[contour & (distance_to(drawing.lines.outline) <= BREAK_PX)])
    return contour & np.isin(part, begun)


def _inked_share(drawings: Sequence[_Drawing]) -> float:
    """Return which share of the hull's depth jumps lies near ink, over all views."""
    jumps = inked = 0
    for drawing in drawings:
        edges = drawing.hints.edges & ~drawing.lines.outline
        near = distance_to(drawing.lines.inner) <= drawing.hints.reach_px
        jumps += int(edges.sum())
        inked += int((edges & near).sum())
    return inked / max(jumps, 1)


def _width_px(
    drawings: Sequence[_Drawing],
    contours: Sequence[Bool[np.ndarray, "height width"]],
    ink: tuple[int, int, int],
) -> float:
    """Return the mean width of the contours, or of the outlines where all contours are empty."""
    pictures = [(drawing.frame.rgba, drawing.bare.rgba) for drawing in drawings]
    rims = [drawing.lines.under(np.zeros_like(drawing.lines.inner)) for drawing in drawings]
    if not any(contour.any() for contour in contours):
        return mean_width(pictures, rims, rims_px(d.lines for d in drawings), ink)
    regions = [
        drawing.lines.under(contour) & ~rim
        for drawing, contour, rim in zip(drawings, contours, rims, strict=True)
    ]
    return mean_width(pictures, regions, strokes_px(contours), ink)


def _cleaned(frame: Frame, lines: Lines, contour: Bool[np.ndarray, "height width"]) -> Frame:
    """Return the frame with the nearest paint under its outline and the contours given."""
    covered = lines.under(contour)
    paint = (frame.rgba[..., 3] >= OPAQUE) & ~covered & ~lines.inner
    if frame.labels is not None and (paint & (frame.labels != UNLABELLED)).any():
        paint &= frame.labels != UNLABELLED
    if not paint.any():
        return frame
    rows, columns = nearest(paint)
    rgba = frame.rgba.copy()
    rgba[covered, :3] = frame.rgba[rows[covered], columns[covered], :3]
    if frame.labels is None:
        return replace(frame, rgba=rgba)
    labels: UInt8[np.ndarray, "height width"] = frame.labels.copy()
    full = covered & (rgba[..., 3] >= OPAQUE)
    labels[full] = frame.labels[rows[full], columns[full]]
    return replace(frame, rgba=rgba, labels=labels)
