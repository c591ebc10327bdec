"""Remove outlines, step lines, grain and shadows from drawings.

Outlines belong to one view only, and new views have their own drawn; so have lines where one part
hides another, and shadows, where the surface is known well enough to draw them anew. What is left
is what sticks to the surface. Under a line goes the nearest paint of the same surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.dataset.silhouettes.mask import mask_of
from toonset.nerf.hull.mannequin_shape import FINER, ShapeView
from toonset.nerf.look.outline import Outline
from toonset.nerf.look.shade import Shade, learn_shade, smoothed
from toonset.nerf.look.step_lines import (
    StepLines,
    learn_steps,
    lines_across,
    step_places,
    step_sides,
)
from toonset.palette.pixels.ink_lines import find_contour
from toonset.raster import depth_inside, distance_to, nearest

SOFT_PX = 1.5  # beyond an outline, in which paint and ink are mixed
INK = 40  # of 255: how far a line covers a pixel that has some of it
SAME = 0.03  # of the figure's height: surfaces so far apart in depth are two
ASTRAY = 0.03  # of the figure's height: so far beside its step a line may be drawn
WIDER = 1.2  # times a line's width, from its middle or its step: ink that is the line's
GAP_PX = 0.5  # between places at which lines are looked for
ROUNDS = 24  # pixels that paint goes under a line
EDGE_PX = 1.0  # beside an edge, colours are mixed
GRAINY, TEXTURE = 0.3, 4.0  # levels: less is not grain; more is fur, gouache or print
STRENGTH, WINDOW = 10.0, 5  # times the grain: what is smoothed; pixels about each
LAPLACE = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32)
AROUND = ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1))

Picture = UInt8[np.ndarray, "height width 4"]
Paint = UInt8[np.ndarray, "height width 3"]
Mask = Bool[np.ndarray, "height width"]


@dataclass(frozen=True, eq=False)
class FlatPaint:
    """The paint of a sheet's drawings, and what was taken off to be drawn anew.

    Attributes:
        paints: (height, width, 3) sRGB of every drawing; beside the figure the nearest paint.
        steps: lines at steps in depth; None: there are none, or the surface is not known.
        shade: the shadow; None: the same.
    """

    paints: tuple[Paint, ...]
    steps: StepLines | None
    shade: Shade | None


def flat_paint(
    drawings: Sequence[Picture],
    outline: Outline | None,
    sights: Sequence[ShapeView] | None,
    height: float,
) -> FlatPaint:
    """Return the paint of drawings.

    Args:
        drawings: agreeing with each other.
        outline: round the figures; None: there is none.
        sights: of the mannequin's shape, with normals, one per drawing; None: the shape is known
            from the drawings alone, which tells too little of steps and normals.
        height: of the figure, world units.
    """
    width = outline.width_px if outline else 0.0
    steps = shade = None
    covers = [find_contour(rgba, width) / np.float32(255) for rgba in drawings] if width else []
    if sights and covers:
        steps = learn_steps(covers, [sight.depth for sight in sights], height, width)
    found = []
    for number, rgba in enumerate(drawings):
        kept = _inner(rgba, width)
        at = nearest(kept)
        if sights and steps:
            kept &= ~_at_steps(covers[number], sights[number], steps, height)
            at = _same_surface(kept, sights[number].depth, SAME * height)
        found.append(_without_grain(rgba[at][..., :3], _inner(rgba, width + SOFT_PX)))
    paints = [(paint.clip(0, 1) * 255 + 0.5).astype(np.uint8) for paint in found]
    if sights:
        normals = [smoothed(s.normal, height * s.camera.scale) for s in sights]
        pairs = zip(drawings, sights, strict=True)
        clear = [_clear(rgba, sight, width, height) for rgba, sight in pairs]
        shade, paints = learn_shade(paints, normals, clear)
    return FlatPaint(tuple(paints), steps, shade)


def pixels_on_steps(sight: ShapeView, least: float) -> Mask:
    """Return the pixels on steps in depth of at least `least` world units."""
    near, far = step_sides(sight.fine, least)
    edge = (near | far).astype(np.float32)
    size = sight.alpha.shape[::-1]
    return np.asarray(cv2.resize(edge, size, interpolation=cv2.INTER_AREA) > 0)


def _inner(rgba: Picture, width: float) -> Mask:
    mask = mask_of(rgba)
    inner = depth_inside(mask) >= width + SOFT_PX
    return inner if inner.any() else mask if mask.any() else np.ones_like(mask)


def _at_steps(
    cover: Float[np.ndarray, "height width"], sight: ShapeView, steps: StepLines, height: float
) -> Mask:
    """Return the pixels with ink of lines at steps, which may be drawn a little beside them."""
    least = steps.least * height
    places, across = step_places(sight.fine, least, FINER, GAP_PX)
    tall = height * sight.camera.scale
    off = lines_across(cover, places, across, ASTRAY / 2 * tall, ASTRAY * tall)
    there = np.isfinite(off)
    lines = np.zeros(cover.shape, dtype=bool)
    drawn = np.floor(places[there] + off[there, None] * across[there]).astype(int)
    drawn = drawn.clip(0, np.array(cover.shape)[::-1] - 1)
    lines[drawn[:, 1], drawn[:, 0]] = True
    near = distance_to(lines | pixels_on_steps(sight, least)) <= WIDER * steps.width_px
    ink = ((cover * 255 >= INK) & near).astype(np.uint8)
    return (cv2.dilate(ink, np.ones((3, 3), np.uint8)) > 0) & near


def _same_surface(
    kept: Mask, depth: Float[np.ndarray, "height width"], apart: float
) -> tuple[Int[np.ndarray, "height width"], Int[np.ndarray, "height width"]]:
    """Return row and column of a kept pixel near every pixel, of the same surface if one is.

    Paint goes on from pixel to pixel where depth does not step by more than `apart`.
    """
    if not kept.any():
        return nearest(np.ones_like(kept))
    source = np.where(kept, np.arange(kept.size).reshape(kept.shape), -1)
    last = np.array(kept.shape) - 1
    todo = np.argwhere(~kept & np.isfinite(depth))
    for _ in range(ROUNDS):
        least = np.full(len(todo), apart)
        taken = np.full(len(todo), -1)
        here = depth[tuple(todo.T)]
        for way in AROUND:
            there = tuple(np.clip(todo + way, 0, last).T)
            with np.errstate(invalid="ignore"):
                gap = np.abs(depth[there] - here)
            better = (source[there] >= 0) & (gap < least)
            least[better], taken[better] = gap[better], source[there][better]
        done = taken >= 0
        if not done.any():
            break
        source[tuple(todo[done].T)] = taken[done]
        todo = todo[~done]
    rows, columns = np.unravel_index(source[nearest(source >= 0)], kept.shape)
    return rows, columns


def _without_grain(paint: Paint, inside: Mask) -> Float[np.ndarray, "height width 3"]:
    """Return colours in [0, 1] without the grain of paper and JPEG.

    Clean drawings and those with a texture are left as they are.

    Sources: noise, Immerkaer 1996; guided filter, He, Sun and Tang 2010.
    """
    light = cv2.cvtColor(paint, cv2.COLOR_RGB2GRAY).astype(np.float32)
    noise = np.abs(cv2.filter2D(light, -1, LAPLACE))[inside]
    grain = float(np.median(noise)) / 0.6745 / 6 if len(noise) else 0.0
    clean = paint.astype(np.float32)
    if GRAINY <= grain < TEXTURE:
        clean = cv2.ximgproc.guidedFilter(clean, clean, WINDOW, (STRENGTH * grain) ** 2)
    return (clean / 255).clip(0, 1)


def _clear(rgba: Picture, sight: ShapeView, width: float, height: float) -> Mask:
    """Return pixels that show paint of the shape, away from all edges."""
    edge = np.minimum(depth_inside(mask_of(rgba)) - width, depth_inside(sight.alpha >= 0.5))
    to_step = distance_to(pixels_on_steps(sight, SAME * height))
    return (np.minimum(edge, to_step) > EDGE_PX) & np.isfinite(sight.depth)
