"""Pack a field's hull for the page's rays: support and safe steps.

support  (z, y, x)  the hull's support, 0 to 255
safe_steps (z, y, x)  per block of BLOCK voxels: 0 = the field is read there; n = steps, in any
                    direction, over what certainly holds no sample
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.hull.hull import EDGE, grow

BLOCK = 4  # voxels a side
MOST_CLEAR = 40  # blocks
MOST_STEPS = 255

Volume = UInt8[np.ndarray, "z y x"]


@dataclass(frozen=True, eq=False)
class PackedHull:
    """See the module.

    Attributes:
        low: (3,) world place of the first voxel's centre.
        box: (2, 3) in voxels from there: where rays begin and end.
        support, safe_steps: see the module.
    """

    low: Float[np.ndarray, " 3"]
    box: Float[np.ndarray, "2 3"]
    support: Volume
    safe_steps: Volume


def packed_hull(trained: TrainedField) -> PackedHull:
    """Return a field's hull, cut to the voxels that may hold a sample."""
    hull = trained.hull
    near = grow(hull.near, 1)
    places = near.nonzero()
    first, last = places.amin(dim=0), places.amax(dim=0) + 1
    cut = tuple(slice(a, b) for a, b in zip(first.tolist(), last.tolist(), strict=True))
    support = hull.support[cut]
    codes = _leaps(grow(support >= EDGE, 1), hull.voxel / trained.step)
    start = first.numpy()
    box = np.stack([-start - 0.5, np.array(hull.support.shape) - start - 0.5])
    levels = (support * 255).round().byte().numpy()
    return PackedHull(
        hull.low + hull.voxel * (start + 0.5), box, *(_in_rows(one) for one in (levels, codes))
    )


def _in_rows(volume: UInt8[np.ndarray, "x y z"]) -> Volume:
    """Return a volume as WebGL reads it: x goes on fastest."""
    return np.ascontiguousarray(volume.transpose(2, 1, 0))


def _leaps(solid: Bool[Tensor, "x y z"], per_voxel: float) -> UInt8[np.ndarray, "bx by bz"]:
    filled = F.max_pool3d(solid[None, None].float(), BLOCK, ceil_mode=True)[0, 0] > 0
    away, around = torch.zeros(filled.shape), filled
    for _ in range(MOST_CLEAR):
        away += ~around
        around = grow(around, 1)
    clear = ((away - 1) * (BLOCK * per_voxel)).floor().clamp(0, MOST_STEPS - 1) + 1
    return torch.where(filled, 0, clear).byte().numpy()
