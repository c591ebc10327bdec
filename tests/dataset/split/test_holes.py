"""Gaps between the legs: paper shows there, whatever lies on the ground."""

import cv2
import numpy as np
import pytest

from tests.dataset.split.test_grounds import opaque
from toonset.dataset.split.sheet import split_picture

PAPER = (253, 246, 232)
RED, NAVY, INK = (196, 60, 44), (30, 50, 110), (12, 12, 16)
CREAM, TAN, SHADOW = (250, 239, 221), (176, 150, 122), (222, 206, 186)
TALL, WIDE = 420, 300


def standing(
    trousers: tuple[int, int, int],
    shadow: tuple[int, int, int] | None,
    line: int,
    ink: tuple[int, int, int] = INK,
) -> np.ndarray:
    """Return a figure with legs apart on grainy paper, and a shadow between its feet."""
    picture = np.full((TALL, WIDE, 3), PAPER, np.uint8)
    parts = [((60, 150), (240, 260), RED), ((70, 250), (108, 380), trousers)]
    parts += [((192, 250), (230, 380), trousers), ((65, 370), (112, 390), INK)]
    parts += [((188, 370), (235, 390), INK), ((110, 40), (190, 150), INK)]
    if shadow is not None:
        cv2.ellipse(picture, (150, 388), (105, 3), 0, 0, 360, shadow, -1)
    for first, last, _ in parts:
        cv2.rectangle(picture, first, last, ink, 2 * line)
    for first, last, color in parts:
        cv2.rectangle(picture, first, last, color, -1)
    grain = np.random.default_rng(0).normal(0, 3, picture.shape)
    return np.clip(picture + grain, 0, 255).astype(np.uint8)


def alpha_at(picture: np.ndarray, x: int, y: int) -> int:
    (view,) = split_picture(opaque(picture)).views
    return int(view.rgba[y - view.box[1], x - view.box[0], 3])


def test_a_shadow_on_the_ground_does_not_fill_the_gap_between_the_legs() -> None:
    picture = standing(NAVY, (120, 110, 100), line=3)
    assert alpha_at(picture, 150, 320) == 0
    assert alpha_at(picture, 88, 320) == 255


@pytest.mark.parametrize("shadow", [SHADOW, (150, 140, 128)])
def test_trousers_nearly_as_light_as_the_paper_stay_and_the_gap_between_them_opens(
    shadow: tuple[int, int, int],
) -> None:
    picture = standing(CREAM, shadow, line=1, ink=TAN)
    assert alpha_at(picture, 150, 320) == 0
    assert alpha_at(picture, 88, 320) == 255


def test_a_white_panel_of_a_skirt_is_no_gap_though_it_ends_on_the_ground() -> None:
    picture = standing(NAVY, None, line=3)
    cv2.rectangle(picture, (108, 380), (192, 390), INK, -1)  # its hem
    cv2.rectangle(picture, (111, 262), (189, 383), PAPER, -1)
    for y in range(280, 380, 20):  # folds
        cv2.line(picture, (112, y), (188, y + 8), (225, 218, 205), 2)
    assert alpha_at(picture, 150, 300) == 255


def test_a_speck_of_the_grain_in_a_gap_is_no_button() -> None:
    picture = standing(NAVY, (120, 110, 100), line=3)
    picture[310:312, 150:153] = (150, 145, 138)
    assert alpha_at(picture, 150, 330) == 0


def test_cuffs_nearly_as_light_as_the_paper_lie_behind_their_line_and_the_gap_opens() -> None:
    picture = standing(NAVY, None, line=3)
    for corner, end in (((108, 362), (192, 390)), ((108, 262), (192, 276))):  # cuffs, a hem
        cv2.rectangle(picture, corner, end, INK, 6)
        cv2.rectangle(picture, corner, end, tuple(c - 20 for c in PAPER), -1)
    assert alpha_at(picture, 150, 320) == 0


@pytest.mark.parametrize(("wide", "high", "alpha"), [(34, 24, 255), (20, 44, 0), (34, 36, 0)])
def test_a_white_label_that_lies_is_paint_and_a_gap_beside_an_arm_is_none(
    wide: int, high: int, alpha: int
) -> None:
    picture = standing(NAVY, None, line=3)
    cv2.rectangle(picture, (100, 180), (100 + wide, 180 + high), PAPER, -1)
    cv2.rectangle(picture, (100, 180), (100 + wide, 180 + high), INK, 3)
    assert alpha_at(picture, 100 + wide // 2, 180 + high // 2) == alpha


def on_paper(paper: tuple[int, int, int], patch: tuple[int, int, int]) -> np.ndarray:
    """Return a body with a thin arm round a patch on its right, and an eye with a pupil."""
    picture = np.full((TALL, WIDE, 3), paper, np.uint8)
    cv2.rectangle(picture, (90, 30), (180, 390), NAVY, -1)
    cv2.rectangle(picture, (176, 150), (240, 300), INK, 6)  # the arm, as thin as a line
    cv2.rectangle(picture, (183, 156), (234, 294), patch, -1)
    cv2.circle(picture, (135, 180), 16, patch, -1)
    cv2.circle(picture, (135, 180), 6, INK, -1)
    return picture


@pytest.mark.parametrize(
    ("paper", "off", "opens"),
    [((216, 216, 216), 0, True), ((216, 216, 216), 2, False), ((255, 255, 255), 0, False)],
)
def test_a_patch_of_exactly_the_tinted_papers_colour_is_a_hole_whatever_is_round_it(
    paper: tuple[int, int, int], off: int, opens: bool
) -> None:
    level = paper[0] - off
    picture = on_paper(paper, (level, level, level))
    assert alpha_at(picture, 210, 220) == (0 if opens else 255)
    assert alpha_at(picture, 135, 170) == 255  # the white of the eye


def test_a_ruled_line_across_a_gap_on_tinted_paper_goes_with_it() -> None:
    picture = on_paper((216, 216, 216), (216, 216, 216))
    for columns in (slice(0, 90), slice(183, 235), slice(244, WIDE)):
        picture[230:233, columns] = 130
    assert alpha_at(picture, 210, 231) == alpha_at(picture, 210, 220) == 0
