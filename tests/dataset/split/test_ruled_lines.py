"""Laws of ruled lines: height lines go on behind figures, hems are no lines."""

from __future__ import annotations

import numpy as np

from toonset.dataset.split.ruled_lines import find_lines


def sheet(levels: tuple[int, ...]) -> np.ndarray:
    """Return the paint of three figures in shirts of the paper's colour, before lines."""
    paint = np.zeros((240, 400), dtype=bool)
    for left in (40, 160, 280):
        paint[30:210, left : left + 80] = True
        paint[90:130, left + 18 : left + 62] = False  # the shirt
    for level in levels:
        row = paint[level].copy()
        paint[level] = True
        if 90 <= level < 130:  # behind the shirts, too
            for left in (40, 160, 280):
                paint[level, left + 18 : left + 62] = row[left + 18 : left + 62]
    return paint


def test_a_height_line_behind_shirts_of_the_papers_colour_is_one_of_its_fellows() -> None:
    levels = (20, 60, 110, 150, 190)
    found = sorted(line.first for line in find_lines(sheet(levels)) if not line.vertical)
    assert found == list(levels)


def test_without_fellows_pieces_on_one_level_are_no_line() -> None:
    assert not [line for line in find_lines(sheet((110,))) if not line.vertical]
