"""Frames drawn by hand, and pieces of them, are paper; figures of lines are not."""

import cv2
import numpy as np
import pytest

from tests.dataset.split.test_messy_sheets import opaque, paper, person
from toonset.dataset.split.sheet import Segmentation, split_picture

GREY = (90, 90, 90)


def wobbly(first: tuple[int, int], last: tuple[int, int], seed: int) -> np.ndarray:
    """Return a rectangle as a hand draws it, whole pixels."""
    (left, top), (right, bottom) = first, last
    corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom], [left, top]])
    at = np.linspace(0, 4, 81)[:-1]
    places = np.stack([np.interp(at, range(5), corners[:, axis]) for axis in (0, 1)], axis=1)
    return np.rint(places + np.random.default_rng(seed).normal(0, 2, places.shape)).astype(np.int32)


def three(width: int = 700, height: int = 300) -> np.ndarray:
    picture = paper(width, height)
    for x in (170, 350, 530):
        person(picture, x)
    return np.roll(picture, 60, axis=0)


def boxes(sheet: Segmentation) -> list[tuple[int, int, int, int]]:
    return [view.figure_box for view in sheet.views]


@pytest.mark.parametrize("seed", range(3))
def test_a_page_frame_drawn_by_hand_is_no_figure(seed: int) -> None:
    bare = split_picture(opaque(three()))
    picture = three()
    cv2.polylines(picture, [wobbly((30, 20), (670, 280), seed)], True, GREY, 2, cv2.LINE_AA)
    sheet = split_picture(opaque(picture))
    assert boxes(sheet) == boxes(bare)
    assert any(left.kind == "frame" for left in sheet.left_out)
    assert "ruled lines and frames were taken for paper (1)" in sheet.remarks
    assert sheet.warnings == ()


def test_pieces_of_a_frame_are_no_figures_beside_painted_ones() -> None:
    bare = split_picture(opaque(three()))
    picture = three()
    frame = wobbly((30, 20), (670, 280), 1)
    cv2.polylines(picture, [frame[:50]], False, GREY, 2, cv2.LINE_AA)
    cv2.polylines(picture, [frame[55:]], False, GREY, 2, cv2.LINE_AA)
    sheet = split_picture(opaque(picture))
    assert boxes(sheet) == boxes(bare)
    assert sheet.warnings == ()


def test_a_figure_of_lines_with_a_face_apart_is_no_frame() -> None:
    picture = paper(400, 300)
    cv2.polylines(picture, [wobbly((40, 60), (160, 240), 0)], True, GREY, 2)  # a television
    cv2.circle(picture, (75, 120), 12, GREY, 2)
    cv2.circle(picture, (125, 120), 12, GREY, 2)
    cv2.line(picture, (70, 190), (130, 190), GREY, 2)
    (view,) = split_picture(opaque(picture)).views
    assert view.figure_box[3] > 175
    width, height = view.figure_box[2:]
    assert view.mask.sum() > 0.9 * width * height


def test_outlines_in_pieces_are_not_lost_where_nothing_is_painted() -> None:
    picture = paper(700, 420)
    for x in (170, 350, 530):
        for side in (-1, 1):
            half = [(x, 60), (x + 45 * side, 90), (x + 30 * side, 200), (x + 40 * side, 370)]
            cv2.polylines(picture, [np.array([*half, (x + 6 * side, 372)])], False, GREY, 2)
    sheet = split_picture(opaque(picture))
    assert len(sheet.views) == 3
    assert not any(left.kind == "frame" for left in sheet.left_out)
