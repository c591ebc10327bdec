"""Search the turn that explains all drawings of a sheet at once.

One drawing of a character whose mannequin has another body fits the mannequin best from a wrong
side; eight drawings together do not. Every view's silhouette is compared with every template,
whatever its shift; the mismatch counts mannequin outside of the drawing in full and drawing outside
of the mannequin (hair, skirt, sword) at 0.3, and a turn's score is its sum over the views.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

from toonset.calib.outline.pose import Pose
from toonset.calib.search.sheet_posterior import Turns
from toonset.calib.search.templates import CELL_PX, Templates, normalised, pose_on_box
from toonset.camera import angles_from_rotation, rotation_distance
from toonset.view import View

OUTSIDE_MANNEQUIN = 0.3  # cost of drawing where the mannequin is not, to mannequin outside
SHIFT_PX = (10, 3)  # of a drawing against its box: props make boxes lopsided
ALTERNATIVES = 2  # turns that are looked into
APART = np.radians(15.0)  # mean rotation between two of them


@dataclass(frozen=True, eq=False)
class TurnStart:
    """Coarse poses of all views under one turn, with their mean mismatch."""

    poses: tuple[Pose, ...]
    mismatch: float


def likely_turns(views: Sequence[View], templates: Templates, turns: Turns) -> list[TurnStart]:
    """Return the best few turns over all views, best first, mirror twins left out."""
    table, boxes = zip(*(_mismatch(view, templates) for view in views), strict=True)
    angles = np.array([angles_from_rotation(r)[:2] for r in templates.rotations])
    levels = np.unique(np.round(angles[:, 1], 6))
    ranked: list[tuple[float, list[int]]] = []
    for level in levels:
        at_level = np.flatnonzero(np.abs(angles[:, 1] - level) < 1e-5)
        off = turns.places[..., None] - angles[at_level, 0]
        nearest = np.abs((off + np.pi) % (2 * np.pi) - np.pi)
        for row, places in zip(nearest, turns.places, strict=True):
            if np.isnan(places).all():
                continue
            chosen = [
                at_level[int(near.argmin())]
                if np.isfinite(place)
                else at_level[int(costs[at_level].argmin())]
                for near, place, costs in zip(row, places, table, strict=True)
            ]
            ranked.append(
                (float(np.mean([t[c] for t, c in zip(table, chosen, strict=True)])), chosen)
            )
    starts: list[TurnStart] = []
    for mismatch, chosen in sorted(ranked, key=lambda item: item[0]):
        poses = tuple(pose_on_box(templates, c, box) for c, box in zip(chosen, boxes, strict=True))
        if all(_apart(poses, other.poses) > APART for other in starts):
            starts.append(TurnStart(poses, mismatch))
        if len(starts) == ALTERNATIVES:
            break
    return starts


def _apart(poses: Sequence[Pose], others: Sequence[Pose]) -> float:
    """Return the mean rotation between two sheets of poses, modulo the mirror twin."""

    def mean(twins: bool) -> float:
        return float(
            np.mean(
                [
                    rotation_distance(p.rotation, (q.twin() if twins else q).rotation)
                    for p, q in zip(poses, others, strict=True)
                ]
            )
        )

    return min(mean(False), mean(True))


def _mismatch(
    view: View, templates: Templates
) -> tuple[Float[np.ndarray, " templates"], Float[np.ndarray, " 4"]]:
    """Return the mismatch with every template at its best shift, and the drawing's box."""
    mask, box = normalised(view)
    wide, tall = SHIFT_PX
    padded = np.pad(mask.astype(np.float32), ((tall, tall), (wide, wide)))
    cells = templates.masks.reshape(-1, CELL_PX, CELL_PX).astype(np.float32)
    shared = np.array([cv2.matchTemplate(padded, c, cv2.TM_CCORR).max() for c in cells])
    areas, drawn = cells.sum(axis=(1, 2)), float(mask.sum())
    cost = areas - shared + OUTSIDE_MANNEQUIN * (drawn - shared)
    return cost / (areas + OUTSIDE_MANNEQUIN * drawn), box
