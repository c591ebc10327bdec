"""Colours that are taken for one paint although each of them is painted flat, over a large area.

People hardly see a difference of 0.02 in OKLab, so such colours are one colour of the palette. That
is right for noise and gradients, whose levels run into each other. Two exact colours with a gap
between them were chosen by somebody, skin and hair perhaps: that can be said.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Int

from toonset.palette.colors import JUST_NOTICEABLE, even_oklab_from_rgb
from toonset.palette.paints.clusters import Paint
from toonset.palette.paints.histogram import Histogram
from toonset.palette.paints.line_color import rounded
from toonset.palette.pixels.labels import nearest_colors

VALLEY = 0.25  # of what a colour must cover: so much joins the levels of noise and of gradients


def near_equal_paints(
    histogram: Histogram, paints: Sequence[Paint], least: float
) -> tuple[Paint, ...]:
    """Return exact colours that cover much, each with those of its paint's colours that look alike.

    Colours that differ by no more than the noise, or by steps of so much, are one. Of a paint's
    exact colours that which gives it its name is not returned.

    Args:
        histogram: of the character.
        paints: of this histogram.
        least: share of the flat pixels, 0 to 1, that an exact colour must have.
    """
    pixels = least * float(histogram.flat.sum())
    found: list[Paint] = []
    for paint in paints:
        flat = histogram.flat[paint.members]
        if (flat >= pixels).sum() > 1:
            tops = _tops(histogram, paint, paint.members[flat >= VALLEY * pixels])
            found += _alike(histogram, paint, tops[histogram.flat[tops] >= pixels])
    return tuple(found)


def _tops(
    histogram: Histogram, paint: Paint, shades: Int[np.ndarray, " shades"]
) -> Int[np.ndarray, " tops"]:
    """Return the most frequent colour of every group of shades that noise or small steps join.

    The paint's own group is left out.
    """
    from scipy.sparse.csgraph import connected_components

    rgb = np.concatenate([[paint.rgb], histogram.colors[shades]]).astype(np.int16)
    near = np.abs(rgb[:, None] - rgb).max(axis=2) <= histogram.noise
    group = connected_components(near, directed=False)[1]
    others = np.flatnonzero(group[1:] != group[0])
    order = others[np.argsort(-histogram.flat[shades[others]], kind="stable")]
    return shades[order[np.unique(group[1:][order], return_index=True)[1]]]


def _alike(histogram: Histogram, paint: Paint, tops: Int[np.ndarray, " tops"]) -> list[Paint]:
    """Return the tops with what looks like each of them more than like the paint's own colour."""
    rgb = np.concatenate([[paint.rgb], histogram.colors[tops]]).astype(np.uint8)
    colors = histogram.colors[paint.members]
    nearest = nearest_colors(colors, rgb)
    away = np.linalg.norm(even_oklab_from_rgb(colors) - even_oklab_from_rgb(rgb)[nearest], axis=1)
    alike = away <= JUST_NOTICEABLE
    return [
        Paint(rounded(one), paint.members[alike & (nearest == number)])
        for number, one in enumerate(rgb[1:], start=1)
    ]
