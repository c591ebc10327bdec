"""What calibration is compared with: each baseline finds what it can, and says where it fails."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import cv2
import numpy as np
import pytest

from lab.bench.calib.baselines import boxed, by_landmarks, solved, track, tracked
from lab.bench.calib.figures import sheet_records
from lab.bench.calib.measure import measured_baseline
from lab.bench.cases.bodies import random_body
from lab.bench.cases.cases import CalibCase
from lab.bench.records.record import Recorder
from toonset.camera import Camera, rotation_distance
from toonset.dataset.mesh.rasterize import silhouette_mask
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
    assert max(errors_deg(placed, case.rotations)) < 0.01
    for points in (np.zeros((12, 3)), np.full((12, 3), np.nan)):  # landmarks that say nothing
        assert solved(points, np.zeros((12, 2)), np.diag([1000.0, 1000.0, 1.0])) is None


def test_worse_clicks_give_worse_rotations_and_seeds_others(case: CalibCase) -> None:
    def mean(noise: float, seed: int = 1) -> float:
        many = replace(case, rotations=np.tile(case.rotations, (10, 1, 1)))
        return float(np.mean(errors_deg(by_landmarks(many, seed, noise=noise), many.rotations)))

    assert mean(0.02) == pytest.approx(2 * mean(0.01), rel=0.2)
    assert mean(0.01) == mean(0.01) != mean(0.01, seed=2)


def test_landmarks_of_another_body_are_clicked_where_it_was_drawn(case: CalibCase) -> None:
    other = random_body(1_000_004, symmetric=True)
    np.testing.assert_array_equal(BODY.faces[: len(other.faces)], other.faces)  # points pair up
    informed = by_landmarks(replace(case, mesh=other), 1, noise=0.0)
    optimistic = by_landmarks(replace(case, mesh=other, drawn=None), 1, noise=0.0)
    assert np.mean(errors_deg(informed, case.rotations)) > 1
    assert max(errors_deg(optimistic, case.rotations)) < 0.01


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


# ---- records


def test_views_without_a_rotation_are_counted(case: CalibCase) -> None:
    placed = [case.rotations[0], None, case.rotations[2]]
    sheet = measured_baseline(case, 0, lambda case, seed: placed)
    assert (len(sheet.views), sheet.not_placed) == (2, 1)
    found = {r.metric: r for r in sheet_records([sheet], Recorder("cv2.rapid", "bodies", 0))}
    assert (found["views not placed"].value, found["views not placed"].n) == (1, 3)
    assert (found["rotation error"].n, [*found["CPU seconds"].by_case]) == (2, ["body 4"])
    assert "ok" not in found


def test_a_lost_view_stays_in_the_sheet(case: CalibCase) -> None:
    blank = View(np.full((3, 3, 4), 255, np.uint8), (0, 0, 3, 3), 0.0, "001.png")
    views = (case.views[0], blank, case.views[2])
    placed = tracked(replace(case, views=views), 0)
    assert [rotation is None for rotation in placed] == [False, True, False]
