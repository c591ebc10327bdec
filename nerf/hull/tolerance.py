"""Choose how many views may contradict the hull, by predicting left-out masks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from toonset.camera import Camera
from toonset.errors import BundleError
from toonset.nerf.hull.hull import LEVEL, Hull, carve
from toonset.nerf.hull.march import march, pixels_near, rays_of
from toonset.nerf.hull.support import alpha_at
from toonset.nerf.kernels.threads import side_by_side

RESOLUTION = 64  # voxels: coarse, since only the ranking matters
MOST_LEFT_OUT = 8  # views tried
FEWEST_VIEWS = 4  # with fewer there is no majority to trust


@dataclass(frozen=True)
class HullEvidence:
    """Evidence of how well hulls of the other views predict a view's mask.

    Attributes:
        missing: the choice: views that may say "background" at a point inside.
        left_out_iou: mean intersection over union of the left-out masks, per choice from 0.
    """

    missing: int
    left_out_iou: tuple[float, ...]


def choose_missing(
    cameras: Sequence[Camera], alphas: Sequence[Float[Tensor, "height width"]]
) -> HullEvidence:
    """Return the tolerance (0 or 1 views) whose hulls predict left-out masks best."""
    views = len(cameras)
    if views < FEWEST_VIEWS:
        return HullEvidence(0, ())
    left_out = [round(i * views / MOST_LEFT_OUT) for i in range(MOST_LEFT_OUT)]
    left_out = list(range(views)) if views <= MOST_LEFT_OUT else left_out
    try:  # whatever the hull of all views but one holds, with one view against it
        grid = carve(cameras, alphas, RESOLUTION, 2)
    except BundleError:  # these views share nothing: nothing can be predicted
        return HullEvidence(0, ())
    values = torch.stack(
        [alpha_at(grid.centres(), *view) for view in zip(cameras, alphas, strict=True)]
    )
    ranked = values.sort(dim=0).values[:3]
    scores = []
    for missing in (0, 1):
        lower, upper = ranked[missing], ranked[missing + 1]

        def met(view: int, lower: Tensor = lower, upper: Tensor = upper) -> float:
            # a view among the lowest moves the others up by one rank
            support = torch.where(values[view] <= lower, upper, lower).view(grid.support.shape)
            return mask_iou(replace(grid, support=support), cameras[view], alphas[view], 2)

        each = side_by_side([partial(met, view) for view in left_out])
        scores.append(sum(each) / len(each))
    return HullEvidence(int(scores[1] > scores[0]), tuple(scores))


def mask_iou(
    hull: Hull, camera: Camera, alpha: Float[Tensor, "height width"], every: int = 1
) -> float:
    """Return the intersection over union of the hull's outline and a mask in one view.

    Args:
        hull: what is seen.
        camera: from where.
        alpha: what should be seen.
        every: only each `every`-th row and column of pixels counts.
    """
    near = pixels_near(camera, hull)[::every, ::every].reshape(-1)
    pixels = camera.pixel_grid()[::every, ::every].reshape(-1, 2)[near]
    samples = march(rays_of(camera, pixels, hull), hull, hull.voxel, 1, LEVEL)
    seen = torch.zeros(len(near), dtype=torch.bool)
    seen[torch.as_tensor(np.flatnonzero(near))[samples.ray]] = True
    drawn = (alpha[::every, ::every] >= LEVEL).reshape(-1)
    return float((seen & drawn).sum() / (seen | drawn).sum())
