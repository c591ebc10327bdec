"""Compute PSNR and SSIM of a rendering against a drawing, over white and inside the mask."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, UInt8
from skimage.metrics import structural_similarity

from toonset.dataset.silhouettes.mask import mask_of
from toonset.view import over_white

BEST_PSNR = 120.0  # reported for identical pictures, which have no finite value
MOST_SHIFT_PX = 2  # of the whole picture that the shift-tolerant PSNR forgives
SSIM_WINDOW, SSIM_SIGMA = 11, 1.5  # px, of a Gaussian: Wang et al. 2004

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
    """Return intersection over union of what is at least half opaque; None if both are empty."""
    a, b = mask_of(rendered), mask_of(drawn)
    return float((a & b).sum() / (a | b).sum()) if (a | b).any() else None


def ssim(
    a: Float[np.ndarray, "height width 3"],
    b: Float[np.ndarray, "height width 3"],
    mask: Bool[np.ndarray, "height width"] | None = None,
) -> float | None:
    """Return the mean structural similarity of the channels, where the Gaussian window fits.

    Args:
        a: a picture in [0, 1].
        b: another one.
        mask: count its pixels alone.

    None where the window fits nowhere, or nowhere in the mask.
    """
    if min(a.shape[:2]) < SSIM_WINDOW:
        return None
    alike = structural_similarity(
        a,
        b,
        data_range=1,
        channel_axis=2,
        gaussian_weights=True,
        sigma=SSIM_SIGMA,
        use_sample_covariance=False,
        full=True,
    )[1]
    fits = (slice(SSIM_WINDOW // 2, -(SSIM_WINDOW // 2)),) * 2
    inner = alike[fits] if mask is None else alike[fits][mask[fits]]
    return float(inner.mean()) if inner.size else None
