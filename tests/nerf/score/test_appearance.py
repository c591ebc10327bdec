"""Figures for the eye: each says what it is for, and nothing else."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.nerf.look.painted import camera_at, draw
from toonset.nerf.score.appearance import block_psnr, dirt, sharpness
from toonset.nerf.score.metrics import BEST_PSNR
from toonset.view import over_white


@pytest.fixture
def picture() -> np.ndarray:
    return over_white(draw(camera_at(0.2)))


@pytest.fixture
def figure() -> np.ndarray:
    return draw(camera_at(0.2))[..., 3] >= 128


def test_blocks_may_shift_each_by_its_own(picture: np.ndarray) -> None:
    assert block_psnr(np.roll(picture, (1, 2), (0, 1)), picture) == BEST_PSNR
    torn = np.concatenate([np.roll(picture[:64], 1, axis=1), np.roll(picture[64:], -2, axis=1)])
    assert block_psnr(torn, picture) > 40
    assert block_psnr(np.roll(picture, 5, axis=1), picture) < 25


def test_blur_is_not_sharp_and_weave_is_dirt(picture: np.ndarray, figure: np.ndarray) -> None:
    assert sharpness(picture, picture, figure) == pytest.approx(1)
    blurred = sharpness(cv2.GaussianBlur(picture, (0, 0), 2), picture, figure)
    woven = picture + 0.05 * np.random.default_rng(0).normal(size=picture.shape)
    clean, dirty = dirt(picture, picture, figure), dirt(woven, picture, figure)
    assert blurred is not None
    assert clean is not None
    assert dirty is not None
    assert blurred < 0.7
    assert clean < 0.2 < 3 < dirty


def test_what_cannot_be_said_is_none(picture: np.ndarray, figure: np.ndarray) -> None:
    nothing = np.zeros_like(figure)
    assert sharpness(picture, picture, nothing) is None
    assert dirt(picture, picture, nothing) is None
    assert sharpness(picture, np.ones_like(picture), figure) is None
