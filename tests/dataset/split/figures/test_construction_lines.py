"""Construction lines of line drawings end at the figure; whiskers, legs and painted props stay."""

import cv2
import numpy as np
import pytest

from toonset.dataset.split.sheet import Segmentation, split_picture

INK, WHITE = (40, 40, 40, 255), (255, 255, 255, 255)
Line = tuple[int, int, int, int, int]


def page(*lines: Line, painted: bool = False) -> Segmentation:
    """Split two figures; lines (x, y, x, y, thickness) are relative to each one's middle."""
    rgba = np.full((480, 700, 4), 255, np.uint8)
    for middle in (180, 500):
        for center, axes in (((middle, 90), (40, 50)), ((middle, 240), (40, 101))):
            paint = (80, 120, 200, 255) if painted else WHITE
            cv2.ellipse(rgba, center, axes, 0, 0, 360, paint, -1)
            cv2.ellipse(rgba, center, axes, 0, 0, 360, INK, 3)
        for x0, y0, x1, y1, thick in lines:
            cv2.line(rgba, (middle + x0, y0), (middle + x1, y1), INK, thick)
    return split_picture(rgba)


BARE = page().views[0].figure_box


@pytest.mark.parametrize(
    "line",
    [(0, 300, 0, 450, 2), (30, 80, 110, 80, 2), (-30, 200, -100, 202, 2)],
    ids=["centre", "eyes", "arm"],
)
def test_a_thin_line_that_sticks_out_goes_and_is_told(line: Line) -> None:
    found = page(line)
    assert np.abs(np.subtract(found.views[0].figure_box, BARE)).max() <= 6
    assert any("ruled lines" in remark for remark in found.remarks)


@pytest.mark.parametrize(
    ("lines", "painted"),
    [
        ([(30, 200, 110, 200, 14)], False),
        ([(0, 60, 0, 10, 2)], False),
        ([(30, 85, 100, 85, 2), (30, 95, 100, 95, 2)], False),
        ([(-15, 300, -15, 440, 2), (15, 300, 15, 440, 2)], False),
        ([(30, 200, 110, 200, 4)], True),
    ],
    ids=["arm", "antenna", "whiskers", "legs", "rapier"],
)
def test_what_is_broad_paired_above_or_of_painted_figures_stays(
    lines: list[Line], painted: bool
) -> None:
    x, y, width, height = page(*lines, painted=painted).views[0].figure_box
    ends = np.array([[180 + x1, y1] for _, _, x1, y1, _ in lines])
    assert x + width >= ends[:, 0].max() - 2
    assert y <= ends[:, 1].min() + 2
    assert y + height >= min(ends[:, 1].max(), 480) - 2
