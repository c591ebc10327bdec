"""Bent drawings: found, and unbent as little as it takes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.nerf.prepare import balls
from toonset.dataset.bundle.scene import Scene
from toonset.dataset.silhouettes.displacement import CONTROLS, Bends, ShiftAndScale
from toonset.dataset.silhouettes.outlines import FIGURE_PX, Square, outlines_of, signed_distance
from toonset.dataset.silhouettes.register import _normal, _touches, fit_moves
from toonset.dataset.silhouettes.tangency import Placed, touch
from toonset.nerf.prepare.unwarp import MOST, Warp, unwarp_drawings, warped


def outlines(scene):
    alphas = [frame.rgba[..., 3] / np.float32(255) for frame in scene.frames]
    return outlines_of([frame.camera for frame in scene.frames], alphas)


@pytest.mark.parametrize("moves", [ShiftAndScale.expected(), Bends.expected()])
def test_displacements_are_linear_in_their_numbers(moves) -> None:
    generator = np.random.default_rng(0)
    unit = generator.uniform(-0.2, 1.2, (50, 2))
    numbers = generator.normal(size=len(moves.covariance))
    np.testing.assert_allclose(moves.at(unit, numbers), moves.jacobian(unit) @ numbers, atol=1e-12)
    grid = moves.on_grid(unit[:9, 0], unit[:7, 1], numbers)
    places = np.stack(np.meshgrid(unit[:9, 0], unit[:7, 1]), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(grid.reshape(-1, 2), moves.at(places, numbers), atol=1e-12)
    assert np.linalg.eigvalsh(moves.covariance).min() > 0
    shift, growth, within = np.array([0.3, -0.2]), 0.1, generator.uniform(0, 1, (200, 2))
    wanted = shift + growth * (2 * within - 1)
    np.testing.assert_allclose(moves.at(within, moves.even(shift, growth)), wanted, atol=1e-9)


def test_distance_to_a_rim_between_pixels() -> None:
    across = np.arange(40) + 0.5
    alpha = np.repeat(np.clip(across - 12.3 + 0.5, 0, 1)[None], 40, axis=0).astype(np.float32)
    distance = signed_distance(alpha)[20]
    np.testing.assert_allclose(distance[5:30], (across - 12.3)[5:30], atol=0.5)
    near = np.abs(across - 12.3) < 0.5
    np.testing.assert_allclose(distance[near], (across - 12.3)[near], atol=1e-5)


def test_rays_of_a_perfect_sheet_touch_every_figure() -> None:
    found = outlines(balls.sheet())
    placed = Placed.of(found, ShiftAndScale.expected(), np.zeros((8, 3)))
    for view, outline in enumerate(found.views):
        assert touch(placed, view, outline.points).apart.max() < 0.6


def test_a_thin_part_is_there_where_it_is_seen_from_its_edge() -> None:
    """A cape's corner covers a third of a pixel from the side: no outline, but no disagreement."""
    cape = ((0.0, -0.55, -0.5), (0.35, 0.45, 0.005))
    frames = []
    for frame in balls.sheet().frames:
        frames.append(replace(frame, rgba=balls.draw(frame.camera, (*balls.BALLS, cape))))
    found = outlines(replace(balls.sheet(), frames=tuple(frames)))
    placed = Placed.of(found, ShiftAndScale.expected(), np.zeros((8, 3)))
    apart = [touch(placed, view, outline.points).apart for view, outline in enumerate(found.views)]
    assert np.concatenate(apart).max() < 1.3  # 2.7 where only pixels covered by half count


def test_gradient_of_the_disagreement() -> None:
    """The fit's first step goes downhill as steeply as finite differences say."""
    found, moves = outlines(balls.bent_sheet()[0]), ShiftAndScale.expected()
    generator = np.random.default_rng(3)
    numbers = generator.normal(0, 0.004, (8, 3))

    def at(values: np.ndarray):
        placed = Placed.of(found, moves, values)
        return _normal(placed, _touches(placed, None))

    normal, direction = at(numbers), generator.normal(size=(8, 3))
    step = 1e-3 * direction / np.linalg.norm(direction)
    slope = 2 * float(normal.slope @ step.reshape(-1))
    difference = (at(numbers + step).cost - at(numbers - step).cost) / 2
    assert slope == pytest.approx(difference, rel=0.35)  # weights are held fixed in the slope


@pytest.mark.parametrize("views", [3, 8])
def test_a_perfect_sheet_is_left_as_it_is(views: int) -> None:
    scene = balls.sheet(views)
    result, found = unwarp_drawings(scene)
    assert result is scene
    assert not found.applied
    assert found.gain_nats <= 0
    assert all(warp.is_none for warp in found.warps)


def test_bent_drawings_are_unbent() -> None:
    scene, fields = balls.bent_sheet()
    result, found = unwarp_drawings(scene)
    assert found.applied
    assert found.gain_nats > 50
    assert found.apart_px[1] < 0.5 * found.apart_px[0]
    left = before = 0.0
    for frame, good, field, warp in zip(
        scene.frames, balls.sheet().frames, fields, found.warps, strict=True
    ):
        outline = np.abs(good.rgba[..., 3].astype(int) - 128) < 127
        move = warp.at(frame.camera.pixel_grid()[outline])
        # corrected(x) = good(x + warp + field): the field is what the warp must undo
        left += float(((move + field[outline]) ** 2).sum())
        before += float((field[outline] ** 2).sum())
        assert np.linalg.norm(move, axis=1).max() <= MOST * warp.square.size
    assert left < 0.75 * before  # the rest moves all outlines alike: another body, no disagreement

    def wrong(drawn: Scene) -> float:
        pairs = zip(drawn.frames, balls.sheet().frames, strict=True)
        return sum(np.abs(r.rgba[..., 3].astype(int) - g.rgba[..., 3]).mean() for r, g in pairs)

    assert wrong(result) < 0.85 * wrong(scene)
    for one, other in zip(found.warps, unwarp_drawings(scene)[1].warps, strict=True):
        assert one.numbers.tobytes() == other.numbers.tobytes()  # the same bits twice


def test_larger_pictures_are_compared_at_one_size() -> None:
    large = outlines(balls.sheet(4, 2 * balls.SIDE))
    assert large.views[0].square.size < 1.2 * FIGURE_PX
    fit = fit_moves(large, ShiftAndScale.expected(), 0.01, 2)
    assert fit.gain_nats <= 0


def test_too_few_drawings_and_empty_ones_are_left_alone() -> None:
    assert unwarp_drawings(balls.sheet(2))[0] is balls.sheet(2)
    scene, _ = balls.bent_sheet()
    empty = replace(scene.frames[0], rgba=np.zeros_like(scene.frames[0].rgba))
    result, found = unwarp_drawings(replace(scene, frames=(empty, *scene.frames[1:])))
    assert result.frames[0] is empty
    assert found.warps[0].is_none
    assert found.applied


def test_no_warp_is_longer_than_allowed() -> None:
    numbers = np.random.default_rng(0).normal(0, 1, 2 * CONTROLS**2)
    root = np.linalg.cholesky(Bends.expected().covariance)
    wild = Warp(Square(np.array([10.0, 6.0]), 80.0), root @ numbers)
    pixels = np.random.default_rng(1).uniform(0, 96, (300, 2))
    assert np.linalg.norm(wild.at(pixels), axis=1).max() <= MOST * wild.square.size


def test_warping_moves_colour_alpha_and_labels_alike() -> None:
    frame = balls.sheet().frames[1]
    labels = np.where(frame.rgba[..., 3] > 127, 3, 255).astype(np.uint8)
    shift = np.zeros(2 * CONTROLS**2)
    shift[: CONTROLS**2] = 2 / 80
    warp = Warp(Square(np.zeros(2), 80.0), shift)
    small = float(warp.at(np.full((1, 2), 40.0))[0, 0])
    assert small == pytest.approx(2 / (1 + (2 / 80 / MOST) ** 4) ** 0.25)
    result = warped(replace(frame, labels=labels), warp)
    assert result.labels is not None
    np.testing.assert_array_equal(result.labels[:, :-4], labels[:, 2:-2])
    middle = result.rgba[48, 40].astype(float)
    assert middle[0] == pytest.approx(255 * (40.5 + small) / 96, abs=2)
