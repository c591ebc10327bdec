"""What is left out is doubted if it may be a view, and not if it is a head or a sword."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from lab.bench.messy.sheet import make_messy_sheet
from tests.dataset.split.test_grounds import opaque
from toonset.dataset.split.background import find_background
from toonset.dataset.split.figures.rows import LIKELIEST, Taken
from toonset.dataset.split.segment import find_layout, find_paint
from toonset.dataset.split.sheet import PictureOptions, split_picture
from toonset.dataset.split.view_warnings import uneven_views
from toonset.dataset.split.warnings import border_warnings
from toonset.view import View


def figure(height: int, shirt: tuple[int, int, int]) -> np.ndarray:
    """Return a block person on white, without paper around."""
    width = height * 2 // 5
    rgb = np.full((height, width, 3), 255, np.uint8)
    rgb[: height // 4, width // 4 : -width // 4] = (230, 190, 160)
    rgb[height // 4 : height * 3 // 5] = shirt
    rgb[height * 3 // 5 :, width // 5 : width * 2 // 5] = (60, 60, 120)
    rgb[height * 3 // 5 :, -width * 2 // 5 : -width // 5] = (60, 60, 120)
    return rgb


def sheet_of(*figures: np.ndarray) -> np.ndarray:
    rgba = np.full((340, 20 + sum(f.shape[1] + 60 for f in figures), 4), 255, np.uint8)
    x = 40
    for drawn in figures:
        height, width = drawn.shape[:2]
        rgba[320 - height : 320, x : x + width, :3] = drawn
        x += width + 60
    return rgba


@pytest.mark.parametrize(("height", "doubted"), [(165, True), (200, True), (165, False)])
def test_a_small_figure_is_doubted_in_the_others_colours_only(height: int, doubted: bool) -> None:
    views = [figure(280, (200, 40, 40)) for _ in range(4)]
    other = figure(height, (200, 40, 40))
    if not doubted:
        other[(other < 255).any(axis=2)] = (90, 200, 40)
    sheet = split_picture(sheet_of(*views, other))
    assert len(sheet.views) == 4
    assert all("left out: if it is a view" in line for line in sheet.warnings)
    assert bool(sheet.warnings) == doubted


@pytest.mark.parametrize("kind", ["heads", "props"])
def test_few_heads_and_swords_are_doubted(kind: str) -> None:
    doubted = [
        bool(split_picture(make_messy_sheet(s, (kind,)).rgba).warnings) for s in range(7300, 7306)
    ]
    assert sum(doubted) <= 1


def test_a_panel_with_text_beside_it_is_doubted_and_a_figure_alone_is_not() -> None:
    page = np.full((320, 240, 4), 255, np.uint8)
    page[24:304, 60:172, :3] = figure(280, (200, 40, 40))
    assert not split_picture(page).warnings
    panel = page.copy()
    cv2.ellipse(panel, (120, 165), (110, 148), 0, 0, 360, (170, 190, 200, 255), -1)
    cv2.putText(panel, "NAME", (4, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (0, 0, 0, 255))
    assert any("most of the sheet" in line for line in split_picture(panel).warnings)


def test_a_small_only_view_may_be_a_scrap_of_fainter_figures() -> None:
    paper = np.full((300, 400, 4), 255, np.uint8)
    paper[100:160, 180:204, :3] = figure(60, (40, 60, 120))
    said = split_picture(paper).warnings
    assert any("the only one, and small on its sheet" in line for line in said)
    assert split_picture(paper[80:180, 140:240].copy()).warnings == ()


def test_figures_that_come_with_their_panels_are_doubted() -> None:
    page = np.full((340, 500, 4), 255, np.uint8)
    for x in (40, 270):
        page[20:320, x : x + 180, :3] = (180, 200, 210)
        page[30:310, x + 5 : x + 175, :3] = (120, 40, 40)
        page[32:308, x + 5 : x + 175 : 2, :3] = (200, 160, 40)
    assert any("--matting" in line for line in split_picture(page).warnings)


def test_pieces_of_a_pencil_drawing_that_were_left_out_are_doubted() -> None:
    page = sheet_of(*[figure(280, (200, 40, 40)) for _ in range(3)], figure(280, (255, 255, 255)))
    x = page.shape[1] - 120
    page[30:330, x - 60 :, :3] = 255
    for k, y in enumerate(range(50, 310, 34)):  # a fourth one: broken strokes, slanting
        for side in (0, 50):
            start, stop = (x + side + 9 * (k % 3), y), (x + side + 9 * ((k + 1) % 3), y + 25)
            cv2.line(page, start, stop, (90, 90, 90, 255), 2)
    cv2.line(page, (x + 9, 60), (x + 50, 66), (90, 90, 90, 255), 2)
    sheet = split_picture(page)
    assert len(sheet.views) == 3
    assert any("strokes at" in line for line in sheet.warnings)


def with_arms(page: np.ndarray, x: int, thickness: int) -> np.ndarray:
    """Return a sheet on which the figure from x on has its arms spread, 30 px beyond its box."""
    result = page.copy()
    result[120 : 120 + thickness, x - 26 : x + 138, :3] = (200, 40, 40)
    return result


@pytest.mark.parametrize(("thickness", "doubted"), [(16, False), (90, True)])
def test_spread_arms_are_no_second_figure(thickness: int, doubted: bool) -> None:
    page = sheet_of(*[figure(280, (200, 40, 40)) for _ in range(4)])
    sheet = split_picture(with_arms(page, 40 + 172, thickness))
    assert len(sheet.views) == 4
    assert any("unusually wide" in line for line in sheet.warnings) == doubted


@pytest.mark.parametrize(("lift", "doubted"), [(0, False), (40, True)])
def test_a_view_off_its_row_is_doubted(lift: int, doubted: bool) -> None:
    page = sheet_of(*[figure(240, (200, 40, 40)) for _ in range(4)])
    last = page[:, -140:].copy()
    page[:, -140:] = 255
    page[: 340 - lift, -140:] = last[lift:]
    sheet = split_picture(page)
    assert len(sheet.views) == 4
    assert any("higher than the rest of its row" in line for line in sheet.warnings) == doubted


def test_a_sword_with_dust_beside_it_is_no_broken_drawing() -> None:
    page = sheet_of(*[figure(280, (200, 40, 40)) for _ in range(3)], figure(280, (255, 255, 255)))
    x = page.shape[1] - 120
    cv2.line(page, (x, 60), (x + 50, 300), (90, 90, 90, 255), 3)
    cv2.line(page, (x, 110), (x + 40, 100), (90, 90, 90, 255), 3)
    for y in range(150, 250, 20):
        page[y, x + (y - 60) * 50 // 240 + 5, :3] = 90
    assert not split_picture(page).warnings


def test_hands_apart_are_those_of_the_figure_with_one_on_each_side() -> None:
    page = np.full((340, 640, 4), 255, np.uint8)
    for x in (80, 300, 460):
        page[20:320, x : x + 112, :3] = np.pad(
            figure(280, (200, 40, 40)), ((20, 0), (0, 0), (0, 0)), constant_values=255
        )
    for x in (26, 232, 280, 418):  # the last one hides its own
        page[180:196, x : x + 14, :3] = (230, 190, 160)
    sheet = split_picture(page)
    assert len(sheet.views) == 3
    assert not sheet.warnings


@pytest.mark.parametrize(
    ("reaching", "sure", "doubted"), [(True, 0.84, False), (True, 0.75, True), (False, 0.84, True)]
)
def test_figures_over_the_edge_explain_a_little_of_the_border(
    reaching: bool, sure: float, doubted: bool
) -> None:
    page = sheet_of(*[figure(280, (200, 40, 40)) for _ in range(3)])
    if reaching:
        page = page[:300]
    paint, ground = find_paint(page, find_background(page))
    found = find_layout(page, paint, ground, (), LIKELIEST)
    assert bool(border_warnings(replace(ground, sure=sure), found)) == doubted


def test_two_views_of_which_one_is_much_lower_are_doubted() -> None:
    for height, doubted in ((225, True), (270, False)):
        page = sheet_of(figure(280, (200, 40, 40)), figure(height, (200, 40, 40)))
        sheet = split_picture(page)
        assert len(sheet.views) == 2
        assert any("as high as" in line for line in sheet.warnings) is doubted


def test_one_of_several_views_that_is_much_lower_is_doubted_but_not_rows_of_all_heights() -> None:
    heights = {(280, 278, 225): True, (280, 278, 262): False, (300, 220, 170): False}
    for tall, doubted in heights.items():
        drawn = [opaque(figure(height, (200, 40, 40))) for height in tall]
        boxes = [(0, 0, one.shape[1], one.shape[0]) for one in drawn]
        views = [View(one, box, 0.0, "") for one, box in zip(drawn, boxes, strict=True)]
        assert any("as high as the others" in line for line in uneven_views(views)) is doubted


def test_figures_that_overlap_all_over_the_sheet_are_doubted_and_a_wide_figure_is_not() -> None:
    page = np.full((320, 300, 4), 255, np.uint8)
    page[24:304, 20:132, :3] = figure(280, (200, 40, 40))
    one = page.copy()
    for x in (94, 168):
        drawn = figure(280, (200, 40, 40))
        page[24:304, x : x + 112, :3] = np.minimum(page[24:304, x : x + 112, :3], drawn)
    cv2.rectangle(page, (60, 120), (240, 150), (90, 60, 200, 255), -1)
    cv2.rectangle(one, (10, 120), (260, 140), (200, 40, 40, 255), -1)
    animal = np.full((320, 300, 4), 255, np.uint8)
    for first, last in (((20, 120), (280, 200)), ((20, 30), (110, 200))):  # trunk, and head
        cv2.rectangle(animal, first, last, (150, 100, 60, 255), -1)
    for leg in (24, 80, 190, 250):
        cv2.rectangle(animal, (leg, 200), (leg + 24, 300), (150, 100, 60, 255), -1)
    for picture, doubted in ((page, True), (one, False), (animal, False)):
        sheet = split_picture(picture)
        assert len(sheet.views) == 1
        assert any("has two tops" in line for line in sheet.warnings) is doubted


def test_small_whole_figures_beside_a_single_large_one_may_be_the_turnaround() -> None:
    small = [cv2.resize(figure(280, (200, 40, 40)), (44, 110)) for _ in range(2)]
    sheet = split_picture(sheet_of(figure(290, (200, 40, 40)), *small))
    assert len(sheet.views) == 1
    assert any("2 drawings from" in line and "--group 2" in line for line in sheet.warnings)


@pytest.mark.parametrize(("shift", "doubted"), [(70, True), (140, False)])
def test_views_whose_boxes_lie_in_each_other_are_doubted(shift: int, doubted: bool) -> None:
    page = np.full((420, 700, 4), 255, np.uint8)
    for x, y in ((200, 40), (200 + shift, 40)):
        corners = np.array([(x, y), (x + 40, y), (x + 160, 380), (x + 120, 380)])
        cv2.fillPoly(page, [corners], (200, 60, 40, 255))
    found = split_picture(page)
    assert len(found.views) == 2
    assert any("lie in each other" in line for line in found.warnings) is doubted


def page_with_hands(hands: list[tuple[int, int]]) -> np.ndarray:
    """Return three figures 300 px from each other with hands apart, at so many px to each side."""
    page = np.full((340, 1100, 4), 255, np.uint8)
    for number, (left, right) in enumerate(hands):
        x = 200 + 300 * number
        page[40:320, x : x + 112, :3] = figure(280, (200, 40, 40))
        for middle in (x - left, x + 111 + right):
            cv2.circle(page, (middle, 180), 8, (230, 190, 160, 255), -1)
    return page


def test_a_hand_that_lies_over_another_view_is_missed() -> None:
    assert not split_picture(page_with_hands([(18, 18), (18, 18), (18, 18)])).warnings
    page = page_with_hands([(40, 40), (40, 40), (40, 40)])
    page[:, 330:470] = 255  # the second figure stands so near that the first one's hand is on it
    page[40:320, 340:452, :3] = figure(280, (200, 40, 40))
    for middle in (352, 412):
        cv2.circle(page, (middle, 180), 8, (230, 190, 160, 255), -1)
    told = split_picture(page).warnings
    assert any("000.png has one part" in line and "over view 001.png" in line for line in told)


def test_hands_of_two_views_that_touch_each_other_are_missed() -> None:
    messy = make_messy_sheet(2279183638, ("floating",))
    told = split_picture(messy.rgba).warnings
    assert sum("is like parts of the views" in line for line in told) == 2


def test_two_figures_in_one_view_have_two_heads_and_ears_are_none() -> None:
    page = np.full((400, 400, 4), 255, np.uint8)
    for x in (100, 240):  # they touch along their arms and their feet
        cv2.circle(page, (x, 80), 55, (230, 190, 160, 255), -1)
        page[120:350, x - 40 : x + 40] = (200, 40, 40, 255)
        page[150:330, x - 70 : x + 71] = (200, 40, 40, 255)
    told = split_picture(page, PictureOptions(without=("touching figures",))).warnings
    assert any("two heads" in line for line in told)
    rabbit = np.full((400, 400, 4), 255, np.uint8)
    for x in (150, 240):
        cv2.ellipse(rabbit, (x, 90), (30, 70), 0, 0, 360, (230, 190, 160, 255), -1)
    rabbit[140:370, 105:285] = (200, 40, 40, 255)
    assert not any("two heads" in line for line in split_picture(rabbit).warnings)


@pytest.mark.parametrize("shoes", [False, True])
def test_a_view_that_keeps_its_shadow_is_doubted_and_grey_shoes_are_not(shoes: bool) -> None:
    page = sheet_of(*[figure(280, (200, 40, 40)) for _ in range(4)])
    for number in range(4):
        x = 40 + number * (112 + 60)
        if shoes:
            for foot in (x + 22, x + 66):
                page[312 : 328 if number == 1 else 320, foot : foot + 24, :3] = (150, 150, 150)
        elif number == 1:
            cv2.ellipse(page, (x + 56, 320), (40, 7), 0, 0, 360, (205, 205, 205, 255), -1)
    told = [line for line in split_picture(page).warnings if "include its shadow" in line]
    assert [line.split()[1] for line in told] == ([] if shoes else ["001.png"])


def test_a_row_that_is_higher_than_the_views_is_doubted() -> None:
    told = split_picture(make_messy_sheet(3640289164).rgba).warnings  # heads were taken for views
    assert sum("of 162 % of the views' height was left out" in line for line in told) == 2


@pytest.mark.parametrize("seed", [5001, 5003])
def test_rows_that_a_person_did_not_choose_are_no_views_left_out(seed: int) -> None:
    messy = make_messy_sheet(seed, ("outfits",))
    whole = split_picture(messy.rgba)
    assert whole.groups[0].outfits
    row = split_picture(messy.rgba, PictureOptions(taken=Taken(0, 1)))
    assert not any("was left out" in line for line in row.warnings)


def test_a_strip_of_colours_in_the_reach_of_a_tail_is_no_part() -> None:
    page = sheet_of(figure(280, (200, 40, 40)), figure(280, (200, 40, 40)))
    page = np.concatenate([np.full((len(page), 150, 4), 255, np.uint8), page], axis=1)
    page[300:320, 40:240, :3] = (200, 40, 40)  # a tail
    page[80:270, 150:178, :3] = (90, 200, 40)
    sheet = split_picture(page)
    assert len(sheet.views) == 2
    x, y, width, height = 150, 80, 28, 190
    left, top, _, _ = sheet.views[0].box
    assert not sheet.views[0].mask[y - top : y - top + height, x - left : x - left + width].any()
