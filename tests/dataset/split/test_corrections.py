"""Corrections of a sheet's first look: each can be left out, and is missed where it is needed."""

import cv2
import numpy as np
import pytest

from lab.bench.messy.sheet import make_messy_sheet
from toonset.dataset.split.corrections import CORRECTIONS
from toonset.dataset.split.sheet import PictureOptions, split_picture
from toonset.errors import SheetError


@pytest.mark.parametrize(
    ("difficulty", "seed", "correction"),
    [
        ("shadows", 0, "shadows"),
        ("ground strokes", 1390503441, "shadows"),
        ("touching", 0, "touching figures"),
        ("hand frame", 4, "frames"),
    ],
)
def test_a_sheet_that_needs_a_correction_misses_it(
    difficulty: str, seed: int, correction: str
) -> None:
    sheet = make_messy_sheet(seed, [difficulty])
    boxes = [view.box for view in split_picture(sheet.rgba).views]
    without = split_picture(sheet.rgba, PictureOptions(without=(correction,)))
    assert len(boxes) == len(sheet.boxes)
    assert [view.box for view in without.views] != boxes


def test_a_plain_sheet_needs_none() -> None:
    rgba = make_messy_sheet(0, ["plain"]).rgba
    bare = split_picture(rgba, PictureOptions(without=tuple(CORRECTIONS)))
    assert [view.box for view in bare.views] == [view.box for view in split_picture(rgba).views]


def test_a_correction_that_is_none_is_refused() -> None:
    rgba = make_messy_sheet(0, ["plain"]).rgba
    with pytest.raises(
        SheetError, match="no correction 'shade'; choose from frames, open outlines, shadows"
    ):
        split_picture(rgba, PictureOptions(without=("shade",)))


@pytest.mark.parametrize(("posed", "count", "views"), [(False, 4, 4), (True, 4, 3), (True, 3, 3)])
def test_a_painted_drawing_in_another_pose_beside_a_turnaround_in_lines_is_no_view(
    posed: bool, count: int, views: int
) -> None:
    page = np.full((400, 150 + 250 * count, 4), 255, np.uint8)
    for number in range(count):
        x = 120 + 250 * number
        paint = (40, 110, 200, 255) if number == 0 else (255, 255, 255, 255)
        tilt = 40 if posed and number == 0 else 0
        axes = (60, 150) if not tilt else (90, 170)
        cv2.ellipse(page, (x, 200), axes, tilt, 0, 360, paint, -1)
        cv2.ellipse(page, (x, 200), axes, tilt, 0, 360, (10, 10, 10, 255), 4)
    assert len(split_picture(page).views) == views
