"""Paints whose shades lie so wide apart that people see more than one colour in them.

Shades that run into each other are one paint, however far they run, as a gradient must be. Where a
drawing is shaded throughout and has little flat paint, even different things can so become one.
That cannot be told from a gradient, but it can be said.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toonset.palette.colors import JUST_NOTICEABLE, oklab_from_rgb
from toonset.palette.names import hex_of
from toonset.palette.paints.clusters import Paint
from toonset.palette.paints.histogram import Histogram

WIDE = 10 * JUST_NOTICEABLE  # in OKLab: a fifth of the way from black to white


def wide_paint_notes(
    histogram: Histogram, paints: Sequence[Paint], least: float
) -> tuple[str, ...]:
    """Return what a person should know of paints with much that looks unlike them.

    Args:
        histogram: of the character.
        paints: those that are kept.
        least: share of the flat pixels, 0 to 1, that are too far from their paint to be silent.
    """
    total = int(histogram.flat.sum())
    notes = []
    for paint in paints:
        shades = oklab_from_rgb(histogram.colors[paint.members])
        own = oklab_from_rgb(np.array(paint.rgb, dtype=np.uint8))
        far = np.linalg.norm(shades - own, axis=1) > WIDE
        share = float(histogram.flat[paint.members] @ far) / total
        if share > 0 and share >= least:
            notes.append(
                f"{hex_of(paint.rgb)}: stands for very different shades ({100 * share:.0f} % of "
                "the flat pixels look unlike it), as in a drawing shaded throughout; name the "
                "colours with --colors"
            )
    return tuple(notes)
