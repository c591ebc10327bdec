"""Search a sheet's cameras from its landmarks: starts, joint adjustment, what else could be.

All starts of all views are refined as one batch, at first each by itself, then as views of one
sheet. The adjustment of all views says what they share; under that all starts are refined once
more: those that fit as well are a view's alternatives, one that fits better takes its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.calib.fit.landmark_adjustment import (
    CLICK_OF_HEIGHT,
    Adjusted,
    ViewPrior,
    adjust,
    refine,
)
from toonset.calib.fit.landmark_residuals import Pairs, pixel_sigmas
from toonset.calib.fit.landmark_starts import Pixels, Points, depth_reversed, start_poses
from toonset.calib.fit.model_selection import BIC_MARGIN
from toonset.calib.fit.sheet_adjustment import FIRST_K_RADIUS
from toonset.calib.fit.sheet_prior import Spreads
from toonset.calib.fit.tilt import ANYWHERE, ROLL_SIGMA, tilt
from toonset.calib.outline.pose import PARAMETERS, Pose
from toonset.camera import rotation_distance

OTHER = np.radians(10.0)  # a camera nearer than this is the same, found from another start
BETTER = 1.0  # nats times two, by which another camera takes a view's place
MOST_ROUNDS = 3  # of joint adjustments
FREE = 1e3  # sigma of a log scale of which nothing is known
MAD = 1.4826  # times the median absolute deviation is a standard deviation

Ranked = list[tuple[float, Pose]]  # distinct cameras of a view with their energies, best first


@dataclass(frozen=True, eq=False)
class FoundCameras:
    """The cameras of a sheet.

    Attributes:
        joint: adjusted together.
        others: every view's alternatives; energies relative to the chosen camera's.
        bic_gain: of one camera distance over orthography.
    """

    joint: Adjusted
    others: tuple[Ranked, ...]
    bic_gain: float


def search_cameras(views: Sequence[tuple[Points, Pixels]], height: float) -> FoundCameras:
    """Return the cameras of a sheet's views.

    Args:
        views: three points or more, not on a line, relative to the surface's middle; pixels.
        height: of the mannequin.
    """
    search = _Search(views, Pairs.of(views), height)
    optima = search.optima()
    chosen = [own[0][1] for own in optima]
    if len(views) > 1:
        chosen = [own[0][1] for own in search.ranked(_poses(optima), _prior_about(chosen))]
    flat = search.adjusted(chosen, perspective=False)
    samples = 2 * float(search.pairs.given.sum())
    if samples <= PARAMETERS * len(views) + 1:
        return FoundCameras(*search.settled(flat, optima, perspective=False), 0.0)
    first_k = FIRST_K_RADIUS / search.pairs.radius
    near = [replace(pose, k=first_k) for pose in flat.poses]
    deep = search.adjusted(near, perspective=True)
    gain = float(deep.evidence - np.log(samples))
    proven = gain > BIC_MARGIN
    return FoundCameras(*search.settled(deep if proven else flat, optima, perspective=proven), gain)


@dataclass(frozen=True, eq=False)
class _Search:
    views: Sequence[tuple[Points, Pixels]]
    pairs: Pairs
    height: float

    def optima(self) -> list[Ranked]:
        """Return every view's orthographic cameras, each view by itself."""
        return self.ranked(
            [start_poses(*own) for own in self.views], _prior([ROLL_SIGMA, ANYWHERE.sigma, FREE])
        )

    def adjusted(self, starts: Sequence[Pose], *, perspective: bool) -> Adjusted:
        """Return all views' cameras, adjusted together."""
        return adjust(starts, self.pairs, self.height, perspective=perspective)

    def settled(
        self, joint: Adjusted, optima: Sequence[Ranked], *, perspective: bool
    ) -> tuple[Adjusted, tuple[Ranked, ...]]:
        """Return a joint adjustment no view of which has a better camera, and the alternatives."""
        own: list[float] = []
        ranked: list[Ranked] = []
        for left in reversed(range(MOST_ROUNDS)):
            starts = [
                [pose, depth_reversed(pose, points), *(replace(own, k=pose.k) for own in others)]
                for pose, (points, _), others in zip(
                    joint.poses, self.views, _poses(optima), strict=True
                )
            ]
            sigma_px = pixel_sigmas(joint.poses, joint.shared.honest_sigma * self.height)
            ranked = self.ranked(starts, _prior_of(joint), sigma_px)
            own = [_energy_of(pose, found) for pose, found in zip(joint.poses, ranked, strict=True)]
            better = [found[0][0] < here - BETTER for here, found in zip(own, ranked, strict=True)]
            if not any(better) or not left:
                break
            poses = [
                found[0][1] if change else pose
                for change, found, pose in zip(better, ranked, joint.poses, strict=True)
            ]
            joint = self.adjusted(poses, perspective=perspective)
        others = tuple(
            [(energy - here, other) for energy, other in found if _apart(other, pose)]
            for here, found, pose in zip(own, ranked, joint.poses, strict=True)
        )
        return joint, others

    def ranked(
        self,
        starts: Sequence[Sequence[Pose]],
        prior: ViewPrior,
        sigma_px: Float[np.ndarray, " views"] | None = None,
    ) -> list[Ranked]:
        """Return every view's distinct optima; sigma as it is before looking, or as given."""
        if sigma_px is None:
            scales = np.array([_scale(*own) for own in self.views])
            sigma_px = CLICK_OF_HEIGHT * self.height * scales
        which = np.repeat(np.arange(len(starts)), [len(own) for own in starts])
        poses, energies = refine(
            [pose for own in starts for pose in own],
            self.pairs.at(which.tolist()),
            sigma_px[which],
            prior,
        )
        found: list[Ranked] = [[] for _ in starts]
        for i in np.argsort(energies, kind="stable"):
            own = found[which[i]]
            if all(_apart(poses[i], other) for _, other in own):
                own.append((float(energies[i]), poses[i]))
        return found


def _poses(ranked: Sequence[Ranked]) -> list[list[Pose]]:
    return [[pose for _, pose in own] for own in ranked]


def _apart(pose: Pose, other: Pose) -> bool:
    return rotation_distance(pose.rotation, other.rotation) > OTHER


def _energy_of(pose: Pose, ranked: Ranked) -> float:
    """Return the energy of the optimum nearest to a pose."""
    return min(ranked, key=lambda own: rotation_distance(own[1].rotation, pose.rotation))[0]


def _scale(points: Points, pixels: Pixels) -> float:
    """Return about how large a figure is drawn: the median over pairs of pairs."""
    first, second = np.triu_indices(len(points), 1)
    apart = np.linalg.norm(points[first] - points[second], axis=1)
    seen = np.linalg.norm(pixels[first] - pixels[second], axis=1)
    return float(np.median(seen[apart > 0] / apart[apart > 0]))


def _prior(sigma: Sequence[float], mean: Sequence[float] = (0.0, ANYWHERE.mean, 0.0)) -> ViewPrior:
    return ViewPrior(np.array(mean), np.array(sigma))


def _prior_about(poses: Sequence[Pose]) -> ViewPrior:
    """Return what views of one sheet have in common, some of them wrong."""
    usual = Spreads()
    values = np.array([[tilt(pose)[0][1], np.log(pose.scale)] for pose in poses])
    middle = np.median(values, axis=0)
    spread = MAD * np.median(np.abs(values - middle), axis=0)
    elevation, scale = np.maximum(spread, [usual.elevation, usual.scale])
    return _prior([usual.roll, elevation, scale], [0.0, *middle])


def _prior_of(joint: Adjusted) -> ViewPrior:
    """Return what a view shares with the others of its sheet."""
    spreads, level = joint.shared.spreads, joint.shared.elevation
    if len(joint.poses) == 1:
        return _prior([spreads.roll, level.sigma, FREE], [0.0, level.mean, 0.0])
    values = np.array([[tilt(pose)[0][1], np.log(pose.scale)] for pose in joint.poses])
    return _prior([spreads.roll, spreads.elevation, spreads.scale], [0.0, *values.mean(axis=0)])
