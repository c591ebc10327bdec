"""Colour swatches that touch: a strip of equal cells, each of one colour, is cut into its cells."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from jaxtyping import Bool, UInt8

from toonset.dataset.split.figures.blobs import Blobs
from toonset.dataset.split.figures.text_and_swatches import DISC, LEAST_SWATCH, LETTERS

EQUAL = 0.06  # of a cell: the strip's length is a whole number of cells
LONGEST = 32  # cells: more are a ruler
PLAIN = 24  # levels from a cell's middle colour: shading, noise
MOSTLY = 0.8  # of the middle of a cell in its colour
OTHER = 12  # levels: colours of neighbouring cells that differ by less are one colour
MIDDLE = 0.25  # of the cell from its rim: its outline is not looked at


def strip_seams(
    blobs: Blobs, rgb: UInt8[np.ndarray, "height width 3"]
) -> Bool[np.ndarray, "height width"]:
    """Return the pixels to take away so that touching swatches come apart."""
    seams = np.zeros(blobs.labels.shape, dtype=bool)
    sides = np.sort(blobs.boxes[:, 2:], axis=1)
    cells = np.rint(sides[:, 1] / np.maximum(sides[:, 0], 1)).astype(int)
    able = np.abs(sides[:, 1] - cells * sides[:, 0]) <= EQUAL * sides[:, 0] * cells
    able &= blobs.areas >= DISC * sides.prod(axis=1)
    able &= (sides[:, 0] >= LEAST_SWATCH) & (cells >= LETTERS) & (cells <= LONGEST)
    for number in np.flatnonzero(able).tolist():
        window = blobs.window(number)
        own = seams[window]
        tall = own if own.shape[0] > own.shape[1] else own.T
        picture = rgb[window] if own.shape[0] > own.shape[1] else rgb[window].swapaxes(0, 1)
        edges = np.rint(np.linspace(0, len(tall), cells[number] + 1)).astype(int)
        if _are_swatches([picture[a:b] for a, b in pairwise(edges)]):
            tall[edges[1:-1]] = True
    return seams


def _are_swatches(cells: list[UInt8[np.ndarray, "side side 3"]]) -> bool:
    """Return whether every cell is of one colour, mostly another than the cell before it."""
    colors = []
    for cell in cells:
        rim = [round(MIDDLE * side) for side in cell.shape[:2]]
        inside = cell[rim[0] : -rim[0], rim[1] : -rim[1]].reshape(-1, 3).astype(np.float64)
        color = np.median(inside, axis=0)
        if np.mean(np.abs(inside - color).max(axis=1) <= PLAIN) < MOSTLY:
            return False
        colors.append(color)
    steps = np.abs(np.diff(colors, axis=0)).max(axis=1)
    return bool(np.mean(steps >= OTHER) > 0.5)
