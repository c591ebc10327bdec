"""The whole sheet at once: shared perspective and outline offset, elevation and scale nearly so.

Unknowns: six numbers per view (rotation increment, shift, log scale), k = 1 / distance and the
outline offset (a drawn line is thicker than a silhouette), one each for the sheet. Residuals are
the two-sided point-to-line distances of `calib.align`; priors tie the views' elevations and log
scales to their own mean, keep roll near zero and the offset within a line's width. Derivatives are
analytic (`calib.pose`); the normal equations are dense, 6n + 2 unknowns.

Model choice: orthographic (k = 0) unless the perspective fit lowers BIC by a margin, with the
*effective* number of outline samples; a k that data cannot tell from zero is zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.calib.align import (
    EFFECTIVE_POINTS,
    MAX_TURN,
    Drawing,
    ElevationPrior,
    Matches,
    match,
    tilt,
    upright_prior,
)
from toonset.calib.pose import PARAMETERS, Pose, project_with_jacobian
from toonset.calib.rim import Surface

SHARED = 2  # k and the outline offset
ELEVATION_SPREAD = np.radians(3.0)  # between the views of one sheet
SCALE_SPREAD = 0.02  # relative, between the views of one sheet
OFFSET_OF_HEIGHT = 0.006  # prior of the outline offset: a line's half width
MIN_NOISE_OF_HEIGHT = 0.001  # matching error of a faultless drawing
MAX_K_RADIUS = 0.6  # nearest camera: the mesh's radius is 0.6 of the distance
BIC_MARGIN = 6.0  # "strong" evidence (Kass and Raftery 1995)


@dataclass(frozen=True, eq=False)
class JointFit:
    """The cameras of a sheet, fitted together.

    Attributes:
        poses: per view, full-size pixels; all share k.
        offset: outline offset over the figure's height (> 0: drawn outside of the mesh).
        noise: robust outline error over the figure's height, over the sheet.
        score: n_eff log(mean Geman-McClure loss), the data term of BIC.
        covariance: (6n + 2, 6n + 2) of (w, shift, log scale) per view in working pixels, then k
            and offset; deflated to the effective number of outline samples.
    """

    poses: tuple[Pose, ...]
    offset: float
    noise: float
    score: float
    covariance: Float[np.ndarray, "unknowns unknowns"]


@dataclass(frozen=True)
class ModelChoice:
    """Orthographic or pinhole, and why.

    Attributes:
        model: "orthographic" or "perspective".
        distance_heights: camera distance in body heights; infinity for orthographic.
        bic_gain: BIC(orthographic) - BIC(perspective); above the margin perspective is proven.
        effective_samples: outline samples counted as independent.
        margin: BIC gain that proves perspective.
    """

    model: str
    distance_heights: float
    bic_gain: float
    effective_samples: float
    margin: float = BIC_MARGIN


def fit_sheet(
    drawings: Sequence[Drawing],
    surface: Surface,
    poses: Sequence[Pose],
    *,
    perspective: bool,
    widths: Float[np.ndarray, " iterations"],
) -> JointFit:
    """Return all views refined together from `poses`.

    Args:
        drawings: outlines at the working scale, one per view.
        surface: the mannequin.
        poses: starts, full-size pixels.
        perspective: free k (else every k stays as it is in `poses`).
        widths: robust width over the figure's height, one per step.
    """
    working = [d.pose_in(p) for d, p in zip(drawings, poses, strict=True)]
    if perspective and working[0].k == 0:
        working = [replace(p, k=0.02 / surface.radius) for p in working]
    offset, noise = 0.0, float(widths[0]) / 2
    for width in widths:
        matched = [match(d, surface, p) for d, p in zip(drawings, working, strict=True)]
        system = _System(drawings, working, matched, offset, width)
        noise = float(np.clip(system.noise, MIN_NOISE_OF_HEIGHT, width))
        normal, gradient = system.equations(noise, free_k=perspective)
        step = -np.linalg.solve(normal, gradient)
        step *= min(1.0, MAX_TURN / max(np.abs(step[:-SHARED]).reshape(-1, 6)[:, :3].max(), 1e-12))
        k = float(np.clip(working[0].k + step[-2], 0.0, MAX_K_RADIUS / surface.radius))
        offset += float(step[-1])
        per_view = step[:-SHARED].reshape(-1, PARAMETERS)
        working = [
            replace(p.moved(s), k=k if perspective else p.k)
            for p, s in zip(working, per_view, strict=True)
        ]
    matched = [match(d, surface, p) for d, p in zip(drawings, working, strict=True)]
    system = _System(drawings, working, matched, offset, float(widths[-1]))
    noise = max(system.noise, MIN_NOISE_OF_HEIGHT)
    normal, _ = system.equations(noise, free_k=perspective)
    samples = EFFECTIVE_POINTS * len(drawings)
    return JointFit(
        tuple(d.pose_out(p) for d, p in zip(drawings, working, strict=True)),
        offset,
        noise,
        samples * float(np.log(system.loss)),
        np.linalg.inv(normal),
    )


def choose_model(
    flat: JointFit, deep: JointFit, surface: Surface, views: int
) -> tuple[JointFit, ModelChoice]:
    """Return the orthographic fit unless the perspective one is proven by BIC."""
    samples = EFFECTIVE_POINTS * views
    gain = flat.score - deep.score - float(np.log(samples))
    k = deep.poses[0].k
    if gain > BIC_MARGIN and k > 0:
        return deep, ModelChoice("perspective", 1 / (k * surface.height), gain, samples)
    return flat, ModelChoice("orthographic", float("inf"), gain, samples)


class _System:
    """The linearised problem at one set of poses and matches."""

    def __init__(
        self,
        drawings: Sequence[Drawing],
        poses: Sequence[Pose],
        matched: Sequence[Matches],
        offset: float,
        width: float,
    ) -> None:
        self.poses = poses
        self.height = drawings[0].height  # the same working height for every view
        rows, residuals, weights = [], [], []
        for pose, matches in zip(poses, matched, strict=True):
            count = len(matches.points)
            pixels, slopes = project_with_jacobian(pose, matches.points)
            jacobian = np.einsum("ni,nij->nj", matches.normals, slopes)
            off = (matches.normals * (pixels - matches.targets)).sum(axis=1)
            rows.append(np.hstack([jacobian, np.full((count, 1), self.height)]))
            residuals.append(off + offset * self.height)
            relative = matches.distances / self.height
            weight = (width**2 / (width**2 + relative**2)) ** 2
            side = np.arange(count) < matches.drawn
            weights.append(weight / (2 * np.where(side, side.sum(), max((~side).sum(), 1))))
        self.rows, self.residuals, self.weights = rows, residuals, weights
        self.offset = offset
        robust = [
            (w * (r / self.height) ** 2).sum() / w.sum()
            for r, w in zip(residuals, weights, strict=True)
        ]
        self.noise = float(np.sqrt(np.mean(robust)))
        # the Geman-McClure loss itself (not its quadratic model) is comparable between models
        self.loss = float(
            np.mean(
                [
                    ((r / self.height) ** 2 * width**2 / (width**2 + (r / self.height) ** 2)).mean()
                    for r in residuals
                ]
            )
        )

    def equations(
        self, noise: float, *, free_k: bool
    ) -> tuple[Float[np.ndarray, "unknowns unknowns"], Float[np.ndarray, " unknowns"]]:
        """Return the normal matrix and gradient of data and priors."""
        views = len(self.poses)
        size = PARAMETERS * views + SHARED
        normal, gradient = np.zeros((size, size)), np.zeros(size)
        for i, (rows, residuals, weights) in enumerate(
            zip(self.rows, self.residuals, self.weights, strict=True)
        ):
            w = weights * EFFECTIVE_POINTS / (noise * self.height) ** 2
            own = slice(PARAMETERS * i, PARAMETERS * (i + 1))
            where = [*range(own.start, own.stop), size - 2, size - 1]
            normal[np.ix_(where, where)] += (rows * w[:, None]).T @ rows
            gradient[where] += rows.T @ (w * residuals)
            matrix, slope = upright_prior(self.poses[i], ElevationPrior())
            normal[own, own] += matrix
            gradient[own] += slope
        self._tie_views(normal, gradient)
        normal[-1, -1] += 1 / OFFSET_OF_HEIGHT**2
        gradient[-1] += self.offset / OFFSET_OF_HEIGHT**2
        if not free_k:
            normal[-2, :] = normal[:, -2] = 0
            normal[-2, -2], gradient[-2] = 1.0, 0.0
        normal += 1e-9 * np.diag(np.diag(normal)) + 1e-12 * np.eye(size)
        return normal, gradient

    def _tie_views(
        self,
        normal: Float[np.ndarray, "unknowns unknowns"],
        gradient: Float[np.ndarray, " unknowns"],
    ) -> None:
        """Pull elevations and log scales to their mean over the sheet (hierarchical prior)."""
        views = len(self.poses)
        size = len(gradient)
        centre = np.eye(views) - 1 / views
        tilts = [tilt(pose) for pose in self.poses]
        elevation = np.array([angles[1] for angles, _ in tilts])
        log_scale = np.log([p.scale for p in self.poses])
        slopes = np.zeros((2, views, size))
        for i, (_, by_turn) in enumerate(tilts):
            slopes[0, i, PARAMETERS * i : PARAMETERS * i + 3] = by_turn[1]
            slopes[1, i, PARAMETERS * i + 5] = 1
        for values, slope, sigma in (
            (elevation, slopes[0], ELEVATION_SPREAD),
            (log_scale, slopes[1], SCALE_SPREAD),
        ):
            tied = centre @ slope / sigma
            normal += tied.T @ tied
            gradient += tied.T @ (centre @ values / sigma)
