"""Find a view's outline between the outlines of the drawings beside it.

A surface that few drawings give has no hair tips, ears or hems, and its own outline is rough. What
a drawing's outline has beyond the surface's, seen by the same camera,

    off = inside(drawing) - inside(surface),            inside: signed distance, > 0 within

is carried over the surface to where the view's outline is the same rim: where the surface's outline
by the drawing's camera is near. Slow differences are errors of the hand, which views between do not
share; they count where they are large, as missing parts are, and beside the drawing itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float

from toonset.raster import depth_inside, distance_to, parts

FARTHEST = 0.06  # of the figure's height, as all below: farther from an outline is as far
SMOOTH = 0.01  # sigma of a field's own outline
SAME = 0.02  # within the surface's outline, where a rim of the view is the drawing's
SLOW = 0.015  # sigma along which a difference is an error of the hand
LARGE = 0.02  # from which on it is a missing part
REACH = 0.025  # beyond the surface, to which anything is added
BESIDE = 0.3  # radians off a drawing, in which its errors are the view's, too
AGREEING = 4  # power of the cosine between view and drawing by which a rim counts

Inside = Float[np.ndarray, "h w"]


@dataclass(frozen=True, eq=False)
class Rim:
    """What a drawing's outline has beyond the surface's; see the module. Shares of the height.

    Attributes:
        off: (height, width, 3) fine differences and missing parts; errors of the hand; how near
            the surface's outline is, 0 to 1.
    """

    off: Float[np.ndarray, "height width 3"]

    def at(self, x: Float[np.ndarray, "h w"], y: Float[np.ndarray, "h w"]) -> np.ndarray:
        """Return the three at places of the drawing, (h, w, 3); 0 beyond its edges."""
        return np.asarray(cv2.remap(self.off, x, y, cv2.INTER_LINEAR))


def inside_of(cover: Float[np.ndarray, "h w"], height_px: float) -> Inside:
    """Return how far within a coverage's outline pixels lie, of the height; < 0 beyond it."""
    solid = cover > 0.5
    depth = np.where(solid, depth_inside(solid), 0.5 - distance_to(solid))
    exact = np.where(np.abs(depth) < 1, cover - 0.5, depth)
    return (exact / height_px).clip(-FARTHEST, FARTHEST).astype(np.float32)


def rim_of(
    cover: Float[np.ndarray, "height width"],
    surface: Bool[np.ndarray, "height width"],
    unknown: Bool[np.ndarray, "height width"],
    height_px: float,
) -> Rim:
    """Return a drawing's rim.

    Args:
        cover: of the drawing.
        surface: pixels that show the surface by the drawing's camera.
        unknown: pixels whose surface is not known: nothing is said of them.
        height_px: of the figure.
    """
    own = smooth_outline(surface.astype(np.float32), height_px)
    off = inside_of(cover, height_px) - own
    band = np.exp(-((own / SAME) ** 2)).astype(np.float32)
    slow = _soft(off * band, SLOW * height_px) / np.maximum(_soft(band, SLOW * height_px), 1e-6)
    part = (np.abs(slow) / LARGE - 1).clip(0, 1)
    error = slow * (1 - part * part * (3 - 2 * part))
    near = np.exp(-((own.clip(0) / SAME) ** 2)) * ~unknown
    return Rim(np.dstack([off - error, error, near]).astype(np.float32))


def smooth_outline(cover: Float[np.ndarray, "h w"], height_px: float) -> Inside:
    """Return how far within a field's own outline, smoothed, pixels lie: see `inside_of`."""
    return _soft(inside_of(cover, height_px), SMOOTH * height_px)


def between_outlines(own: Inside, rims: Sequence[tuple[np.ndarray, float, float]]) -> Inside:
    """Return how far within the view's outline pixels lie, of the height.

    Args:
        own: within the field's outline.
        rims: of every flanking drawing `Rim.at` the view's places, its share of the view, and the
            angle between both, radians.
    """
    moved, total = np.zeros(own.shape, np.float32), np.zeros(own.shape, np.float32)
    reach = ((own + REACH) / (REACH / 2)).clip(0, 1)
    for at, share, angle in rims:
        near = share * max(0.0, float(np.cos(angle))) ** AGREEING * at[..., 2] * reach
        moved += near * (at[..., 0] + max(0.0, 1 - angle / BESIDE) ** 2 * at[..., 1])
        total += near
    found = own + moved / np.maximum(total, 0.5)
    loose = parts(found > 0, connectivity=4)
    kept = np.zeros(int(loose.max()) + 1, dtype=bool)
    kept[np.unique(loose[own > 0])] = True
    return np.where((found > 0) & ~kept[loose], -REACH, found).astype(np.float32)


def _soft(values: Float[np.ndarray, "h w"], sigma: float) -> Float[np.ndarray, "h w"]:
    return np.asarray(cv2.GaussianBlur(values.astype(np.float32), (0, 0), max(sigma, 0.3)))
