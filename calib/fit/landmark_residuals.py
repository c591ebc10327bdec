"""Measure how far cameras are from landmarks: errors, slopes and weights of the pairs.

Pixels and Jacobians are `toonset.projection`'s (kornia), of many cameras at once: the views of a
sheet, or all starts of its views. A pair's error is a Student t in two dimensions,

    energy = sum (TAIL + 2) log(1 + |r|^2 / (TAIL sigma^2)),

so that a wrong pair pulls little.

Source: the t distribution as reweighted least squares: Lange, Little and Taylor, Robust statistical
modeling using the t distribution, JASA 84 (1989).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from toonset.calib.fit.landmark_starts import Pixels, Points
from toonset.calib.fit.proportions import Body
from toonset.calib.outline.pose import Pose, pixel_slopes
from toonset.projection import CameraTensors, project, project_with_jacobian

TAIL = 4.0  # degrees of freedom of a pair's error
ROUNDING_PX = 1e-3  # no pixel is given more exactly


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

    def rows(
        self, poses: Sequence[Pose], sigma_px: Float[np.ndarray, " views"]
    ) -> tuple[
        Float[np.ndarray, "views n 2"],
        Float[np.ndarray, "views n 2 7"],
        Float[np.ndarray, "views n"],
    ]:
        """Return errors and slopes by (w, shift, log scale, k) over sigma, and the pairs' weights.

        Errors and slopes of padding are 0.
        """
        pixels, slopes = project_with_jacobian(_tensors(poses), self.points)
        seen = self.given[..., None] * torch.from_numpy(1 / sigma_px)[:, None, None]
        off = (pixels - self.pixels) * seen
        weights = (TAIL + 2) / (TAIL + off.square().sum(-1))
        return off.numpy(), (slopes * seen[..., None]).numpy(), weights.numpy()

    def squared(
        self, poses: Sequence[Pose], sigma_px: Float[np.ndarray, " views"]
    ) -> Float[np.ndarray, "views n"]:
        """Return squared errors over sigma squared, infinite behind a camera, 0 for padding."""
        off = (project(_tensors(poses), self.points) - self.pixels).square().sum(-1) * self.given
        return off.nan_to_num(nan=torch.inf).numpy() / sigma_px[:, None] ** 2

    def misplaced(self, squared: Float[np.ndarray, "views n"]) -> Bool[np.ndarray, "views n"]:
        """Return which pairs are wrong, at 1 % significance over a view's."""
        counts = self.given.sum(1, keepdim=True).numpy()
        return np.asarray(squared > 2 * np.log(100 * counts))

    @property
    def radius(self) -> float:
        """Return how far the points are from the middle at most."""
        return float(torch.linalg.norm(self.points, dim=-1).max())


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
        off, slopes, weights = pairs.rows(poses, self.sigma_px)
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


def energy_of(squared: Float[np.ndarray, "views n"]) -> Float[np.ndarray, " views"]:
    """Return the energy of every camera's pairs; see the module docstring."""
    return np.asarray((TAIL + 2) * np.log1p(squared / TAIL).sum(axis=1))


def normal_equations(
    off: Float[np.ndarray, "views n 2"],
    slopes: Float[np.ndarray, "views n 2 7"],
    weights: Float[np.ndarray, "views n"],
) -> tuple[Float[np.ndarray, "views 7 7"], Float[np.ndarray, "views 7"]]:
    """Return normal matrices and gradients of `Pairs.rows`."""
    views = len(off)
    rows = slopes.reshape(views, -1, 7)
    weighted = (slopes * weights[..., None, None]).reshape(views, -1, 7).transpose(0, 2, 1)
    return weighted @ rows, (weighted @ off.reshape(views, -1, 1))[..., 0]


def pixel_sigmas(poses: Sequence[Pose], sigma: float) -> Float[np.ndarray, " views"]:
    """Return an error in world units as pixels of every view."""
    return np.array([max(sigma * pose.scale, ROUNDING_PX) for pose in poses])


def _tensors(poses: Sequence[Pose]) -> CameraTensors:
    return CameraTensors(
        torch.from_numpy(np.array([pose.rotation for pose in poses])),
        torch.zeros((len(poses), 3), dtype=torch.float64),
        torch.from_numpy(np.array([pose.shift for pose in poses])),
        torch.from_numpy(np.array([(pose.scale, pose.scale) for pose in poses])),
        torch.from_numpy(np.array([pose.k for pose in poses])),
    )
