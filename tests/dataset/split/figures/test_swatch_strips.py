"""Swatches that touch come apart; staffs and belts, however straight, do not."""

import numpy as np
import pytest

from bench.messy.sheet import make_messy_sheet
from toonset.dataset.split.figures.blobs import find_blobs
from toonset.dataset.split.figures.swatch_strips import strip_seams
from toonset.dataset.split.sheet import split_picture

COLORS = [(200, 30, 40), (20, 60, 180), (236, 188, 155), (30, 120, 60)]


def strip(colors: list[tuple[int, int, int]], side: int = 20) -> np.ndarray:
    picture = np.full((side * len(colors) + 20, side + 20, 3), 255, np.uint8)
    for i, color in enumerate(colors):
        picture[10 + side * i : 10 + side * (i + 1), 10 : 10 + side] = color
    return picture


def pieces(picture: np.ndarray) -> int:
    painted = np.asarray((picture < 255).any(axis=2))
    seams = strip_seams(find_blobs(painted), picture)
    return len(find_blobs(painted & ~seams).areas)


@pytest.mark.parametrize("count", [3, 4])
@pytest.mark.parametrize("turned", [False, True])
def test_a_strip_comes_apart_into_its_cells(count: int, turned: bool) -> None:
    picture = strip(COLORS[:count])
    assert pieces(np.ascontiguousarray(picture.swapaxes(0, 1)) if turned else picture) == count


@pytest.mark.parametrize(
    "colors",
    [COLORS[:1] * 4, COLORS[:2], [*COLORS[:2], COLORS[1], COLORS[1]]],
    ids=["one colour", "two cells", "most neighbours alike"],
)
def test_other_rectangles_stay_whole(colors: list[tuple[int, int, int]]) -> None:
    assert pieces(strip(colors)) == 1


def test_a_rectangle_of_no_whole_number_of_cells_stays() -> None:
    assert pieces(np.delete(strip(COLORS), slice(12, 22), axis=0)) == 1


@pytest.mark.parametrize("seed", [5001, 5015])
def test_a_column_of_discs_beside_a_figure_is_no_part_of_it(seed: int) -> None:
    sheet = make_messy_sheet(seed, ("swatches",))
    found = split_picture(sheet.rgba)
    assert len(found.views) == len(sheet.boxes)
    assert [left.kind for left in found.left_out].count("swatch") >= 5
    for view, (_, _, width, _) in zip(found.views, sheet.boxes, strict=True):
        assert abs(view.figure_box[2] - width) <= 2
