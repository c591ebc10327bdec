"""Lines at steps in depth: the rule that a sheet follows is found, and lines are drawn by it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.nerf.bodies import (
    FINE,
    HEIGHT,
    LINE_PX,
    STEPS,
    Hand,
    body,
    depths,
    own_shape,
    ring,
    sheet,
)
from toonset.nerf.hull.mannequin_shape import FINER
from toonset.nerf.look.step_lines import (
    StepLines,
    draw_steps,
    learn_steps,
    lines_across,
    step_places,
    step_sides,
)
from toonset.palette.pixels.ink_lines import find_contour


def stair(step: float, slope: float = 0.0) -> np.ndarray:
    """Return depth that rises by `slope` a pixel and steps between columns 29 and 30."""
    columns = np.arange(60.0)
    depth = np.broadcast_to(slope * columns + step * (columns >= 30), (40, 60)).copy()
    depth[:2] = np.nan
    return depth


@pytest.mark.parametrize("slope", [0.0, 0.04])
@pytest.mark.parametrize("turned", [False, True])
def test_steps_are_found_whatever_the_slope(slope: float, turned: bool) -> None:
    depth = stair(0.1, slope)
    near, far = step_sides(depth.T if turned else depth, 0.05)
    near, far = (near.T, far.T) if turned else (near, far)
    assert near[5:-5, 29].all()
    assert far[5:-5, 30].all()
    assert near.sum() + far.sum() == near[:, 29].sum() + far[:, 30].sum()
    assert not np.any(step_sides(stair(0.03, slope), 0.05))
    near, far = step_sides(-stair(0.1), 0.05)  # a step down
    assert near[5:-5, 30].all()
    assert far[5:-5, 29].all()


def test_places_lie_between_both_sides_and_point_to_the_far_one() -> None:
    places, across = step_places(np.repeat(np.repeat(stair(0.1), 3, 0), 3, 1), 0.05, 3, 1.0)
    inner = (places[:, 1] > 5) & (places[:, 1] < 35)
    np.testing.assert_allclose(places[inner, 0], 30, atol=0.05)
    np.testing.assert_allclose(
        across[inner], np.broadcast_to([1, 0], across[inner].shape), atol=1e-3
    )
    assert len(places) == pytest.approx(38, abs=3)


def test_a_line_is_found_where_it_lies() -> None:
    cover = np.zeros((40, 60))
    cover[:, 33:35] = 1.0
    places = np.column_stack([np.full(20, 30.0), np.arange(10, 30)])
    across = np.tile([1.0, 0.0], (20, 1))
    np.testing.assert_allclose(lines_across(cover, places, across, 8.0, 8.0), 3.75, atol=0.6)
    assert np.isnan(lines_across(cover, places, across, 8.0, 2.0)).all()


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_lines_are_as_wide_as_told_on_either_side(scale: float) -> None:
    fine = np.repeat(np.repeat(stair(0.1), 3, axis=0), 3, axis=1)
    line = draw_steps(fine, StepLines(0.05, 2.0, 1.0), 1.0, 3, scale)
    middle = line[10:30].mean(axis=0)
    assert middle[:30].sum() == pytest.approx(2.0 * scale, abs=0.2)
    assert middle[30:].sum() == pytest.approx(1.0 * scale, abs=0.2)
    assert not draw_steps(fine, StepLines(0.2, 2.0, 1.0), 1.0, 3, scale).any()


def covers_and_depths(hand: Hand) -> tuple[list[np.ndarray], list[np.ndarray]]:
    covers = [find_contour(f.rgba, LINE_PX) / 255.0 for f in sheet(body(), hand).frames]
    return covers, [depths(body(), camera) for camera in ring()]


def test_the_rule_of_a_sheet_is_learned() -> None:
    found = learn_steps(*covers_and_depths(Hand()), HEIGHT, LINE_PX)
    assert found is not None
    assert found.least <= STEPS.least * 1.2
    assert found.width_px == pytest.approx(STEPS.width_px, abs=0.8)
    assert abs(found.beyond_px) < 0.5


def test_an_artist_who_draws_no_steps_has_no_rule() -> None:
    covers, seen = covers_and_depths(Hand(lines=False))
    assert learn_steps(covers, seen, HEIGHT, LINE_PX) is None
    assert learn_steps(covers, seen, HEIGHT, 0.0) is None
    flat = [np.zeros_like(depth) for depth in seen]
    assert learn_steps(covers, flat, HEIGHT, LINE_PX) is None


def test_lines_of_a_shape_are_those_of_the_drawing() -> None:
    camera = ring()[1]
    sight = own_shape().seen(camera)
    line = draw_steps(sight.fine, STEPS, HEIGHT, FINER, 1.0)
    exact = depths(body(), camera.resized(FINE))
    truth = draw_steps(exact, STEPS, HEIGHT, FINE, 1.0)
    assert truth.sum() > 20
    assert np.abs(line - truth).sum() < 0.1 * truth.sum()


@pytest.mark.parametrize("width", [2, 8, 24])
def test_lines_of_any_width_are_measured(width: int) -> None:
    depth = np.broadcast_to(0.2 * (np.arange(400.0) >= 200), (400, 400)).copy()
    depth[:4] = depth[-4:] = np.nan
    cover = np.zeros((400, 400))
    cover[:, 200 - width // 2 : 200 + width // 2] = 1
    found = learn_steps([cover], [depth], 2.0, float(width))
    assert found is not None
    assert found.width_px == pytest.approx(width, abs=1.5)
