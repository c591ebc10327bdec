"""Measure the width of a figure's drawn contour line."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import UInt8

from toonset.raster import dilate, distance_to

DARKEST_CONTOUR = 100.0  # luma of 255: a lighter border is not ink
LEAST_INKED = 0.7  # of the border that must be dark to speak of a contour
MOST_DEEP = 0.5  # of the border's darkness: if so much goes on inside, the figure itself is dark
NOT_INK = 24  # levels above the ink: another colour
WIDEST = 0.05  # of the figure's height
MOST_LAYERS = 24


def contour_width_px(rgba: UInt8[np.ndarray, "height width 4"]) -> float:
    """Return the width in pixels of the dark line along the figure's outline; 0 = no contour.

    From the border inwards, layer by layer, the share of pixels that have been dark all the way
    stays near 1 within the line and falls behind it to the share of dark clothes and hair. The
    width is the area under that curve above its floor.
    """
    mask = np.pad(rgba[..., 3] >= 128, 1)
    luma = np.pad(cv2.cvtColor(rgba, cv2.COLOR_RGBA2GRAY), 1, constant_values=255)
    depth = distance_to(~mask)
    rows = np.flatnonzero(mask.any(axis=1))
    layers = int(np.clip(WIDEST * (rows[-1] - rows[0] + 1), 6, MOST_LAYERS))
    layers = min(layers, int(depth.max()))
    dark = mask & (luma < _threshold(luma[(depth > 0) & (depth <= 2)], luma[depth > 2]))
    layer_of = np.minimum(np.rint(depth), layers + 1).astype(np.uint8)
    sizes = np.bincount(layer_of.ravel(), minlength=layers + 1)
    run = (layer_of == 1) & dark
    shares = [float(run.sum() / max(sizes[1], 1))]
    for layer in range(2, layers + 1):
        inked = dilate(run) & dark & (layer_of == layer)
        shares.append(float(inked.sum() / max(sizes[layer], 1)))
        run |= inked
    return _width(np.array(shares))


def _threshold(border: np.ndarray, inside: np.ndarray) -> float:
    """Return the luma halfway between the ink and the darkest common tone inside."""
    ink = float(np.percentile(border, 25)) if border.size else 255.0
    if ink > DARKEST_CONTOUR or not inside.size:
        return 0.0
    lighter = inside[inside > ink + NOT_INK]
    tone = float(np.percentile(lighter, 10)) if lighter.size else 255.0
    return (ink + tone) / 2


def _width(shares: np.ndarray) -> float:
    if len(shares) < 3 or shares[:2].max() < LEAST_INKED:
        return 0.0
    top, floor = float(shares[:2].max()), float(shares[-1])
    if floor > MOST_DEEP * top:
        return 0.0
    return float(np.clip((shares - floor) / (top - floor), 0, 1).sum())
