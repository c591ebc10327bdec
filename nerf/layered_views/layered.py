"""Take a drawn view apart into what a page puts together again in any colours.

    colour = (light((1 - t) a + t b) + tint) (1 - ink) + pen ink

a and b are paints; most pixels have one, those along borders are mixtures of two (`unmix`). `light`
makes a mixture darker or lighter and moves with its paints: shadow, grain, what enlarging does
beside lines (`light`). `tint` is what paints do not explain: a feature without a paint of its own.

Drawings that are shaded throughout have no colour that a paint's pixels are near to. There a view
keeps its colours as they are, and its paints say how they move: each along its own ramp, by the
equation of `toonset.palette.pixels.ramp_recolor`.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.nerf.layered_views.light import Light, light_of
from toonset.nerf.layered_views.lossy import rgb_of_webp, webp
from toonset.nerf.layered_views.unmix import PARTS, Unmixed, unmixed, unmixed_shaded
from toonset.nerf.look.drawings import INK_LIKE
from toonset.nerf.look.drawn_view import SOLID, DrawnView
from toonset.nerf.look.outline import Outline
from toonset.palette.palette import Shadow
from toonset.raster import depth_inside, distance_to, from_nearest

LEVELS = 15  # of alpha and ink, from nothing to all
EXACT = 1.5 / 255  # so well do paint and ink make up a pixel, or it is a drawing's own
MOST_INK = 0.9  # of a pixel, under which its paint is seen
RIM = 2.5  # times the pen's width: so near the figure's edge lines are its outline
WIDER, WIDER_PX = 1.2, 0.75  # times the pen's width, and pixels: what is so deep is no line

Map = UInt8[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]
Colors = UInt8[np.ndarray, "paints 3"]
Box = tuple[slice, slice]  # rows and columns


@dataclass(frozen=True, eq=False)
class Layered:
    """A drawn view in layers, cut to the figure.

    Attributes:
        corner: x, y of the first pixel in the view.
        alpha: (height, width) coverage, 0 to LEVELS.
        ink: (height, width) share of the coverage that lines have, 0 to LEVELS.
        paints: of every pixel.
        light: what else makes up its colour; None: nothing.
        color: under the ink, a WebP file, of drawings that are shaded throughout; None: it is made
            of paints and light.
    """

    corner: tuple[int, int]
    alpha: Map
    ink: Map
    paints: Unmixed
    light: Light | None
    color: bytes | None = None


def page_paints(paints: Colors, pen: Outline | None) -> Colors:
    """Return the paints that a page knows: a palette's, and that of lines as the last one."""
    return paints if pen is None else np.concatenate([paints, np.array([pen.rgb], np.uint8)])


def layered(
    view: DrawnView,
    paints: Colors,
    pen: Outline | None,
    shadow: Shadow | None = None,
    *,
    shaded: bool = False,
) -> Layered | None:
    """Return a view's layers in `page_paints`; None where it shows nothing.

    Args:
        view: in the colours of `paints`.
        paints: the palette that its labels name; the next label, if any, is the lines'.
        pen: that draws the lines, its width in pixels of the view; None: there are no lines.
        shadow: that the drawings have.
        shaded: whether they are shaded throughout.
    """
    there = view.alpha >= 0.5 / LEVELS
    if not there.any():
        return None
    box, corner = _box(there)
    there, alpha = there[box], view.alpha[box].clip(0, 1)
    paint, ink, own = _under_lines(view, box, there, pen)
    labels = np.where(there, view.labels[box], 0).astype(np.uint8)
    color = np.rint(paint * 255).clip(0, 255).astype(np.uint8)
    share = np.divide(ink, alpha, out=np.zeros_like(alpha), where=there).clip(0, 1)
    lit, known, like = there & (share < 1), page_paints(paints, pen), None
    if pen is not None:
        off = np.abs(paints.astype(int) - np.array(pen.rgb)).sum(axis=1)
        like = int(off.argmin()) if off.min() < INK_LIKE else len(paints)
    if shaded:
        found = unmixed_shaded(color, labels, there)
    else:
        own_paints = known[: max(len(paints), (like or 0) + 1)]
        found = unmixed(color, labels, there, own_paints, like, shadow)
    if pen is not None and like is not None:
        drawn = found.share(like)
        found.rename(like, len(paints), (drawn > 0) & ~_thick(drawn >= SOLID, pen.width_px))
        rim = depth_inside(alpha >= SOLID) <= RIM * pen.width_px
        lifted = found.lift(len(paints), rim & own & there)
        share = np.maximum(share, lifted)
        color, lit = _lifted(color, pen.rgb, lifted), lit & (share < MOST_INK)
    cover, line = (
        np.rint(np.where(there, one, 0) * LEVELS).astype(np.uint8) for one in (alpha, share)
    )
    if shaded:  # by the colours that the page will read
        file = webp(from_nearest(color, lit))
        found = unmixed_shaded(rgb_of_webp(file), found.first, there)
        return Layered(corner, cover, line, found, None, file)
    mixture = found.colors(known.astype(np.float32))
    return Layered(corner, cover, line, found, light_of(color, mixture, lit))


def layered_shares(
    shares: Float[np.ndarray, "height width paints"], alpha: Float[np.ndarray, "height width"]
) -> Layered | None:
    """Return a view of pure paints in layers, from the share of every pixel that each covers."""
    there = alpha >= 0.5 / LEVELS
    if not there.any():
        return None
    box, corner = _box(there)
    shares, alpha = shares[box], alpha[box]
    two = np.argsort(-shares, axis=2, kind="stable")[..., :2]
    covered = np.take_along_axis(shares, two, axis=2)
    one, other = covered[..., 0], covered[..., -1]
    first, second = (two[..., i].astype(np.uint8) for i in (0, -1))
    part = np.rint(PARTS * other / np.maximum(one + other, 1e-6)).astype(np.uint8)
    part[second == first] = 0
    none = np.zeros(alpha.shape, np.uint8)
    cover = np.rint(alpha.clip(0, 1) * LEVELS).astype(np.uint8)
    return Layered(corner, cover, none, Unmixed(first, second, part, none > 0), None)


def _box(there: Mask) -> tuple[Box, tuple[int, int]]:
    """Return the rows and columns that hold all of a mask, and the first column and row."""
    rows, columns = (np.flatnonzero(there.any(axis=axis)) for axis in (1, 0))
    box = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
    return box, (int(columns[0]), int(rows[0]))


def _under_lines(
    view: DrawnView, box: Box, there: Mask, pen: Outline | None
) -> tuple[Float[np.ndarray, "h w 3"], Float[np.ndarray, "h w"], Mask]:
    """Return straight colour and ink that make up what the view shows, and where it is a drawing.

    A drawing's own pixels are not made of the view's paint and ink: they have no ink.
    """
    rgb, alpha, ink, paint = (part[box] for part in (view.rgb, view.alpha, view.ink, view.paint))
    line = np.array(pen.rgb if pen else (0, 0, 0), np.float32) / np.float32(255)
    own = np.zeros(there.shape, dtype=bool)
    for shown, under, over in zip(cv2.split(rgb), cv2.split(paint), line, strict=True):
        own |= np.abs(under * (alpha - ink) + ink * over - shown) > EXACT
    own &= there
    if not own.any():
        return paint, ink, own
    paint, ink = paint.copy(), np.where(own, 0, ink)
    paint[own] = (rgb[own] / alpha[own][:, None]).clip(0, 1)
    return paint, ink, own


def _lifted(
    color: UInt8[np.ndarray, "h w 3"], pen: tuple[int, int, int], ink: Float[np.ndarray, "h w"]
) -> UInt8[np.ndarray, "h w 3"]:
    """Return colours under ink that covers them."""
    at = (ink > 0) & (ink < MOST_INK)
    under = (color[at] - ink[at][:, None] * np.array(pen)) / (1 - ink[at])[:, None]
    found = color.copy()
    found[at] = np.rint(under).clip(0, 255)
    return found


def _thick(line: Mask, width_px: float) -> Mask:
    """Return the parts of a mask that are too thick for lines of a pen, and their edges."""
    deep = WIDER * width_px + WIDER_PX
    core = depth_inside(line) > deep
    return core if not core.any() else distance_to(core) <= deep + 1
