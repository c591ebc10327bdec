"""Give every colour of a palette a name of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Int, UInt8

from toonset.palette.color_names import distinct_names, part_of
from toonset.palette.palette import Palette
from toonset.palette.pixels.labels import UNLABELLED, nearest_labels

Picture = UInt8[np.ndarray, "height width 4"]
LEVELS = 100  # of height that are told apart


def with_names(found: Palette, pictures: Sequence[Picture]) -> Palette:
    """Return a palette whose colours have a name each; the lines' colour has that of its paint.

    Args:
        found: a palette of the pictures.
        pictures: sRGB with straight alpha.
    """
    names = distinct_names([one.rgb for one in found.colors], lambda: parts_of(found, pictures))
    pairs = zip(found.colors, names, strict=True)
    colors = tuple(replace(one, name=name) for one, name in pairs)
    ink = found.contour
    if ink is not None:
        name_by_color = {one.rgb: one.name for one in colors}
        ink = replace(ink, name=name_by_color.get(ink.rgb, ink.name))
    return replace(found, colors=colors, contour=ink)


def parts_of(found: Palette, pictures: Sequence[Picture]) -> list[str]:
    """Return the part of the figure, by height, in which each colour's median pixel lies."""
    at = sum(_heights(picture, found) for picture in pictures)
    below = np.cumsum(np.asarray(at), axis=1)
    middle = (below < below[:, -1:] / 2).sum(axis=1)
    return [
        part_of(level / LEVELS) if total else ""
        for level, total in zip(middle.tolist(), below[:, -1].tolist(), strict=True)
    ]


def _heights(picture: Picture, found: Palette) -> Int[np.ndarray, "colors levels"]:
    """Return how many pixels of each colour lie at which height of the figure, from its top."""
    labels = nearest_labels(picture, found.rgb)
    rows = np.flatnonzero((labels != UNLABELLED).any(axis=1))
    counts = np.zeros((len(found.colors), LEVELS + 1), dtype=np.int64)
    for row in rows:
        level = LEVELS * (row - rows[0]) // max(rows[-1] - rows[0], 1)
        counts[:, level] += np.bincount(labels[row], minlength=256)[: len(found.colors)]
    return counts
