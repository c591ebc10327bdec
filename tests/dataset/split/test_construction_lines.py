"""Construction lines end at the figure; staffs, antennae and arms stay."""

import cv2
import numpy as np
import pytest

from toonset.dataset.split.sheet import Segmentation, split_picture

INK = (40, 40, 40, 255)


def page(*lines: tuple[int, int, int, int, int]) -> Segmentation:
    """Split two figures; lines (x, y, x, y, thickness) are relative to the first one's middle."""
    rgba = np.full((480, 600, 4), 255, np.uint8)
    for middle in (150, 420):
        cv2.ellipse(rgba, (middle, 90), (40, 50), 0, 0, 360, (250, 210, 180, 255), -1)
        cv2.ellipse(rgba, (middle, 90), (40, 50), 0, 0, 360, INK, 3)
        cv2.rectangle(rgba, (middle - 34, 138), (middle + 34, 340), (80, 120, 200, 255), -1)
        cv2.rectangle(rgba, (middle - 34, 138), (middle + 34, 340), INK, 3)
    for x0, y0, x1, y1, thick in lines:
        cv2.line(rgba, (150 + x0, y0), (150 + x1, y1), INK, thick)
    return split_picture(rgba)


BARE = page().views[0].figure_box


@pytest.mark.parametrize(
    "line",
    [(0, 300, 0, 450, 2), (30, 80, 110, 80, 2), (-30, 200, -100, 202, 2)],
    ids=["centre", "eyes", "arm"],
)
def test_a_thin_line_that_sticks_out_goes(line: tuple[int, int, int, int, int]) -> None:
    found = page(line).views[0].figure_box
    assert np.abs(np.subtract(found, BARE)).max() <= 6


@pytest.mark.parametrize(
    "line",
    [(60, 130, 60, 400, 12), (0, 90, 0, 10, 2), (20, 60, 90, 15, 2), (30, 200, 110, 200, 14)],
    ids=["staff", "antenna", "whisker", "arm"],
)
def test_what_is_broad_or_stands_above_or_aslant_stays(
    line: tuple[int, int, int, int, int],
) -> None:
    held = (30, 200, 60, 200, 12) if line[0] == 60 else line
    x, y, width, height = page(line, held).views[0].figure_box
    left, right = min(BARE[0], 150 + line[0], 150 + line[2]), 150 + max(line[0], line[2])
    assert x <= left + 2
    assert x + width >= max(BARE[0] + BARE[2], right) - 2
    assert y <= min(BARE[1], line[3]) + 2
    assert y + height >= min(max(BARE[1] + BARE[3], line[3]), 400) - 2
