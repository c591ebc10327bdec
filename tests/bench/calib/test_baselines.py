"""What calibration is compared with: each baseline finds what it can, and says where it fails."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import cv2
import numpy as np
import pytest
import torch

from bench.calib.baselines import (
    BASELINES,
    LANDMARKS,
    Placed,
    boxed,
    by_landmarks,
    nominal_rotations,
    solved,
    spread_vertices,
    track,
    tracked,
)
from bench.calib.figures import Recorder, sheet_records
from bench.calib.measure import measured_baseline
from bench.calib.soft_silhouette import (
    GRID,
    by_soft_silhouette,
    coarse,
    descended,
    missed,
    picture_of,
    soft_silhouette,
)
from bench.cases.bodies import random_body
from bench.cases.cases import CalibCase
from bench.charts.points import CLICKED, PLOTS
from toonset.calib.outline.occluding_contour import silhouette_mask
from toonset.camera import Camera, rotation_distance, rotation_from_angles
from toonset.mesh import Mesh
from toonset.view import View

BODY = random_body(4)  # with a bag at one side
SIZE = 160, 220
YAWS = (20.0, 130.0, 250.0)
AROUND = {"x": [1.0, 0, 0], "y": [0, 1.0, 0], "z": [0, 0, 1.0]}


def true_camera(yaw_deg: float) -> Camera:
    yaw, elevation = math.radians(yaw_deg), math.radians(8.0)
    return Camera.looking_at(BODY.middle, yaw, elevation, 100.0, SIZE)


def drawing(camera: Camera) -> View:
    """Return the body's filled outline, cut out as tightly as sheets are."""
    mask = silhouette_mask(camera.project(BODY.vertices)[0], BODY.faces, SIZE)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    own = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    rgba = np.zeros((*own.shape, 4), np.uint8)
    rgba[..., 3] = 255 * own
    return View(rgba, (7, 9, own.shape[1], own.shape[0]), 0.0, "000.png")


@pytest.fixture(scope="module")
def case() -> CalibCase:
    cameras = [true_camera(yaw) for yaw in YAWS]
    rotations = np.stack([camera.rotation for camera in cameras])
    return CalibCase("body 4", "bodies", tuple(map(drawing, cameras)), BODY, rotations, BODY)


def turned(rotation: np.ndarray, axis: str, degrees: float) -> np.ndarray:
    """Return the rotation turned further about an axis of the camera."""
    return cv2.Rodrigues(math.radians(degrees) * np.array(AROUND[axis]))[0] @ rotation


def errors_deg(rotations, truth: np.ndarray) -> list[float]:
    assert len(rotations) == len(truth)
    pairs = zip(rotations, truth, strict=True)
    return [math.degrees(rotation_distance(found, true)) for found, true in pairs]


# ---- landmarks


def test_landmarks_without_noise_give_the_exact_rotation(case: CalibCase) -> None:
    placed = by_landmarks(case, 1, noise=0.0)
    assert max(errors_deg(placed.rotations, case.rotations)) < 0.01


def test_worse_clicks_give_worse_rotations_and_seeds_others(case: CalibCase) -> None:
    def mean(noise: float, seed: int = 1) -> float:
        many = replace(case, rotations=np.tile(case.rotations, (10, 1, 1)))
        return float(
            np.mean(errors_deg(by_landmarks(many, seed, noise=noise).rotations, many.rotations))
        )

    assert mean(0.02) == pytest.approx(2 * mean(0.01), rel=0.2)
    assert mean(0.01) == mean(0.01) != mean(0.01, seed=2)


def test_landmarks_of_another_body_are_clicked_where_it_was_drawn(case: CalibCase) -> None:
    other = random_body(1_000_004, symmetric=True)
    np.testing.assert_array_equal(BODY.faces[: len(other.faces)], other.faces)  # points pair up
    informed = by_landmarks(replace(case, mesh=other), 1, noise=0.0)
    optimistic = by_landmarks(replace(case, mesh=other, drawn=None), 1, noise=0.0)
    assert np.mean(errors_deg(informed.rotations, case.rotations)) > 1
    assert max(errors_deg(optimistic.rotations, case.rotations)) < 0.01


def test_landmarks_are_spread() -> None:
    def closest(chosen: np.ndarray) -> float:
        points = BODY.vertices[chosen]
        apart = np.linalg.norm(points[:, None] - points, axis=-1)
        return float(apart[~np.eye(len(points), dtype=bool)].min())

    rng = np.random.default_rng(0)
    chosen = spread_vertices(BODY, LANDMARKS, rng)
    anyhow = [rng.choice(len(BODY.vertices), LANDMARKS, replace=False) for _ in range(50)]
    assert len(set(chosen)) == LANDMARKS
    assert closest(chosen) > 2 * max(map(closest, anyhow))


@pytest.mark.parametrize("points", [np.zeros((12, 3)), np.full((12, 3), np.nan)])
def test_landmarks_that_say_nothing_give_no_rotation(points: np.ndarray) -> None:
    assert solved(points, np.zeros((12, 2)), np.diag([1000.0, 1000.0, 1.0])) is None


# ---- the start from the figure's box, and the tracker


def test_the_mesh_stands_in_the_figures_box(case: CalibCase) -> None:
    for view, rotation in zip(case.views, case.rotations, strict=True):
        camera = boxed(BODY, view, rotation)
        pixels = camera.project(BODY.vertices)[0]
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        np.testing.assert_allclose([low, high], [[0, 0], camera.size_wh], atol=1.5)
        assert camera.scale == pytest.approx(100, rel=0.01)


def test_the_tracker_turns_starts_nearer(case: CalibCase) -> None:
    errors = []  # of all starts: where it ends differs by half a degree between processors
    for axis, off in product(AROUND, (-5, 5)):
        starts = [turned(rotation, axis, off) for rotation in case.rotations]
        assert errors_deg(starts, case.rotations) == pytest.approx([5] * len(YAWS))
        pairs = zip(case.views, starts, strict=True)
        found = [track(BODY, view, boxed(BODY, view, start)) for view, start in pairs]
        errors += errors_deg(found, case.rotations)
    assert np.mean(errors) < 2.5


def test_a_tracker_without_a_figure_gives_no_rotation(case: CalibCase) -> None:
    view = case.views[0]
    start = boxed(BODY, view, case.rotations[0])
    beside = replace(start, center=start.center + 5000.0)
    assert track(BODY, view, beside) is None
    blank = replace(view, rgba=np.full((40, 40, 4), 255, np.uint8))
    tiny = replace(start, scale=1e-3, center=np.array([20.0, 20.0]))
    assert track(BODY, blank, tiny) is None


# ---- the soft silhouette


def test_the_soft_silhouette_is_the_masks_coverage() -> None:
    corners = torch.tensor([[[3.0, 2.0], [27.0, 6.0], [12.0, 29.0], [30.0, 28.0]]])
    faces = torch.tensor([[0, 1, 2], [3, 2, 1]])  # wound differently
    alpha = soft_silhouette(corners, faces, 32, sigma=0.1)[0].numpy()
    mask = silhouette_mask(corners[0].double().numpy(), faces.int().numpy(), (32, 32))
    certain = np.abs(alpha - 0.5) > 0.45
    assert certain.mean() > 0.93
    np.testing.assert_array_equal(alpha[certain] > 0.5, mask[certain])


def test_gradients_are_those_of_differences() -> None:
    rng = np.random.default_rng(3)
    pixels = torch.tensor(rng.uniform(1, 9, (2, 5, 2)), requires_grad=True)
    faces = torch.tensor([[0, 1, 2], [2, 3, 4]])
    target = torch.tensor(rng.random((2, 10, 10)))
    assert torch.autograd.gradcheck(
        lambda places: missed(soft_silhouette(places, faces, 10, sigma=1.0), target), [pixels]
    )


def test_what_lies_outside_the_picture_is_not_there() -> None:
    corners = torch.tensor([[[-90.0, 2.0], [-70.0, 6.0], [-80.0, 29.0]]])
    assert soft_silhouette(corners, torch.tensor([[0, 1, 2]]), 32).abs().max() == 0


def test_small_pictures_show_the_figure_where_their_camera_says(case: CalibCase) -> None:
    for view, rotation in zip(case.views, case.rotations, strict=True):
        small, camera = picture_of(view, boxed(BODY, view, rotation))
        assert small.shape == (GRID, GRID) == camera.size_wh
        mask = silhouette_mask(camera.project(BODY.vertices)[0], BODY.faces, (GRID, GRID))
        both, either = (mask & (small > 0.5)).sum(), (mask | (small > 0.5)).sum()
        assert both / either > 0.95


@pytest.mark.parametrize("axis", AROUND)
def test_adam_turns_a_start_nearer(case: CalibCase, axis: str) -> None:
    starts = [turned(rotation, axis, 5) for rotation in case.rotations]
    pairs = zip(case.views, starts, strict=True)
    cameras = [boxed(BODY, view, start) for view, start in pairs]
    found = descended(coarse(BODY, 400), case.views, cameras, steps=40)
    assert np.mean(errors_deg(found, case.rotations)) < 2.5


def test_open_meshes_are_decimated_too() -> None:
    holed = Mesh(BODY.vertices, BODY.faces[25:])
    assert len(holed.faces) % 2 == 1
    small = coarse(holed, 600)
    assert len(small.faces) <= 700
    np.testing.assert_allclose(small.bounds, holed.bounds, atol=0.03)
    assert coarse(small, 10_000) is small


# ---- records


def test_views_without_a_rotation_are_counted(case: CalibCase) -> None:
    placed = Placed((case.rotations[0], None, case.rotations[2]), 2.0, 1.5)
    sheet = measured_baseline(case, placed)
    assert (len(sheet.views), sheet.not_placed) == (2, 1)
    found = {r.metric: r for r in sheet_records([sheet], Recorder("cv2.rapid", "bodies", 0))}
    assert (found["views not placed"].value, found["views not placed"].n) == (1, 3)
    assert (found["rotation error"].n, found["CPU seconds"].by_case) == (2, {"body 4": 1.5})
    assert "ok" not in found


def test_a_lost_view_stays_in_the_sheet(case: CalibCase) -> None:
    blank = View(np.full((3, 3, 4), 255, np.uint8), (0, 0, 3, 3), 0.0, "001.png")
    views = (case.views[0], blank, case.views[2])
    placed = tracked(replace(case, views=views), 0)
    assert [rotation is None for rotation in placed.rotations] == [False, True, False]


def test_nominal_angles_are_even_turns() -> None:
    expected = [rotation_from_angles(turn, math.radians(5), 0) for turn in (0, math.pi)]
    np.testing.assert_allclose(nominal_rotations(2), expected, atol=1e-12)


def test_what_is_told_is_set_aside_in_charts() -> None:
    assert set(CLICKED) == {name for name in BASELINES if name.startswith("PnP")}
    assert set(CLICKED) < set(PLOTS["calib"].told)


@pytest.mark.slow
def test_adam_does_a_sheet_from_the_nominal_angles(case: CalibCase) -> None:
    rotations = np.stack([turned(r, "y", 4) for r in nominal_rotations(len(YAWS))])
    views = tuple(
        drawing(Camera(rotation, BODY.middle, 100.0, np.array(SIZE) / 2, SIZE))
        for rotation in rotations
    )
    placed = by_soft_silhouette(replace(case, views=views, rotations=rotations), 0)
    assert max(errors_deg(placed.rotations, rotations)) < 3
