"""PSNR and SSIM of a rendering against a drawing, over white and inside the mask."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.dataset.silhouettes.mask import mask_of
from toonset.view import over_white

BEST_PSNR = 120.0  # reported for identical pictures, which have no finite value
MOST_SHIFT_PX = 2  # of the whole picture that the shift-tolerant PSNR forgives
SSIM_WINDOW, SSIM_SIGMA = 11, 1.5  # Wang et al. 2004
SSIM_C1, SSIM_C2 = 0.01**2, 0.03**2

Figures = dict[str, float | None]  # by metric; None where it cannot be said


def compare(
    rendered: UInt8[np.ndarray, "height width 4"], drawn: UInt8[np.ndarray, "height width 4"]
) -> Figures:
    """Return psnr, psnr_mask (where the drawing has any alpha) and ssim, over white.

    `psnr_mask` is None where the drawing is empty, `ssim` where it is smaller than its window.
    """
    a, b = over_white(rendered), over_white(drawn)
    error = ((a - b) ** 2).mean(axis=-1)
    mask = drawn[..., 3] > 0
    inside = psnr_of(float(error[mask].mean())) if mask.any() else None
    return {"psnr": psnr_of(float(error.mean())), "psnr_mask": inside, "ssim": ssim(a, b)}


def means(rows: Sequence[Figures]) -> Figures:
    """Return the mean of every figure over the views that have it, None where none has."""
    result: Figures = {}
    for name in rows[0] if rows else ():
        values = [v for v in (row[name] for row in rows) if v is not None]
        result[name] = float(np.mean(values)) if values else None
    return result


def psnr_of(mean_squared_error: float) -> float:
    """Return the peak signal-to-noise ratio in dB of values in [0, 1]."""
    if mean_squared_error <= 10 ** (-BEST_PSNR / 10):
        return BEST_PSNR
    return -10 * math.log10(mean_squared_error)


def shifted_psnr(
    rendered: Float[np.ndarray, "height width 3"],
    drawn: Float[np.ndarray, "height width 3"],
    mask: Bool[np.ndarray, "height width"],
) -> tuple[float, float | None]:
    """Return the best PSNR over all shifts of the rendering by up to 2 whole pixels a side.

    The second number counts the pixels of the mask alone, with a best shift of its own; None where
    the mask is empty. What a shift uncovers is white.
    """
    m = MOST_SHIFT_PX
    height, width = mask.shape
    padded = np.pad(rendered, ((m, m), (m, m), (0, 0)), constant_values=1.0)
    whole, inside = math.inf, math.inf
    for y in range(2 * m + 1):
        for x in range(2 * m + 1):
            error = ((padded[y : y + height, x : x + width] - drawn) ** 2).mean(axis=-1)
            whole = min(whole, float(error.mean()))
            inside = min(inside, float(error[mask].mean())) if mask.any() else inside
    return psnr_of(whole), psnr_of(inside) if mask.any() else None


def silhouette_iou(
    rendered: UInt8[np.ndarray, "height width 4"], drawn: UInt8[np.ndarray, "height width 4"]
) -> float | None:
    """Return intersection over union of what is at least half opaque; None where nothing is."""
    a, b = mask_of(rendered), mask_of(drawn)
    return float((a & b).sum() / (a | b).sum()) if (a | b).any() else None


def ssim(
    a: Float[np.ndarray, "height width 3"], b: Float[np.ndarray, "height width 3"]
) -> float | None:
    """Return the mean of `ssim_map`, None where a picture is smaller than the window."""
    return None if min(a.shape[:2]) < SSIM_WINDOW else float(ssim_map(a, b).mean())


def ssim_inside(
    a: Float[np.ndarray, "height width 3"],
    b: Float[np.ndarray, "height width 3"],
    mask: Bool[np.ndarray, "height width"],
) -> float | None:
    """Return the mean of `ssim_map` over the mask's pixels whose window fits, None without any."""
    if min(a.shape[:2]) < SSIM_WINDOW:
        return None
    rim = SSIM_WINDOW // 2
    inner = mask[rim:-rim, rim:-rim]
    return float(ssim_map(a, b)[inner].mean()) if inner.any() else None


def ssim_map(
    a: Float[np.ndarray, "height width 3"], b: Float[np.ndarray, "height width 3"]
) -> Float[np.ndarray, "h w 3"]:
    """Return the structural similarity per channel, Gaussian window of 11 px, where it fits.

    Source: Wang, Bovik, Sheikh, Simoncelli, "Image quality assessment", 2004, equation 13.
    """
    mean_a, mean_b = _blurred(a), _blurred(b)
    variance_a, variance_b = _blurred(a * a) - mean_a**2, _blurred(b * b) - mean_b**2
    covariance = _blurred(a * b) - mean_a * mean_b
    light = (2 * mean_a * mean_b + SSIM_C1) / (mean_a**2 + mean_b**2 + SSIM_C1)
    structure = (2 * covariance + SSIM_C2) / (variance_a + variance_b + SSIM_C2)
    return light * structure


def _blurred(image: Float[np.ndarray, "height width 3"]) -> Float[np.ndarray, "h w 3"]:
    """Return the Gaussian average around every pixel whose window fits."""
    offsets = np.arange(SSIM_WINDOW) - SSIM_WINDOW // 2
    kernel = np.exp(-0.5 * (offsets / SSIM_SIGMA) ** 2)
    kernel /= kernel.sum()
    rows = np.lib.stride_tricks.sliding_window_view(image, SSIM_WINDOW, axis=0) @ kernel
    return np.lib.stride_tricks.sliding_window_view(rows, SSIM_WINDOW, axis=1) @ kernel
