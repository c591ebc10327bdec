"""Find the colours of tiny features: eyes, teeth, buttons, too small to be a paint.

What little there is of a colour is mostly a blend along an edge, or noise. A feature differs from
both: its colour is unlike every paint, no two paints mix to it, and it is there at two places at
least, as eyes are, or in two views. Each of these is thicker than a blend, which in a clean picture
is a pixel wide and hardly ever flat, and wider where there is noise.

Beside them stand colours that are taken for one paint although each is painted flat, over a large
area. People hardly see a difference of 0.02 in OKLab, so such colours are one colour of the
palette. That is right for noise and gradients, whose levels run into each other; two exact colours
with a gap between them were chosen by somebody, skin and hair perhaps: that can be said.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Int

from toonset.palette.colors import JUST_NOTICEABLE, even_oklab_from_rgb
from toonset.palette.paints.blends import LEAST_FLAT, false_paints
from toonset.palette.paints.clusters import UNLIKE, Paint
from toonset.palette.paints.histogram import LEAST_NOISE, Histogram
from toonset.palette.paints.line_color import rounded
from toonset.palette.paints.places import PLACES, THIN, Members, Pixels, patches_of, pixels_of
from toonset.palette.pixels.labels import nearest_colors

THICK = 5  # pixels: blends are thinner in a JPEG, too, which smears chroma over two
VALLEY = 0.25  # of what a colour must cover: so much joins the levels of noise and of gradients


def tiny_paints(
    histogram: Histogram, paints: Sequence[Paint], specks: Sequence[Members]
) -> tuple[Paint, ...]:
    """Return the colours of tiny features, the most frequent first.

    Args:
        histogram: of the character.
        paints: of this histogram.
        specks: positions in the histogram of colours alike, which are unlike every paint.
    """
    tops = np.array([own[histogram.flat[own].argmax()] for own in specks], dtype=np.int64)
    order = np.argsort([-int(histogram.flat[own].sum()) for own in specks], kind="stable")
    tops = tops[order.astype(np.int64)]
    tops = tops[~_mixed(histogram, tops, paints)]
    alike = [_alike(histogram, top) for top in tops]
    found: list[Paint] = []
    for top, members, places in zip(tops, alike, pixels_of(histogram, alike), strict=True):
        if _stands_out(histogram, top, paints, found) and _is_at_places(histogram, members, places):
            found.append(Paint(rounded(histogram.colors[top]), members))
    return tuple(found)


def _alike(histogram: Histogram, top: np.int64) -> Members:
    """Return the colours that nobody tells from one of them."""
    reach = even_oklab_from_rgb(histogram.colors) - even_oklab_from_rgb(histogram.colors[top])
    return np.flatnonzero(np.linalg.norm(reach, axis=1) <= JUST_NOTICEABLE)


def _mixed(
    histogram: Histogram, tops: Int[np.ndarray, " tops"], paints: Sequence[Paint]
) -> Bool[np.ndarray, " tops"]:
    """Return which colours look like a blend of two paints."""
    rgb = np.array([*(paint.rgb for paint in paints), *histogram.colors[tops]], dtype=np.float64)
    false = false_paints(rgb, np.arange(len(rgb)) < len(paints), histogram.noise, None)
    return false[len(paints) :]


def _stands_out(
    histogram: Histogram, top: np.int64, paints: Sequence[Paint], found: Sequence[Paint]
) -> bool:
    """Return whether a colour is unlike those found before, and no blend of theirs."""
    if not found:
        return True
    rgb = np.array([paint.rgb for paint in found], dtype=np.uint8)
    away = even_oklab_from_rgb(rgb) - even_oklab_from_rgb(histogram.colors[top])
    unlike = np.linalg.norm(away, axis=1).min() >= UNLIKE
    return bool(unlike) and not _mixed(histogram, np.array([top]), [*paints, *found])[0]


def _is_at_places(histogram: Histogram, members: Members, places: Sequence[Pixels]) -> bool:
    """Return whether a colour is in patches thicker than a blend at two places or more."""
    flat, count = (int(n[members].sum()) for n in (histogram.flat, histogram.counts))
    clean = histogram.noise <= LEAST_NOISE and flat >= LEAST_FLAT * count
    return len(patches_of(places, THIN if clean else THICK)) >= PLACES


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
            found += _tops_alike(histogram, paint, tops[histogram.flat[tops] >= pixels])
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


def _tops_alike(histogram: Histogram, paint: Paint, tops: Int[np.ndarray, " tops"]) -> list[Paint]:
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
