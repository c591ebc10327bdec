"""PSNR and SSIM of a rendering against a drawing, over white and inside the mask."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, UInt8

BEST_PSNR = 120.0  # reported for identical pictures, which have no finite value
SSIM_WINDOW, SSIM_SIGMA = 11, 1.5  # Wang et al. 2004
SSIM_C1, SSIM_C2 = 0.01**2, 0.03**2


def over_white(rgba: UInt8[np.ndarray, "height width 4"]) -> Float[np.ndarray, "height width 3"]:
    """Return a straight-alpha picture over white, in [0, 1]."""
    values = rgba.astype(np.float64) / 255
    return values[..., :3] * values[..., 3:] + 1 - values[..., 3:]


def compare(
    rendered: UInt8[np.ndarray, "height width 4"], drawn: UInt8[np.ndarray, "height width 4"]
) -> dict[str, float | None]:
    """Return psnr, psnr_mask (where the drawing has any alpha) and ssim, over white.

    `psnr_mask` is None where the drawing is empty, `ssim` where it is smaller than its window.
    """
    a, b = over_white(rendered), over_white(drawn)
    error = ((a - b) ** 2).mean(axis=-1)
    mask = drawn[..., 3] > 0
    inside = psnr_of(float(error[mask].mean())) if mask.any() else None
    return {"psnr": psnr_of(float(error.mean())), "psnr_mask": inside, "ssim": ssim(a, b)}


def psnr_of(mean_squared_error: float) -> float:
    """Return the peak signal-to-noise ratio in dB of values in [0, 1]."""
    if mean_squared_error <= 10 ** (-BEST_PSNR / 10):
        return BEST_PSNR
    return -10 * math.log10(mean_squared_error)


def ssim(
    a: Float[np.ndarray, "height width 3"], b: Float[np.ndarray, "height width 3"]
) -> float | None:
    """Return the structural similarity, Gaussian window of 11 px, mean over valid pixels.

    None where a picture is smaller than the window.

    Source: Wang, Bovik, Sheikh, Simoncelli, "Image quality assessment", 2004, equation 13.
    """
    if min(a.shape[:2]) < SSIM_WINDOW:
        return None
    mean_a, mean_b = _blurred(a), _blurred(b)
    variance_a, variance_b = _blurred(a * a) - mean_a**2, _blurred(b * b) - mean_b**2
    covariance = _blurred(a * b) - mean_a * mean_b
    light = (2 * mean_a * mean_b + SSIM_C1) / (mean_a**2 + mean_b**2 + SSIM_C1)
    structure = (2 * covariance + SSIM_C2) / (variance_a + variance_b + SSIM_C2)
    return float((light * structure).mean())


def _blurred(image: Float[np.ndarray, "height width 3"]) -> Float[np.ndarray, "h w 3"]:
    """Return the Gaussian average around every pixel whose window fits."""
    offsets = np.arange(SSIM_WINDOW) - SSIM_WINDOW // 2
    kernel = np.exp(-0.5 * (offsets / SSIM_SIGMA) ** 2)
    kernel /= kernel.sum()
    rows = np.lib.stride_tricks.sliding_window_view(image, SSIM_WINDOW, axis=0) @ kernel
    return np.lib.stride_tricks.sliding_window_view(rows, SSIM_WINDOW, axis=1) @ kernel
