"""Check by their colours that all drawings show one character.

A view of a turn shares much of what it shows with the next one, and with its mirror image. So the
views hang together: link those whose colours overlap most until all are linked (single linkage);
where even the last link, the weakest, is too weak, there are two characters. Nothing needs cameras.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from toonset.palette.colors import oklab_from_rgb
from toonset.raster import depth_inside
from toonset.view import View

FEWEST = 3  # views: front and back alone need not share a colour
BIN, CHROMA = 0.05, 0.025  # OKLab: of lightness; of a and b
MOST_CHROMA = 0.35
BLUR = 1.0  # bins: shadows and paper move a colour a little
REACH = 4.0  # sigmas of the blur
OPAQUE = 200  # alpha: fainter are mixed with the paper
FEWEST_PIXELS = 200  # that lie deeper than the contour's ink; fewer, and ink counts, too
# Share of colours that two drawings have not in common. The weakest link of 40 sheets of one
# character has at most 0.45, of nine in ten pairs of characters more than 0.5 (docs/decisions.md)
MOST_APART = 0.5


def other_character(drawings: Sequence[View]) -> list[int]:
    """Return the views whose colours are not those of the first one's group; none: all are one."""
    if len(drawings) < FEWEST:
        return []
    colors = [_colors(view) for view in drawings]
    pairs = np.triu_indices(len(colors), 1)
    shared = [np.minimum(colors[i], colors[j]).sum() for i, j in zip(*pairs, strict=True)]
    linked = np.eye(len(colors), dtype=bool)
    linked[pairs] = linked.T[pairs] = 1 - np.array(shared) <= MOST_APART
    group = linked[0]
    for _ in colors:
        group = linked[group].any(axis=0)
    return np.flatnonzero(~group).tolist()


def _colors(view: View) -> Float[np.ndarray, "lightness a b"]:
    """Return how much of a drawing has which colour, its contour's ink aside; 1 in all."""
    opaque = view.rgba[..., 3] > OPAQUE
    deep = depth_inside(opaque) > view.line_width_px + 0.5
    if deep.sum() < FEWEST_PIXELS:
        deep = opaque if opaque.any() else view.mask
    lab = oklab_from_rgb(view.rgba[deep][:, :3])
    sides = np.arange(-MOST_CHROMA, MOST_CHROMA + CHROMA / 2, CHROMA)
    counts, _ = np.histogramdd(lab, [np.arange(0, 1 + 1.5 * BIN, BIN), sides, sides])
    for bins in counts.shape:  # along every axis in turn
        apart = np.abs(np.subtract.outer(np.arange(bins), np.arange(bins))) / BLUR
        weights = np.where(apart <= REACH, np.exp(-(apart**2) / 2), 0)
        counts = np.tensordot(counts, weights, axes=(0, 0))
    return np.asarray(counts / counts.sum())
