"""Where one ray per pixel is not enough, and where more of them go."""

from __future__ import annotations

import numpy as np
import torch.nn.functional as F
from jaxtyping import Bool, Float
from torch import Tensor

RAYS_PER_SIDE = 2  # of a pixel on a border
TOLERANCE = 0.04  # difference of neighbours that makes a border


def borders(values: Float[Tensor, "height width channels"]) -> Bool[Tensor, "height width"]:
    """Return the pixels that differ from one of their eight neighbours.

    Args:
        values: what is seen at the pixels' centres, in [0, 1]: colour, opacity, labels' shares.
    """
    planes = values.permute(2, 0, 1)[None]
    highest, lowest = (F.max_pool2d(sign * planes, 3, stride=1, padding=1) for sign in (1, -1))
    return ((highest + lowest) > TOLERANCE)[0].any(dim=0)


def places_within(
    chosen: Bool[np.ndarray, "height width"], side: int = RAYS_PER_SIDE
) -> Float[np.ndarray, "n rays 2"]:
    """Return where `side` x `side` rays go through each chosen pixel (first centre at 0.5)."""
    rows, columns = np.nonzero(chosen)
    part = (np.arange(side) + 0.5) / side
    down, right = (grid.reshape(-1) for grid in np.meshgrid(part, part, indexing="ij"))
    return np.stack([columns[:, None] + right, rows[:, None] + down], axis=-1)
