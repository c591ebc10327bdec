"""Compute the shape that few drawings of one side show: the steps, in order.

A visual hull of three to five drawings is square where nobody drew, and lacks what any drawing
lacks. Here each row of the front drawing is an ellipse, as deep as the side drawing says. Diagonals
and their mirror images carve, with a tolerance; what is drawn and lacking is put back; outlines are
met by smooth moves.

Source: elliptic sections between front and side silhouettes, as of generalised cylinders; inflated
parts as in Igarashi et al., "Teddy", 1999.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import ndimage

from toonset.dataset.bundle.scene import Frame
from toonset.nerf.sections.bodies import carved, sections
from toonset.nerf.sections.completion import completed
from toonset.nerf.sections.drawing import Drawing, working_drawings
from toonset.nerf.sections.grid import Solid, Volume, blurred, distance_again, grid_of
from toonset.nerf.sections.merge import merged
from toonset.nerf.sections.roles import mirror_images, roles_of
from toonset.nerf.sections.touching import touching

CARVE_PX = 2.0  # by which diagonals may be wrong
SMOOTH_VOXELS = 1.0
CRUMB = 0.004  # of the largest part
GONE_PX = 0.5


def shape_of(frames: Sequence[Frame], plane_x: float | None = None) -> Solid:
    """Return the body that drawings show.

    Args:
        frames: posed drawings, of which at least two show a figure.
        plane_x: of the body's mirror plane x = const, world units; None: it has none.

    Raises:
        BundleError: fewer than two drawings show a figure, or cameras do not belong together.
    """
    drawings, per_px = working_drawings(frames)
    roles = roles_of(drawings)
    facing, aside = _merged(roles.facing), _merged(roles.aside)
    grid = grid_of([*facing, *aside, *roles.between], per_px)
    diagonals = list(roles.between)
    if plane_x is not None:
        diagonals += mirror_images(roles.between, drawings, plane_x)
    f = sections(grid, facing[0], aside[0] if aside else None, diagonals)
    f = carved(f, grid, diagonals, CARVE_PX)
    f = distance_again(blurred(f, SMOOTH_VOXELS))
    everything = [*facing, *aside, *diagonals]
    covered = [facing[0], *aside[:1], *roles.between]
    f = distance_again(completed(grid, f, covered, everything, plane_x))
    f = _without_crumbs(touching(grid, f, everything))
    return Solid(grid, completed(grid, f, covered, everything))  # tips that smoothing lost


def _merged(drawings: Sequence[Drawing]) -> list[Drawing]:
    """Return drawings of one silhouette, the first two brought half way to each other."""
    if len(drawings) < 2:
        return list(drawings)
    pair = merged(drawings[0], drawings[1])
    return [pair.first, pair.second, *drawings[2:]]


def _without_crumbs(f: Volume) -> Volume:
    numbered: Any = ndimage.label(f < 0)
    labels, count = numbered
    if count < 2:
        return f
    sizes = np.bincount(labels.reshape(-1))
    crumbs = sizes < CRUMB * sizes[1:].max()
    crumbs[0] = False
    return np.where(crumbs[labels], np.float32(GONE_PX), f)
