"""Hands apart that touch the neighbour's: each goes with its own figure, or a person is told."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from toonset.dataset.split.figures.blobs import find_blobs, find_mains
from toonset.dataset.split.figures.grouping import group_blobs
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.split.touching.parts import part_shared

RED, SKIN = (200, 30, 40), (236, 188, 155)


def sheet_of(*middles: int, hands: int = 10) -> np.ndarray:
    """Return figures 180 high whose hands hang in the air, 50 to each side of their middles."""
    rgb = np.full((240, max(middles) + 90, 3), 255, np.uint8)
    for x in middles:
        cv2.circle(rgb, (x, 45), 22, SKIN, -1)
        cv2.rectangle(rgb, (x - 20, 60), (x + 20, 209), RED, -1)
        if hands:
            cv2.circle(rgb, (x - 50, 120), hands, SKIN, -1)
            cv2.circle(rgb, (x + 50, 120), hands, SKIN, -1)
    return rgb


def shared(rgb: np.ndarray) -> tuple[int, dict[int, int], int]:
    """Return the number of patches more than before, the bodies of halves, the number of cuts."""
    blobs = find_blobs((rgb != 255).any(axis=-1))
    mains = find_mains(blobs)
    grouping = group_blobs(blobs, mains, rgb)
    after, bodies, cuts = part_shared(blobs, mains, grouping)
    assert ((after.labels > 0) == (blobs.labels > 0)).all()
    assert after.areas.sum() == blobs.areas.sum()
    return len(after.areas) - len(blobs.areas), bodies, len(cuts)


@pytest.mark.parametrize("apart", [120, 112])
def test_hands_that_meet_go_with_their_figures(apart: int) -> None:
    rgb = sheet_of(90, 90 + apart, 400)
    more, bodies, cuts = shared(rgb)
    assert (more, cuts, len(set(bodies.values()))) == (1, 1, 2)
    sheet = split_picture(np.dstack([rgb, np.full(rgb.shape[:2], 255, np.uint8)]))
    assert [view.figure_box[2] for view in sheet.views] == pytest.approx([121] * 3, abs=6)
    assert "touching figures were cut apart (1)" in sheet.remarks
    assert sheet.warnings == ()  # each is nearer to its own body


def test_hands_that_keep_their_distance_are_not_cut_or_doubted() -> None:
    rgb = sheet_of(90, 250, 410)
    assert shared(rgb) == (0, {}, 0)
    assert split_picture(np.dstack([rgb, np.full(rgb.shape[:2], 255, np.uint8)])).warnings == ()


def test_a_hand_as_near_to_the_next_body_is_doubted() -> None:
    rgb = sheet_of(90, 185, 400)
    sheet = split_picture(np.dstack([rgb, np.full(rgb.shape[:2], 255, np.uint8)]))
    assert any("is it a part of" in line for line in sheet.warnings)


def test_a_thing_between_figures_that_have_no_such_parts_stays_whole() -> None:
    rgb = sheet_of(90, 210, 400, hands=0)
    for x in (140, 160):
        cv2.circle(rgb, (x, 120), 10, SKIN, -1)
    assert shared(rgb) == (0, {}, 0)


def test_a_bar_twice_as_large_as_a_hand_stays_whole() -> None:
    rgb = sheet_of(90, 400, 600)
    cv2.rectangle(rgb, (235, 110), (265, 128), SKIN, -1)  # no neck
    assert shared(rgb) == (0, {}, 0)


def test_letters_over_the_figures_stay_whole() -> None:
    rgb = sheet_of(90, 250, 410, hands=0)
    for x, word in ((120, "oo"), (200, "oo"), (330, "o0")):
        cv2.putText(rgb, word, (x, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.9, (20, 20, 60), 5)
    assert shared(rgb) == (0, {}, 0)
