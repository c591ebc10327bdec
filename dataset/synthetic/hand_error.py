"""Add errors of a hand to a picture: a smooth random displacement, pens that swell.

The displacement is a sum of cosines that fit 1 to 3 half waves into the cell, per axis,

    d(x, y) = sum over i, j in 0..3, not both 0, of a_ij cos(pi i x) cos(pi j y),   x, y in [0, 1],

a_ij normal with deviation 1 / (i + j): proportions drift over a body part, lines stay smooth. Its
mean over the figure is removed (a shift is not an error of a drawing) and its size set exactly.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float, Shaped, UInt8

from toonset.dataset.synthetic.drawing import Lines
from toonset.dataset.synthetic.shadow import Shade
from toonset.palette.pixels.labels import UNLABELLED

HALF_WAVES = 3
SWELLS = 9  # per side of the cell: how often a line may grow wider and thinner


def bend(
    labels: UInt8[np.ndarray, "height width"],
    lines: Lines,
    shade: Shade | None,
    rms_px: float,
    generator: np.random.Generator,
) -> tuple[UInt8[np.ndarray, "height width"], Lines, Shade | None]:
    """Return labels, lines and shade of a drawing bent by a random field of `rms_px` (figure)."""
    if rms_px == 0:
        return labels, lines, shade
    field = displacement_field(generator, labels != UNLABELLED, rms_px)
    far = float(max(labels.shape))
    bent = Lines(
        displace(lines.silhouette, field, far, smooth=True),
        displace(lines.inner, field, far, smooth=True),
    )
    moved = None if shade is None else displace(shade, field, 1.0, smooth=True)
    return displace(labels, field, UNLABELLED, smooth=False), bent, moved


def displacement_field(
    generator: np.random.Generator, figure: Bool[np.ndarray, "height width"], rms_px: float
) -> Float[np.ndarray, "height width 2"]:
    """Return how far (x, y) in pixels every pixel's content comes from.

    Args:
        generator: asked for the same number of draws, whatever the size.
        figure: where the drawing is; not empty.
        rms_px: root mean square length of the displacement over the figure.
    """
    height, width = figure.shape
    weights = generator.standard_normal((HALF_WAVES + 1, HALF_WAVES + 1, 2))
    order = np.add.outer(np.arange(HALF_WAVES + 1), np.arange(HALF_WAVES + 1))
    weights = weights / np.maximum(order, 1)[..., None]
    rows, columns = _waves(height), _waves(width)
    field = np.einsum("hi,wj,ijc->hwc", rows, columns, weights, optimize=True)
    field -= field[figure].mean(axis=0)
    return field * (rms_px / np.sqrt((field[figure] ** 2).sum(axis=1).mean()))


def pen_width(
    outline_px: float, spread: float, shape: tuple[int, int], generator: np.random.Generator
) -> float | Float[np.ndarray, "height width"]:
    """Return the width of a view's lines, at each pixel where it varies along them.

    Args:
        outline_px: the width meant.
        spread: the view's is off by up to this share, and again by half of it along the line.
        shape: height and width of the picture.
        generator: asked for the same number of draws, whatever the width and the size.
    """
    of_view, along = generator.uniform(-1, 1), generator.uniform(-1, 1, (SWELLS, SWELLS))
    if not outline_px * spread:
        return outline_px
    smooth = cv2.resize(along.astype(np.float32), shape[::-1], interpolation=cv2.INTER_LINEAR)
    return outline_px * (1 + spread * of_view) * (1 + spread / 2 * smooth.astype(np.float64))


def displace(
    picture: Shaped[np.ndarray, "height width"],
    field: Float[np.ndarray, "height width 2"],
    outside: float,
    *,
    smooth: bool,
) -> Shaped[np.ndarray, "height width"]:
    """Return `picture` with every pixel taken from where `field` says.

    Args:
        picture: uint8 or float32.
        field: pixels.
        outside: value beyond the picture's edges.
        smooth: interpolate linearly; else take the nearest pixel (labels).
    """
    height, width = picture.shape
    x = (np.arange(width) + field[..., 0]).astype(np.float32)
    y = (np.arange(height)[:, None] + field[..., 1]).astype(np.float32)
    mode = cv2.INTER_LINEAR if smooth else cv2.INTER_NEAREST
    return cv2.remap(
        picture, x, y, mode, borderMode=cv2.BORDER_CONSTANT, borderValue=(outside,) * 4
    )


def _waves(size: int) -> Float[np.ndarray, "size waves"]:
    place = (np.arange(size) + 0.5) / size
    return np.cos(np.pi * np.outer(place, np.arange(HALF_WAVES + 1)))
