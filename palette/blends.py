"""Along the borders between labels: which pixels are blends, and which colour the others have.

Every pixel is compared with the colours that begin beside it, in units of the picture's own noise:
a clean picture tells a blend of one part in a hundred, a JPEG only what rises above its ringing.
Let a be the nearest of those colours, b another one next to the pixel x: how far x has gone from
a towards b is

    (|x - a|^2 + |a - b|^2 - |x - b|^2) / (2 |a - b|).

Lightness and chroma are weighed apart, for JPEG smears chroma over two pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.palette.mixed import FLAT_LEVELS, between_neighbours, in_flat_block

NONE = 255
# JPEG's lightness and chroma of 8-bit RGB (ITU-T T.871), without offsets
YCC_FROM_RGB = np.array(
    [[0.299, 0.587, 0.114], [-0.168736, -0.331264, 0.5], [0.5, -0.418688, -0.081312]],
    dtype=np.float32,
)
ROUNDING = 1 / np.sqrt(12)  # levels: the noise of 8 bits
BESIDE = np.array([1.4, 2.5, 2.5])  # noise of JPEG next to an edge, over that two pixels away
SURE = 2.5  # times the noise towards a neighbour's colour: a blend
STRAY = 3.0  # times the noise by which a colour that begins nowhere near must be nearer
FEW = 50  # pixels from which no noise can be told
SAMPLE = 1 << 17  # pixels that noise is told from
CELLS = 1 << 22  # distances held at once


@dataclass(frozen=True, eq=False)
class Border:
    """The pixels along borders, and what stands round them.

    Attributes:
        at: (n,) places in the padded, flattened pictures.
        labels: padded, flattened nearest labels, 255 = not opaque.
        inner: padded, flattened: the label's eight neighbours have the same.
        width: of the padded picture.
    """

    at: Int[np.ndarray, " n"]
    labels: UInt8[np.ndarray, " pixels"]
    inner: Bool[np.ndarray, " pixels"]
    width: int
