"""OKLab: a colour space in which distances match what people see.

Lightness L in [0, 1], a (green to red) and b (blue to yellow) within about +-0.3. A distance of
0.02 is just noticeable side by side. Source: B. Ottosson, "A perceptual color space for image
processing" (2020), https://bottosson.github.io/posts/oklab/.
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
_LEVELS = np.arange(256) / 255
LINEAR_OF_LEVEL = np.where(_LEVELS <= 0.04045, _LEVELS / 12.92, ((_LEVELS + 0.055) / 1.055) ** 2.4)


def oklab_from_rgb(rgb: UInt8[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Return OKLab (L, a, b) of 8-bit sRGB colours."""
    linear = LINEAR_OF_LEVEL[rgb]
    return np.cbrt(linear @ LMS_FROM_LINEAR.T) @ LAB_FROM_ROOTS.T
