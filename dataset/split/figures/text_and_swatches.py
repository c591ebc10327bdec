"""Detect text and colour swatches: small things alike, side by side on a line."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Int

LETTERS = 3  # small things in a row: a word
DISC = 0.72  # of its box that a disc fills; a square fills more
EQUAL = 0.2  # of a swatch's size: others differ by less
LEAST_SWATCH = 6  # cells
HIGHEST = 0.3  # of a figure's height, of letters; and their width
TOO_MANY = 4000  # more is noise, and the table below would be large


def find_letters(boxes: Int[np.ndarray, "n 4"], figure_height: int) -> Bool[np.ndarray, " n"]:
    """Return which boxes (x, y, width, height) are letters of a word.

    Three or more of like height, on one level, nearer to each other than one and a half of their
    height, and well below a figure's height.
    """
    result = np.zeros(len(boxes), dtype=bool)
    able = np.flatnonzero(boxes[:, 2:].max(axis=1, initial=0) <= HIGHEST * figure_height)
    if len(able) < LETTERS or len(able) > TOO_MANY:
        return result
    groups = _groups(boxes[able])
    result[able] = np.bincount(groups)[groups] >= LETTERS
    return result


def find_swatches(
    boxes: Int[np.ndarray, "n 4"], areas: Int[np.ndarray, " n"]
) -> Bool[np.ndarray, " n"]:
    """Return which patches are swatches: three or more equal squares or discs in a line."""
    fill = areas / np.maximum(boxes[:, 2] * boxes[:, 3], 1)
    able = np.flatnonzero(
        (fill >= DISC) & (boxes[:, 2:].min(axis=1, initial=10**9) >= LEAST_SWATCH)
    )
    result = np.zeros(len(boxes), dtype=bool)
    if len(able) < LETTERS or len(able) > TOO_MANY:
        return result
    middle = boxes[able, :2] + boxes[able, 2:] / 2
    size = boxes[able, 2:].astype(float)
    equal = (np.abs(size[:, None] - size) <= EQUAL * np.maximum(size[:, None], size)).all(axis=2)
    apart = np.abs(middle[:, None] - middle)
    near = np.zeros_like(equal)
    for along, across in ((0, 1), (1, 0)):
        level = apart[..., across] <= EQUAL * size[:, across]
        near |= level & (apart[..., along] <= 2 * size[:, along])
    groups = connected(near & equal & equal.T)
    result[able] = np.bincount(groups)[groups] >= LETTERS
    return result


def words(letters: Int[np.ndarray, "n 4"]) -> Int[np.ndarray, "words 4"]:
    """Return the boxes round the words that letters form."""
    if not len(letters) or len(letters) > TOO_MANY:
        return letters
    groups = _groups(letters)
    boxes = []
    for group in range(int(groups.max()) + 1):
        own = letters[groups == group]
        low, high = own[:, :2].min(axis=0), (own[:, :2] + own[:, 2:]).max(axis=0)
        boxes.append([*low, *(high - low)])
    return np.array(boxes)


def _groups(boxes: Int[np.ndarray, "n 4"]) -> Int[np.ndarray, " n"]:
    """Return for every box the number of its group: boxes of like height on one level."""
    x, y, width, height = (boxes[:, i, None].astype(float) for i in range(4))
    taller = np.maximum(height, height.T)
    gap = np.maximum(x, x.T) - np.minimum(x + width, (x + width).T)
    level = np.abs((y + height / 2) - (y + height / 2).T) <= 0.6 * taller
    alike = taller <= 2.5 * np.minimum(height, height.T)
    return connected(level & alike & (gap <= 1.5 * taller))


def connected(near: Bool[np.ndarray, "n n"]) -> Int[np.ndarray, " n"]:
    """Return the number of every node's connected component (SciPy's is slower to import)."""
    groups, number = np.full(len(near), -1), 0
    while (rest := groups < 0).any():
        front = np.arange(len(near)) == rest.argmax()
        while front.any():
            groups[front] = number
            front = near[front].any(axis=0) & (groups < 0)
        number += 1
    return groups
