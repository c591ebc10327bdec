"""Adjust cameras to their landmarks by Levenberg-Marquardt: single starts, or all views together.

What views share (elevation, scale, no roll) is tied as in the adjustment to outlines
(`toonset.calib.fit.sheet_prior`); the clicks' sigma and the ties' spreads are estimated along the
way. Eye level is where sheets are drawn: the sheet's elevation is N(0, 3 deg) or, rarely, anything.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float

from toonset.calib.fit.landmark_residuals import Pairs, energy_of, normal_equations, pixel_sigmas
from toonset.calib.fit.sheet_adjustment import MAX_K_RADIUS
from toonset.calib.fit.sheet_prior import SharedPrior, Spreads, anchors, sheet_priors
from toonset.calib.fit.tilt import ANYWHERE, ElevationPrior, level_or_steep, tilt
from toonset.calib.outline.pose import PARAMETERS, Pose

NORMAL = 1.2018  # makes sigma the standard deviation of normal errors: 2 / E[weight |r|^2]
CLICK_OF_HEIGHT = 0.01  # error of a click or of the mannequin's proportions, before looking
CLICK_WEIGHT = 2.0  # of that knowledge, in coordinates
LARGEST_STEP = 0.5  # radians, log scale: beyond it the linearisation means nothing
MOST_STEPS, MOST_JOINT_STEPS = 20, 40
SETTLED = 2  # steps before sigma and the spreads are estimated
CONVERGED, SIGMA_CONVERGED = 1e-5, 0.01  # radians or log scale; relative
MOST_DAMPING, LEAST_DAMPING = 1e6, 1e-9  # of Levenberg-Marquardt
LEAST_FREE = 1e-6  # coordinates beyond what cameras and priors explain


@dataclass(frozen=True, eq=False)
class ViewPrior:
    """What is known of roll, elevation (radians) and log scale of a batch's cameras."""

    mean: Float[np.ndarray, " 3"]
    sigma: Float[np.ndarray, " 3"]


@dataclass(frozen=True)
class Shared:
    """What is estimated of a sheet beside its cameras.

    Attributes:
        sigma: of a pixel coordinate, over the figure's height, as the fit takes it: the geometric
            mean of what is left and what is expected, so that exact clicks count as exact.
        honest_sigma: the quadratic mean, which says how sure the cameras are.
        spreads: between the views.
        elevation: prior of the sheet's mean.
    """

    sigma: float = CLICK_OF_HEIGHT
    honest_sigma: float = CLICK_OF_HEIGHT
    spreads: Spreads = field(default_factory=Spreads)
    elevation: ElevationPrior = ANYWHERE


@dataclass(frozen=True, eq=False)
class Adjusted:
    """The cameras of a sheet, adjusted together.

    Attributes:
        poses: one per view.
        shared: estimated beside them.
        covariance: (u, u) of (w, shift, log scale) per view and, where it is free, k.
        squared: (views, n) squared error of every pair over the honest sigma squared.
        misplaced: (views, n) which pairs do not fit the others.
    """

    poses: tuple[Pose, ...]
    shared: Shared
    covariance: Float[np.ndarray, "u u"]
    squared: Float[np.ndarray, "views n"]
    misplaced: Bool[np.ndarray, "views n"]

    @property
    def evidence(self) -> float:
        """Return k in its own uncertainty, squared, where k is free."""
        sharper = (self.shared.honest_sigma / self.shared.sigma) ** 2
        return self.poses[0].k ** 2 / float(self.covariance[-1, -1]) * sharper


def refine(
    starts: Sequence[Pose], pairs: Pairs, sigma_px: Float[np.ndarray, " cameras"], prior: ViewPrior
) -> tuple[list[Pose], Float[np.ndarray, " cameras"]]:
    """Return the optimum that every start reaches, k as it is, and its energy.

    Args:
        starts: a batch of poses, of any views.
        pairs: of every start.
        sigma_px: of a pixel coordinate.
        prior: of all of them.
    """
    poses, damping = list(starts), np.full(len(starts), 1e-3)
    moving = np.ones(len(starts), dtype=bool)
    energy = energy_of(pairs.squared(poses, sigma_px)) + _upright(poses, prior)[0]
    for _ in range(MOST_STEPS):
        which = np.flatnonzero(moving)
        own = [poses[i] for i in which]
        mine, sigmas = pairs.at(which.tolist()), sigma_px[which]
        of_pairs, slope = normal_equations(*mine.rows(own, sigmas))
        _, normal, gradient = _upright(own, prior)
        normal += of_pairs[:, :PARAMETERS, :PARAMETERS]
        gradient += slope[:, :PARAMETERS]
        diagonal = np.einsum("bii->bi", normal)
        diagonal *= 1 + damping[which, None]
        diagonal += 1e-12 * diagonal.max(axis=1, keepdims=True)
        steps = _limited(-np.linalg.solve(normal, gradient[..., None])[..., 0])
        moved = [pose.moved(step) for pose, step in zip(own, steps, strict=True)]
        trial = energy_of(mine.squared(moved, sigmas)) + _upright(moved, prior)[0]
        better = trial <= energy[which]
        for i in np.flatnonzero(better):
            poses[which[i]], energy[which[i]] = moved[i], trial[i]
        damping[which] *= np.where(better, 0.1, 10.0)
        turned = np.abs(steps[:, [0, 1, 2, 5]]).max(axis=1)
        moving[which] = np.where(better, turned > CONVERGED, damping[which] < MOST_DAMPING)
        if not moving.any():
            break
    return poses, energy


def adjust(starts: Sequence[Pose], pairs: Pairs, height: float, *, perspective: bool) -> Adjusted:
    """Return the cameras of all views that fit the pairs and each other best.

    Args:
        starts: one per view; their k is where the search for perspective begins.
        pairs: of every view.
        height: of the mannequin.
        perspective: free k, one for the sheet; else k stays as it is.
    """
    poses, shared, damping = tuple(starts), Shared(), 1e-3
    for number in range(MOST_JOINT_STEPS):
        system = _System(poses, pairs, height, shared, perspective)
        better, moved, step = False, poses, np.zeros(0)
        while not better and damping < MOST_DAMPING:
            step = system.step(damping)
            moved = _moved(poses, step, MAX_K_RADIUS / pairs.radius)
            better = system.energy_at(moved) <= system.energy
            damping = max(damping / 10, LEAST_DAMPING) if better else 10 * damping
        poses = moved if better else poses
        if number < SETTLED:
            continue
        before, shared = shared.sigma, system.learned(poses)
        still = abs(np.log(shared.sigma / before)) < SIGMA_CONVERGED
        if still and (not better or np.abs(step).max(initial=0) < CONVERGED):
            break
        damping = min(damping, 1.0)
    wrong = pairs.misplaced(pairs.squared(poses, pixel_sigmas(poses, shared.sigma * height)))
    honest = replace(shared, sigma=shared.honest_sigma)
    system = _System(poses, pairs, height, honest, perspective)
    covariance = np.linalg.inv(system.normal)
    return Adjusted(poses, shared, covariance, pairs.squared(poses, system.sigma_px), wrong)


class _System:
    """The problem of all views, linearised at their poses."""

    def __init__(
        self, poses: Sequence[Pose], pairs: Pairs, height: float, shared: Shared, perspective: bool
    ) -> None:
        size = PARAMETERS * len(poses) + perspective
        self.pairs, self.shared = pairs, shared
        self.sigma_px = pixel_sigmas(poses, shared.sigma * height)
        self.of_pairs, self.gradient = np.zeros((size, size)), np.zeros(size)
        normal, gradient = normal_equations(*pairs.rows(poses, self.sigma_px))
        for i in range(len(poses)):
            where = np.arange(PARAMETERS * i, PARAMETERS * (i + 1))
            where = np.append(where, size - 1) if perspective else where
            self.of_pairs[np.ix_(where, where)] += normal[i, : len(where), : len(where)]
            self.gradient[where] += gradient[i, : len(where)]
        self.normal = self.of_pairs + 1e-12 * np.diag(np.diag(self.of_pairs))
        for prior, sigma in self._ties(poses):
            matrix, slope = prior.equations(sigma)
            self.normal += matrix
            self.gradient += slope
        self.energy = self.energy_at(poses)

    def step(self, damping: float) -> Float[np.ndarray, " u"]:
        damped = self.normal + damping * np.diag(np.diag(self.normal))
        return _limited(-np.linalg.solve(damped, self.gradient)[None])[0]

    def energy_at(self, poses: Sequence[Pose]) -> float:
        ties = sum(
            float((prior.weights * (prior.centre @ prior.values / sigma) ** 2).sum())
            for prior, sigma in self._ties(poses)
        )
        return float(energy_of(self.pairs.squared(poses, self.sigma_px)).sum()) + ties

    def learned(self, poses: Sequence[Pose]) -> Shared:
        """Return what the sheet tells of what its views share."""
        covariance = np.linalg.inv(self.normal)
        squared = self.pairs.squared(poses, self.sigma_px)
        kept = self.pairs.given.numpy().astype(bool) & ~self.pairs.misplaced(squared)
        told = float(np.trace(covariance @ self.of_pairs))
        free = max(2 * int(kept.sum()) - told, LEAST_FREE)
        weights = self.pairs.rows(poses, self.sigma_px)[2]
        left = NORMAL * float((weights * squared)[kept].sum()) * self.shared.sigma**2 / free
        share, usual = free / (free + CLICK_WEIGHT), Spreads()
        logs = share * np.log(max(left, 1e-14)) + (1 - share) * np.log(CLICK_OF_HEIGHT**2)
        honest = np.sqrt(share * left + (1 - share) * CLICK_OF_HEIGHT**2)
        priors = self._priors(poses)
        spreads = {n: p.spread(covariance, getattr(usual, n)) for n, p in priors.items()}
        level = level_or_steep(float(priors["elevation"].values.mean()))
        return Shared(float(np.exp(logs / 2)), float(honest), replace(usual, **spreads), level)

    def _priors(self, poses: Sequence[Pose]) -> dict[str, SharedPrior]:
        return sheet_priors(poses, None, self.shared.spreads.yaw, len(self.gradient))

    def _ties(self, poses: Sequence[Pose]) -> list[tuple[SharedPrior, float]]:
        priors = self._priors(poses)
        own = [(prior, getattr(self.shared.spreads, name)) for name, prior in priors.items()]
        return [*own, *anchors(priors, None, self.shared.elevation)]


def _moved(poses: Sequence[Pose], step: Float[np.ndarray, " u"], most_k: float) -> tuple[Pose, ...]:
    own = step[: PARAMETERS * len(poses)].reshape(-1, PARAMETERS)
    moved = [pose.moved(each) for pose, each in zip(poses, own, strict=True)]
    if not len(step) % PARAMETERS:
        return tuple(moved)
    k = float(np.clip(poses[0].k + step[-1], 0.0, most_k))
    return tuple(replace(pose, k=k) for pose in moved)


def _upright(
    poses: Sequence[Pose], prior: ViewPrior
) -> tuple[
    Float[np.ndarray, " views"], Float[np.ndarray, "views 6 6"], Float[np.ndarray, "views 6"]
]:
    """Return energy, normal matrices and gradients of the views' priors."""
    tilts = [tilt(pose) for pose in poses]
    values = np.array(
        [[*angles, np.log(p.scale)] for (angles, _), p in zip(tilts, poses, strict=True)]
    )
    slopes = np.zeros((len(poses), 3, PARAMETERS))
    slopes[:, :2, :3] = [by_turn for _, by_turn in tilts]
    slopes[:, 2, 5] = 1
    rows, off = slopes / prior.sigma[:, None], (values - prior.mean) / prior.sigma
    return (
        (off**2).sum(axis=1),
        np.einsum("vij,vik->vjk", rows, rows),
        np.einsum("vij,vi->vj", rows, off),
    )


def _limited(steps: Float[np.ndarray, "n u"]) -> Float[np.ndarray, "n u"]:
    """Return steps shortened to `LARGEST_STEP` in turns and log scales."""
    views = steps.shape[1] // PARAMETERS
    own = steps[:, : PARAMETERS * views].reshape(len(steps), views, PARAMETERS)
    largest = np.abs(own[..., [0, 1, 2, 5]]).max(axis=(1, 2))
    return steps * np.minimum(1.0, LARGEST_STEP / np.maximum(largest, 1e-12))[:, None]
