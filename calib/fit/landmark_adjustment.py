"""Adjust the cameras of all views to their landmarks by Levenberg-Marquardt in torch.

Projection, increments and Jacobians are `toonset.projection`'s (kornia's So3); views, and starts of
one view, are a batch. A pair's error is a Student t in two dimensions of one width for the sheet,

    energy = sum (TAIL + 2) log(1 + |r|^2 / (TAIL sigma^2)),

so that a wrong pair pulls little. What views share (elevation, scale, no roll) is tied as in the
adjustment to outlines (`toonset.calib.fit.sheet_prior`), and sigma and the ties' spreads are
estimated along the way. Eye level is where sheets are drawn: the sheet's elevation is N(0, 3 deg)
or, rarely, anything.

Source: the t distribution as reweighted least squares: Lange, Little and Taylor, Robust statistical
modeling using the t distribution, JASA 84 (1989).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from toonset.calib.fit.align import ROLL_SIGMA, ElevationPrior, tilt
from toonset.calib.fit.landmark_starts import Pixels, Points
from toonset.calib.fit.proportions import Body
from toonset.calib.fit.sheet_prior import SharedPrior, Spreads, anchors, sheet_priors
from toonset.calib.outline.pose import PARAMETERS, Pose, pixel_slopes
from toonset.projection import CameraTensors, project, project_with_jacobian

TAIL = 4.0  # degrees of freedom of a pair's error
NORMAL = 1.2018  # makes sigma the standard deviation of normal errors: 2 / E[weight |r|^2]
CLICK_OF_HEIGHT = 0.01  # error of a click or of the mannequin's proportions, before looking
CLICK_WEIGHT = 2.0  # of that knowledge, in coordinates
ROUNDING_PX = 1e-3  # no pixel is given more exactly
NEAREST = 0.6  # largest k times the points' radius: all points lie well before the camera
LARGEST_STEP = 0.5  # radians, log scale: beyond it the linearisation means nothing
MOST_STEPS, MOST_JOINT_STEPS = 20, 40
SETTLED = 2  # steps before sigma and the spreads are estimated
CONVERGED, SIGMA_CONVERGED = 1e-5, 0.01  # radians or log scale; relative
MOST_DAMPING, LEAST_DAMPING = 1e6, 1e-9  # of Levenberg-Marquardt
LEAST_FREE = 1e-6  # coordinates beyond what cameras and priors explain
# Elevations of sheets: all of 45 collected ones are drawn at eye level, sprites from anywhere
LEVEL, ANYWHERE, P_STEEP = ElevationPrior(0.0, np.radians(3.0)), ElevationPrior(), 0.05


@dataclass(frozen=True, eq=False)
class Pairs:
    """The pairs of several views, padded to the most that one has.

    Attributes:
        points: (views, n, 3) relative to the surface's middle.
        pixels: (views, n, 2).
        given: (views, n) 1 for a pair, 0 for padding.
    """

    points: Float[Tensor, "views n 3"]
    pixels: Float[Tensor, "views n 2"]
    given: Float[Tensor, "views n"]

    @classmethod
    def of(cls, views: Sequence[tuple[Points, Pixels]]) -> Pairs:
        """Return the pairs of several views."""
        most = max(len(points) for points, _ in views)
        points, pixels = np.zeros((len(views), most, 3)), np.zeros((len(views), most, 2))
        given = np.zeros((len(views), most))
        for i, (own, seen) in enumerate(views):
            points[i, : len(own)], pixels[i, : len(own)], given[i, : len(own)] = own, seen, 1
        return cls(*map(torch.from_numpy, (points, pixels, given)))

    def at(self, views: Sequence[int]) -> Pairs:
        """Return the pairs of views that may repeat."""
        which = list(views)
        return Pairs(self.points[which], self.pixels[which], self.given[which])

    @property
    def radius(self) -> float:
        """Return how far the points are from the middle at most."""
        return float(torch.linalg.norm(self.points, dim=-1).max())


@dataclass(frozen=True, eq=False)
class ViewPrior:
    """What is known of roll, elevation (radians) and log scale of a batch's cameras."""

    mean: Float[np.ndarray, " 3"]
    sigma: Float[np.ndarray, " 3"]


@dataclass(frozen=True, eq=False)
class Adjusted:
    """The cameras of a sheet, adjusted together.

    Attributes:
        poses: one per view.
        sigma: of a pixel coordinate, over the figure's height.
        spreads: of what the views share.
        elevation: prior of the sheet's mean.
        covariance: (u, u) of (w, shift, log scale) per view and, where it is free, k.
        squared: (views, n) squared error of every pair over sigma squared, 0 for padding.
        misplaced: (views, n) which pairs do not fit the others.
        evidence: for perspective: k in its own uncertainty, squared; 0 where it is not free.
    """

    poses: tuple[Pose, ...]
    sigma: float
    spreads: Spreads
    elevation: ElevationPrior
    covariance: Float[np.ndarray, "u u"]
    squared: Float[np.ndarray, "views n"]
    misplaced: Bool[np.ndarray, "views n"]
    evidence: float


@dataclass(frozen=True, eq=False)
class Equations:
    """A batch's energies and normal equations of (w, shift, log scale, k)."""

    normal: Float[np.ndarray, "views 7 7"]
    gradient: Float[np.ndarray, "views 7"]
    squared: Float[np.ndarray, "views n"]

    @property
    def energy(self) -> Float[np.ndarray, " views"]:
        return np.asarray(_energy(self.squared))


@dataclass(frozen=True, eq=False)
class LandmarkRows:
    """The pairs of a sheet as rows of its adjustment to outlines; views may have none.

    Attributes:
        pairs: pixels of the working pictures, points of the mannequin as it is.
        sigma_px: (views,) of a coordinate, working pixels.
    """

    pairs: Pairs
    sigma_px: Float[np.ndarray, " views"]

    def at(
        self, poses: Sequence[Pose], body: Body
    ) -> list[tuple[Float[np.ndarray, " m"], Float[np.ndarray, "m 7"], Float[np.ndarray, "m p"]]]:
        """Return every view's errors and their slopes by (w, shift, log scale, k) and proportions.

        In units of sigma, weighed; points move with the body.
        """
        rest = self.pairs.points.numpy()
        moves = body.slopes(rest.reshape(-1, 3)).reshape(*rest.shape, -1)
        bent = rest + moves @ body.theta
        pairs = replace(self.pairs, points=torch.from_numpy(bent))
        off, slopes, weights = (part.numpy() for part in _rows(poses, pairs, self.sigma_px))
        root = np.sqrt(weights)[..., None]
        found = []
        for i, pose in enumerate(poses):
            by_point = pixel_slopes(pose, bent[i]) * (root[i] / self.sigma_px[i])[..., None]
            by_point *= self.pairs.given[i].numpy()[:, None, None]
            found.append(
                (
                    (off[i] * root[i]).ravel(),
                    (slopes[i] * root[i][..., None]).reshape(-1, 7),
                    np.einsum("ncj,njp->ncp", by_point, moves[i]).reshape(-1, moves.shape[-1]),
                )
            )
        return found


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
    energy = _energy(_squared(poses, pairs, sigma_px)) + _upright(poses, prior)[0]
    for _ in range(MOST_STEPS):
        which = np.flatnonzero(moving)
        own = [poses[i] for i in which]
        system = equations(own, pairs.at(which.tolist()), sigma_px[which])
        _, normal, gradient = _upright(own, prior)
        normal += system.normal[:, :PARAMETERS, :PARAMETERS]
        gradient += system.gradient[:, :PARAMETERS]
        diagonal = np.einsum("bii->bi", normal)
        diagonal *= 1 + damping[which, None]
        diagonal += 1e-12 * diagonal.max(axis=1, keepdims=True)
        steps = _limited(-np.linalg.solve(normal, gradient[..., None])[..., 0])
        moved = [pose.moved(step) for pose, step in zip(own, steps, strict=True)]
        squared = _squared(moved, pairs.at(which.tolist()), sigma_px[which])
        trial = _energy(squared) + _upright(moved, prior)[0]
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
    size = PARAMETERS * len(starts) + perspective
    most_k, damping = NEAREST / pairs.radius, 1e-3
    poses, shared = tuple(starts), _Shared()
    for number in range(MOST_JOINT_STEPS):
        sigma_px = pixel_sigmas(poses, shared.sigma * height)
        system = _System.of(poses, pairs, sigma_px, shared, size)
        while True:
            damped = system.normal + damping * np.diag(np.diag(system.normal))
            step = _limited(-np.linalg.solve(damped, system.gradient)[None])[0]
            moved = _moved(poses, step, most_k)
            if better := _total(moved, pairs, sigma_px, shared) <= system.energy:
                break
            damping *= 10
            if damping > MOST_DAMPING:
                break
        if better:
            poses, damping = moved, max(damping / 10, LEAST_DAMPING)
        before = shared
        if number >= SETTLED:
            shared = shared.learned(system, _squared(poses, pairs, sigma_px), pairs)
            still = abs(np.log(shared.sigma / before.sigma)) < SIGMA_CONVERGED
            if still and (not better or np.abs(step).max() < CONVERGED):
                break
    sigma_px = pixel_sigmas(poses, shared.sigma * height)
    wrong = misplaced(_squared(poses, pairs, sigma_px), pairs)
    fitted = _System.of(poses, pairs, sigma_px, shared, size)
    evidence = poses[0].k ** 2 / float(np.linalg.inv(fitted.normal)[-1, -1])
    sigma_px = pixel_sigmas(poses, shared.honest_sigma * height)
    honest = _System.of(poses, pairs, sigma_px, shared, size)
    return Adjusted(
        poses,
        shared.honest_sigma,
        shared.spreads,
        shared.elevation,
        np.linalg.inv(honest.normal),
        _squared(poses, pairs, sigma_px),
        wrong,
        evidence if perspective else 0.0,
    )


def misplaced(squared: Float[np.ndarray, "views n"], pairs: Pairs) -> Bool[np.ndarray, "views n"]:
    """Return which pairs are wrong, at 1 % significance over a view's; squared as in `Adjusted`."""
    counts = pairs.given.sum(1, keepdim=True).numpy()
    return np.asarray(squared > 2 * np.log(100 * counts))


def pixel_sigmas(poses: Sequence[Pose], sigma: float) -> Float[np.ndarray, " views"]:
    """Return an error in world units as pixels of every view."""
    return np.maximum(sigma * _scales(poses), ROUNDING_PX)


@dataclass(frozen=True)
class _Shared:
    """What is estimated of the sheet beside its cameras; see `Adjusted`.

    Two sigmas: the fit takes the geometric mean of what is left and what is expected of clicks, so
    that exact clicks count as exact; the arithmetic one says how sure the cameras are.
    """

    sigma: float = CLICK_OF_HEIGHT
    honest_sigma: float = CLICK_OF_HEIGHT
    spreads: Spreads = field(default_factory=Spreads)
    elevation: ElevationPrior = ANYWHERE

    def learned(
        self, system: _System, squared: Float[np.ndarray, "views n"], pairs: Pairs
    ) -> _Shared:
        """Return it as the sheet tells it."""
        covariance = np.linalg.inv(system.normal)
        told = float(np.trace(covariance @ system.of_pairs))
        kept = pairs.given.numpy().astype(bool) & ~misplaced(squared, pairs)
        free = max(2 * int(kept.sum()) - told, LEAST_FREE)
        weighted = float((_weights(squared) * squared)[kept].sum())
        left = NORMAL * weighted * self.sigma**2 / free
        share, usual = free / (free + CLICK_WEIGHT), Spreads()
        logs = share * np.log(max(left, 1e-14)) + (1 - share) * np.log(CLICK_OF_HEIGHT**2)
        honest = np.sqrt(share * left + (1 - share) * CLICK_OF_HEIGHT**2)
        spreads = {
            name: prior.spread(covariance, getattr(usual, name))
            for name, prior in system.priors.items()
        }
        level = _level(float(system.priors["elevation"].values.mean()))
        return _Shared(float(np.exp(logs / 2)), float(honest), replace(usual, **spreads), level)


def _level(mean: float) -> ElevationPrior:
    """Return the prior of a sheet's elevation: eye level, as far as its mean is likely to be that.

    The mixture of both as one normal distribution of their mean precision (expectation step).
    """
    level, steep = (
        p * np.exp(-0.5 * ((mean - prior.mean) / prior.sigma) ** 2) / prior.sigma
        for p, prior in ((1 - P_STEEP, LEVEL), (P_STEEP, ANYWHERE))
    )
    near = level / (level + steep)
    precisions = near / LEVEL.sigma**2, (1 - near) / ANYWHERE.sigma**2
    middle = precisions[1] * ANYWHERE.mean / sum(precisions)
    return ElevationPrior(float(middle), float(sum(precisions) ** -0.5))


@dataclass(frozen=True, eq=False)
class _System:
    """The linearised problem: energy, normal equations, the pairs' part of them, the priors."""

    energy: float
    normal: Float[np.ndarray, "u u"]
    gradient: Float[np.ndarray, " u"]
    of_pairs: Float[np.ndarray, "u u"]
    priors: dict[str, SharedPrior]

    @classmethod
    def of(
        cls,
        poses: Sequence[Pose],
        pairs: Pairs,
        sigma_px: Float[np.ndarray, " views"],
        shared: _Shared,
        size: int,
    ) -> _System:
        points = equations(poses, pairs, sigma_px)
        of_pairs, gradient = _spread_out(points, size)
        normal, energy = of_pairs.copy(), float(points.energy.sum())
        priors = sheet_priors(poses, None, shared.spreads.yaw, size)
        for prior, sigma in _with_sigmas(priors, shared):
            matrix, slope = prior.equations(sigma)
            normal += matrix
            gradient += slope
            energy += _off(prior, sigma)
        normal += 1e-12 * np.diag(np.diag(normal))
        return cls(energy, normal, gradient, of_pairs, priors)


def _total(
    poses: Sequence[Pose], pairs: Pairs, sigma_px: Float[np.ndarray, " views"], shared: _Shared
) -> float:
    """Return the energy of pairs and priors."""
    priors = sheet_priors(poses, None, shared.spreads.yaw, PARAMETERS * len(poses))
    own = (_off(prior, sigma) for prior, sigma in _with_sigmas(priors, shared))
    return float(_energy(_squared(poses, pairs, sigma_px)).sum()) + sum(own)


def _with_sigmas(
    priors: dict[str, SharedPrior], shared: _Shared
) -> list[tuple[SharedPrior, float]]:
    own = [(prior, getattr(shared.spreads, name)) for name, prior in priors.items()]
    return [*own, *anchors(priors, None, shared.elevation)]


def _off(prior: SharedPrior, sigma: float) -> float:
    return float((prior.weights * (prior.centre @ prior.values / sigma) ** 2).sum())


def _spread_out(
    points: Equations, size: int
) -> tuple[Float[np.ndarray, "u u"], Float[np.ndarray, " u"]]:
    """Return the views' equations as the sheet's, k last where it is free."""
    normal, gradient = np.zeros((size, size)), np.zeros(size)
    for i, (own, slope) in enumerate(zip(points.normal, points.gradient, strict=True)):
        where = np.arange(PARAMETERS * i, PARAMETERS * (i + 1))
        if size % PARAMETERS:
            where = np.append(where, size - 1)
        normal[np.ix_(where, where)] += own[: len(where), : len(where)]
        gradient[where] += slope[: len(where)]
    return normal, gradient


def _moved(poses: Sequence[Pose], step: Float[np.ndarray, " u"], most_k: float) -> tuple[Pose, ...]:
    own = step[: PARAMETERS * len(poses)].reshape(-1, PARAMETERS)
    moved = [pose.moved(each) for pose, each in zip(poses, own, strict=True)]
    if not len(step) % PARAMETERS:
        return tuple(moved)
    k = float(np.clip(poses[0].k + step[-1], 0.0, most_k))
    return tuple(replace(pose, k=k) for pose in moved)


def equations(
    poses: Sequence[Pose], pairs: Pairs, sigma_px: Float[np.ndarray, " views"]
) -> Equations:
    """Return the reweighted normal equations of every view."""
    off, slopes, weights = _rows(poses, pairs, sigma_px)
    weighted = slopes * weights[..., None, None]
    normal = torch.einsum("vncp,vncq->vpq", weighted, slopes)
    gradient = torch.einsum("vncp,vnc->vp", weighted, off)
    return Equations(normal.numpy(), gradient.numpy(), off.square().sum(-1).numpy())


def _rows(
    poses: Sequence[Pose], pairs: Pairs, sigma_px: Float[np.ndarray, " views"]
) -> tuple[Float[Tensor, "views n 2"], Float[Tensor, "views n 2 7"], Float[Tensor, "views n"]]:
    """Return errors and slopes in units of sigma, 0 for padding, and the pairs' weights."""
    pixels, slopes = project_with_jacobian(_tensors(poses), pairs.points)
    seen = pairs.given[..., None] * torch.from_numpy(1 / sigma_px)[:, None, None]
    off = (pixels - pairs.pixels) * seen
    return off, slopes * seen[..., None], (TAIL + 2) / (TAIL + off.square().sum(-1))


def _squared(
    poses: Sequence[Pose], pairs: Pairs, sigma_px: Float[np.ndarray, " views"]
) -> Float[np.ndarray, "views n"]:
    off = (project(_tensors(poses), pairs.points) - pairs.pixels).square().sum(-1) * pairs.given
    return off.nan_to_num(nan=torch.inf).numpy() / sigma_px[:, None] ** 2


def _weights(squared: Float[np.ndarray, "views n"]) -> Float[np.ndarray, "views n"]:
    return (TAIL + 2) / (TAIL + squared)


def _energy(squared: Float[np.ndarray, "views n"]) -> Float[np.ndarray, " views"]:
    return np.asarray((TAIL + 2) * np.log1p(squared / TAIL).sum(axis=1))


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


def _tensors(poses: Sequence[Pose]) -> CameraTensors:
    scales = _scales(poses)
    return CameraTensors(
        torch.from_numpy(np.array([pose.rotation for pose in poses])),
        torch.zeros((len(poses), 3), dtype=torch.float64),
        torch.from_numpy(np.array([pose.shift for pose in poses])),
        torch.from_numpy(np.stack([scales, scales], axis=1)),
        torch.from_numpy(np.array([pose.k for pose in poses])),
    )


def _scales(poses: Sequence[Pose]) -> Float[np.ndarray, " views"]:
    return np.array([pose.scale for pose in poses])
