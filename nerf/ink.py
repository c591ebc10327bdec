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

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, UInt8

from toonset.dataset.scene import Frame, Scene
from toonset.nerf.ink_evidence import (
    Hints,
    Pairs,
    depth_hints,
    lined_pairs,
    on_borders,
)
from toonset.nerf.ink_nearest import distance_to, nearest
from toonset.nerf.ink_strokes import (
    Lines,
    drawn_by_pen,
    lines_of,
    outline_width,
    rim_width,
    stroke_width,
    strokes_of,
)
from toonset.palette.labels import UNLABELLED

FEWEST_OUTLINED = 0.5  # of the views must have an outline
EXPLAINED = 0.5  # of a stroke's pixels, for the stroke to be a contour
INKED = 0.5  # of the hull's depth jumps, for the sheet to draw lines there
INK_QUANTILE = 0.2  # darkest part of the rim: the rest is mixed with what it surrounds
OPAQUE = 250


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


def without_ink(scene: Scene) -> tuple[Scene, InkStyle | None]:
    """Return the scene with paint under its contour lines, and the lines' style.

    Alpha is kept. A scene without outlines is returned as it is, with None.

    Args:
        scene: posed drawings of one character; colour borders are known only with labels.

    Raises:
        BundleError: the views share no volume.
    """
    frames = scene.frames
    widths = [outline_width(frame.rgba) for frame in frames]
    drawn = [width for width in widths if width > 0]
    if not drawn or len(drawn) < FEWEST_OUTLINED * len(widths):
        return scene, None
    lines = [lines_of(frame.rgba, float(np.median(drawn))) for frame in frames]
    hints, jump = depth_hints(scene, float(np.median(drawn)))
    bare = [_cleaned(f, line, line.inner) for f, line in zip(frames, lines, strict=True)]
    outline = rim_width(lines)
    style = InkStyle(
        rgb=_ink_color(scene, lines),
        outline_px=outline,
        inner_px=outline,
        views_px=tuple(widths),
        px_per_unit=float(np.median([frame.camera.scale for frame in frames])),
        jump=jump if _inked_share(hints, lines) >= INKED else None,
        borders=lined_pairs(bare, lines, hints),
    )
    contours = [_contour(*each, style) for each in zip(frames, bare, lines, hints, strict=True)]
    cleaned = tuple(_cleaned(*each) for each in zip(frames, lines, contours, strict=True))
    inner = stroke_width(lines, contours) or outline
    return replace(scene, frames=cleaned), replace(style, inner_px=inner)


def _contour(
    frame: Frame, bare: Frame, lines: Lines, hints: Hints, style: InkStyle
) -> Bool[np.ndarray, "height width"]:
    """Return the inner strokes of the ink that depth jumps or colour borders explain."""
    explained = hints.to_jump <= hints.reach_px
    if bare.labels is not None:
        explained |= distance_to(on_borders(bare.labels, style.borders)) <= lines.width_px
    strokes = strokes_of(lines)
    size = np.bincount(strokes.number.ravel(), minlength=strokes.count)
    known = np.bincount(strokes.number[explained], minlength=strokes.count)
    taken = (known >= EXPLAINED * size) & ~strokes.dots
    taken &= drawn_by_pen(strokes, lines, frame.rgba, bare.rgba, style.rgb)
    return taken[strokes.number]


def _inked_share(hints: list[Hints], lines: list[Lines]) -> float:
    """Return which share of the hull's depth jumps lies near ink, over all views."""
    jumps = inked = 0
    for hint, line in zip(hints, lines, strict=True):
        edges = hint.edges & ~line.outline
        jumps += int(edges.sum())
        inked += int((edges & (distance_to(line.inner) <= hint.reach_px)).sum())
    return inked / max(jumps, 1)


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


def _ink_color(scene: Scene, lines: list[Lines]) -> tuple[int, int, int]:
    """Return the median of the darkest pixels of all rims."""
    rims = [frame.rgba[line.rim][:, :3] for frame, line in zip(scene.frames, lines, strict=True)]
    colors = np.concatenate(rims).astype(np.float64)
    light = colors.mean(axis=1)
    red, green, blue = np.median(colors[light <= np.quantile(light, INK_QUANTILE)], axis=0)
    return round(float(red)), round(float(green)), round(float(blue))
