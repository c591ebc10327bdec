"""Line drawings: what their outlines nearly close is figure; real gaps stay, and doubt is said."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from toonset.dataset.split.figures.open_outlines import close_outlines
from toonset.dataset.split.sheet import Segmentation, split_picture

PAPER = 250
Gaps = tuple[tuple[int, int, int], ...]  # x, y and width of what is rubbed out


def _lines(gaps: Gaps = (), figures: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Return ink over paper, 0 to 1, and the figures: a head on a body with two legs."""
    ink = np.zeros((300, 40 + 150 * figures), np.uint8)
    true = np.zeros_like(ink)
    for left in range(0, 150 * figures, 150):
        body = [[60, 120], [120, 120], [140, 200], [130, 270], [100, 270], [92, 210], [88, 210]]
        body += [[80, 270], [50, 270], [40, 200]]
        outline = np.add(body, (left, 0))
        for canvas, thickness in ((ink, 3), (true, -1)):
            cv2.circle(canvas, (left + 90, 80), 42, 255, thickness)
            if thickness < 0:
                cv2.fillPoly(canvas, [outline], 255)
            cv2.polylines(canvas, [outline], True, 255, 3)
        cv2.circle(true, (left + 90, 80), 42, 255, 3)
        for x, y, width in gaps:
            ink[y - 5 : y + 6, left + x - width // 2 : left + x - width // 2 + width] = 0
    return ink / 255.0, true > 0


def _on_paper(ink: np.ndarray) -> np.ndarray:
    grey = np.rint(PAPER + (20 - PAPER) * ink).astype(np.uint8)
    return np.dstack([grey, grey, grey, np.full_like(grey, 255)])


def _as_layer(ink: np.ndarray) -> np.ndarray:
    alpha = np.rint(255 * ink).astype(np.uint8)
    return np.dstack([np.zeros_like(alpha)] * 3 + [alpha])


def _iou(found: Segmentation, true: np.ndarray) -> float:
    seen = np.zeros_like(true)
    for view in found.views:
        x, y, width, height = view.box
        seen[y : y + height, x : x + width] |= view.mask
    return float((seen & true).sum() / (seen | true).sum())


@pytest.mark.parametrize("width", [1, 2, 4, 8])
@pytest.mark.parametrize("draw", [_on_paper, _as_layer])
def test_an_outline_with_gaps_is_filled(
    width: int, draw: Callable[[np.ndarray], np.ndarray]
) -> None:
    ink, true = _lines(((90, 38, width), (90, 122, width), (43, 200, width)))
    found = split_picture(draw(ink))
    assert len(found.views) == 3
    assert _iou(found, true) > 0.97
    assert not found.warnings
    assert any("open outlines were closed" in remark for remark in found.remarks)


def test_a_closed_outline_says_nothing() -> None:
    ink, true = _lines()
    found = split_picture(_on_paper(ink))
    assert _iou(found, true) > 0.98
    assert not found.warnings
    assert not any("outline" in remark for remark in found.remarks)


def test_the_inside_of_a_line_layer_becomes_opaque_paper() -> None:
    ink, true = _lines()
    found = split_picture(_as_layer(ink))
    assert any("white paper (3 views)" in remark for remark in found.remarks)
    x, y, _, _ = found.views[0].box
    np.testing.assert_array_equal(found.views[0].rgba[80 - y, 90 - x], 255)
    assert _iou(found, true) > 0.97


def test_the_gap_between_arm_and_body_stays_open_on_transparency() -> None:
    canvas = np.zeros((300, 200, 4), np.uint8)
    cv2.ellipse(canvas, (90, 150), (40, 120), 0, 0, 360, (40, 90, 200, 255), -1)
    cv2.ellipse(canvas, (130, 150), (45, 60), 0, 0, 360, (0, 0, 0, 255), 14)
    found = split_picture(canvas)
    np.testing.assert_array_equal(found.views[0].mask.sum(), (canvas[..., 3] > 0).sum())
    assert not found.remarks


def test_a_painted_figure_whose_hand_nearly_touches_its_hip_keeps_the_gap() -> None:
    canvas = np.full((300, 220, 4), 255, np.uint8)
    cv2.ellipse(canvas, (90, 150), (40, 120), 0, 0, 360, (40, 90, 200, 255), -1)
    cv2.ellipse(canvas, (130, 150), (45, 60), 0, -70, 140, (40, 90, 200, 255), 22)
    cv2.ellipse(canvas, (90, 150), (42, 122), 0, 10, 70, (255, 255, 255, 255), 3)  # the hand is off
    found = split_picture(canvas)
    painted = (canvas[..., :3] != 255).any(axis=2)
    assert found.views[0].mask.sum() == painted.sum()


@pytest.mark.parametrize("width", [40, 60])
def test_what_stays_open_is_said(width: int) -> None:
    ink, _ = _lines(((90, 38, width), (90, 270, 120)))
    found = split_picture(_on_paper(ink))
    assert any("the outline of 000.png is open at" in line for line in found.warnings)


def test_a_pencil_outline_is_no_shadow() -> None:
    ink, true = _lines()
    grain = np.random.default_rng(0).uniform(0.35, 0.6, ink.shape)
    found = split_picture(_on_paper(cv2.GaussianBlur(ink * grain, (0, 0), 0.7)))
    assert len(found.views) == 3
    assert _iou(found, true) > 0.96


def test_paper_between_two_figures_is_no_inside():
    drawn = np.zeros((400, 400), dtype=bool)
    for x in (60, 260):
        drawn[60:340, x : x + 60] = True
    for y in (110, 320):  # what they hold and stand on almost meets
        drawn[y : y + 3, 120:188] = drawn[y : y + 3, 192:260] = True
    ring = np.ones_like(drawn)
    ring[1:-1, 1:-1] = False
    filled, _ = close_outlines(drawn, ~drawn, ring & ~drawn)
    assert not filled.any()
