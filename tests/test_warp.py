"""Drawings that disagree: found, moved as little as it takes, and given back."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from toonset.camera import Camera
from toonset.dataset.drawing_error import displacement_field
from toonset.dataset.scene import Frame, Scene
from toonset.errors import BundleError
from toonset.nerf.consistency import consistency_of
from toonset.nerf.consistency_picture import CELL, TEXT, consistency_picture
from toonset.nerf.registration import registered
from toonset.nerf.warp import MOST, Warp, unbent, warped
from toonset.nerf.warp_back import KeyWarps, give_back, view_shares
from toonset.nerf.warp_coherence import Placed, touch
from toonset.nerf.warp_fit import fit_moves
from toonset.nerf.warp_moves import CONTROLS, Bends, ShiftAndScale
from toonset.nerf.warp_outline import FIGURE_PX, Square, outlines_of, signed_distance

SIDE = 96
BALLS = (  # middle, half axes: body, head, two arms, a pack
    ((0.0, 0.0, 0.0), (0.35, 0.6, 0.3)),
    ((0.0, 0.85, 0.05), (0.35, 0.35, 0.35)),
    ((0.5, 0.2, 0.1), (0.3, 0.1, 0.1)),
    ((-0.55, 0.1, 0.0), (0.3, 0.12, 0.1)),
    ((0.2, 0.1, -0.4), (0.2, 0.3, 0.2)),
)


def camera_at(yaw_deg: float, elevation_deg: float = 8.0, side: int = SIDE) -> Camera:
    return Camera.looking_at(
        np.array([0.0, 0.3, 0.0]),
        math.radians(yaw_deg),
        math.radians(elevation_deg),
        0.36 * side,
        (side, side),
        k=0.1,
    )


def draw(camera: Camera) -> np.ndarray:
    """Return the balls' picture: coloured by place, so that what moves can be seen."""
    fine = camera.resized(4)
    origins, directions = fine.rays(fine.pixel_grid())
    hit = np.zeros(origins.shape[:2], dtype=bool)
    for middle, axes in BALLS:
        o, d = (origins - middle) / axes, directions / axes
        a, b, c = (d * d).sum(-1), (o * d).sum(-1), (o * o).sum(-1) - 1
        hit |= b * b > a * c
    side = camera.size_wh[0]
    alpha = hit.reshape(side, 4, side, 4).mean(axis=(1, 3))
    grid = camera.pixel_grid() / side
    rgba = np.dstack([grid[..., 0], grid[..., 1], 0.5 + 0 * alpha, alpha])
    rgba[..., :3] *= alpha[..., None] > 0
    return (rgba * 255 + 0.5).astype(np.uint8)


@cache
def sheet(views: int = 8, side: int = SIDE) -> Scene:
    cameras = [camera_at(360 * i / views, side=side) for i in range(views)]
    frames = [Frame(f"{i:03d}.png", camera, draw(camera)) for i, camera in enumerate(cameras)]
    return Scene(tuple(frames), None, "balls")


@cache
def bent_sheet(rms_px: float = 1.5) -> tuple[Scene, tuple[np.ndarray, ...]]:
    frames, fields = [], []
    for i, frame in enumerate(sheet().frames):
        figure = frame.rgba[..., 3] > 127
        field = displacement_field(np.random.default_rng(i), figure, rms_px)
        place = (frame.camera.pixel_grid() + field - 0.5).astype(np.float32)
        across, down = place[..., 0].copy(), place[..., 1].copy()
        rgba = cv2.remap(frame.rgba, across, down, cv2.INTER_LINEAR)
        frames.append(replace(frame, rgba=rgba))
        fields.append(field)
    return replace(sheet(), frames=tuple(frames)), tuple(fields)


def alphas(scene: Scene) -> list[np.ndarray]:
    return [frame.rgba[..., 3] / np.float32(255) for frame in scene.frames]


def outlines(scene: Scene):
    return outlines_of([frame.camera for frame in scene.frames], alphas(scene))


def random_warp(seed: int, size: float = 0.01) -> Warp:
    numbers = np.random.default_rng(seed).normal(0, 1, 2 * CONTROLS**2)
    root = np.linalg.cholesky(Bends.expected().covariance)
    return Warp(Square(np.array([10.0, 6.0]), 80.0), size * root @ numbers)


@pytest.mark.parametrize("moves", [ShiftAndScale.expected(), Bends.expected()])
def test_displacements_are_linear_in_their_numbers(moves) -> None:
    generator = np.random.default_rng(0)
    unit = generator.uniform(-0.2, 1.2, (50, 2))
    numbers = generator.normal(size=len(moves.covariance))
    np.testing.assert_allclose(moves.at(unit, numbers), moves.jacobian(unit) @ numbers, atol=1e-12)
    assert np.linalg.eigvalsh(moves.covariance).min() > 0


def test_bends_hold_every_shift_and_growth() -> None:
    unit = np.random.default_rng(1).uniform(0, 1, (200, 2))
    wanted = np.array([0.3, -0.2]) + 0.1 * unit
    jacobian = Bends.expected().jacobian(unit).reshape(400, -1)
    found = np.linalg.lstsq(jacobian, wanted.reshape(-1), rcond=None)[0]
    np.testing.assert_allclose(jacobian @ found, wanted.reshape(-1), atol=1e-9)


def test_distance_to_a_rim_between_pixels() -> None:
    across = np.arange(40) + 0.5
    alpha = np.repeat(np.clip(across - 12.3 + 0.5, 0, 1)[None], 40, axis=0).astype(np.float32)
    distance = signed_distance(alpha)[20]
    np.testing.assert_allclose(distance[5:30], (across - 12.3)[5:30], atol=0.5)
    near = np.abs(across - 12.3) < 0.5
    np.testing.assert_allclose(distance[near], (across - 12.3)[near], atol=1e-5)


def test_rays_of_a_perfect_sheet_touch_every_figure() -> None:
    found = outlines(sheet())
    placed = Placed.of(found, ShiftAndScale.expected(), np.zeros((8, 3)))
    for view, outline in enumerate(found.views):
        assert touch(placed, view, outline.rim).apart.max() < 0.6


def test_gradient_of_the_disagreement() -> None:
    """The fit's first step goes downhill as steeply as finite differences say."""
    from toonset.nerf.warp_fit import _normal, _touches

    found, moves = outlines(bent_sheet()[0]), ShiftAndScale.expected()
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


@pytest.mark.parametrize("views", [3, 5, 8])
def test_a_perfect_sheet_is_left_as_it_is(views: int) -> None:
    scene = sheet(views)
    result, found = unbent(scene)
    assert result is scene
    assert not found.applied
    assert found.gain_nats <= 0
    assert all(warp.is_none for warp in found.warps)


def test_bent_drawings_are_unbent() -> None:
    scene, fields = bent_sheet()
    result, found = unbent(scene)
    assert found.applied
    assert found.gain_nats > 50
    assert found.apart_px[1] < 0.5 * found.apart_px[0]
    left = before = 0.0
    for frame, good, field, warp in zip(
        scene.frames, sheet().frames, fields, found.warps, strict=True
    ):
        rim = np.abs(good.rgba[..., 3].astype(int) - 128) < 127
        move = warp.at(frame.camera.pixel_grid()[rim])
        # corrected(x) = good(x + warp + field): the field is what the warp must undo
        left += float(((move + field[rim]) ** 2).sum())
        before += float((field[rim] ** 2).sum())
        assert np.linalg.norm(move, axis=1).max() <= MOST * warp.square.size
    assert left < 0.75 * before  # the rest moves all outlines alike: another body, no disagreement
    worst = [np.abs(r.rgba[..., 3].astype(int) - g.rgba[..., 3]).mean() for r, g in
             zip(result.frames, sheet().frames, strict=True)]  # fmt: skip
    drawn = [np.abs(r.rgba[..., 3].astype(int) - g.rgba[..., 3]).mean() for r, g in
             zip(scene.frames, sheet().frames, strict=True)]  # fmt: skip
    assert np.mean(worst) < 0.85 * np.mean(drawn)


def test_the_same_bits_twice() -> None:
    scene, _ = bent_sheet()
    first, second = unbent(scene)[1], unbent(scene)[1]
    for one, other in zip(first.warps, second.warps, strict=True):
        assert one.numbers.tobytes() == other.numbers.tobytes()


def test_larger_pictures_are_compared_at_one_size() -> None:
    large = outlines(sheet(4, 2 * SIDE))
    assert large.views[0].square.size < 1.2 * FIGURE_PX
    fit = fit_moves(large, ShiftAndScale.expected(), 0.01, 2)
    assert fit.gain_nats <= 0


def test_too_few_drawings_and_empty_ones_are_left_alone() -> None:
    assert unbent(sheet(2))[0] is sheet(2)
    scene, _ = bent_sheet()
    empty = replace(scene.frames[0], rgba=np.zeros_like(scene.frames[0].rgba))
    result, found = unbent(replace(scene, frames=(empty, *scene.frames[1:])))
    assert result.frames[0] is empty
    assert found.warps[0].is_none
    assert found.applied


def test_back_undoes_a_warp() -> None:
    warp = random_warp(0)
    pixels = np.random.default_rng(1).uniform(0, 96, (300, 2))
    there = pixels + warp.at(pixels)
    np.testing.assert_allclose(there + warp.back(there), pixels, atol=2e-3)


def test_no_warp_is_longer_than_allowed() -> None:
    wild = random_warp(0, size=1.0)
    pixels = np.random.default_rng(1).uniform(0, 96, (300, 2))
    assert np.linalg.norm(wild.at(pixels), axis=1).max() <= MOST * wild.square.size


def test_warps_survive_json() -> None:
    keys = KeyWarps((camera_at(0), camera_at(45)), (random_warp(0), Warp.none()), np.ones(3))
    again = KeyWarps.from_json(keys.to_json(), keys.cameras)
    pixels = np.random.default_rng(1).uniform(0, 96, (30, 2))
    for one, other in zip(keys.warps, again.warps, strict=True):
        np.testing.assert_array_equal(one.at(pixels), other.at(pixels))


def test_warping_moves_colour_alpha_and_labels_alike() -> None:
    frame = sheet().frames[1]
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


def test_a_key_view_comes_out_as_it_was_drawn() -> None:
    cameras = tuple(camera_at(45 * i) for i in range(8))
    keys = KeyWarps(cameras, tuple(random_warp(i) for i in range(8)), np.array([0.0, 0.3, 0.0]))
    drawn = sheet().frames[2]
    corrected = warped(drawn, keys.warps[2])
    back = give_back({"rgb": corrected.rgba}, cameras[2], keys)["rgb"]
    before = np.abs(corrected.rgba[..., 3].astype(int) - drawn.rgba[..., 3]).mean()
    after = np.abs(back[..., 3].astype(int) - drawn.rgba[..., 3]).mean()
    assert after < 0.5 * before  # what two resamplings leave


def test_a_key_view_of_another_size_is_given_back_alike() -> None:
    keys = KeyWarps((camera_at(0),), (random_warp(4),), np.array([0.0, 0.3, 0.0]))
    frame, large = sheet().frames[0], camera_at(0, side=2 * SIDE)
    small = give_back({0: frame.rgba}, frame.camera, keys)[0]
    wide = give_back({0: draw(large)}, large, keys)[0]
    halved = cv2.resize(wide[..., 3], (SIDE, SIDE), interpolation=cv2.INTER_AREA)
    assert np.abs(halved.astype(int) - small[..., 3]).mean() < 1.0


def test_shares_go_over_from_one_key_view_to_the_next() -> None:
    keys = KeyWarps(
        tuple(camera_at(45 * i) for i in range(8)), (Warp.none(),) * 8, np.array([0.0, 0.3, 0.0])
    )
    for i in range(8):
        np.testing.assert_allclose(view_shares(camera_at(45 * i), keys), np.eye(8)[i], atol=1e-6)
    between = view_shares(camera_at(60), keys)
    np.testing.assert_allclose(between[[1, 2]], [2 / 3, 1 / 3], atol=0.02)
    assert between.sum() == pytest.approx(1, abs=0.01)
    yaws = np.linspace(0, 360, 721)
    all_shares = np.array([view_shares(camera_at(yaw), keys) for yaw in yaws])
    assert np.abs(np.diff(all_shares, axis=0)).max() < 0.03  # no jump anywhere
    assert view_shares(camera_at(10, elevation_deg=88), keys).sum() < 0.6


def test_drawings_without_bends_give_nothing_back() -> None:
    keys = KeyWarps((camera_at(0),), (Warp.none(),), np.zeros(3))
    picture = draw(camera_at(20))
    assert give_back({"rgb": picture}, camera_at(20), keys)["rgb"] is picture


@cache
def misplaced(seed: int) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Return the sheet with every drawing shifted by up to 3 px and sized by up to 3 %."""
    generator = np.random.default_rng(seed)
    shifts, sizes = generator.uniform(-3, 3, (8, 2)), generator.uniform(0.97, 1.03, 8)
    frames = []
    for frame, shift, size in zip(sheet().frames, shifts, sizes, strict=True):
        offset = shift + SIDE / 2 * (1 - size) + 0.5 * (size - 1)
        matrix = np.array([[size, 0, offset[0]], [0, size, offset[1]]])
        alpha = cv2.warpAffine(frame.rgba[..., 3], matrix, (SIDE, SIDE), flags=cv2.INTER_LINEAR)
        rgba = np.dstack([np.full((SIDE, SIDE, 3), 128, np.uint8), alpha])
        frames.append(replace(frame, rgba=rgba))
    return replace(sheet(), frames=tuple(frames)), shifts, sizes


@pytest.mark.parametrize("views", [3, 5, 8])
def test_a_perfect_sheet_keeps_its_cameras(views: int) -> None:
    result, found = registered(sheet(views))
    assert result is sheet(views)
    assert not found.applied
    assert found.gain_nats <= 0


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_shifts_and_sizes_are_found(seed: int) -> None:
    scene, shifts, sizes = misplaced(seed)
    result, found = registered(scene)
    assert found.applied
    scales = np.array([view.scale for view in found.views])
    np.testing.assert_allclose(scales / scales.mean(), sizes / sizes.mean(), atol=0.016)
    left = np.array(
        [
            after.camera.center - before.camera.center - shift
            for before, after, shift in zip(sheet().frames, result.frames, shifts, strict=True)
        ]
    )
    # The body has no place of its own, and outlines say nothing of what is between two sides:
    # told are heights against each other, and each side against the one opposite to it.
    assert np.abs(left[:, 1] - left[:, 1].mean()).max() < 1.0
    assert np.abs(left[:4, 0] + left[4:, 0]).max() < 1.0
    assert np.sqrt((shifts**2).mean()) > 1


def test_pictures_are_not_touched() -> None:
    scene, _, _ = misplaced(0)
    result, _ = registered(scene)
    for before, after in zip(scene.frames, result.frames, strict=True):
        assert after.rgba is before.rgba
        np.testing.assert_array_equal(after.camera.rotation, before.camera.rotation)


def test_registering_twice_changes_little() -> None:
    scene, _, _ = misplaced(1)
    once, _ = registered(scene)
    _, again = registered(once)
    assert again.apart_px[0] < 0.6
    shifts = np.array([view.shift_px for view in again.views])
    assert np.abs(shifts).max() < 1.0


def test_the_report_has_plain_numbers() -> None:
    _, found = registered(misplaced(0)[0])
    again = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert again["applied"] is True
    assert len(again["views"]) == 8
    assert again["apart_px"][1] < again["apart_px"][0]


def test_two_drawings_keep_their_cameras() -> None:
    scene = sheet(2)
    result, found = registered(scene)
    assert result is scene
    assert len(found.views) == 2


def test_report_of_a_perfect_sheet() -> None:
    found = consistency_of(sheet())
    assert not found.registration.applied
    assert not found.unbending.applied
    assert found.odd == ()
    for view in found.views:
        assert view.shift_px == (0.0, 0.0)
        assert view.bend_most_px == 0
        assert min(view.agreement) > 0.97
        assert max(view.unexplained) == 0


def test_report_names_the_drawing_with_a_part_of_its_own() -> None:
    frames = list(sheet().frames)
    rgba = frames[3].rgba.copy()
    rgba[40:52, 70:90] = (200, 30, 30, 255)  # a bag that no other drawing shows
    frames[3] = replace(frames[3], rgba=rgba)
    found = consistency_of(replace(sheet(), frames=tuple(frames)))
    assert "003.png" in found.odd
    assert found.heat_px[3][46, 85] > 3
    worst = max(found.views, key=lambda view: view.unexplained[0])
    assert worst.name == "003.png"
    picture = consistency_picture(found)
    assert picture.shape == (2 * (CELL + TEXT), 4 * CELL, 3)
    red = (picture[..., 0] > 200) & (picture[..., 1] < 120)
    cell = red[:CELL, 3 * CELL :]
    assert cell.sum() > 0.8 * red.sum() > 0
    json.dumps(found.to_json(), allow_nan=False)


def test_report_needs_three_drawings() -> None:
    with pytest.raises(BundleError, match=r"balls: 2 picture\(s\).*at least 3"):
        consistency_of(sheet(2))
