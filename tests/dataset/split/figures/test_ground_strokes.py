"""Sketched ground under the feet is left out; toes, hems and tails of the figures are not."""

import cv2
import numpy as np
import pytest

from tests.dataset.split.test_shadows import fault
from toonset.dataset.split.sheet import Segmentation, split_picture
from toonset.errors import SheetError

INK, CLOTH, SKIN = (20, 20, 20, 255), (60, 90, 180, 255), (240, 200, 170, 255)
TALL, WIDE, VIEWS = 300, 200, 3


def page(under: str = "", feet: str = "shoes") -> np.ndarray:
    """Return three figures of 300 px that stand on row 320."""
    rng = np.random.default_rng(7)
    rgba = np.full((400, VIEWS * WIDE, 4), 255, np.uint8)
    for middle in range(WIDE // 2, VIEWS * WIDE, WIDE):
        if under == "wash":
            cv2.ellipse(rgba, (middle, 316), (80, 12), 0, 0, 360, (215, 205, 190, 255), -1)
        for _ in range(40 if under == "hatching" else 0):
            x, y = rng.uniform(-75, 60), rng.uniform(-8, 10)
            start = round(middle + x), round(314 + y)
            cv2.line(rgba, start, (start[0] + 16, start[1]), INK, 1)
        cv2.ellipse(rgba, (middle, 60), (36, 40), 0, 0, 360, SKIN, -1)
        cv2.ellipse(rgba, (middle, 60), (36, 40), 0, 0, 360, INK, 3)
        cv2.rectangle(rgba, (middle - 34, 100), (middle + 34, 220), CLOTH, -1)
        cv2.rectangle(rgba, (middle - 34, 100), (middle + 34, 220), INK, 3)
        for side in (-1, 1):
            x = middle + 18 * side
            cv2.rectangle(rgba, (x - 11, 220), (x + 11, 312), SKIN, -1)
            cv2.rectangle(rgba, (x - 11, 220), (x + 11, 312), INK, 3)
            if feet == "shoes":
                cv2.ellipse(rgba, (x + 4 * side, 308), (20, 12), 0, 0, 360, CLOTH, -1)
                cv2.ellipse(rgba, (x + 4 * side, 308), (20, 12), 0, 0, 360, INK, 3)
            else:  # a bird's toes
                for tip in (-24, 0, 24):
                    cv2.line(rgba, (x, 308), (x + tip, 320), INK, 4)
    return rgba


def painted(sheet: Segmentation) -> int:
    return sum(int(view.mask.sum()) for view in sheet.views)


@pytest.mark.parametrize("under", ["hatching", "wash"])
def test_ground_under_the_feet_is_left_out(under: str) -> None:
    bare, found = split_picture(page()), split_picture(page(under))
    assert len(found.views) == VIEWS
    assert abs(painted(found) / painted(bare) - 1) < 0.01
    assert "shadows on the ground were left out" in found.remarks


@pytest.mark.parametrize("feet", ["shoes", "toes"])
def test_feet_stay(feet: str) -> None:
    found = split_picture(page(feet=feet))
    assert "shadows on the ground were left out" not in found.remarks
    assert {view.figure_box[3] for view in found.views} <= {*range(300, 306)}


@pytest.mark.parametrize("seed", [1759524489, 1390503441, 579572382])
def test_a_wash_under_a_sheet_of_any_figures_is_left_out(seed: int) -> None:
    assert fault(seed, "ground strokes") == ""


@pytest.mark.parametrize("size", [2, 3, 4])
def test_specks_alone_are_refused_as_ever(size: int) -> None:
    rgba = np.full((300, 400, 4), 255, np.uint8)
    for x, y in ((100, 130), (230, 140), (160, 135)):
        rgba[y : y + size, x : x + size] = INK
    with pytest.raises(SheetError, match="no figure on the"):
        split_picture(rgba)


@pytest.mark.parametrize("what", ["fringe", "tail"])
def test_a_fringe_and_a_tail_on_the_ground_stay(what: str) -> None:
    rgba = page()
    for middle in range(WIDE // 2, VIEWS * WIDE, WIDE):
        if what == "fringe":
            cv2.rectangle(rgba, (middle - 60, 200), (middle + 60, 290), CLOTH, -1)
            for x in range(middle - 60, middle + 61, 6):
                cv2.line(rgba, (x, 290), (x, 318), CLOTH, 2)
        else:
            cv2.ellipse(rgba, (middle + 55, 308), (40, 10), 0, 0, 360, (225, 215, 205, 255), -1)
    found = split_picture(rgba)
    assert "shadows on the ground were left out" not in found.remarks
    painted_there = int((rgba[..., :3] < 250).any(axis=2).sum())
    assert painted(found) >= 0.98 * painted_there
