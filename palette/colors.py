"""Convert colours to OKLab, whose distances match what people see.

Lightness L in [0, 1], a (green to red) and b (blue to yellow) within about +-0.3. A distance of
0.02 is just noticeable side by side. Source: B. Ottosson, "A perceptual color space for image
processing" (2020), https://bottosson.github.io/posts/oklab/. sRGB's curve between levels and linear
light: IEC 61966-2-1.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8

LMS_FROM_LINEAR = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
LAB_FROM_ROOTS = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)
JUST_NOTICEABLE = 0.02  # Source: CSS Color 4 (W3C), 13.2: "JND" of its gamut mapping in OKLab
TOE = (0.206, 0.03)
BLACK = 4  # levels of sRGB


def linear_from_srgb(srgb: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return linear light of sRGB in [0, 1]."""
    value = np.asarray(srgb, dtype=np.float64)
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(linear: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return sRGB in [0, 1] of linear light, clipped; NaN becomes 0."""
    value = np.clip(np.nan_to_num(linear), 0, 1)
    return np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)


LINEAR_OF_LEVEL = linear_from_srgb(np.arange(256) / 255)


def oklab_from_rgb(rgb: UInt8[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Return OKLab (L, a, b) of 8-bit sRGB colours."""
    linear = LINEAR_OF_LEVEL[rgb]
    return np.cbrt(linear @ LMS_FROM_LINEAR.T) @ LAB_FROM_ROOTS.T


def rgb_from_oklab(lab: Float[np.ndarray, "*n 3"]) -> UInt8[np.ndarray, "*n 3"]:
    """Return 8-bit sRGB of OKLab colours, each channel clipped."""
    roots = lab @ np.linalg.inv(LAB_FROM_ROOTS).T
    linear = roots**3 @ np.linalg.inv(LMS_FROM_LINEAR).T
    return np.rint(255 * srgb_from_linear(linear)).astype(np.uint8)


def even_oklab_from_rgb(rgb: UInt8[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Return OKLab of 8-bit sRGB colours with dark ones drawn together.

    OKLab has no toe: from #000000 to #010101 it measures 0.07, which nobody sees. Its author's toe
    brings lightness close to CIE L*; a and b shrink alike. Above L = 0.5 distances hardly change.
    Source: B. Ottosson, "Okhsv and Okhsl" (2021), lightness estimate L_r.
    """
    lab = oklab_from_rgb(rgb)
    lightness = lab[..., :1]
    slope = (1 + TOE[0]) / (1 + TOE[1])
    bent = slope * lightness - TOE[0]
    toned = (bent + np.sqrt(bent**2 + 4 * TOE[1] * slope * lightness)) / 2
    even: np.ndarray = lab * np.where(lightness > 0, toned / np.maximum(lightness, 1e-9), 0)
    return even


def shaded_oklab_from_rgb(rgb: UInt8[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Return lightness, and a and b per lightness as the colour has them in full light, times it.

    L is that of `even_oklab_from_rgb`. Shade that scales levels of sRGB, as painting programs
    multiply, changes L alone: a / L and b / L are those of the colour scaled up until one channel
    is full. `BLACK` is added before, for black has no hue.
    """
    levels = np.asarray(rgb, dtype=np.float64) + BLACK
    full = levels / levels.max(axis=-1, keepdims=True)
    lab = np.cbrt(linear_from_srgb(full) @ LMS_FROM_LINEAR.T) @ LAB_FROM_ROOTS.T
    light = even_oklab_from_rgb(rgb)[..., :1]
    return np.concatenate([light, lab[..., 1:] * light / lab[..., :1]], axis=-1)
