"""Where a picture is its paper with less light, as in a shadow: channels dimmed by one factor."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

DARKEST = 0.25  # of the paper's light
LIGHTEST = 0.998
OFF_PAPER = 2.0  # levels, beyond the noise: a channel dimmed otherwise is paint
STEEPEST = 0.06  # of the light per cell: a shadow's inside is smooth
BLACK = 40  # levels: a shadow on transparency is no lighter
OPAQUE = 230  # alpha: and less opaque


@dataclass(frozen=True, eq=False)
class Dim:
    """Where a picture is the paper with less light.

    Attributes:
        mask: there.
        smooth: there, away from edges.
        light: share of the paper's light, 0 to 1.
        tint: levels by which every channel is off the paper's, dimmed.
        noise: of the sheet, in levels.
    """

    mask: Bool[np.ndarray, "height width"]
    smooth: Bool[np.ndarray, "height width"]
    light: Float[np.ndarray, "height width"]
    tint: Float[np.ndarray, "height width 3"]
    noise: float


def see_through(rgba: UInt8[np.ndarray, "height width 4"]) -> Dim:
    """Return where a transparent picture is see-through black."""
    dim = (rgba[..., :3].max(axis=2) <= BLACK) & (rgba[..., 3] < OPAQUE)
    light = 1 - rgba[..., 3].astype(np.float32) / 255
    return Dim(dim, opened(dim), light, np.zeros((*light.shape, 3), np.float32), 0.0)


def dimmed(
    rgb: UInt8[np.ndarray, "height width 3"],
    ground: UInt8[np.ndarray, "height width 3"],
    tolerance: int,
) -> Dim:
    """Return where a picture is a darker background.

    Args:
        rgb: the picture.
        ground: its background's colours.
        tolerance: noise in levels.
    """
    paper = np.maximum(ground.astype(np.float32), 1)
    seen = rgb.astype(np.float32)
    light = (seen * paper).sum(axis=2) / (paper * paper).sum(axis=2)
    tint = seen - light[..., None] * paper
    off = np.abs(tint).max(axis=2)
    dim = (light > DARKEST) & (light < LIGHTEST) & (off <= OFF_PAPER + tolerance)
    slopes = [cv2.Sobel(light, cv2.CV_32F, *axis, scale=0.125) for axis in ((1, 0), (0, 1))]
    slope = np.abs(slopes).max(axis=0)
    smooth = opened(dim & (slope <= max(STEEPEST, 1.5 * tolerance / 255)))
    return Dim(dim, smooth, light, tint, float(tolerance))


def opened(mask: Bool[np.ndarray, "height width"]) -> Bool[np.ndarray, "height width"]:
    """Return the mask without what is as thin as a soft edge."""
    return cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0
