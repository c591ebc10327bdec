"""What a sheet's views share: priors, labels, turns, proportions, model selection."""

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from toonset.calib.fit.proportions import as_it_is
from toonset.calib.fit.sheet_prior import Turn, sheet_priors, yaw_slope
from toonset.calib.outline.occluding_contour import prepare_surface
from toonset.calib.outline.pose import Pose, pixel_slopes, project
from toonset.calib.search.sheet_posterior import possible_turns
from toonset.camera import angles_from_rotation, rotation_from_angles
from toonset.dataset.split_folder.view_labels import label_rows, parse_labels
from toonset.errors import SheetError
from toonset.mesh import Mesh


def pose_at(yaw=0.7, elevation=0.2, roll=0.1, k=0.0) -> Pose:
    return Pose(rotation_from_angles(yaw, elevation, roll), np.array([10.0, 20.0]), 90.0, k)


def degrees(rows) -> list:
    return np.round(np.degrees(rows)).tolist()


def test_yaw_slope_equals_central_differences():
    for yaw in (-3.0, 0.1, 2.0):
        pose, step = pose_at(yaw), 1e-6
        for axis in range(3):
            move = np.zeros(6)
            move[axis] = step
            high, low = (
                angles_from_rotation(pose.moved(s * move).rotation)[0] for s in (1.0, -1.0)
            )
            assert yaw_slope(pose)[axis] == pytest.approx((high - low) / (2 * step), abs=1e-5)


@pytest.mark.parametrize("k", [0.0, 0.2])
def test_pixel_slopes_equal_central_differences(k):
    pose, rng, step = pose_at(k=k), np.random.default_rng(0), 1e-6
    points = rng.normal(size=(5, 3))
    for axis in range(3):
        move = step * np.eye(3)[axis]
        change = (project(pose, points + move) - project(pose, points - move)) / (2 * step)
        np.testing.assert_allclose(pixel_slopes(pose, points)[..., axis], change, atol=1e-5)


def test_ties_measure_deviations_across_the_seam_of_yaw():
    poses = [pose_at(yaw) for yaw in (math.pi - 0.1, -math.pi + 0.1, math.pi - 0.1)]
    turn = Turn(np.array([math.pi, math.pi, np.nan]))
    tie = sheet_priors(poses, turn, 0.1, 18)["yaw"]
    deviations = tie.centre @ tie.values
    np.testing.assert_allclose(deviations, [-0.1, 0.1, 0.0], atol=1e-9)


def test_a_spread_is_what_the_deviations_show_between_its_expectation_and_them():
    wild = [replace(pose_at(roll=r)) for r in (-0.4, 0.4, -0.4, 0.4)]
    still = [pose_at(roll=0.0)] * 4
    nothing = np.zeros((24, 24))
    spreads = [sheet_priors(p, None, 0.1, 24)["roll"].spread(nothing, 0.05) for p in (wild, still)]
    assert 0.2 < spreads[0] < 0.4
    assert 0.02 < spreads[1] < 0.05


def test_labels_name_directions_and_numbers():
    found = parse_labels("front, 3q, Side,back,?,270", 6)
    assert [degrees(one) for one in found] == [[0], [45, 315], [90, 270], [180], [], [270]]


def test_open_sides_turn_one_way_more_likely_than_not():
    rows, log_p = label_rows(parse_labels("front,3q,side,back", 4))
    assert len(rows) == 4
    assert np.exp(log_p).sum() == pytest.approx(1)
    best = {tuple(r) for r in degrees(rows[np.argsort(-log_p)[:2]])}
    assert best == {(0, 45, 90, 180), (0, 315, 270, 180)}


def test_two_sides_are_rather_both_sides():
    rows, log_p = label_rows(parse_labels("front,side,back,side", 4))
    likely = degrees(rows[int(np.argmax(log_p))])
    assert sorted(likely) == [0, 90, 180, 270]


@pytest.mark.parametrize(
    ("text", "views", "message"),
    [
        ("front,back", 3, "2 labels for 3 views"),
        ("front,bakc", 2, "'bakc' is no direction; did you mean 'back'"),
        ("front,nan", 2, "'nan' is no direction"),
    ],
)
def test_labels_that_say_nothing_are_refused(text, views, message):
    with pytest.raises(SheetError, match=message):
        parse_labels(text, views)


def test_even_turns_need_four_views_and_labels_replace_them():
    assert np.isnan(possible_turns(3).places).all()
    turns = possible_turns(4)
    assert len(turns.places) > 50
    assert np.exp(turns.log_prior).sum() == pytest.approx(1)
    named = possible_turns(2, parse_labels("front,side", 2))
    assert named.anchored
    assert degrees(named.places) == [[0, 90], [0, 270]]


def test_one_label_leaves_the_others_their_even_turn():
    turns = possible_turns(4, parse_labels("?,95,?,?", 4))
    assert turns.anchored
    known = turns.places[np.isfinite(turns.places).all(axis=1)]
    assert degrees(known) == [[5, 95, 185, 275], [185, 95, 5, 275]]
    alone = turns.places[np.isnan(turns.places).any(axis=1)]
    np.testing.assert_allclose(np.degrees(alone), [[np.nan, 95, np.nan, np.nan]])
    assert np.exp(turns.log_prior).sum() == pytest.approx(1)
    apart = possible_turns(4, parse_labels("0,40,?,?", 4))  # in no even turn
    assert len(apart.places) == 1


def body():
    shape = trimesh.creation.capsule(height=1.0, radius=0.3)
    shape.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    return as_it_is(prepare_surface(Mesh(np.asarray(shape.vertices), np.asarray(shape.faces))))


def test_proportions_bend_symmetrically_and_can_be_undone():
    rest = body()
    theta = np.random.default_rng(0).normal(0, 0.05, len(rest.theta))
    bent = rest.moved(theta)
    np.testing.assert_allclose(bent.at_rest(bent.surface.vertices), rest.rest.vertices, atol=1e-3)
    mirror = np.array([-1.0, 1.0, 1.0])
    points = np.random.default_rng(1).uniform(-0.3, 0.3, (20, 3))
    moved = rest.slopes(points) @ theta
    np.testing.assert_allclose(rest.slopes(points * mirror) @ theta, moved * mirror, atol=1e-12)


def test_the_prior_of_proportions_is_proper():
    assert np.linalg.eigvalsh(body().precision).min() > 0
