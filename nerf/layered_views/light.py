"""Say how colours differ from the paints that they are made of, so that it moves with the paints.

    colour = gain m + glow (255 - gain m) + tint

m is a mixture of paints; gain makes it darker, or up to BRIGHTEST times lighter, and glow leads
from there to white. One level says both: they are what gives the colour its luma. `tint` is the
rest, without luma. All three lie in one picture: the level as luma, the tint as chroma.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8

MIDDLE = 128.0  # the level of what is as its paints are
DARKEST, LIGHTEST = 8.0, 248.0  # levels of black and white
BRIGHTEST = 1.25  # the largest gain
TURN = MIDDLE + (BRIGHTEST - 1) * (MIDDLE - DARKEST)  # its level
TINT = 2.0  # levels of 255 in a colour that one of the picture stands for
LUMA = np.array([0.299, 0.587, 0.114], np.float32)
TO_BLUE, TO_RED = 1.772, 1.402  # levels of a colour per level of chroma. Source: ITU-R BT.601
LEAST = 4.0  # levels of 255 that make no difference

Colors = Float[np.ndarray, "height width 3"]


@dataclass(frozen=True, eq=False)
class Light:
    """Attributes: level (height, width); tint: (height, width, 2) blue and red chroma."""

    level: Float[np.ndarray, "height width"]
    tint: Float[np.ndarray, "height width 2"]

    def picture(self) -> UInt8[np.ndarray, "height width 3"]:
        """Return both as one picture."""
        blue, red = self.tint[..., 0] / TINT, self.tint[..., 1] / TINT
        green = (LUMA[2] * TO_BLUE * blue + LUMA[0] * TO_RED * red) / LUMA[1]
        parts = (self.level + TO_RED * red, self.level - green, self.level + TO_BLUE * blue)
        return np.rint(np.stack(parts, axis=-1)).clip(0, 255).astype(np.uint8)


def light_of(
    color: UInt8[np.ndarray, "height width 3"],
    mixture: Colors,
    lit: Bool[np.ndarray, "height width"],
) -> Light | None:
    """Return how colours differ from mixtures; None where none does.

    Args:
        color: sRGB.
        mixture: of paints, 0 to 255.
        lit: where that matters.
    """
    shown = color.astype(np.float32)
    lit = lit & (np.abs(shown - mixture).max(axis=-1) > LEAST)
    if not lit.any():
        return None
    bright, own = shown[lit] @ LUMA, mixture[lit] @ LUMA
    gain = np.minimum(bright / np.maximum(own, 1e-3), BRIGHTEST)
    brightest = BRIGHTEST * own
    glow = ((bright - brightest) / np.maximum(255 - brightest, 1)).clip(0, 1)
    level = np.full(lit.shape, MIDDLE, np.float32)
    level[lit] = np.where(
        glow > 0, TURN + glow * (LIGHTEST - TURN), MIDDLE + (gain - 1) * (MIDDLE - DARKEST)
    )
    under = mixture[lit] * gain[:, None]
    left = shown[lit] - (under + glow[:, None] * (255 - under))
    luma = left @ LUMA
    tint = np.zeros((*lit.shape, 2), np.float32)
    tint[lit] = np.stack([(left[:, 2] - luma) / TO_BLUE, (left[:, 0] - luma) / TO_RED], axis=1)
    return Light(level, tint)
