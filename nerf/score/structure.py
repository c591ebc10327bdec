"""HaarPSI and GMSD: how alike two pictures are in edges at several scales, and in gradients.

Both work on the luma of pictures over white at half size, HaarPSI with chroma besides. Inside a
mask, HaarPSI weighs the pixels of the mask alone and GMSD deviates over them alone.

Sources: Reisenhofer, Bosse, Kutyniok, Wiegand, "A Haar wavelet-based perceptual similarity index
for image quality assessment", 2018, equations 9 to 13; Xue, Zhang, Mou, Bovik, "Gradient magnitude
similarity deviation", 2014, equations 1 to 6. Borders as in the package piq 0.8.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float

YIQ_FROM_RGB = np.array(
    [[0.299, 0.587, 0.114], [0.5959, -0.2746, -0.3213], [0.2115, -0.5227, 0.3112]]
)
HAAR_SCALES = (2, 4, 8)  # the side of the wavelet; similarity at the first two, weight by the last
HAAR_C, HAAR_ALPHA = 30.0, 4.2
SMALLEST_SIDE = 16  # of a picture: the widest wavelet at half size
PREWITT = np.array([[1.0, 0.0, -1.0]] * 3) / 3
GMSD_C = 170 / 255**2


def haarpsi(
    a: Float[np.ndarray, "height width 3"],
    b: Float[np.ndarray, "height width 3"],
    mask: Bool[np.ndarray, "height width"] | None = None,
) -> float | None:
    """Return the Haar perceptual similarity in [0, 1], 1 = alike.

    None where a picture is smaller than 16 px or the mask is empty.
    """
    if min(a.shape[:2]) < SMALLEST_SIDE or (mask is not None and not mask.any()):
        return None
    first, second = _halved(255 * a @ YIQ_FROM_RGB.T), _halved(255 * b @ YIQ_FROM_RGB.T)
    similarity, weight = [], []
    for turned in (False, True):
        x, y = (
            [np.abs(_wavelet(p[..., 0], n, turned)) for n in HAAR_SCALES] for p in (first, second)
        )
        similarity.append((_alike(x[0], y[0], HAAR_C) + _alike(x[1], y[1], HAAR_C)) / 2)
        weight.append(np.maximum(x[2], y[2]))
    chroma = [np.abs(_mean_of_four(p[..., 1:])) for p in (first, second)]
    similarity.append(_alike(chroma[0], chroma[1], HAAR_C).mean(axis=-1))
    weight.append((weight[0] + weight[1]) / 2)
    inside = 1.0 if mask is None else _half_mask(mask)
    weights = np.stack(weight) * inside
    if weights.sum() == 0:  # no edge in either picture
        return 1.0
    share = float(
        (weights / (1 + np.exp(-HAAR_ALPHA * np.stack(similarity)))).sum() / weights.sum()
    )
    return float((np.log(share / (1 - share)) / HAAR_ALPHA) ** 2)


def gmsd(
    a: Float[np.ndarray, "height width 3"],
    b: Float[np.ndarray, "height width 3"],
    mask: Bool[np.ndarray, "height width"] | None = None,
) -> float | None:
    """Return the deviation of the gradients' similarity, 0 = alike; None where a mask is empty."""
    if mask is not None and not mask.any():
        return None
    x, y = (_gradient(_halved(p @ YIQ_FROM_RGB[:1].T)[..., 0]) for p in (a, b))
    similarity = _alike(x, y, GMSD_C)
    return float((similarity if mask is None else similarity[_half_mask(mask)]).std())


def _halved(image: Float[np.ndarray, "height width c"]) -> Float[np.ndarray, "h w c"]:
    """Return 2 x 2 means; a picture with an odd side gets a black row and column more."""
    odd = max(image.shape[0] % 2, image.shape[1] % 2)
    padded = np.pad(image, ((0, odd), (0, odd), (0, 0)))
    height, width = padded.shape[0] // 2, padded.shape[1] // 2
    cut = padded[: 2 * height, : 2 * width]
    return cut.reshape(height, 2, width, 2, -1).mean(axis=(1, 3))


def _half_mask(mask: Bool[np.ndarray, "height width"]) -> Bool[np.ndarray, "h w"]:
    return _halved(mask[..., None].astype(np.float64))[..., 0] > 0


def _wavelet(
    image: Float[np.ndarray, "height width"], side: int, turned: bool
) -> Float[np.ndarray, "height width"]:
    kernel = np.full((side, side), 1 / side)
    kernel[side // 2 :] *= -1
    anchor = (side // 2 - 1, side // 2 - 1)
    kernel = kernel.T if turned else kernel
    return cv2.filter2D(image, cv2.CV_64F, kernel, anchor=anchor, borderType=cv2.BORDER_CONSTANT)


def _mean_of_four(image: Float[np.ndarray, "height width c"]) -> Float[np.ndarray, "h w c"]:
    """Return the mean of every pixel and its neighbours right, below and across; black outside."""
    padded = np.pad(image, ((0, 1), (0, 1), (0, 0)))
    return (padded[:-1, :-1] + padded[1:, :-1] + padded[:-1, 1:] + padded[1:, 1:]) / 4


def _gradient(image: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    across, down = (
        cv2.filter2D(image, cv2.CV_64F, kernel, borderType=cv2.BORDER_CONSTANT)
        for kernel in (PREWITT, PREWITT.T)
    )
    return np.hypot(across, down)


def _alike(x: np.ndarray, y: np.ndarray, constant: float) -> np.ndarray:
    return (2 * x * y + constant) / (x * x + y * y + constant)
