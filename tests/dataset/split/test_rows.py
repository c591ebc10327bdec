"""Rows of equal figures: the turnaround of a page among poses, busts and other clothes."""

import cv2
import numpy as np
import pytest

from lab.bench.messy.sheet import MessySheet, make_messy_sheet
from tests.dataset.split.test_messy_sheets import iou
from toonset.dataset.split.figures.blobs import find_blobs
from toonset.dataset.split.figures.rows import Taken, find_groups
from toonset.dataset.split.sheet import PictureOptions, Segmentation, split_picture
from toonset.errors import SheetError

SEEDS = range(3)


def assert_right(sheet: Segmentation, messy: MessySheet) -> None:
    assert len(sheet.views) == len(messy.boxes)
    for view, box in zip(sheet.views, messy.boxes, strict=True):
        assert iou(view.figure_box, box) > 0.93


@pytest.mark.parametrize("difficulty", ["poses", "busts", "outfits"])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_turnaround_is_taken_whatever_stands_beside_it(difficulty: str, seed: int) -> None:
    messy = make_messy_sheet(4100 + seed, (difficulty,))
    assert_right(split_picture(messy.rgba), messy)


def test_poses_are_listed_and_can_be_taken() -> None:
    messy = make_messy_sheet(4100, ("poses",))
    first = split_picture(messy.rgba)
    assert [group.taken for group in first.groups] == [True, False]
    assert first.groups[0].likely == 1 > first.groups[1].likely
    second = split_picture(messy.rgba, PictureOptions(taken=Taken(group=1)))
    poses = [box for row in first.groups[1].rows for box in row]
    assert len(second.views) == len(poses)
    assert second.groups[1].taken


def test_another_group_is_announced_only_where_it_is_nearly_as_likely() -> None:
    for seed, said in ((4100, True), (4101, False)):
        sheet = split_picture(make_messy_sheet(seed, ("poses",)).rgba)
        assert (sheet.groups[1].likely >= 0.6) is said
        assert any("--group 2" in warning for warning in sheet.warnings) is said


def test_a_group_that_is_not_there_is_refused() -> None:
    messy = make_messy_sheet(4100, ("plain",))
    with pytest.raises(SheetError, match="no such group: the sheet has 1"):
        split_picture(messy.rgba, PictureOptions(taken=Taken(group=1)))
    with pytest.raises(SheetError, match="no such outfit: the group has one row"):
        split_picture(messy.rgba, PictureOptions(taken=Taken(outfit=1)))


def test_rows_in_other_clothes_are_outfits_and_a_row_can_be_taken() -> None:
    messy = make_messy_sheet(4102, ("outfits",))
    whole = split_picture(messy.rgba)
    assert whole.groups[0].outfits
    assert any("--outfit" in remark for remark in whole.remarks)
    rows = whole.groups[0].rows
    second = split_picture(messy.rgba, PictureOptions(taken=Taken(outfit=1)))
    assert [view.figure_box for view in second.views] == list(rows[1])


def test_a_turnaround_of_two_rows_is_not_two_outfits() -> None:
    for seed in SEEDS:
        sheet = split_picture(make_messy_sheet(4200 + seed, ("rows",)).rgba)
        assert not sheet.groups[0].outfits


@pytest.mark.parametrize("seed", [4301, 3271289844])  # the second at a side view
def test_a_study_that_touches_a_figure_is_cut_off(seed: int) -> None:
    messy = make_messy_sheet(seed, ("glued study",))
    assert_right(split_picture(messy.rgba), messy)


def test_a_study_that_may_touch_a_figure_is_told() -> None:
    sheet = split_picture(make_messy_sheet(1893722509, ("glued study",)).rgba)
    assert ["a study may touch" in line for line in sheet.warnings] == [True]
    assert not any("cut apart" in remark for remark in sheet.remarks)


def figures(*tops: int) -> np.ndarray:
    """Return four figures 100 high on one ground line, and squares with these upper edges."""
    drawn = np.zeros((300, 500), dtype=bool)
    for x in (40, 140, 240, 340):
        drawn[100:200, x : x + 20] = True
        drawn[120:130, x - 15 : x + 35] = True
    for top in tops:
        drawn[top : top + 25, 362:387] = True
    return drawn


def test_a_part_beside_the_head_belongs_to_the_figure_and_one_above_the_row_does_not() -> None:
    for top, belongs in ((95, True), (60, False)):
        picture = np.where(figures(top)[..., None], (200, 30, 40), (255, 255, 255)).astype(np.uint8)
        picture[110:115, 345:355] = (20, 20, 60)
        rgba = np.dstack([picture, np.full(picture.shape[:2], 255, np.uint8)])
        widths = [view.figure_box[2] for view in split_picture(rgba).views]
        assert (widths[3] > widths[0]) is belongs


def test_an_empty_sheet_has_no_group() -> None:
    assert find_groups(find_blobs(np.zeros((20, 20), dtype=bool))) == ()


def painted(mask: np.ndarray) -> np.ndarray:
    picture = np.where(mask[..., None], (200, 30, 40), (255, 255, 255)).astype(np.uint8)
    return np.dstack([picture, np.full(mask.shape, 255, np.uint8)])


def test_what_neither_stands_in_a_row_nor_looks_like_it_is_another_drawing() -> None:
    mask = np.pad(figures(), ((0, 0), (0, 200))).astype(np.uint8)
    bare = split_picture(painted(mask > 0)).views
    cv2.ellipse(mask, (560, 130), (70, 30), 25, 0, 360, 1, -1)
    cv2.ellipse(mask, (560, 130), (25, 50), 25, 0, 360, 1, -1)
    found = split_picture(painted(mask > 0))
    assert [view.box for view in found.views] == [view.box for view in bare]
    assert found.warnings == ()


@pytest.mark.parametrize(("height", "is_part"), [(16, True), (40, False)])
def test_what_stands_beside_a_figure_and_is_larger_than_a_hand_is_no_part(
    height: int, is_part: bool
) -> None:
    mask = figures().astype(np.uint8)
    cv2.ellipse(mask, (281 + height // 4, 125), (height // 4, height // 2), 0, 0, 360, 1, -1)
    found = split_picture(painted(mask > 0))
    widths = [view.figure_box[2] for view in found.views]
    assert (widths[2] > widths[0] + 2) is is_part
    assert any("apart from view 002.png" in line for line in found.warnings) is is_part


def test_a_line_drawn_round_the_page_is_no_figure_and_makes_none_small() -> None:
    page = np.full((600, 600, 4), 255, np.uint8)
    rng = np.random.default_rng(4)
    for x0, y0, x1, y1 in ((20, 20, 20, 580), (20, 580, 580, 580), (580, 590, 580, 20)):
        ends = np.linspace((x0, y0), (x1, y1), 12) + rng.normal(0, 2, (12, 2))
        cv2.polylines(page, [np.rint(ends).astype(np.int32)], False, (0, 0, 0, 255), 3)
    for x in (200, 260, 320):
        cv2.ellipse(page, (x, 400), (22, 60), 0, 0, 360, (200, 60, 40, 255), -1)
        cv2.ellipse(page, (x, 400), (22, 60), 0, 0, 360, (0, 0, 0, 255), 2)
    assert len(split_picture(page).views) == 3
