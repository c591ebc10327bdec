"""Intersect rays through outline points with the visual hull of the other silhouettes.

A point of a ray lies in the visual hull if it is inside every silhouette. Instead of cutting rays
with polygons, the signed distance to each silhouette's outline is sampled along them: its minimum
over the silhouettes says how deep in the hull, or how far outside of it, a sample lies.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.camera import Camera
from toonset.dataset.silhouettes.contour import drawn_contour
from toonset.raster import signed_distance
from toonset.view import Ends, View

SAMPLES = 96  # along a ray through the whole figure: about 1 % of the height apart
FINE = 17  # samples between the neighbours of the best one
POINTS = 160  # of a view's outline
PAD_OF_HEIGHT = 0.25  # around a crop: how far outside a point can be told from the outline


class Silhouette:
    """A drawing's silhouette with its camera, outline and signed distance (built once)."""

    def __init__(self, view: View, camera: Camera) -> None:
        """Measure the view; `camera` is in the view's pixels."""
        contour = drawn_contour(view)
        self.camera = camera
        self.height = contour.height_px
        self.points = contour.points[:: max(1, len(contour.points) // POINTS)]
        self.pad = int(np.ceil(PAD_OF_HEIGHT * self.height))
        self.distance = signed_distance(_continued(view.mask, self.pad, contour.ends))

    def seen_by(self, camera: Camera) -> Silhouette:
        """Return the same drawing under another camera."""
        other = copy.copy(self)
        other.camera = camera
        return other

    def reach(self, anchor: Float[np.ndarray, " 3"]) -> float:
        """Return how far, in world units, the outline goes from the picture of `anchor`."""
        (pixel,), (depth,), _ = self.camera.project(anchor[None])
        far = float(np.linalg.norm(self.points - pixel, axis=1).max())
        return far * (1 + self.camera.k * float(depth)) / self.camera.scale

    def depth_inside(
        self,
        origins: Float[np.ndarray, "points 3"],
        directions: Float[np.ndarray, "points 3"],
        along: Float[np.ndarray, "points t"],
    ) -> Float[np.ndarray, "points t"]:
        """Return the signed distance from the outline over the height, > 0 inside, along rays."""
        camera = self.camera
        start = ((origins - camera.target) @ camera.rotation.T).astype(np.float32)
        slope = (directions @ camera.rotation.T).astype(np.float32)
        u, v = (along * slope[:, a, None] for a in range(2))
        u += start[:, 0, None]
        v += start[:, 1, None]
        scale = np.float32(camera.scale)
        if not camera.is_orthographic:
            z = start[:, 2, None] + along * slope[:, 2, None]
            scale = scale / np.maximum(1 + np.float32(camera.k) * z, 1e-6)
        left, top = camera.center.astype(np.float32) - 0.5 + self.pad
        u *= scale
        u += left
        v *= np.float32(camera.pixel_aspect) * scale
        v += top
        np.clip(u, 0, self.distance.shape[1] - 1, out=u)
        np.clip(v, 0, self.distance.shape[0] - 1, out=v)
        found = cv2.remap(self.distance, u, v, cv2.INTER_LINEAR)
        found /= np.float32(self.height)
        return found


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays of a view, and where along them to look.

    Attributes:
        origins: (points, 3) world.
        directions: (points, 3) world, of length 1.
        along: (t,) parameters, evenly spaced through the whole figure.
    """

    origins: Float[np.ndarray, "points 3"]
    directions: Float[np.ndarray, "points 3"]
    along: Float[np.ndarray, " t"]

    @classmethod
    def of(
        cls,
        camera: Camera,
        pixels: Float[np.ndarray, "points 2"],
        middle: Float[np.ndarray, " 3"],
        radius: float,
    ) -> Rays:
        """Return the rays through pixels, as far as `radius` from where they pass the middle."""
        _, (depth,), _ = camera.project(middle[None])
        along = float(depth) + np.linspace(-radius, radius, SAMPLES)
        return cls(*camera.rays(pixels), along.astype(np.float32))

    def inside(self, silhouette: Silhouette) -> Float[np.ndarray, "points t"]:
        """Return the samples' signed distances from a silhouette's outline over its height."""
        along = np.broadcast_to(self.along, (len(self.origins), len(self.along)))
        return silhouette.depth_inside(self.origins, self.directions, along)

    def refined(
        self,
        silhouettes: Iterable[Silhouette],
        points: Int[np.ndarray, " n"],
        nearest: Int[np.ndarray, " n"],
    ) -> Float[np.ndarray, " n"]:
        """Return the largest minimum over silhouettes between the neighbours of a sample.

        Args:
            silhouettes: of the others, one or more.
            points: which rays.
            nearest: the best sample of each.
        """
        fine = (self.along[1] - self.along[0]) * np.linspace(-1, 1, FINE, dtype=np.float32)
        along = self.along[nearest][:, None] + fine
        own = self.origins[points], self.directions[points]
        return least(f.depth_inside(*own, along) for f in silhouettes).max(axis=1)


def cut_rays(
    silhouettes: Sequence[Silhouette], i: int
) -> tuple[Float[np.ndarray, "views points t"], Float[np.ndarray, " points"]]:
    """Return distances inside the silhouettes along the rays of outline i, and the deepest ones.

    Args:
        silhouettes: all of the sheet.
        i: whose outline; it excludes nothing on its own rays, so its row is infinite.

    Returns:
        Per silhouette and sample the signed distance over the silhouette's height, positive
        inside; and per outline point the largest minimum over the silhouettes, refined.
    """
    return _cut(silhouettes, i, silhouettes[i].points)


def depth_in_hull(
    silhouettes: Sequence[Silhouette], i: int, pixels: Float[np.ndarray, "points 2"]
) -> Float[np.ndarray, " points"]:
    """Return how deep rays of view i come into the hull of the others, over the height.

    Negative: the others have no body there.
    """
    return _cut(silhouettes, i, pixels)[1]


def _cut(
    silhouettes: Sequence[Silhouette], i: int, points: Float[np.ndarray, "points 2"]
) -> tuple[Float[np.ndarray, "views points t"], Float[np.ndarray, " points"]]:
    rays = Rays.of(silhouettes[i].camera, points, *figure_of(silhouettes))
    own = np.full((len(points), SAMPLES), np.inf, np.float32)
    sampled = np.stack([own if j == i else rays.inside(f) for j, f in enumerate(silhouettes)])
    nearest = sampled.min(axis=0).argmax(axis=1)
    others = (f for j, f in enumerate(silhouettes) if j != i)
    refined = rays.refined(others, np.arange(len(points)), nearest)
    return sampled, refined.astype(np.float64)


def least(each: Iterable[Float[np.ndarray, "points t"]]) -> Float[np.ndarray, "points t"]:
    """Return the least of one array or more, element by element."""
    return reduce(np.minimum, each)


def figure_of(silhouettes: Sequence[Silhouette]) -> tuple[Float[np.ndarray, " 3"], float]:
    """Return the figure's middle and how far from there it goes, world units."""
    middle = middle_of(silhouettes)
    return middle, max(silhouette.reach(middle) for silhouette in silhouettes)


def middle_of(silhouettes: Sequence[Silhouette]) -> Float[np.ndarray, " 3"]:
    """Return the world point that the cameras look at, in the mean."""
    return np.mean([silhouette.camera.target for silhouette in silhouettes], axis=0)


def contradiction(residuals: Float[np.ndarray, " points"]) -> float:
    """Return the mean square of the negative residuals: what the other silhouettes exclude."""
    return float((np.minimum(residuals, 0) ** 2).mean())


def _continued(
    mask: Bool[np.ndarray, "height width"], pad: int, ends: Ends
) -> Bool[np.ndarray, "height+2*pad width+2*pad"]:
    """Return the padded mask; where the figure is cut off it goes on as it is at the cut."""
    padded = np.pad(mask, pad)
    left, top, right, bottom = (round(end) + pad if np.isfinite(end) else None for end in ends)
    if top is not None:
        padded[:top] = padded[top]
    if bottom is not None:
        padded[bottom:] = padded[bottom - 1]
    if left is not None:
        padded[:, :left] = padded[:, left, None]
    if right is not None:
        padded[:, right:] = padded[:, right - 1, None]
    return padded
