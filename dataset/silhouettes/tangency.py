"""Measure how far a sheet's outlines are from being those of one body.

Every ray through a drawing's outline touches the body, so somewhere on it there is a point that all
other drawings show as figure. Where there is none, the drawings disagree, and the ray's point
with the smallest sum of squared distances to the other figures says by how much, and with whom:

    r(outline point, other view) = min(0, signed distance of the other figure at its best point)

Any sheet of any body, however few its views and however hollow the body, has r = 0, so nothing is
asked of drawings that agree. (A hull of the other views is too large instead, and would be.)

Source: Hernandez, Schmitt, Cipolla, "Silhouette coherence for camera calibration under circular
motion", 2007, with distances instead of overlaps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from toonset.camera import Camera
from toonset.dataset.silhouettes.displacement import Moves
from toonset.dataset.silhouettes.outlines import Outlines, sample

ALONG = 64  # points of a ray that are tried first
CLOSER = 7  # points tried between its best and their neighbours
FAR = 0.06  # of the square: beyond, a disagreement is no longer weighed by its size


@dataclass(frozen=True, eq=False)
class Placed:
    """Outlines with their drawings moved.

    Attributes:
        outlines: as drawn.
        moves: the family of displacements.
        numbers: (views, k) each drawing's displacement, in units of its square.
        displaced: per view (2, height, width) where a pixel's content comes from, less the pixel.
        distances: per view (1, height, width) signed distance of the moved drawing, pixels.
    """

    outlines: Outlines
    moves: Moves
    numbers: Float[np.ndarray, "views k"]
    displaced: tuple[Float[np.ndarray, "2 height width"], ...]
    distances: tuple[Float[np.ndarray, "1 height width"], ...]

    @classmethod
    def of(cls, outlines: Outlines, moves: Moves, numbers: Float[np.ndarray, "views k"]) -> Placed:
        """Return the outlines moved by `numbers`."""
        displaced, distances = [], []
        for outline, own in zip(outlines.views, numbers, strict=True):
            axes = outline.square.axes(outline.camera.size_wh)
            move = outline.square.size * moves.on_grid(*axes, own)
            places = outline.camera.pixel_grid() + move
            values = sample(outline.distance[:1], places.reshape(-1, 2))
            displaced.append(np.ascontiguousarray(np.moveaxis(move, -1, 0), np.float32))
            distances.append(values.reshape(1, *move.shape[:2]))
        return cls(outlines, moves, numbers, tuple(displaced), tuple(distances))

    def source(self, view: int, pixels: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
        """Return where the moved drawing's pixels come from."""
        return pixels + sample(self.displaced[view], pixels).T

    def target(self, view: int, pixels: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
        """Return where the drawing's pixels have been moved to."""
        place = pixels
        for _ in range(4):  # the displacement changes by little over its own length
            place = place - (self.source(view, place) - pixels)
        return place


@dataclass(frozen=True, eq=False)
class Touch:
    """The best points of one view's rays.

    Attributes:
        pixels: (n, 2) where the rays start, in the moved drawing.
        points: (n, 3) world; each ray's point that the other figures agree on best.
        along: (n,) its parameter along the ray.
        apart: (n,) root of the sum of squared disagreements there, pixels; 0 = none.
    """

    pixels: Float[np.ndarray, "n 2"]
    points: Float[np.ndarray, "n 3"]
    along: Float[np.ndarray, " n"]
    apart: Float[np.ndarray, " n"]


def touch(
    placed: Placed,
    view: int,
    pixels: Float[np.ndarray, "n 2"],
    near: Float[np.ndarray, " n"] | None = None,
) -> Touch:
    """Return where rays through pixels of a moved drawing meet the others' figures best.

    Args:
        placed: the sheet.
        view: whose rays.
        pixels: (n, 2) of that view's small picture.
        near: parameters along the rays to look around; None: everywhere.
    """
    outlines = placed.outlines
    origins, directions = outlines.views[view].camera.rays(pixels)
    reach = 1.2 * outlines.radius
    spacing = 2 * reach / (ALONG - 1)
    if near is None:
        middle = ((outlines.middle - origins) * directions).sum(axis=-1)
        along = middle[:, None] + np.linspace(-reach, reach, ALONG)
        near, _ = _best(placed, view, origins, directions, along)
    along = near[:, None] + np.linspace(-1, 1, CLOSER) * spacing
    best, cost = _best(placed, view, origins, directions, along)
    return Touch(pixels, origins + directions * best[:, None], best, np.sqrt(cost))


def pixels_of(camera: Camera, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 2"]:
    """Return the pixels of world points; points behind a camera land far outside."""
    pixels, _, in_front = camera.project(points)
    return pixels if in_front.all() else np.nan_to_num(pixels, nan=-1e4)


def _best(
    placed: Placed, view: int, origins: np.ndarray, directions: np.ndarray, along: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return of each ray the parameter with the least cost, and that cost."""
    points = origins[:, None] + directions[:, None] * along[..., None]
    far = -FAR * placed.outlines.size_px
    cost = np.zeros(along.shape)
    for other, outline in enumerate(placed.outlines.views):
        if other != view:
            pixels = pixels_of(outline.camera, points).reshape(-1, 2)
            distance = sample(placed.distances[other], pixels)[0].reshape(along.shape)
            cost += np.clip(distance, far, 0) ** 2
    best, rows = cost.argmin(axis=1), np.arange(len(cost))
    return along[rows, best], cost[rows, best]
