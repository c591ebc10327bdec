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


def opaque(picture: np.ndarray) -> np.ndarray:
    return np.dstack([picture, np.full(picture.shape[:2], 255, np.uint8)])


def drawn(size_wh: tuple[int, int] = (1000, 400)) -> np.ndarray:
    """Return a page with three line drawings in the paper's colour."""
    picture = np.full((size_wh[1], size_wh[0], 3), 200, np.uint8)
    for x in (170, 500, 830):
        cv2.ellipse(picture, (x, 200), (120, 150), 0, 0, 360, (20, 20, 20), 5)
        cv2.line(picture, (x - 60, 150), (x + 60, 150), (20, 20, 20), 5)
    return picture


def assert_same_views(picture: np.ndarray, bare: np.ndarray, off_px: int = 3) -> None:
    found, wanted = split_picture(opaque(picture)), split_picture(opaque(bare))
    assert len(found.views) == len(wanted.views) == 3
    for a, b in zip(found.views, wanted.views, strict=True):
        assert np.abs(np.subtract(a.figure_box, b.figure_box)).max() <= off_px
        assert abs(int(a.mask.sum()) - int(b.mask.sum())) < 0.02 * b.mask.sum()


def test_levels_that_drift_and_that_figures_cut_short_are_height_lines() -> None:
    picture = drawn()
    lines = np.full_like(picture, 200)
    for number, y in enumerate(range(20, 400, 36)):
        for x in range(1000):
            drift = x // 500 * (number % 2)
            lines[y + drift : y + drift + 4, x] = 120
    inside = np.zeros(picture.shape[:2], np.uint8)
    for x in (170, 500, 830):
        cv2.ellipse(inside, (x, 200), (120, 150), 0, 0, 360, 1, -1)
    behind = np.where((inside > 0)[..., None], 200, lines).astype(np.uint8)
    assert_same_views(np.minimum(picture, behind), picture, off_px=6)  # soft edges beside figures


def test_a_floor_from_edge_to_edge_is_no_figure() -> None:
    picture = drawn()
    floor = picture.copy()
    floor[353:369] = (30, 60, 90)
    assert_same_views(floor, picture)


def test_a_frame_behind_figures_goes_on_wherever_there_is_paper() -> None:
    picture = np.full((400, 1000, 3), 230, np.uint8)
    for x in (170, 500, 830):
        cv2.ellipse(picture, (x, 200), (60, 170), 0, 0, 360, (60, 160, 90), -1)
    framed = picture.copy()
    cv2.rectangle(framed, (130, 80), (870, 330), (90, 40, 160), 3)
    assert_same_views(np.where(picture == 230, framed, picture), picture)


def test_a_line_like_several_others_is_one_though_little_paper_is_beside_it() -> None:
    paint = np.zeros((300, 400), dtype=bool)
    for level in (20, 60, 100, 220, 260):
        paint[level] = True
    paint[120:200, 22:378] = True
    paint[160] = True
    found = [line.first for line in find_lines(paint) if not line.vertical]
    assert 160 in found
