"""Contours: drawn lines are found, black cloth and drawings without lines are not."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.palette.pixels import ink_lines as contour_module
from toonset.palette.pixels.ink_lines import find_contour

BLACK = (8, 8, 10)


def drawn(seed: int, outline: float, *, black_trunk: bool = False) -> Turnaround:
    body = random_body(seed)
    if black_trunk:
        assert body.face_colors is not None
        assert body.face_parts is not None
        colors = body.face_colors.copy()
        colors[body.face_parts == body.part_names.index("trunk")] = BLACK
        body = replace(body, face_colors=colors)
    options = SynthOptions(views=2, cell_px=240, outline_px=outline, warp_percent=0.5)
    return make_turnaround(body, options, seed)


def precision_and_recall(made: Turnaround, width: float | None) -> tuple[float, float]:
    found = np.stack([find_contour(view.rgba, width) for view in made.views]) >= 128
    truth = np.stack(made.ink) >= 128
    hits = (found & truth).sum()
    return float(hits / found.sum()), float(hits / truth.sum())


@pytest.mark.parametrize("outline", [1.5, 3.0, 5.0])
@pytest.mark.parametrize("given", [True, False])
def test_lines_are_found(outline: float, given: bool) -> None:
    precision, recall = precision_and_recall(drawn(2, outline), outline if given else None)
    assert precision > (0.95 if outline > 2 else 0.88)  # half of a thin line is soft pixels
    assert recall > 0.88


def test_black_cloth_is_no_line() -> None:
    made = drawn(2, 3.0, black_trunk=True)
    precision, recall = precision_and_recall(made, 3.0)
    assert precision > 0.95
    assert recall > 0.8
    for view, ink in zip(made.views, made.ink, strict=True):
        cloth = (view.rgba[..., :3] == BLACK).all(axis=-1) & (ink == 0)
        assert cloth.sum() > 500
        assert (find_contour(view.rgba, 3.0)[cloth] >= 128).mean() < 0.02


@pytest.mark.parametrize("seed", [2, 5])
def test_a_drawing_without_lines_has_none(seed: int) -> None:
    for view in drawn(seed, 0.0).views:
        assert not find_contour(view.rgba).any()
        assert not find_contour(view.rgba, 0.0).any()


def ring(
    ink: tuple[int, int, int], *, side: int = 120, radius: float = 40, width: float = 4
) -> np.ndarray:
    """Return a light disc with a round line along its border and a pupil inside."""
    down, right = np.mgrid[:side, :side] - (side - 1) / 2
    away = np.hypot(down, right)
    rgba = np.zeros((side, side, 4), dtype=np.uint8)
    rgba[away < radius + width / 2] = (240, 200, 160, 255)
    rgba[np.abs(away - radius) < width / 2, :3] = ink
    rgba[np.hypot(down + 8, right) < 2.2 * width, :3] = ink
    return rgba


@pytest.mark.parametrize("ink", [(0, 0, 0), (90, 50, 20), (20, 30, 90)])
def test_lines_of_any_dark_colour_are_found_and_pupils_are_not(ink: tuple[int, int, int]) -> None:
    picture = ring(ink)
    down, right = np.mgrid[:120, :120] - 59.5
    line = np.abs(np.hypot(down, right) - 40) < 2
    for width in (4.0, None):
        found = find_contour(picture, width) >= 128
        assert found[line].all()
        assert (found & ~line).sum() < 0.02 * line.sum()


def test_contours_turn_with_the_picture_and_bands_change_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    view = drawn(3, 3.0).views[1]
    found = find_contour(view.rgba, 3.0)
    assert np.array_equal(find_contour(view.rgba[:, ::-1], 3.0), found[:, ::-1])
    assert np.array_equal(find_contour(view.rgba.transpose(1, 0, 2), 3.0), found.T)
    monkeypatch.setattr(contour_module, "BAND_PX", 1000)
    assert np.array_equal(find_contour(view.rgba, 3.0), found)


def test_tiny_empty_and_wholly_black_pictures_have_no_lines() -> None:
    black = ring((0, 0, 0))
    black[..., :3] = 0
    shapes = ((1, 1), (1, 30), (5, 7))
    plain = [np.full((*shape, 4), alpha, np.uint8) for shape in shapes for alpha in (0, 255)]
    for picture in (black, *plain):
        assert not find_contour(picture).any()
        assert not find_contour(picture, 3.0).any()


@pytest.mark.parametrize("sigma", [1.0, 2.0])
def test_lines_of_large_blurred_drawings_are_found(sigma: float) -> None:
    sharp = ring((0, 0, 0), side=1000, radius=440, width=14)
    on_paper = np.where(sharp[..., 3:] > 0, sharp[..., :3], 255).astype(np.uint8)
    soft = cv2.GaussianBlur(on_paper, (0, 0), sigma)
    grown = cv2.dilate(sharp[..., 3], np.ones((3, 3), np.uint8), iterations=round(sigma))
    found = find_contour(np.dstack([soft, grown])) >= 128
    line = (sharp[..., :3] == 0).all(axis=-1) & (sharp[..., 3] > 0)
    line &= np.hypot(*(np.mgrid[:1000, :1000] - 499.5)) > 400
    assert found[line].mean() > 0.9
    assert (found & ~line).sum() < 0.15 * line.sum()
