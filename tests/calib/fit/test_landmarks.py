"""Landmarks: poses from pairs, and which pairs and which camera model to believe."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from toonset.calib.fit.landmark_adjustment import ViewPrior, refine
from toonset.calib.fit.landmark_residuals import LandmarkRows, Pairs
from toonset.calib.fit.landmark_starts import depth_reversed, start_poses
from toonset.calib.fit.landmarks import LandmarkFit, landmark_starts, solve_landmarks
from toonset.calib.fit.proportions import as_it_is
from toonset.calib.outline.occluding_contour import Surface, prepare_surface
from toonset.calib.outline.pose import Pose, project
from toonset.camera import rotation_distance, rotation_from_angles
from toonset.dataset.mannequin.landmark_file import Landmarks
from toonset.errors import LandmarkError
from toonset.mesh import Mesh

HEIGHT_PX = 300.0
CORNERS = np.array([[x, y, z] for x in (-0.3, 0.3) for y in (0.0, 1.0) for z in (-0.15, 0.15)])


@pytest.fixture(scope="module")
def surface() -> Surface:
    """Return a body one unit high whose middle is not the origin."""
    return prepare_surface(Mesh(CORNERS, np.array([[0, 1, 2], [1, 3, 2], [4, 5, 6], [5, 7, 6]])))


def random_pose(rng, heights: float = np.inf, *, level: bool = False) -> Pose:
    angles = rng.uniform([-np.pi, -0.5, -0.1], [np.pi, 0.5, 0.1])
    rotation = rotation_from_angles(*(angles * [1, 0, 0] if level else angles))
    return Pose(rotation, rng.uniform(100, 300, 2), HEIGHT_PX, 1 / heights)


def random_points(rng, count: int) -> np.ndarray:
    return rng.uniform(-0.5, 0.5, (count, 3)) * [0.6, 1.0, 0.3]


def clicked(
    pose: Pose, points: np.ndarray, surface: Surface, off: float | np.ndarray = 0.0
) -> Landmarks:
    names = tuple(f"point {i}" for i in range(len(points)))
    return Landmarks("000.png", names, points + surface.middle, project(pose, points) + off)


def solved(landmarks: Landmarks, surface: Surface) -> LandmarkFit:
    return solve_landmarks([landmarks], surface)[0]


def turned_deg(pose: Pose, other: Pose) -> float:
    return float(np.degrees(rotation_distance(pose.rotation, other.rotation)))


@pytest.mark.parametrize("count", [5, 7, 12])
@pytest.mark.parametrize("seed", range(4))
def test_orthographic_camera_is_recovered_exactly(surface, count, seed):
    rng = np.random.default_rng([seed, count])
    pose, points = random_pose(rng), random_points(rng, count)
    found = solved(clicked(pose, points, surface), surface)
    assert found.model == "orthographic"
    assert found.misplaced == ()
    assert turned_deg(found.poses[0], pose) < 1e-4
    np.testing.assert_allclose(found.poses[0].shift, pose.shift, atol=1e-5)
    assert found.poses[0].scale == pytest.approx(pose.scale, rel=1e-7)
    assert found.rms_px < 1e-5


@pytest.mark.parametrize("seed", range(4))
def test_four_pairs_at_eye_level_tell_the_camera(surface, seed):
    rng = np.random.default_rng([seed, 4])
    pose, points = random_pose(rng, level=True), random_points(rng, 4)
    found = solved(clicked(pose, points, surface), surface)
    assert turned_deg(found.poses[0], pose) < 1e-3


@pytest.mark.parametrize("count", [4, 6, 9])
def test_no_other_start_reaches_a_better_camera(surface, count):
    rng = np.random.default_rng(count)
    pose, points = random_pose(rng), random_points(rng, count)
    pixels = project(pose, points) + rng.normal(0, 0.03 * HEIGHT_PX, (count, 2))
    pairs, sigma_px = Pairs.of([(points, pixels)]), np.array([0.01 * HEIGHT_PX])
    prior = ViewPrior(np.zeros(3), np.array([0.1, 0.4, 1e3]))

    def least(starts):
        mine = pairs.at([0] * len(starts))
        return refine(starts, mine, np.repeat(sigma_px, len(starts)), prior)[1].min()

    turns = Rotation.random(60, np.random.default_rng(count)).as_matrix()
    others = [Pose(turn, pixels.mean(axis=0), 200.0) for turn in turns]
    assert least(start_poses(points, pixels)) <= least(others) * (1 + 1e-3)


@pytest.mark.parametrize("heights", [1.5, 2, 5, 20, 100, 500])
@pytest.mark.parametrize("count", [5, 10])
def test_perspective_camera_is_recovered_exactly(surface, heights, count):
    rng = np.random.default_rng([count, int(heights)])
    pose, points = random_pose(rng, heights), random_points(rng, count)
    found = solved(clicked(pose, points, surface), surface)
    assert found.model == "perspective"
    assert found.misplaced == ()
    assert turned_deg(found.poses[0], pose) < 1e-3
    assert found.poses[0].k == pytest.approx(pose.k, rel=1e-4)


@pytest.mark.parametrize("count", [3, 4, 8])
def test_points_in_an_upright_plane_have_two_cameras(surface, count):
    rng = np.random.default_rng(count)
    pose, points = random_pose(rng, level=True), random_points(rng, count) * [1, 1, 0]
    found = solved(clicked(pose, points, surface), surface)
    assert found.probabilities == pytest.approx((0.5, 0.5), abs=0.05)
    assert min(turned_deg(p, pose) for p in found.poses) < 0.1
    for candidate in found.poses:
        np.testing.assert_allclose(project(candidate, points), project(pose, points), atol=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_eye_level_tells_the_cameras_of_a_leaning_plane(surface, seed):
    rng = np.random.default_rng(seed)
    pose, flat = random_pose(rng, level=True), random_points(rng, 8) * [1, 1, 0]
    points = flat @ Rotation.from_rotvec([0.6, 0.0, 0.0]).as_matrix().T
    found = solved(clicked(pose, points, surface), surface)
    assert turned_deg(found.poses[0], pose) < 0.1
    assert found.probabilities[0] > 0.95


def test_depth_reversal_is_its_own_inverse_and_a_rotation():
    rng = np.random.default_rng(0)
    pose, points = random_pose(rng), random_points(rng, 6)
    reverse = depth_reversed(pose, points)
    assert np.linalg.det(reverse.rotation) == pytest.approx(1)
    again = depth_reversed(reverse, points)
    np.testing.assert_allclose(project(again, points), project(pose, points))


def test_plane_seen_head_on_has_a_finite_uncertainty(surface):
    points = random_points(np.random.default_rng(1), 6) * [1, 1, 0]
    pose = Pose(rotation_from_angles(0.0, 0.0, 0.0), np.array([150.0, 150]), HEIGHT_PX)
    found = solved(clicked(pose, points, surface), surface)
    sigmas = np.sqrt(np.diag(found.covariance))
    assert np.isfinite(sigmas).all()
    assert sigmas[1] > 0.5  # radians: nothing is known about the turn
    assert sigmas[2] < 0.05


def test_uncertainty_is_that_of_repeated_clicks(surface):
    rng = np.random.default_rng(2)
    scores = []
    for _ in range(25):
        pose, points = random_pose(rng), random_points(rng, 8)
        noise = rng.normal(0, 0.01 * HEIGHT_PX, (8, 2))
        found = solved(clicked(pose, points, surface, noise), surface)
        own = found.poses[0]
        turn = Rotation.from_matrix(pose.rotation @ own.rotation.T).as_rotvec()
        off = [*turn, *(pose.shift - own.shift), np.log(pose.scale / own.scale)]
        scores.append(np.array(off) / np.sqrt(np.diag(found.covariance)))
    spread = 1.4826 * np.median(np.abs(scores), axis=0)
    assert 0.8 < np.sqrt(np.mean(spread**2)) < 1.25
    assert (np.abs(scores) < 4).mean() > 0.98


@pytest.mark.parametrize("heights", [2.0, np.inf])
@pytest.mark.parametrize("count", [6, 12])
def test_one_misplaced_pair_is_named_and_left_out(surface, heights, count):
    rng = np.random.default_rng([count, int(heights == 2)])
    pose, points = random_pose(rng, heights, level=True), random_points(rng, count)
    off = rng.normal(0, 0.3, (count, 2))
    off[2] += [0.25 * HEIGHT_PX, -0.1 * HEIGHT_PX]
    found = solved(clicked(pose, points, surface, off), surface)
    assert found.misplaced == ("point 2",)
    assert turned_deg(found.poses[0], pose) < 1.5


def test_honest_clicks_are_kept_and_prove_no_perspective(surface):
    rng = np.random.default_rng(3)
    for count in (4, 5, 6, 10, 14):
        off = rng.normal(0, 0.01 * HEIGHT_PX, (count, 2))
        landmarks = clicked(random_pose(rng), random_points(rng, count), surface, off)
        found = solved(landmarks, surface)
        assert found.misplaced == ()
        assert found.model == "orthographic"


def test_a_wrong_pair_of_four_is_told_by_the_other_views(surface):
    rng = np.random.default_rng(8)
    poses = [random_pose(rng, level=True) for _ in range(5)]
    points = [random_points(rng, 4) for _ in poses]
    sheet = [
        clicked(*pair, surface, rng.normal(0, 0.5, (4, 2)))
        for pair in zip(poses, points, strict=True)
    ]
    sheet[2].pixels[1] += [90, 60]
    found = solve_landmarks(sheet, surface)
    assert [fit.misplaced for fit in found] == [(), (), ("point 1",), (), ()]
    assert max(turned_deg(fit.poses[0], pose) for fit, pose in zip(found, poses, strict=True)) < 5


def test_views_without_pairs_enough_are_left_out(surface):
    rng = np.random.default_rng(9)
    landmarks = clicked(random_pose(rng), random_points(rng, 6), surface)
    few = Landmarks("001.png", ("a",), landmarks.world[:1], landmarks.pixels[:1])
    found = landmark_starts([None, few, landmarks], surface)
    assert [fit is not None for fit in found] == [False, False, True]


def test_order_of_pairs_does_not_matter(surface):
    rng = np.random.default_rng(4)
    off = rng.normal(0, 3, (9, 2))
    off[1] += 80
    landmarks = clicked(random_pose(rng), random_points(rng, 9), surface, off)
    order = rng.permutation(9)
    shuffled = Landmarks(
        landmarks.view,
        tuple(landmarks.names[i] for i in order),
        landmarks.world[order],
        landmarks.pixels[order],
    )
    first, second = (solved(each, surface) for each in (landmarks, shuffled))
    assert first.misplaced == second.misplaced == ("point 1",)
    assert turned_deg(first.poses[0], second.poses[0]) < 1e-3
    np.testing.assert_allclose(first.covariance, second.covariance, rtol=1e-3, atol=1e-7)


def test_scaled_and_shifted_drawing_has_the_same_turn(surface):
    rng = np.random.default_rng(6)
    landmarks = clicked(random_pose(rng), random_points(rng, 7), surface, rng.normal(0, 2, (7, 2)))
    larger = replace(landmarks, pixels=2 * landmarks.pixels + [30, -40])
    first, second = (solved(each, surface).poses[0] for each in (landmarks, larger))
    assert turned_deg(first, second) < 1e-3
    assert second.scale == pytest.approx(2 * first.scale, rel=1e-6)
    np.testing.assert_allclose(second.shift, 2 * first.shift + [30, -40], atol=1e-3)


@pytest.mark.parametrize("count", [4, 6, 12])
@pytest.mark.parametrize("depth", [0.0, 1.0])
def test_starts_are_near_the_camera(count, depth):
    rng = np.random.default_rng(count)
    for _ in range(10):
        pose, points = random_pose(rng), random_points(rng, count) * [1, 1, depth]
        starts = start_poses(points, project(pose, points))
        assert all(start.k == 0 and start.scale > 0 for start in starts)
        assert min(turned_deg(start, pose) for start in starts) < 10


def test_rows_beside_outlines_have_the_right_slopes(surface):
    rng = np.random.default_rng(10)
    poses = [random_pose(rng, 4), random_pose(rng, 4)]
    own = [(random_points(rng, n), rng.uniform(100, 300, (n, 2))) for n in (5, 3)]
    rows = LandmarkRows(Pairs.of(own), np.array([1e4, 2e4]))  # weights hardly change
    body = as_it_is(surface).moved(rng.normal(0, 0.01, len(as_it_is(surface).theta)))
    for view, (off, slopes, by_body) in enumerate(rows.at(poses, body)):
        assert off.shape == (10,)  # padded
        assert np.allclose(off[2 * len(own[view][0]) :], 0)
        for axis in range(6):
            step = 1e-6 * np.eye(6)[axis]
            moved = [rows.at([p.moved(d) for p in poses], body)[view][0] for d in (step, -step)]
            np.testing.assert_allclose(slopes[:, axis], (moved[0] - moved[1]) / 2e-6, atol=1e-4)
        for axis in range(len(body.theta)):
            step = 1e-6 * np.eye(len(body.theta))[axis]
            bent = [rows.at(poses, body.moved(d))[view][0] for d in (step, -step)]
            np.testing.assert_allclose(by_body[:, axis], (bent[0] - bent[1]) / 2e-6, atol=1e-4)


@pytest.mark.parametrize(
    ("points", "pixels", "message"),
    [
        (np.outer(range(4), [0.1, 0.2, 0.0]), np.eye(4)[:, :2] * 50, "one line of the mannequin"),
        (np.zeros((3, 3)), np.eye(3)[:, :2] * 50, "one line of the mannequin"),
        (CORNERS[:5] - [0, 0.5, 0], np.ones((5, 2)), "pixels are within 1 px"),
        (CORNERS[:5] * 100, np.eye(5)[:, :2] * 50, "check its units"),
    ],
)
def test_landmarks_that_determine_no_camera_are_refused(surface, points, pixels, message):
    names = tuple("abcde"[: len(points)])
    landmarks = Landmarks("003.png", names, points + surface.middle, pixels)
    with pytest.raises(LandmarkError, match=rf"view 003\.png.*{message}"):
        solved(landmarks, surface)
