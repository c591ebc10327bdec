"""Prepare a drawing as paint for a surface: without outlines, with a trust per pixel.

Outlines are no paint. Under the silhouette's `Texture` holds the nearest paint already. Those along
the drawing's own steps in depth are strokes of the outline's colour near such a step; what is round
(an eye) is not a line. Strokes elsewhere are painted and stay.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from scipy import ndimage

from toonset.nerf.look.crisp_depth import SQUARE
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.look.step_lines import step_edges
from toonset.nerf.look.texture import Texture
from toonset.nerf.surface.strokes import SOFT, lines_of, strokes_of
from toonset.raster import depth_inside, distance_to, nearest, parts, sized_parts

STEP = 0.015  # of the figure's height: an outline may be drawn where depth steps by so much
SLIP = 0.02  # of the figure's height: so far from a step its line may lie
EXPLAINED = 0.5  # of a stroke's pixels must lie there, for the stroke to be an outline
INK_LIKE = 40.0  # levels from the outline's colour, Euclidean
ROUND = 3.0  # times the largest circle in it: a dark spot of so little area is not a line
BESIDE_PX = 1.5  # a pixel and those that touch it
FEATHER_PX, LEAST_TRUST = 4.0, 0.1  # beside an edge a drawing shows what the next one may not
SMALL = 0.012  # of the figure's squared height: smaller patches are features, eyes and buttons


@dataclass(frozen=True, eq=False)
class Paint:
    """One drawing.

    Attributes:
        texture: without outlines.
        trust: (height, width) in [0, 1]: low beside edges and where an outline was.
        feature: (height, width) pixels of small patches, and those beside them.
        under: rows and columns from which every pixel's paint comes; None: its own.
    """

    texture: Texture
    trust: Float[np.ndarray, "height width"]
    feature: Bool[np.ndarray, "height width"]
    under: tuple[Int[np.ndarray, "height width"], Int[np.ndarray, "height width"]] | None = None

    def in_colors_of(self, texture: Texture) -> Paint:
        """Return the paint of the same drawing in other colours."""
        return replace(self, texture=_covered(texture, self.under))


def paint_of(
    texture: Texture, depth: Float[np.ndarray, "height width"], drawings: Drawings
) -> Paint:
    """Return a drawing as paint.

    Args:
        texture: the drawing.
        depth: of the surface as its camera sees it, nan where there is none.
        drawings: that it is one of.
    """
    ink, paint = _outlines(texture, depth, drawings)
    trust = 1 - (1 - LEAST_TRUST) * np.exp(-((texture.to_edge / FEATHER_PX) ** 2))
    trust = np.where(ink, LEAST_TRUST * trust, trust).astype(np.float32)
    under = nearest(paint | ~ink) if ink.any() and paint.any() else None
    texture = _covered(texture, under)
    figure_px = drawings.height * texture.camera.scale
    return Paint(texture, trust, _features(texture.labels, SMALL * figure_px**2), under)


def _covered(
    texture: Texture,
    under: tuple[Int[np.ndarray, "height width"], Int[np.ndarray, "height width"]] | None,
) -> Texture:
    """Return a drawing with its outlines painted over."""
    if under is None:
        return texture
    return replace(texture, paint=texture.paint[under], labels=texture.labels[under])


def _outlines(
    texture: Texture, depth: Float[np.ndarray, "height width"], drawings: Drawings
) -> tuple[Bool[np.ndarray, "height width"], Bool[np.ndarray, "height width"]]:
    """Return the ink along a drawing's own steps in depth, and what may lie under it."""
    line = drawings.outline
    if line is None:
        return np.zeros(depth.shape, dtype=bool), np.ones(depth.shape, dtype=bool)
    whole = texture.whole.copy()
    whole[..., :3] /= np.maximum(whole[..., 3:], 1e-6)
    rgba = np.rint(255 * whole.clip(0, 1)).astype(np.uint8)
    lines = lines_of(rgba, line.width_px)
    strokes = strokes_of(lines)
    reach = SLIP * drawings.height * texture.camera.scale + line.width_px / 2
    to_step = distance_to(step_edges(depth, STEP * drawings.height))
    near = np.minimum(to_step, depth_inside(lines.figure)) <= reach
    number, count = strokes.number, strokes.count
    middle = np.where(strokes.skeleton, number, 0)
    size, length = (np.bincount(at.ravel(), minlength=count) for at in (number, middle))
    off = np.linalg.norm(rgba[..., :3].astype(float) - line.rgb, axis=-1)
    mean = np.bincount(middle.ravel(), off.ravel(), count) / np.maximum(length, 1)
    explained = np.bincount(number[near], minlength=count) >= EXPLAINED * size
    spots = _round((off <= 2 * INK_LIKE) & lines.figure & ~lines.outline)
    kept = distance_to(spots) <= 2 * BESIDE_PX
    ink = (explained & (mean <= INK_LIKE))[number] & (number > 0) & ~kept
    ink = distance_to(ink) < BESIDE_PX
    ink |= (distance_to(ink) < BESIDE_PX) & (lines.cover >= SOFT)
    ink &= ~kept
    return ink, ~(ink | lines.inner)


def _round(dark: Bool[np.ndarray, "height width"]) -> Bool[np.ndarray, "height width"]:
    """Return the connected parts that are little larger than the largest circle in them."""
    spot = parts(dark)
    radius = ndimage.maximum(depth_inside(dark), spot, np.arange(spot.max() + 1))
    area = np.bincount(spot.ravel())
    return (area <= ROUND * np.pi * np.square(radius))[spot] & dark


def _features(
    labels: UInt8[np.ndarray, "height width"], most_px: float
) -> Bool[np.ndarray, "height width"]:
    found = np.zeros(labels.shape, dtype=np.uint8)
    for label in np.unique(labels):
        part, areas = sized_parts(labels == label)
        small = areas <= most_px
        small[0] = False
        found |= small[part].astype(np.uint8)
    return cv2.dilate(found, SQUARE) > 0
