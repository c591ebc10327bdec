"""Smooth the grain of paper and pencil away before pixels are labelled.

A label map without specks is a Markov field: every pixel's paint is likely by its own colour, and
by its neighbours' unless the drawing has an edge between. With squared distances to the paints'
colours on one side and squared differences between neighbours on the other, smoothing the
distances is smoothing the colours, once for all paints: weighted least squares.

Sources: J. Immerkaer, "Fast noise variance estimation" (1996); D. Min and others, "Fast global
image smoothing based on weighted least squares" (2014), as OpenCV has it.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import UInt8

from toonset.palette.pixels.antialias import OPAQUE
from toonset.raster import erode, median_inside

LEAST_LEVELS = 2.0  # of 255: finer grain does labels no harm
LAPLACIANS = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)  # nothing on slopes
SIGMA_FROM_MEDIAN = 1 / (0.6745 * 6)  # of that mask's magnitude, in normal noise
SMOOTHNESS = 50.0  # of the field, over the data: a third or three times as much is no better
ALIKE, GUIDE_ALIKE = 1.5, 4.0  # times the noise: steeper is a border
GUIDE_PX = 9  # window in which the guide's own grain is averaged

Picture = UInt8[np.ndarray, "height width 4"]


def remove_grain(pictures: Sequence[Picture]) -> list[Picture]:
    """Return drawings whose grain is smoothed within borders; as they are where it is faint.

    Only opaque pixels are changed, and only they are averaged.

    Args:
        pictures: of one sheet: its paper has one grain.
    """
    levels = noise_levels(pictures)
    if levels < LEAST_LEVELS:
        return list(pictures)
    return [_smoothed(picture, levels) for picture in pictures]


def noise_levels(pictures: Sequence[Picture]) -> float:
    """Return the noise's standard deviation in levels of 255, the median over drawings.

    From lightness where all pixels around are opaque; 0 without such a place.
    """
    found = []
    for picture in pictures:
        if not picture.size:
            continue
        light = cv2.cvtColor(picture, cv2.COLOR_RGBA2GRAY)
        inside = erode(picture[..., 3] >= OPAQUE, 2)
        if inside.any():
            rough = cv2.filter2D(light, cv2.CV_16S, LAPLACIANS)
            found.append(median_inside(np.abs(rough, out=rough).view(np.uint16), inside))
    return SIGMA_FROM_MEDIAN * float(np.median(found)) if found else 0.0


def _smoothed(picture: Picture, levels: float) -> Picture:
    rgb = np.ascontiguousarray(picture[..., :3])
    opaque = picture[..., 3] >= OPAQUE
    guide = cv2.bilateralFilter(rgb, GUIDE_PX, GUIDE_ALIKE * levels, GUIDE_PX / 3)
    channels = [opaque, *(rgb[..., n] * opaque for n in range(3))]
    weight, *sums = (
        cv2.ximgproc.fastGlobalSmootherFilter(
            guide, channel.astype(np.float32), SMOOTHNESS, ALIKE * levels
        )
        for channel in channels
    )
    mean = np.stack(sums, axis=-1) / np.maximum(weight, np.finfo(np.float32).eps)[..., None]
    smooth = picture.copy()
    smooth[opaque, :3] = np.rint(mean[opaque]).clip(0, 255).astype(np.uint8)
    return smooth
