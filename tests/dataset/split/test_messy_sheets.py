"""Messy sheets are split right: each difficulty alone, and what must not be mistaken for one."""

import cv2
import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from lab.bench.messy.options import DIFFICULTIES
from lab.bench.messy.sheet import make_messy_sheet
from toonset.dataset.split import segment
from toonset.dataset.split.background import find_background
from toonset.dataset.split.sheet import PictureOptions, Segmentation, split_picture
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.errors import SheetError

WHITE, RED, BLUE, SKIN = (255, 255, 255), (200, 30, 40), (20, 60, 180), (236, 188, 155)
GREY, BLACK = (80, 80, 80), (10, 10, 10)
HARD = ("touching", "overlap", "glued study")  # not always right: see `python -m lab.bench split`


def paper(width: int, height: int) -> np.ndarray:
    return np.full((height, width, 3), 255, np.uint8)


def person(
    picture: np.ndarray, x: int, *, boots: tuple[int, int, int] = BLUE, arm: int = 34
) -> None:
    """Draw a person of 100 x 170 px whose middle is at x: head, shirt, arms, legs, boots."""
    cv2.rectangle(picture, (x - 18, 80), (x - 4, 160), BLUE, -1)
    cv2.rectangle(picture, (x + 4, 80), (x + 18, 160), BLUE, -1)
    cv2.rectangle(picture, (x - 22, 155), (x - 3, 174), boots, -1)
    cv2.rectangle(picture, (x + 3, 155), (x + 22, 174), boots, -1)
    cv2.rectangle(picture, (x - arm, 62), (x + arm, 74), SKIN, -1)
    cv2.rectangle(picture, (x - 22, 50), (x + 22, 110), RED, -1)
    cv2.circle(picture, (x, 30), 22, SKIN, -1)


def opaque(picture: np.ndarray) -> np.ndarray:
    return np.dstack([picture, np.full(picture.shape[:2], 255, np.uint8)])


def iou(a: tuple[int, ...], b: tuple[int, ...]) -> float:
    width = min(a[0] + a[2], b[0] + b[2]) - max(a[0], b[0])
    height = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
    shared = max(width, 0) * max(height, 0)
    return shared / (a[2] * a[3] + b[2] * b[3] - shared)


def figure_boxes(sheet: Segmentation) -> list[tuple[int, int, int, int]]:
    return [view.figure_box for view in sheet.views]


@pytest.mark.parametrize("difficulty", [name for name in DIFFICULTIES if name not in HARD])
def test_every_difficulty_alone(difficulty: str) -> None:
    messy = make_messy_sheet(3001, (difficulty,))
    sheet = split_picture(messy.rgba)
    assert len(sheet.views) == len(messy.boxes)
    for view, box in zip(sheet.views, messy.boxes, strict=True):
        assert iou(view.figure_box, box) > 0.93  # JPEG frays edges by a pixel or two


def test_a_gradient_is_told_with_its_evidence() -> None:
    picture = np.tile(np.linspace(120, 250, 600)[None, :, None], (200, 1, 3)).astype(np.uint8)
    for x in (100, 300, 500):
        person(picture, x)
    ground = find_background(opaque(picture))
    assert ground.kind == "gradient"
    assert "if it were plain" in ground.evidence
    assert len(split_picture(opaque(picture)).views) == 3


def test_hand_in_hand_is_cut_between_the_hands() -> None:
    picture = paper(420, 200)
    for x in (80, 170, 330):
        person(picture, x, arm=46)
    sheet = split_picture(opaque(picture))
    assert len(sheet.views) == 3
    assert abs(figure_boxes(sheet)[0][0] + figure_boxes(sheet)[0][2] - 125) <= 3
    assert sheet.warnings == ()  # both halves look like the third figure: no doubt
    assert "touching figures were cut apart (1)" in sheet.remarks
    by_hand = PictureOptions(boxes=((30, 0, 95, 200), (125, 0, 95, 200)))
    assert not any("cut apart" in said for said in split_picture(opaque(picture), by_hand).remarks)


def test_a_figure_with_wide_arms_stays_whole() -> None:
    picture = paper(300, 200)
    person(picture, 150, arm=90)
    sheet = split_picture(opaque(picture))
    assert len(sheet.views) == 1
    assert sheet.warnings == ()


def test_a_soft_shadow_is_left_out_and_grey_boots_are_not() -> None:
    light = np.ones((220, 620), np.float32)
    for x in (100, 300, 500):
        cv2.ellipse(light, (x, 174), (55, 14), 0, 0, 360, 0.5, -1)
    light = cv2.GaussianBlur(light, (0, 0), 5)
    picture = np.rint(255 * np.dstack([light] * 3)).astype(np.uint8)
    bare = paper(620, 220)
    for x in (100, 300, 500):
        person(picture, x, boots=GREY)
        person(bare, x, boots=GREY)
    shaded, clean = split_picture(opaque(picture)), split_picture(opaque(bare))
    assert "shadows on the ground were left out" in shaded.remarks
    assert clean.remarks == ()
    assert find_background(opaque(bare)).kind == "plain"
    for old, new in zip(figure_boxes(clean), figure_boxes(shaded), strict=True):
        assert iou(old, new) > 0.97


def test_swatches_studies_and_swords_have_names() -> None:
    picture = paper(760, 330)
    for x in (100, 250, 400):
        person(picture, x)
    for i, color in enumerate((RED, BLUE, SKIN, BLACK)):
        cv2.rectangle(picture, (60 + 30 * i, 270), (80 + 30 * i, 290), color, -1)
    cv2.circle(picture, (560, 90), 45, SKIN, -1)  # a head, larger
    cv2.circle(picture, (560, 100), 6, BLACK, -1)
    cv2.rectangle(picture, (690, 20), (700, 180), GREY, -1)  # a sword
    cv2.rectangle(picture, (675, 140), (715, 150), BLACK, -1)
    sheet = split_picture(opaque(picture))
    assert len(sheet.views) == 3
    kinds = sorted(left.kind for left in sheet.left_out)
    assert kinds == ["mark"] + ["swatch"] * 5  # a bare head is a disc of one colour


def test_boxes_by_hand_are_cut_in_their_order() -> None:
    picture = paper(420, 200)
    person(picture, 100)
    person(picture, 300)
    boxes = ((240, 2, 120, 190), (40, 2, 120, 190))
    sheet = split_picture(opaque(picture), PictureOptions(boxes=boxes))
    assert figure_boxes(sheet) == figure_boxes(split_picture(opaque(picture)))[::-1]
    assert sheet.left_out == ()
    with pytest.raises(SheetError, match=r"box 0 \(5, 5, 20, 20\) holds background only"):
        split_picture(opaque(picture), PictureOptions(boxes=((5, 5, 20, 20),)))
    with pytest.raises(SheetError, match="does not lie on the sheet"):
        split_picture(opaque(picture), PictureOptions(boxes=((300, 5, 200, 20),)))


def test_a_grid_has_one_view_per_cell_that_is_not_empty() -> None:
    picture = paper(400, 200)
    person(picture, 50)
    cv2.circle(picture, (250, 100), 9, RED, -1)  # much smaller: no figure without the grid
    sheet = split_picture(opaque(picture), PictureOptions(grid=(4, 1)))
    assert figure_boxes(sheet)[1] == (241, 91, 19, 19)
    assert len(split_picture(opaque(picture)).views) == 1
    with pytest.raises(SheetError, match="a grid of 500 x 1 cells on 400 x 200 px; use fewer"):
        split_picture(opaque(picture), PictureOptions(grid=(500, 1)))


def test_white_clothes_are_no_holes_and_gaps_behind_arms_are() -> None:
    picture = paper(200, 260)
    cv2.ellipse(picture, (100, 130), (70, 110), 0, 0, 360, BLACK, -1)
    cv2.ellipse(picture, (100, 130), (67, 107), 0, 0, 360, BLUE, -1)
    cv2.rectangle(picture, (44, 100), (60, 160), BLACK, -1)  # a gap, a limb's width from outside
    cv2.rectangle(picture, (47, 103), (57, 157), WHITE, -1)
    shirt = np.zeros(picture.shape[:2], np.uint8)
    cv2.ellipse(shirt, (100, 130), (67, 107), 0, 40, 140, 1, -1)  # white up to the outline
    picture[shirt > 0] = WHITE
    view = split_picture(opaque(picture)).views[0]
    x, y = view.box[:2]
    assert view.rgba[130 - y, 52 - x, 3] == 0
    assert view.rgba[215 - y, 100 - x, 3] == 255


def test_segmentation_in_cells_finds_the_same_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    picture = paper(1240, 400)
    for x in (100, 300, 500):
        person(picture, x)
    picture = cv2.resize(picture[:200, :620], (1240, 400), interpolation=cv2.INTER_NEAREST)
    whole = split_picture(opaque(picture))
    monkeypatch.setattr(segment, "LARGEST_SIDE", 400)  # cells of 4 px
    in_cells = split_picture(opaque(picture))
    assert figure_boxes(in_cells) == figure_boxes(whole)
    for a, b in zip(whole.views, in_cells.views, strict=True):
        assert np.count_nonzero(a.mask) == np.count_nonzero(b.mask)


def test_limbs_of_small_figures_are_no_ruled_lines() -> None:
    drawn = make_turnaround(random_body(11), SynthOptions(views=5, cell_px=120, outline_px=0), 11)
    sheet = split_picture(drawn.sheet)
    for found, true in zip(sheet.views, drawn.views, strict=True):
        assert abs(int(found.mask.sum()) - int(true.mask.sum())) <= 0.01 * true.mask.sum()
