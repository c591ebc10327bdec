"""Sheets without paints: line art, and figures in one colour."""

import cv2
import numpy as np
import pytest

from tests.palette.pictures import block
from toonset.palette.extract import extract_palette

LINES = "lines only; no palette to find"


def line_art(
    paper: tuple[int, int, int], *, fill: tuple[int, int, int] | None = None
) -> np.ndarray:
    rgba = np.zeros((240, 160, 4), dtype=np.uint8)
    cv2.ellipse(rgba, (80, 120), (60, 100), 0, 0, 360, (*paper, 255), -1)
    if fill is not None:
        cv2.rectangle(rgba, (50, 100), (110, 160), (*fill, 255), -1)
    for box in ((60, 100), (30, 50), (12, 20)):
        cv2.ellipse(rgba, (80, 120), box, 0, 0, 360, (0, 0, 0, 255), 4)
    return rgba


@pytest.mark.parametrize("paper", [(255, 255, 255), (250, 244, 226)])
def test_line_art_says_so(paper: tuple[int, int, int]) -> None:
    assert LINES in extract_palette([line_art(paper)]).warnings[0]


def test_painted_drawings_with_lines_do_not() -> None:
    for picture in (line_art((240, 200, 160)), line_art((255, 255, 255), fill=(0, 0, 0))):
        assert not any(LINES in text for text in extract_palette([picture]).warnings)
    red = line_art((255, 255, 255), fill=(200, 30, 40))
    assert not any(LINES in text for text in extract_palette([red]).warnings)


def test_one_colour_says_so() -> None:
    found = extract_palette([block(((200, 60, 50), 80))])
    assert found.warnings == ("one colour only, #c83c32: there is nothing to tell apart",)
    two = extract_palette([block(((200, 60, 50), 80), ((20, 60, 180), 80))])
    assert not two.warnings
