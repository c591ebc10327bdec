"""Matte a figure from a plain background: soft alpha and unmixed colours.

A pixel of the edge is a mixture C = a F + (1 - a) B of the figure's colour F and the background B.
F is found by walking inwards while the contrast to B still grows and C stays on the line from B to
F. The coverage `a` is C's projection onto that line, and the colour is un-mixed with it, so that
laying the cutout over the background gives the sheet again.
Source: T. Porter, T. Duff, "Compositing digital images" (1984).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.raster import distance_to

SOFTEST_EDGE_PX = 3
PURE = 0.95  # of the contrast: a layer of pixels that has it is no longer mixed
GROWTH = 1.04  # of the contrast per step inwards: slower growth is shading, not an edge
HARD_CONTRAST = 16  # levels: below it the figure is too like the background to divide
OFF_LINE = 5.0  # levels, beyond the background's noise: farther off the line is not a mixture
SHADED = 0.2  # of the contrast: so far the next pixel's colour may differ from that in the mixture
STEPS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))

Pixels = tuple[np.ndarray, np.ndarray]


def edge_softness_px(
    rgb: UInt8[np.ndarray, "height width 3"],
    mask: Bool[np.ndarray, "height width"],
    background: UInt8[np.ndarray, "height width 3"],
    tolerance: int,
) -> int:
    """Return how many pixels deep the figure's edge is mixed with the background; 0 = hard.

    A layer of pixels counts as pure if three quarters of it have the contrast to the background
    of the colours farther inside. Pixel art is hard, anti-aliased drawings have 1, scans 2 or 3.
    """
    depth = _depth(mask)
    for softness in range(SOFTEST_EDGE_PX):
        layer = _pixels((depth > softness) & (depth <= softness + 1))
        ground = background[layer].astype(np.float64)
        pure = rgb[_pure_pixels(layer, depth, rgb, ground, tolerance)] - ground
        contrast = np.linalg.norm(pure, axis=1)
        usable = contrast > HARD_CONTRAST
        if not usable.any():
            continue
        ratio = np.linalg.norm(rgb[layer] - ground, axis=1)[usable] / contrast[usable]
        if np.percentile(ratio, 25) >= PURE:
            return softness
    return SOFTEST_EDGE_PX


def cut_out(
    rgb: UInt8[np.ndarray, "height width 3"],
    mask: Bool[np.ndarray, "height width"],
    background: UInt8[np.ndarray, "height width 3"],
    tolerance: int,
    softness_px: int,
) -> UInt8[np.ndarray, "height width 4"]:
    """Return the figure with straight alpha.

    Args:
        rgb: the crop of the sheet.
        mask: the figure's pixels, mixed ones included.
        background: the sheet's colour behind the crop.
        tolerance: noise of the sheet in levels.
        softness_px: depth of the mixed edge, see `edge_softness_px`.

    Returns:
        RGBA such that alpha * RGB + (1 - alpha) * background is the crop within a level, inside
        `mask`; alpha 0 outside of it. Where figure and background are too alike to divide, or the
        pixel is not a mixture of the two, alpha is 1.
    """
    solid = mask.astype(np.uint8)
    rgba = np.dstack([rgb * solid[..., None], 255 * solid])
    if softness_px == 0:
        return rgba
    depth = _depth(mask)
    band = _pixels(mask & (depth <= softness_px + 1))
    ground = background[band].astype(np.float64)
    mixed = rgb[band] - ground
    pure = rgb[_pure_pixels(band, depth, rgb, ground, tolerance)] - ground
    alpha = _coverage(mixed, pure, ground, tolerance)
    levels = np.maximum(np.rint(255 * alpha), 1)
    rgba[band[0], band[1], 3] = levels
    color = ground + mixed * (255 / levels)[:, None]
    rgba[band[0], band[1], :3] = np.clip(np.rint(color), 0, 255)
    return rgba


def _depth(mask: Bool[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """Return each pixel's distance in pixels to the background; the picture's rim is none."""
    return distance_to(~np.pad(mask, 1, mode="edge"))[1:-1, 1:-1]


def _pixels(mask: Bool[np.ndarray, "height width"]) -> Pixels:
    rows, columns = np.nonzero(mask)
    return rows, columns


def _pure_pixels(
    start: Pixels, depth: np.ndarray, rgb: np.ndarray, ground: np.ndarray, tolerance: int
) -> Pixels:
    """Return for every pixel of the edge the pixel inwards whose colour is unmixed.

    One step goes to the deepest neighbour. It is taken while that neighbour is farther from the
    background and the starting colour lies on the line from the background to it; strictly so
    after the first step, lest the walk goes from light skin on to dark hair.
    """
    here = (start[0].copy(), start[1].copy())
    mixed = rgb[start] - ground
    walking = np.ones(len(start[0]), dtype=bool)
    for step in range(SOFTEST_EDGE_PX):
        there = _step_inwards(here, depth)
        next_away = rgb[there] - ground
        now = np.linalg.norm(rgb[here] - ground, axis=1)
        then = np.linalg.norm(next_away, axis=1)
        _, off_line = _project(mixed, next_away)
        allowed = np.maximum(OFF_LINE + tolerance, SHADED * then if step == 0 else 0.0)
        walking &= (then > GROWTH * now + 1) & (off_line <= allowed)
        here = (np.where(walking, there[0], here[0]), np.where(walking, there[1], here[1]))
    return here


def _step_inwards(here: Pixels, depth: np.ndarray) -> Pixels:
    height, width = depth.shape
    best = depth[here].copy()
    there = (here[0].copy(), here[1].copy())
    for down, right in STEPS:
        row = np.clip(here[0] + down, 0, height - 1)
        column = np.clip(here[1] + right, 0, width - 1)
        deeper = depth[row, column] > best
        best = np.where(deeper, depth[row, column], best)
        there = (np.where(deeper, row, there[0]), np.where(deeper, column, there[1]))
    return there


def _project(mixed: np.ndarray, pure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the place of C - B along F - B (1 = at F), and the distance from that line."""
    share = (mixed * pure).sum(axis=1) / np.maximum((pure * pure).sum(axis=1), 1e-9)
    return share, np.linalg.norm(mixed - share[:, None] * pure, axis=1)


def _coverage(
    mixed: np.ndarray, pure: np.ndarray, ground: np.ndarray, tolerance: int
) -> np.ndarray:
    """Return alpha of C - B given F - B, never below what an un-mixed colour in range needs."""
    share, off_line = _project(mixed, pure)
    contrast = np.linalg.norm(pure, axis=1)
    allowed = np.maximum(OFF_LINE + tolerance, SHADED * contrast)
    is_mixture = (contrast > HARD_CONTRAST) & (off_line <= allowed)
    room = np.where(mixed > 0, 255 - ground, ground)
    needed = (np.abs(mixed) / np.maximum(room, 1)).max(axis=1)
    return np.where(is_mixture, np.clip(np.maximum(share, needed), 0, 1), 1.0)
