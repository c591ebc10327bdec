"""CIE L*a*b* as Adobe stores it (white D50), to sRGB.

Source: W3C, CSS Color Module Level 4, sections 9 to 11 and its sample code: Lab to XYZ, Bradford
adaptation from D50 to D65, XYZ to linear sRGB.
"""

from __future__ import annotations

import numpy as np

from toonset.palette.colors import srgb_from_linear
from toonset.palette.names import RGB

WHITE_D50 = np.array([0.3457 / 0.3585, 1.0, (1 - 0.3457 - 0.3585) / 0.3585])
D65_FROM_D50 = np.array(
    [
        [0.955473421488075, -0.02309845494876471, 0.06325924320057072],
        [-0.0283697093338637, 1.0099953980813041, 0.021041441191917323],
        [0.012314014864481998, -0.020507649298898964, 1.330365926242124],
    ]
)
LINEAR_FROM_D65 = np.array(
    [
        [12831 / 3959, -329 / 214, -1974 / 3959],
        [-851781 / 878810, 1648619 / 878810, 36519 / 878810],
        [705 / 12673, -2585 / 12673, 705 / 667],
    ]
)
KAPPA, EPSILON = 24389 / 27, 216 / 24389  # where the cube root gives way to a line


def rgb_from_lab(lightness: float, a: float, b: float) -> RGB:
    """Return the 8-bit sRGB colour of L* (0 to 100), a* and b*; outside sRGB it is clipped."""
    y = (lightness + 16) / 116
    roots = np.array([y + a / 500, y, y - b / 200])
    cubes = roots**3
    xyz = WHITE_D50 * np.where(cubes > EPSILON, cubes, (116 * roots - 16) / KAPPA)
    linear = LINEAR_FROM_D65 @ D65_FROM_D50 @ xyz
    red, green, blue = np.rint(255 * srgb_from_linear(linear)).astype(int).tolist()
    return red, green, blue
