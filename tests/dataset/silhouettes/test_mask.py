"""What of a picture is the figure: thin parts count, borders stay as they are."""

import math

import cv2
import numpy as np
import pytest

from toonset.dataset.silhouettes.mask import thin, widen_thin_parts


def coverage(corners: np.ndarray, side: int = 40, fine: int = 16) -> np.ndarray:
    """Return how much of each pixel a polygon covers."""
    picture = np.zeros((side * fine, side * fine), np.uint8)
    cv2.fillPoly(picture, [np.round(corners * fine).astype(np.int32)], 1)
    return picture.reshape(side, fine, side, fine).mean(axis=(1, 3)).astype(np.float32)


def turned_box(width: float, height: float, degrees: float) -> np.ndarray:
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (width / 2, height / 2)
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return corners @ np.array([[cos, sin], [-sin, cos]]) + 20.3


@pytest.mark.parametrize("covered", [0.1, 0.25, 0.4])
def test_a_line_is_as_wide_as_it_covers_pixels(covered: float) -> None:
    alpha = np.zeros((30, 30), np.float32)
    alpha[20:] = 1
    alpha[5:20, 12] = covered
    row = widen_thin_parts(alpha)[10]
    across = np.linspace(10, 14, 40001)
    inside = np.interp(across, np.arange(30), row) >= 0.5
    assert abs(4 * inside.mean() - covered) < 1e-3
    np.testing.assert_array_equal(widen_thin_parts(alpha)[20:], alpha[20:])


@pytest.mark.parametrize("degrees", [0, 10, 30, 45, 70])
def test_borders_are_no_thin_parts(degrees: float) -> None:
    """Only a box's corners, which hold less than half of their pixels, may be taken for some."""
    corners = turned_box(17.3, 22.6, degrees)
    rows, columns = np.nonzero(thin(coverage(corners)))
    away = np.linalg.norm(np.c_[columns, rows][:, None] + 0.5 - corners, axis=-1).min(axis=1)
    assert (away < 1.5).all()


@pytest.mark.parametrize("degrees", [0, 15, 45, 80])
def test_a_faint_spike_is_found_up_to_its_tip(degrees: float) -> None:
    box = coverage(turned_box(10, 10, degrees))
    spike = coverage(turned_box(0.35, 26, degrees))
    found = thin(np.maximum(box, spike))
    beyond = (spike > 0.1) & (box == 0)
    assert found[beyond].mean() > 0.8


def test_faint_pixels_apart_from_the_figure_are_no_part_of_it() -> None:
    alpha = np.zeros((40, 40), np.float32)
    alpha[:, 20:] = 1
    alpha[10:20, 4] = 0.3
    assert not thin(alpha).any()
