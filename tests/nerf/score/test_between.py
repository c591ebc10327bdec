"""What eyes count on a picture: turns of outlines, small patches, features of the drawings."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from toonset.nerf.score.outline_turning import border_turning, outline_turning
from toonset.nerf.score.patches import (
    Patches,
    eye_like,
    features,
    fragments,
    matched,
    patches_of,
    plain_colors,
)

SIDE = 240  # of pictures, whose figure is 200 px tall
TALL = 200.0
SKIN, EYE, INK = (230, 190, 160), (60, 90, 200), (10, 10, 10)
PAINTS = np.array([SKIN, EYE, INK], np.uint8)


def disc(radius: float, wave: float = 0.0, at: float = 120.0, side: int = SIDE) -> np.ndarray:
    """Return coverage of a disc whose rim is wavy by a share of its radius."""
    y, x = np.mgrid[:side, :side] + 0.5 - at
    rim = radius * (1 + wave * np.sin(24 * np.arctan2(y, x)))
    return (rim - np.hypot(x, y) + 0.5).clip(0, 1)


def figure(*spots: tuple[int, int, int, tuple[int, int, int]]) -> np.ndarray:
    """Return a round figure of 200 px with discs of paint on it: column, row, radius, colour."""
    picture = np.zeros((SIDE, SIDE, 4), np.uint8)
    picture[disc(100) > 0.5] = (*SKIN, 255)
    for x, y, radius, color in spots:
        cv2.circle(picture, (x, y), radius, (*color, 255), -1)
    return picture


EYES = ((95, 90, 8, EYE), (145, 90, 8, EYE))


def small(*spots: tuple[int, int, int, tuple[int, int, int]]) -> Patches:
    return patches_of(figure(*spots), PAINTS, TALL)


@pytest.mark.parametrize("size", [1, 2, 4])
def test_an_outline_turns_once_at_any_size_and_more_where_it_is_ragged(size: int) -> None:
    smooth = disc(100 * size, at=120 * size, side=SIDE * size)
    ragged = disc(100 * size, 0.04, at=120 * size, side=SIDE * size)
    assert outline_turning(smooth, TALL * size) == pytest.approx(1, abs=0.1)
    assert outline_turning(ragged, TALL * size) == pytest.approx(11.6, rel=0.03)


def test_crumbs_and_holes_are_a_turn_more_each() -> None:
    whole = disc(80)
    crumb = np.maximum(whole, disc(5, at=25.0))
    holed = whole * (1 - disc(8))
    for picture in (crumb, holed):
        assert outline_turning(picture, TALL) == pytest.approx(2, abs=0.15)
    assert outline_turning(np.zeros((9, 9)), TALL) == 0


def test_borders_of_paint_count_from_both_sides() -> None:
    plain, eyed = (border_turning(one, PAINTS, TALL) for one in (figure(), figure(*EYES)))
    assert plain == pytest.approx(1.3, abs=0.1)
    assert eyed == pytest.approx(plain + 4, abs=0.3)  # two discs, and the holes they leave


def test_what_a_drawing_beside_the_view_shows_is_no_fragment() -> None:
    drawing, moved = small(*EYES), small((90, 92, 8, EYE), (140, 92, 8, EYE))
    assert len(drawing) == 2
    assert fragments(moved, [drawing, drawing]) == 0
    crumbs = small(*EYES, (120, 150, 4, INK), (80, 150, 4, INK))
    assert fragments(crumbs, [drawing, small()]) == 2
    two, three = ((95, 90, 5, EYE), (145, 90, 5, EYE)), (120, 90, 5, EYE)
    assert fragments(small(*two, three), [small(*two)]) == 1  # an eye too many
    assert fragments(small(), [drawing]) == 0


def test_features_are_what_both_drawings_show_and_torn_ones_are_missed() -> None:
    front, side = small(*EYES), small((150, 91, 7, EYE))
    assert len(features(front, front)) == 2
    assert len(features(front, side)) == 1
    torn = small((95, 88, 2, EYE), (95, 94, 2, EYE), (145, 90, 8, EYE))
    assert matched(features(front, front), torn) == 1
    assert len(eye_like(small((120, 200, 8, EYE)))) == 0  # at the feet


def test_colours_that_cover_little_are_told_apart_if_they_stand_out() -> None:
    found = plain_colors([figure(*EYES, (120, 150, 4, INK))])
    assert sorted(map(tuple, found.tolist())) == sorted(map(tuple, PAINTS.tolist()))
    speck = figure()
    speck[120, 120, :3] = EYE
    assert plain_colors([speck]).tolist() == [list(SKIN)]


def test_an_empty_picture_has_no_patches() -> None:
    empty = patches_of(np.zeros((9, 9, 4), np.uint8), PAINTS, TALL)
    assert len(empty) == 0
    assert fragments(empty, [empty]) == matched(empty, small(*EYES)) == 0
