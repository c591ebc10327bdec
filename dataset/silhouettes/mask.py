"""Compute a picture's figure mask from its alpha."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.errors import BundleError
from toonset.raster import connected_to

if TYPE_CHECKING:
    from toonset.dataset.bundle.scene import Frame, Scene

OPAQUE = 128  # alpha from which a pixel belongs to the figure
FAINT = 0.02  # coverage below which nothing is there


def mask_of(rgba: UInt8[np.ndarray, "height width 4"]) -> Bool[np.ndarray, "height width"]:
    """Return the figure's pixels."""
    return rgba[..., 3] >= OPAQUE


def alpha_of(frame: Frame) -> Float[np.ndarray, "height width"]:
    """Return a frame's coverage in [0, 1]."""
    return frame.rgba[..., 3] / np.float32(255)


def widen_thin_parts(alpha: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """Return the coverage with thin parts as wide as they cover pixels.

    Interpolated between pixel centres, a line that covers the share a of its pixels is in the mask
    (coverage 1/2) on a width of 2 - 1 / a, if at all; with 1 / (2 - a) instead of a it is a wide.
    """
    return np.where(thin(alpha), 1 / (2 - alpha), alpha)


def thin(alpha: Float[np.ndarray, "height width"]) -> Bool[np.ndarray, "height width"]:
    """Return faint pixels that hang on the figure and are not its border.

    A cape's corner seen from its edge covers too little of any pixel to be in the mask. On a
    border, what is on one side of a pixel covers more than the pixel does; on a ridge, both sides
    together cover less.
    """
    height, width = alpha.shape
    padded = np.pad(alpha, 1)
    ridge = np.zeros(alpha.shape, dtype=bool)
    for down, across in ((0, 1), (1, 0), (1, 1), (1, -1)):
        before = padded[1 - down :, 1 - across :][:height, :width]
        after = padded[1 + down :, 1 + across :][:height, :width]
        ridge |= before + after <= alpha
    inside = alpha >= 0.5
    thick = cv2.morphologyEx(alpha, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    hanging = connected_to(inside, alpha > FAINT, connectivity=8)
    return ridge & hanging & ~inside & (thick < alpha / 2)


def check_cut_out(scene: Scene) -> None:
    """Refuse drawings whose background is not transparent.

    Raises:
        BundleError: a picture is opaque all over: the whole of it would be the figure.
    """
    for frame in scene.frames:
        if (frame.rgba[..., 3] == 255).all():
            raise BundleError(
                f"{scene.name}: {frame.name} has no transparent background; training needs figures "
                "cut out (RGBA): `toonset split` does that"
            )


def has_figure(frame: Frame) -> bool:
    """Return whether a frame shows an opaque pixel."""
    return bool(mask_of(frame.rgba).any())


def figure_px(frame: Frame) -> int:
    """Return the longer side of a figure's box, 0 without a figure."""
    mask = mask_of(frame.rgba)
    sides = [np.flatnonzero(mask.any(axis=axis)) for axis in (0, 1)]
    return max((int(side[-1] - side[0] + 1) if len(side) else 0) for side in sides)
