"""Drawings are placed sideways by what their rows agree on."""

import numpy as np
import pytest

from toonset.calib.without_body.sideways import axis_columns


def drawn(yaw, axis, arm=0):
    """Return a round, leaning body of 100 rows whose axis stands at column `axis`; an arm of px."""
    rows = np.arange(100)
    middle = axis + 8 * np.sin(rows / 20) * np.cos(yaw) + (rows / 10) * np.sin(yaw)
    half = 15 + 5 * np.cos(rows / 9)
    columns = np.arange(160) + 0.5
    mask = np.abs(columns - middle[:, None]) < half[:, None]
    arm_rows = (rows > 30) & (rows < 60)
    reach = (columns > middle[:, None]) & (columns < (middle + half)[:, None] + arm)
    return mask | (arm_rows[:, None] & reach)


@pytest.mark.parametrize("degrees", [(0, 90, 180), (0, 45, 90, 180), (0, 45, 90, 135, 180)])
def test_an_arm_in_one_drawing_moves_no_axis(degrees):
    yaws = np.radians(degrees)
    axes = np.linspace(70, 90, len(yaws))
    arms = [30, *[0] * (len(yaws) - 1)]
    masks = [drawn(*one) for one in zip(yaws, axes, arms, strict=True)]
    found = axis_columns(masks, yaws)
    open_to_choice = np.stack([np.cos(yaws), np.sin(yaws)], axis=1)
    off = found - axes
    off -= open_to_choice @ np.linalg.lstsq(open_to_choice, off, rcond=None)[0]
    assert np.abs(off).max() < 0.5
    boxes = np.array([np.flatnonzero(mask.any(axis=0))[[0, -1]].mean() + 0.5 for mask in masks])
    worse = boxes - axes
    worse -= open_to_choice @ np.linalg.lstsq(open_to_choice, worse, rcond=None)[0]
    assert np.abs(worse).max() > 3  # what the boxes' middles would be off


def test_front_and_back_alone_share_one_direction():
    yaws = np.radians([0, 180.0])
    found = axis_columns([drawn(0, 80, arm=30), drawn(np.pi, 75)], yaws)
    assert found.sum() == pytest.approx(155, abs=0.5)
