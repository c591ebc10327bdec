"""Laws of ruled lines: height lines go on behind figures, hems are no lines."""

from __future__ import annotations

import cv2
import numpy as np

from toonset.dataset.split.ruled_lines import find_lines
from toonset.dataset.split.sheet import split_picture


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


def test_crumbs_of_faint_guide_lines_join_no_figures() -> None:
    picture = np.full((500, 900, 3), 255, np.uint8)
    for x in (200, 450, 700):
        cv2.ellipse(picture, (x, 250), (60, 180), 0, 0, 360, (120, 120, 120), 2)
        cv2.ellipse(picture, (x, 250), (30, 60), 0, 0, 360, (120, 120, 120), 2)
    bare = split_picture(np.dstack([picture, np.full(picture.shape[:2], 255, np.uint8)]))
    rng = np.random.default_rng(0)
    for y in range(60, 450, 45):
        for x in rng.integers(20, 870, 40):  # what a scan leaves of a ruled line
            picture[y + rng.integers(2), x : x + rng.integers(2, 12)] = 200
    found = split_picture(np.dstack([picture, np.full(picture.shape[:2], 255, np.uint8)]))
    assert len(found.views) == 3
    for a, b in zip(found.views, bare.views, strict=True):
        assert np.abs(np.subtract(a.figure_box, b.figure_box)).max() <= 3
    assert sum(left.kind == "frame" for left in found.left_out) >= 8


def test_height_lines_that_end_together_are_ruled_though_they_are_short() -> None:
    picture = np.full((400, 1000, 3), 255, np.uint8)
    for x in (100, 220, 340):
        cv2.ellipse(picture, (x, 200), (45, 150), 0, 0, 360, (180, 60, 40), -1)
    bare = split_picture(np.dstack([picture, np.full(picture.shape[:2], 255, np.uint8)]))
    for y in range(45, 360, 62):
        picture[y, 30:430][(picture[y, 30:430] == 255).all(axis=1)] = 170
    found = split_picture(np.dstack([picture, np.full(picture.shape[:2], 255, np.uint8)]))
    assert [view.figure_box for view in found.views] == [view.figure_box for view in bare.views]
    assert "ruled lines and frames were taken for paper (6)" in found.remarks
