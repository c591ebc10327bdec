"""What of a picture is the figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, UInt8

if TYPE_CHECKING:
    from toonset.dataset.scene import Frame

OPAQUE = 128  # alpha from which a pixel belongs to the figure


def mask_of(
    rgba: UInt8[np.ndarray, "height width 4"],
) -> Bool[np.ndarray, "height width"]:
    """Return the figure's pixels."""
    return rgba[..., 3] >= OPAQUE


def alpha_of(frame: Frame) -> Float[np.ndarray, "height width"]:
    """Return a frame's coverage in [0, 1]."""
    return frame.rgba[..., 3] / np.float32(255)


def has_figure(frame: Frame) -> bool:
    """Return whether a frame shows an opaque pixel."""
    return bool(mask_of(frame.rgba).any())


def figure_px(frame: Frame) -> int:
    """Return the longer side of a figure's box, 0 where there is none."""
    mask = mask_of(frame.rgba)
    sides = [np.flatnonzero(mask.any(axis=axis)) for axis in (0, 1)]
    return max((int(side[-1] - side[0] + 1) if len(side) else 0) for side in sides)
