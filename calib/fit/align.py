"""Align one view's contour by robust two-sided point-to-line Gauss-Newton, from one start.

Residuals, in pixels of the working scale: (a) every point of the occluding contour against the
nearest drawn one, (b) every drawn point against the nearest of the occluding contour, both along
the drawn normal.
"Nearest" is measured over position and outline direction together, so that the two sides of a
thin limb are not confused. Geman-McClure weights w = (t^2 / (t^2 + d^2))^2 with t annealed from
coarse to fine make far points, such as a hat that the mesh lacks, count little.

Source of the scheme: correspondence-line trackers (Stoiber et al. 2022, SRT3D; Tian et al. 2022)
with iterative closest points instead of colour lines: a drawing has its outline given.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from toonset.calib.fit.tilt import ANYWHERE, upright_prior
from toonset.calib.outline.correspondences import Drawing, Matches, match
from toonset.calib.outline.mesh_edges import Surface
from toonset.calib.outline.pose import PARAMETERS, Pose, project, project_with_jacobian
from toonset.camera import rotation_distance

MAX_TURN = np.radians(12.0)  # per iteration: beyond it the matches of this iteration mean nothing
MERGED = np.radians(3.0)  # starts this near to each other go to the same optimum
NOISE_OF_HEIGHT = 0.012  # a drawn outline's typical error; sets the priors' strength
EFFECTIVE_POINTS = 40.0  # weight of a view's outline against the priors, in points
INDEPENDENT_POINTS = 10.0  # outline errors of a view when alternative poses are compared


@dataclass(frozen=True, eq=False)
class Fit:
    """A refined hypothesis.

    Attributes:
        pose: in pixels of the full-size view.
        cost: mean squared two-sided outline distance, each capped, over height squared.
        error: root mean square of the uncapped part, over height: what is badly off stays out.
        coverage: share of occluding contour and drawn points nearer than the cap.
    """

    pose: Pose
    cost: float
    error: float
    coverage: float


def align(
    drawing: Drawing, surface: Surface, start: Pose, widths: Float[np.ndarray, " iterations"]
) -> Fit:
    """Return `start` (full-size pixels) refined by one Gauss-Newton step per entry of `widths`.

    Args:
        drawing: the outline at the working scale.
        surface: the mannequin.
        start: first pose; its k is kept.
        widths: the robust width of each step over the figure's height.
    """
    return align_all(drawing, surface, [start], widths)[0]


def align_all(
    drawing: Drawing,
    surface: Surface,
    starts: Sequence[Pose],
    widths: Float[np.ndarray, " iterations"],
) -> list[Fit]:
    """Align from every start; drop those that end at a better one."""
    poses = [drawing.pose_in(start) for start in starts]
    for width in widths:
        before, poses = poses, []
        costs = []
        for pose in before:
            matches = match(drawing, surface, pose)
            weights = robust_weights(matches, width * drawing.height)
            step = _gauss_newton_step(matches, weights, pose, drawing.height)
            poses.append(pose.moved(step))
            costs.append(-float(weights.sum()))
        poses = _apart(poses, costs)
    return [measure(drawing, surface, pose) for pose in poses]


def _apart(poses: Sequence[Pose], costs: Sequence[float]) -> list[Pose]:
    """Return the poses less those within `MERGED` of a cheaper one, in their order."""
    kept: list[int] = []
    for i in sorted(range(len(poses)), key=lambda i: costs[i]):
        turns = (rotation_distance(poses[i].rotation, poses[j].rotation) for j in kept)
        if all(turn > MERGED for turn in turns):
            kept.append(i)
    return [poses[i] for i in sorted(kept)]


def measure(drawing: Drawing, surface: Surface, pose: Pose, cap: float = 0.05) -> Fit:
    """Return the fit of a working pose: two-sided distances across the outline, over height.

    Points without a counterpart within `cap` of the height (direction included) count `cap`.
    """
    matches = match(drawing, surface, pose)
    shown = drawing.free[matches.target_index]
    side = np.arange(len(shown)) < matches.drawn
    off = (matches.normals * (project(pose, matches.points) - matches.targets)).sum(axis=1)
    met = matches.distances < cap * drawing.height
    across = np.where(met, np.abs(off) / drawing.height, cap)
    sides = (across[side & shown], across[~side & shown])
    cost = float(np.mean([np.mean(part**2) for part in sides if len(part)]))
    error = float(np.sqrt(np.mean(across[met] ** 2))) if met.any() else cap
    return Fit(drawing.pose_out(pose), cost, error, float(met[shown].mean()))


def robust_weights(matches: Matches, width_px: float) -> Float[np.ndarray, " n"]:
    """Return Geman-McClure weights; the weights of perfect matches sum to 1.

    Both directions count the same, however many points each has.
    """
    weights = (width_px**2 / (width_px**2 + matches.distances**2)) ** 2
    weights[: matches.drawn] /= 2 * matches.drawn
    weights[matches.drawn :] /= 2 * max(len(weights) - matches.drawn, 1)
    return weights


def _gauss_newton_step(
    matches: Matches, weights: Float[np.ndarray, " n"], pose: Pose, height_px: float
) -> Float[np.ndarray, " 6"]:
    pixels, jacobian = project_with_jacobian(pose, matches.points)
    residual = (matches.normals * (pixels - matches.targets)).sum(axis=1)
    rows = np.einsum("ni,nij->nj", matches.normals, jacobian[..., :PARAMETERS])
    weights = weights * EFFECTIVE_POINTS / (NOISE_OF_HEIGHT * height_px) ** 2
    normal = (rows * weights[:, None]).T @ rows
    gradient = rows.T @ (weights * residual)
    prior_matrix, prior_gradient = upright_prior(pose, ANYWHERE)
    normal += prior_matrix + 1e-3 * np.diag(np.diag(normal)) + 1e-9 * np.eye(PARAMETERS)
    step = -np.linalg.solve(normal, gradient + prior_gradient)
    turn = float(np.linalg.norm(step[:3]))
    return step * min(1.0, MAX_TURN / max(turn, 1e-12), 0.3 / max(abs(step[5]), 1e-12))
