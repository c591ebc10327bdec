"""Decide which straight sides are crops by fitting the mannequin with and without them.

A side that may be a cut is left out of the outlines, and the sheet fitted again. At the picture's
edge the cut must then explain the rest far better: a whole figure may touch the edge. Within the
picture the ruled line is evidence of its own, but so drawn soles may end; there the mannequin must
be the character, for another body's legs are longer, and the views that nothing cuts must agree.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toonset.calib.fit.sheet_adjustment import JointFit
from toonset.calib.flaws.cropped import beyond_px, flat_sides, overhang_px
from toonset.calib.result import CutOff, FlatSide
from toonset.view import View

LEAST_LOST_PX = 1.5  # less is a sole that lies between two pixels
MET = 0.005**2  # cost under which a figure at the picture's edge is whole
EXPLAINED = 0.5  # of the cost, under which a cut at the picture's edge explains the outline
FARTHER = 2.0  # times what it does elsewhere the mannequin goes on beyond a cut
SAME_SCALE = 0.02  # views of a sheet differ by 1 % (`sheet_prior.Spreads`)

Cuts = list[tuple[int, CutOff]]  # with the view's number


def possible_cuts(
    views: Sequence[View], joint: JointFit, costs: Sequence[float]
) -> tuple[Cuts, Cuts]:
    """Return the cuts that the outlines end at already, and those that are worth a fit.

    Args:
        views: the drawings, ending where that is known.
        joint: the sheet's fit with the other figures taken for whole.
        costs: of its views.
    """
    sides = [(i, flat) for i, view in enumerate(views) for flat in flat_sides(view)]
    known, possible = [], []
    for i, cut in _measured(views, joint, sides):
        if cut.flat.is_end_of(views[i]):
            known += [(i, cut)] if cut.lost_px >= LEAST_LOST_PX else []
        elif costs[i] > MET if cut.flat.at_edge else cut.lost_px >= LEAST_LOST_PX / 2:
            possible.append((i, cut))
    return known, possible


def prove_cuts(
    views: Sequence[View],
    possible: Cuts,
    tried: JointFit,
    costs: tuple[Sequence[float], Sequence[float]],
    *,
    differs: bool,
) -> Cuts:
    """Return the cuts that a fit without those sides proves.

    Args:
        views: the drawings.
        possible: what may be cut off.
        tried: the fit of the outlines that end there.
        costs: of the views as whole figures, and in `tried`.
        differs: the mannequin is another body than the drawn one.
    """
    whole, ended = costs
    proven = []
    for i, cut in _measured(views, tried, [(i, cut.flat) for i, cut in possible]):
        error = tried.noise.smooth * views[i].figure_box[3]
        if cut.flat.at_edge:
            right = ended[i] < EXPLAINED * whole[i]
        else:
            right = not differs and _stands_out(i, cut, views, possible, tried)
        if right and cut.lost_px >= max(LEAST_LOST_PX, error):
            proven.append((i, cut))
    return proven


def _stands_out(
    index: int, cut: CutOff, views: Sequence[View], possible: Cuts, tried: JointFit
) -> bool:
    """Return whether the views that are whole on that side agree with a cut.

    Longer legs than the character's reach below all feet, or make the views that end in a ruled
    line larger than the others; where all end so, on a ground line, nothing tells.
    """
    side, surface, poses = cut.flat.side, tried.body.surface, tried.poses
    ruled = {i for i, other in possible if other.flat.side == side}
    whole = [i for i in range(len(views)) if i not in ruled]
    if not whole:
        return False
    usual = float(np.median([overhang_px(side, surface, poses[i], views[i]) for i in whole]))
    larger = poses[index].scale / np.median([poses[i].scale for i in whole]) - 1
    farther = cut.lost_px >= LEAST_LOST_PX + FARTHER * max(0.0, usual)
    return bool(abs(larger) < SAME_SCALE and farther)


def _measured(
    views: Sequence[View], joint: JointFit, sides: Sequence[tuple[int, FlatSide]]
) -> Cuts:
    surface = joint.body.surface
    lost = [beyond_px(flat, surface, joint.poses[i], views[i]) for i, flat in sides]
    return [(i, CutOff(views[i].name, flat, px)) for (i, flat), px in zip(sides, lost, strict=True)]
