"""Sample coloured points of the drawings' visual hull, where there is no mannequin.

The ray of a pixel enters the hull where it first lies inside all other silhouettes: there is a
point of its surface. A view sees a point if the view's own ray enters the hull no earlier.

Source: Laurentini, The visual hull concept for silhouette-based image understanding, PAMI 1994.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from toonset.dataset.exporters.common import ExportView
from toonset.dataset.exporters.points import TrackedPoints, look_up
from toonset.dataset.silhouettes.hull_rays import SAMPLES, Silhouette, middle_of
from toonset.dataset.silhouettes.mask import mask_of
from toonset.view import View

POINTS = 5_000
HIDDEN = 0.02  # of the figure's height: twice the distance of a ray's samples
FEWEST_VIEWS = 3  # two silhouettes leave the hull open


def hull_points(views: Sequence[ExportView], seed: int) -> TrackedPoints | None:
    """Return coloured points of the visual hull; None where the drawings have none.

    One that is transparent or opaque all over shows no silhouette: there is no hull, either.

    Args:
        views: drawings with their cameras; points are those of their pinholes.
        seed: of which pixels are chosen.
    """
    masks = [mask_of(view.rgba) for view in views]
    if len(views) < FEWEST_VIEWS or any(mask.all() or not mask.any() for mask in masks):
        return None
    rng = np.random.default_rng(seed)
    silhouettes = [_silhouette(view) for view in views]
    found = []
    for number, mask in enumerate(masks):
        rows, columns = np.nonzero(mask)
        chosen = rng.choice(len(rows), min(len(rows), POINTS // len(views)), replace=False)
        pixels = np.stack([columns[chosen], rows[chosen]], axis=1) + rng.random((len(chosen), 2))
        points, depth = _entered(silhouettes, number, pixels)
        found.append(points[np.isfinite(depth)])
    xyz = np.concatenate(found)
    return _tracked(views, silhouettes, xyz) if len(xyz) else None


def _silhouette(view: ExportView) -> Silhouette:
    height, width = view.rgba.shape[:2]
    return Silhouette(View(view.rgba, (0, 0, width, height), 0.0, view.name), view.pinhole)


def _entered(
    silhouettes: Sequence[Silhouette], i: int, pixels: Float[np.ndarray, "points 2"]
) -> tuple[Float[np.ndarray, "points 3"], Float[np.ndarray, " points"]]:
    """Return where rays of view i enter the hull, and how far along; nan where they do not."""
    camera, anchor = silhouettes[i].camera, middle_of(silhouettes)
    radius = max(silhouette.reach(anchor) for silhouette in silhouettes)
    _, (middle,), _ = camera.project(anchor[None])
    origins, directions = camera.rays(pixels)
    along = (float(middle) + np.linspace(-radius, radius, SAMPLES)).astype(np.float32)
    steps = np.broadcast_to(along, (len(pixels), SAMPLES))
    inside = np.min(
        [
            own.depth_inside(origins, directions, steps)
            for j, own in enumerate(silhouettes)
            if j != i
        ],
        axis=0,
    )
    first = (inside >= 0).argmax(axis=1)
    rows = np.arange(len(pixels))
    before, after = inside[rows, first - 1], inside[rows, first]
    share = before / np.minimum(before - after, -1e-9)  # of the step at which the rim is crossed
    depth = np.where(first > 0, along[first - 1] + share * (along[1] - along[0]), np.nan)
    return origins + depth[:, None] * directions, depth


def _tracked(
    views: Sequence[ExportView],
    silhouettes: Sequence[Silhouette],
    xyz: Float[np.ndarray, "points 3"],
) -> TrackedPoints:
    """Return the points as the views see them, coloured where they lie deepest in a drawing."""
    count = len(xyz)
    seen, pixels = np.zeros((len(views), count), dtype=bool), np.zeros((len(views), count, 2))
    rgb, deepest = np.zeros((count, 3), np.uint8), np.full(count, -1.0)
    for i, (view, own) in enumerate(zip(views, silhouettes, strict=True)):
        pixels[i], depth, _ = own.camera.project(xyz)
        away, inside, color = look_up(view.rgba, pixels[i])
        _, entered = _entered(silhouettes, i, pixels[i])
        tolerance = HIDDEN * own.height / own.camera.scale
        seen[i] = (away == 0) & ~(depth > entered + tolerance)
        better = seen[i] & (inside > deepest)
        rgb[better], deepest[better] = color[better], inside[better]
    kept = seen.any(axis=0)
    whose = "on the visual hull of the drawings, projected (not measured)"
    return TrackedPoints(xyz[kept], rgb[kept], seen[:, kept], pixels[:, kept], whose)
