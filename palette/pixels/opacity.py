"""See paint that is not wholly opaque: glass cloth, a layer at 80 %, brush flow.

Less than opaque is a pixel of the figure's soft rim, or see-through paint. Which, says its place:
the rim is where the figure ends. What lies farther in is paint, and its straight colour counts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, UInt8

from toonset.palette.pixels.antialias import OPAQUE
from toonset.raster import erode

COVERED = 128  # of 255: a pixel is the figure's if that covers half of it
RIM = 2  # pixels: a soft rim, as resampling and matting leave it, is no wider
LEAST = 0.01  # of a drawing: what matting leaves inside is 0.6 % at most, paint 9 % and more
WORTH_A_LINE = 0.05  # of the figure: less of it see-through is not worth a warning

Picture = UInt8[np.ndarray, "height width 4"]


def opaque_inside(rgba: Picture) -> Picture:
    """Return a picture whose see-through paint is opaque; the same one where there is none."""
    paint = _see_through(rgba)
    if not paint.any():
        return rgba
    solid = rgba.copy()
    solid[paint, 3] = 255
    return solid


def see_through_notes(pictures: Sequence[Picture]) -> tuple[str, ...]:
    """Return what a person should know of see-through paint: that its own colour counts."""
    alphas, covered = [], 0
    for rgba in pictures:
        alphas.append(rgba[..., 3][_see_through(rgba)])
        covered += int((rgba[..., 3] >= COVERED).sum())
    seen = np.concatenate([np.zeros(0, dtype=np.uint8), *alphas])
    if len(seen) < WORTH_A_LINE * max(covered, 1):
        return ()
    return (
        f"{100 * len(seen) / covered:.0f} % of the figure is see-through, mostly "
        f"{100 * float(np.median(seen)) / 255:.0f} % opaque: the paint's own colour counts, not "
        "what shows through it",
    )


def _see_through(rgba: Picture) -> Bool[np.ndarray, "height width"]:
    alpha = rgba[..., 3]
    covered: Bool[np.ndarray, "height width"] = alpha >= COVERED
    able = covered & (alpha < OPAQUE)
    if able.any():
        able &= erode(covered, RIM)
    return able if able.sum() >= LEAST * covered.sum() else np.zeros_like(able)
