"""Adjust all cameras of a sheet jointly by Gauss-Newton, with shared parameters and the body.

Landmarks take part with their own errors, where there are any.

Unknowns: per view a rotation increment, shift and log scale; then k = 1 / distance (none, one for
the sheet, or one per view), the outline offset (a drawn contour line lies outside of the
silhouette) and, if asked, the mannequin's proportions. A drawing's own error is integrated out
(`toonset.calib.fit.drawing_error`), what views share is tied (`toonset.calib.fit.sheet_prior`);
both strengths are estimated on the sheet along the way. The covariance is the inverse of the final
normal matrix.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

import numpy as np
from jaxtyping import Float

from toonset.calib.fit.align import MAX_TURN
from toonset.calib.fit.drawing_error import (
    ROUGH_POINTS,
    Marginal,
    Noise,
    Residuals,
    error_modes,
    least_white,
    marginalise,
    next_noise,
)
from toonset.calib.fit.proportions import Body
from toonset.calib.fit.sheet_prior import Spreads, Turn, anchors, locks, sheet_priors
from toonset.calib.fit.tilt import ElevationPrior
from toonset.calib.outline.correspondences import Drawing, Matches, match
from toonset.calib.outline.pose import PARAMETERS, Pose, pixel_slopes, project_with_jacobian

if TYPE_CHECKING:
    from toonset.calib.fit.landmark_residuals import LandmarkRows

OFFSET_OF_HEIGHT = 0.006  # prior of the outline offset: a line's half width
MAX_K_RADIUS = 0.6  # nearest camera: the mesh's radius is 0.6 of the distance
FIRST_K_RADIUS = 0.02  # where the search for perspective starts
STRETCH = 0.1  # relative spread of height over width between drawings, where it is free
COMMON_STRETCH = 0.05  # and of their mean, which the mannequin tells
SETTLED = 2  # steps before the spreads are estimated: the first matches are wrong

Perspective = Literal["none", "given", "shared", "per view"]


@dataclass(frozen=True)
class SheetModel:
    """Camera model of a sheet.

    Attributes:
        perspective: whose k is free; none: orthographic, given: every k stays as it is.
        spreads: expected differences between the views.
        proportions: whether the mannequin's body is free.
        stretches: whether drawings may be taller or lower than their width asks for.
    """

    perspective: Perspective = "none"
    spreads: Spreads = field(default_factory=Spreads)
    proportions: bool = False
    stretches: bool = False


@dataclass(frozen=True, eq=False)
class JointFit:
    """The cameras of a sheet, fitted together.

    Attributes:
        poses: per view, full-size pixels.
        body: with the fitted proportions.
        offset: outline offset over the figure's height (> 0: drawn outside of the mesh).
        noise: the drawings' error over the figure's height.
        spreads: estimated differences between the views.
        energy: -2 log likelihood of the drawings, up to a constant, at `noise`.
        covariance: (u, u) of (w, shift, log scale) per view in working pixels, k, offset, body.
        stretches: (views,) log of height over width of every drawing, over the camera's.
    """

    poses: tuple[Pose, ...]
    body: Body
    offset: float
    noise: Noise
    spreads: Spreads
    energy: float
    covariance: Float[np.ndarray, "u u"]
    stretches: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class _State:
    """State of the iteration; poses in working pixels."""

    poses: tuple[Pose, ...]
    body: Body
    offset: float
    noise: Noise
    spreads: Spreads
    stretches: Float[np.ndarray, " views"]
    covariance: Float[np.ndarray, "u u"] | None = None


@dataclass(frozen=True, eq=False)
class _System:
    """The linearised problem at a state."""

    normal: Float[np.ndarray, "u u"]
    gradient: Float[np.ndarray, " u"]
    energy: float
    noise: Noise
    spreads: Spreads


class JointProblem:
    """The drawings of a sheet with what every fit of them needs once."""

    def __init__(
        self,
        drawings: Sequence[Drawing],
        turn: Turn | None = None,
        kept: Mapping[str, Float[np.ndarray, " views"]] = MappingProxyType({}),
        samples: float = ROUGH_POINTS,
        landmarks: LandmarkRows | None = None,
    ) -> None:
        """Prepare the drawings' error modes.

        Args:
            drawings: outlines at the working scale, one per view.
            turn: where the views are meant to be seen from.
            kept: yaw, elevation (radians) or scale (log, px of the views) that stay as given.
            samples: how many independent samples an outline is worth.
            landmarks: that are fitted beside the outlines.
        """
        self.drawings = tuple(drawings)
        self.modes = [error_modes(drawing) for drawing in drawings]
        self.turn = turn
        self.elevation = ElevationPrior()
        self.samples = samples
        self.landmarks = landmarks
        self.kept = {
            name: values + np.log([d.factor for d in drawings]) if name == "scale" else values
            for name, values in kept.items()
        }

    def with_elevation(self, prior: ElevationPrior) -> JointProblem:
        """Return the problem with more known of the sheet's mean elevation."""
        other = copy(self)
        other.elevation = prior
        return other

    def fit(
        self,
        body: Body,
        poses: Sequence[Pose],
        widths: Float[np.ndarray, " iterations"],
        model: SheetModel = SheetModel(),
        noise: Noise | None = None,
        offset: float = 0.0,
    ) -> JointFit:
        """Return all views refined together.

        Args:
            body: the mannequin.
            poses: starts, full-size pixels.
            widths: robust width over the figure's height, one per step.
            model: what is free.
            noise: of the drawings, kept; None to estimate it.
            offset: first outline offset.
        """
        working = [d.pose_in(p) for d, p in zip(self.drawings, poses, strict=True)]
        if model.perspective == "none":
            working = [replace(p, k=0.0) for p in working]
        elif model.perspective != "given":
            first_k = FIRST_K_RADIUS / body.rest.radius
            working = [replace(p, k=p.k or first_k) for p in working]
        start = np.zeros(len(working))
        state = _State(tuple(working), body, offset, noise or Noise(), model.spreads, start)
        for step, width in enumerate(widths):
            system = self._system(state, model, width, settled=step >= SETTLED)
            state = self._stepped(state, system, model, keep_noise=noise is not None)
        system = self._system(state, model, float(widths[-1]), settled=True)
        covariance = np.linalg.inv(system.normal)
        return JointFit(
            tuple(d.pose_out(p) for d, p in zip(self.drawings, state.poses, strict=True)),
            state.body,
            state.offset,
            state.noise,
            system.spreads,
            system.energy,
            covariance,
            tuple(state.stretches.tolist()),
        )

    def _size(self, state: _State, model: SheetModel) -> int:
        return (
            _first_shared(model, len(state.poses)) + 1 + model.proportions * len(state.body.theta)
        )

    def _view(
        self, state: _State, model: SheetModel, index: int, width: float
    ) -> tuple[list[int], Marginal]:
        """Return which unknowns view `index` has and its normal equations."""
        drawing = self.drawings[index]
        if model.stretches:
            drawing = drawing.unstretched(state.stretches[index])
        height = drawing.height
        found = match(drawing, state.body.surface, state.poses[index])
        where, pixels, slopes = _derivatives(state, model, index, drawing, found)
        relative = found.distances / height
        side = np.arange(len(relative)) < found.drawn
        counts = np.where(side, found.drawn, max(len(side) - found.drawn, 1))
        off = Residuals(
            (found.normals * (pixels - found.targets)).sum(axis=1) + state.offset * height,
            slopes,
            found.target_index,
            1 / (2 * counts),
            (width**2 / (width**2 + relative**2)) ** 2,
        )
        modes = self.modes[index]
        return where, marginalise(modes, state.noise, height, off, width, self.samples)

    def _system(self, state: _State, model: SheetModel, width: float, *, settled: bool) -> _System:
        size = self._size(state, model)
        normal, gradient = np.zeros((size, size)), np.zeros(size)
        views = []
        for index in range(len(self.drawings)):
            where, view = self._view(state, model, index, width)
            normal[np.ix_(where, where)] += view.normal
            gradient[where] += view.gradient
            views.append(view)
        self._add_landmarks(state, normal, gradient, model)
        spreads = self._add_priors(state, normal, gradient, model.spreads if settled else None)
        first = _first_shared(model, len(views))
        normal[first, first] += OFFSET_OF_HEIGHT**-2
        gradient[first] += state.offset / OFFSET_OF_HEIGHT**2
        if model.stretches:
            own = slice(first - len(views), first)
            known = np.eye(len(views)) / STRETCH**2 + 1 / (len(views) * COMMON_STRETCH) ** 2
            normal[own, own] += known
            gradient[own] += known @ state.stretches
        if model.proportions:
            normal[first + 1 :, first + 1 :] += state.body.precision
            gradient[first + 1 :] += state.body.precision @ state.body.theta
        normal += 1e-9 * np.diag(np.diag(normal)) + 1e-12 * np.eye(size)
        energy = sum(view.energy for view in views)
        noise = next_noise(views, least_white(self.drawings), width)
        return _System(normal, gradient, energy, noise, spreads)

    def _add_landmarks(
        self,
        state: _State,
        normal: Float[np.ndarray, "u u"],
        gradient: Float[np.ndarray, " u"],
        model: SheetModel,
    ) -> None:
        views = len(state.poses)
        found = self.landmarks.at(state.poses, state.body) if self.landmarks else []
        for index, (off, slopes, by_body) in enumerate(found):
            where = _own_unknowns(model, index, views)
            parts = [slopes[:, : len(where)]]
            if model.proportions:
                first = _first_shared(model, views) + 1
                where.extend(range(first, first + by_body.shape[1]))
                parts.append(by_body)
            rows = np.hstack(parts)
            normal[np.ix_(where, where)] += rows.T @ rows
            gradient[where] += rows.T @ off

    def _add_priors(
        self,
        state: _State,
        normal: Float[np.ndarray, "u u"],
        gradient: Float[np.ndarray, " u"],
        expected: Spreads | None,
    ) -> Spreads:
        """Add the priors; return the spreads, estimated anew where an expectation is given."""
        spreads = state.spreads
        priors = sheet_priors(state.poses, self.turn, spreads.yaw, len(gradient))
        if expected is not None and state.covariance is not None:
            spreads = replace(
                spreads,
                **{n: t.spread(state.covariance, getattr(expected, n)) for n, t in priors.items()},
            )
        terms = [(shared, getattr(spreads, name)) for name, shared in priors.items()]
        known = [
            *anchors(priors, self.turn, self.elevation),
            *locks(priors, state.poses, self.kept),
        ]
        for shared, sigma in [*terms, *known]:
            matrix, slope = shared.equations(sigma)
            normal += matrix
            gradient += slope
        return spreads

    def _stepped(
        self, state: _State, system: _System, model: SheetModel, *, keep_noise: bool
    ) -> _State:
        covariance = np.linalg.inv(system.normal)
        step = -covariance @ system.gradient
        views = len(state.poses)
        per_view = step[: PARAMETERS * views].reshape(views, PARAMETERS)
        shrink = min(1.0, MAX_TURN / max(np.abs(per_view[:, :3]).max(), 1e-12))
        step = step * shrink
        first = _first_shared(model, views)
        last_k = first - views * model.stretches
        k_steps = step[PARAMETERS * views : last_k]
        k_steps = np.broadcast_to(k_steps, views) if len(k_steps) else np.zeros(views)
        most = MAX_K_RADIUS / state.body.rest.radius
        poses = tuple(
            replace(pose.moved(own * shrink), k=float(np.clip(pose.k + change, 0.0, most)))
            for pose, own, change in zip(state.poses, per_view, k_steps, strict=True)
        )
        return _State(
            poses,
            state.body.moved(step[first + 1 :]) if model.proportions else state.body,
            state.offset + float(step[first]),
            state.noise if keep_noise else system.noise,
            system.spreads,
            state.stretches + (step[last_k:first] if model.stretches else 0.0),
            covariance,
        )


def _first_shared(model: SheetModel, views: int) -> int:
    """Return the index of the outline offset, after poses, distances and stretches."""
    distances = {"none": 0, "given": 0, "shared": 1, "per view": views}[model.perspective]
    return PARAMETERS * views + distances + views * model.stretches


def _own_unknowns(model: SheetModel, index: int, views: int) -> list[int]:
    """Return where a view's pose is among the unknowns, and its k where it is free."""
    where = list(range(PARAMETERS * index, PARAMETERS * (index + 1)))
    if model.perspective in ("shared", "per view"):
        where.append(PARAMETERS * views + (index if model.perspective == "per view" else 0))
    return where


def _derivatives(
    state: _State, model: SheetModel, index: int, drawing: Drawing, found: Matches
) -> tuple[list[int], Float[np.ndarray, "n 2"], Float[np.ndarray, "n u"]]:
    """Return which unknowns view `index` has, where its points are seen, and px per unknown."""
    pose, views = state.poses[index], len(state.poses)
    pixels, jacobian = project_with_jacobian(pose, found.points)
    across = np.einsum("ni,nij->nj", found.normals, jacobian)
    where = _own_unknowns(model, index, views)
    parts = [across[:, : len(where)]]
    first = _first_shared(model, views)
    if model.stretches:
        where.append(first - views + index)
        by = np.array([0.5, -0.5]) * (found.targets - np.array(drawing.size_wh) / 2)
        parts.append(-(found.normals * by).sum(axis=1)[:, None])
    where.append(first)
    parts.append(np.full((len(pixels), 1), drawing.height))
    if model.proportions:
        where.extend(range(first + 1, first + 1 + len(state.body.theta)))
        by_point = np.einsum("ni,nij->nj", found.normals, pixel_slopes(pose, found.points))
        slopes = state.body.slopes(state.body.at_rest(found.points))
        parts.append(np.einsum("nj,njp->np", by_point, slopes))
    return where, pixels, np.hstack(parts)
