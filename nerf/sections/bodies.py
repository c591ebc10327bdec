"""Make a body of elliptic sections: one for every run of every scanline.

Row by row, a run of the front drawing has middle c_F and half width h_F, and the side drawing's run
at the same height c_S and h_S. With n_F = (u_F - c_F) / h_F, and n_S alike,

    f = max((sqrt(n_F^2 + n_S^2) - 1) min(h_F, h_S), g_F, g_S)

where g are signed distances to the outlines. All are look-ups at the pixels where a point appears,
so that cameras may stand anywhere.

The widest runs of a row are the body's, and as deep as the side drawing. Others are limbs: they are
at most LIMB_DEPTH times as deep as wide, where `limbs` says. What they hold out in the side drawing
(fists) is not the body's; limbs reach as far where a diagonal drawing says whose it is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool
from scipy import ndimage

from toonset.nerf.sections.drawing import TALL, Drawing, Mask, cells, sample, signed_distance
from toonset.nerf.sections.grid import NEAR_PX, Grid, Volume
from toonset.nerf.sections.limbs import depths_of, slenderness
from toonset.nerf.sections.runs import Outline, parted, runs_of
from toonset.nerf.sections.thin_parts import thin_parts, without_sections
from toonset.raster import parts

LEAD = 0.7  # of the row's widest run: from here a run is the body's
FIST_PX = 0.26 * TALL  # what is lower and sticks out of the side drawing is held by limbs
FIST_OUT_PX = 0.05 * TALL
LIMB_ROW_PX = 0.02 * TALL  # of limbs in a row of the front drawing, at least
SHALLOW = 0.5  # times as deep as wide: a body is no shallower
FIST_ROWS = 5  # by which heights differ between drawings


def sections(grid: Grid, front: Drawing, side: Drawing | None, others: Sequence[Drawing]) -> Volume:
    """Return f of the sections.

    Args:
        grid: where.
        front: the drawing whose runs are sections.
        side: the one that says how deep they are; None: as deep as wide.
        others: drawings that say where limbs are.
    """
    if side is None:
        return _round_sections(grid, front)
    front_thin, side_thin = without_sections(front.mask, side.mask)
    face = Outline.of(front, parted(_some(front.mask & ~front_thin, front.mask)))
    profile = Outline.of(side, _some(side.mask & ~side_thin, side.mask))
    lead = face.runs.half >= LEAD * face.runs.widest()
    trunk = Outline.of(side, _without_fists(face, lead, profile.mask))
    width = slenderness(face.runs, front.mask)
    depth, middle = depths_of(grid, face, profile, profile.mask & ~trunk.mask, width, lead, others)

    at_front, at_side = front.pixels(grid.centres), side.pixels(grid.centres)
    g_front, g_side = sample(face.distance, at_front), sample(profile.distance, at_side)
    f = np.maximum(g_front, g_side)
    near = np.flatnonzero(f < NEAR_PX)  # what lies outside of an outline is as far from the body
    at_front, at_side = at_front[near], at_side[near]
    run = face.runs.number[cells(face.mask.shape, at_front)]
    trunk_run = trunk.runs.number[cells(trunk.mask.shape, at_side)]
    led, g_trunk = lead[run], sample(trunk.distance, at_side)
    half = np.where(led, trunk.runs.half[trunk_run], depth[run])
    centre = np.where(led, trunk.runs.middle[trunk_run], middle[run])
    across = (at_front[:, 0] - face.runs.middle[run]) / face.runs.half[run]
    along = (at_side[:, 0] - centre) / half
    radius = np.hypot(across, along) - 1
    bound = np.maximum(g_front[near], np.where(led, g_trunk, g_side[near]))
    f[near] = np.maximum(radius * np.minimum(face.runs.half[run], half), bound)
    return f.reshape(grid.shape)


def carved(f: Volume, grid: Grid, drawings: Sequence[Drawing], tolerance_px: float) -> Volume:
    """Return f without what drawings show as background, but for a tolerance."""
    flat = f.reshape(-1)
    for drawing in drawings:
        flat = np.maximum(flat, drawing.distance_at(grid.centres) - tolerance_px)
    return flat.reshape(f.shape)


def _round_sections(grid: Grid, front: Drawing) -> Volume:
    """Return f of sections that are as deep as wide, round the middle of the grid."""
    mask = _some(front.mask & ~thin_parts(front.mask), front.mask)
    runs, points = runs_of(mask), grid.centres
    pixels = front.pixels(points)
    run = runs.number[cells(mask.shape, pixels)]
    forward = front.camera.rotation[2].astype(np.float32)
    depth = (points - grid.middle.astype(np.float32)) @ forward / np.float32(grid.per_px)
    across = pixels[:, 0] - runs.middle[run]
    outline = sample(signed_distance(mask.astype(np.float32)), pixels)
    f: Volume = np.maximum(np.hypot(across, depth) - runs.half[run], outline).reshape(grid.shape)
    return f


def _some(mask: Mask, whole: Mask) -> Mask:
    """Return a mask, or the whole where nothing is left of it."""
    return mask if mask.any() else whole


def _without_fists(face: Outline, lead: Bool[np.ndarray, " n"], side: Mask) -> Mask:
    """Return the side drawing's mask without what limbs hold out of it."""
    runs = face.runs
    led = face.mask & lead[runs.number]
    rows = ((face.mask & ~led).sum(axis=1) > LIMB_ROW_PX) & led.any(axis=1)
    if not rows.any():
        return side
    held = thin_parts(side, FIST_PX, FIST_OUT_PX)
    held &= ndimage.binary_dilation(rows, iterations=FIST_ROWS)[:, None]
    return _some(side & ~_but_heads(held, side, led), side)


def _but_heads(held: Mask, side: Mask, led: Mask) -> Mask:
    """Return the parts without which a body is still at least SHALLOW times as deep as wide.

    An arm beside a head makes no fist of the face.
    """
    labels = parts(held, 4)
    kept = np.zeros_like(held)
    for number in range(1, int(labels.max()) + 1):
        part = labels == number
        rows = part.any(axis=1)
        deep, wide = (mask[rows].sum(axis=1).mean() for mask in (side & ~held, led))
        if deep > SHALLOW * wide:
            kept |= part
    return kept
