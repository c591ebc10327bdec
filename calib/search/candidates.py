"""Refine a view's candidate cameras by contour alignment, and add their mirror twins.

A candidate's negative log-likelihood is n / 2 * log(cost), noise profiled out, with the number n of
independent outline errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.calib.fit.align import INDEPENDENT_POINTS, Fit, align_all
from toonset.calib.outline.correspondences import Drawing
from toonset.calib.outline.occluding_contour import Surface
from toonset.calib.outline.pose import Pose, project
from toonset.camera import rotation_distance
from toonset.dataset.mesh.rasterize import silhouette_mask

SAME_POSE = np.radians(8.0)  # candidates nearer than this are one
OTHER = np.radians(15.0)  # an alternative this far away is another camera
MIRROR = np.radians(15.0)  # a candidate this near to the twin's rotation is the twin
LOOK_PX = 192  # picture in which a pose and its twin are compared
ALIKE = 0.99  # overlap from which two silhouettes are one; a bag at one side makes it 0.94


@dataclass(frozen=True, eq=False)
class Candidates:
    """A view's refined, distinct poses.

    Attributes:
        fits: best data fit first.
        energies: (n,) negative log-likelihood of the data, nats, relative to the best.
    """

    fits: tuple[Fit, ...]
    energies: Float[np.ndarray, " n"]

    @classmethod
    def of(cls, fits: Sequence[Fit]) -> Candidates:
        """Return the best of all fits that are the same, the outlines' distance their evidence."""
        distinct: list[Fit] = []
        for fit in sorted(fits, key=lambda fit: fit.cost):
            apart = (rotation_distance(fit.pose.rotation, f.pose.rotation) for f in distinct)
            if all(angle > SAME_POSE for angle in apart):
                distinct.append(fit)
        costs = np.array([fit.cost for fit in distinct])
        return cls(tuple(distinct), 0.5 * INDEPENDENT_POINTS * np.log(costs / costs[0]))


def refine(
    drawing: Drawing,
    surface: Surface,
    starts: Sequence[Pose],
    widths: Float[np.ndarray, " iterations"],
) -> Candidates:
    """Return the distinct optima that contour alignment reaches from `starts`."""
    return Candidates.of(align_all(drawing, surface, starts, widths))


def add_twins(poses: Sequence[Pose]) -> list[Pose]:
    """Return the poses and their mirror twins."""
    return [*poses, *(pose.twin() for pose in poses)]


def is_twin(pose: Pose, other: Pose) -> bool:
    """Return whether `other` is the mirror twin of `pose` up to refinement."""
    return rotation_distance(pose.twin().rotation, other.rotation) < MIRROR


def turn_half(pose: Pose) -> Pose:
    """Return the pose that sees the other side: turned by 180 degrees about the vertical."""
    return replace(pose, rotation=pose.rotation @ np.diag([-1.0, 1.0, -1.0]))


def looks_alike_from_behind(surface: Surface, poses: Sequence[Pose]) -> bool:
    """Return whether no view tells the body from itself turned by 180 degrees: a stack of boxes."""
    return all(_look_alike(surface, pose, turn_half(pose)) for pose in poses)


def level_twins(
    view: Candidates, surface: Surface, pose: Pose, *, always: bool, from_behind: bool
) -> Candidates:
    """Return the candidates with equal energies for `pose` and those that look the same.

    Both outlines of a symmetric body are one curve, but sampled at other points; what their costs
    differ by is not evidence, and would add up over the views of a sheet.

    Args:
        view: the candidates.
        surface: the mannequin.
        pose: the chosen one; with k = 0 where perspective is not evidence.
        always: the mannequin is not the character: its asymmetries are no evidence either.
        from_behind: the body looks alike from behind.
    """
    alike = [pose]
    if always or _look_alike(surface, pose, pose.twin()):
        alike.append(pose.twin())
    if from_behind:
        alike += [turn_half(p) for p in alike]
    if len(alike) == 1:
        return view
    pair = [
        i
        for i, fit in enumerate(view.fits)
        if rotation_distance(fit.pose.rotation, pose.rotation) < SAME_POSE
        or any(rotation_distance(fit.pose.rotation, p.rotation) < MIRROR for p in alike[1:])
    ]
    energies = view.energies.copy()
    energies[pair] = energies[pair].min(initial=np.inf)
    return Candidates(view.fits, energies)


def _look_alike(surface: Surface, pose: Pose, other: Pose) -> bool:
    size = (LOOK_PX, LOOK_PX)
    scale = 0.5 * LOOK_PX / surface.radius
    a, b = (
        silhouette_mask(project(p, surface.vertices), surface.faces, size)
        for p in (replace(q, shift=np.full(2, LOOK_PX / 2), scale=scale) for q in (pose, other))
    )
    return float((a & b).sum() / max((a | b).sum(), 1)) >= ALIKE
