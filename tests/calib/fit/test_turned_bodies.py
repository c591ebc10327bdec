"""Bodies that turn from drawing to drawing: told by elevation and roll, taken off yaw."""

import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from toonset.calib.fit.drawing_error import Noise
from toonset.calib.fit.proportions import as_it_is
from toonset.calib.fit.sheet_adjustment import JointFit
from toonset.calib.fit.sheet_prior import Spreads, Turn, yaw_slope
from toonset.calib.fit.turned_bodies import ROLL, YAW, account_for_turned_bodies
from toonset.calib.outline.occluding_contour import prepare_surface
from toonset.calib.outline.pose import PARAMETERS, Pose
from toonset.camera import angles_from_rotation, rotation_from_angles

VIEWS, SIGMA = 8, np.radians(0.3)
RING = np.arange(VIEWS) * 2 * np.pi / VIEWS
TURN = Turn(RING)
BODY = as_it_is(prepare_surface(random_body(0)))
LOOSE = Spreads(1.0, 1.0, 1.0, 1.0)  # priors that hold nothing


def fit_of(angles) -> JointFit:
    poses = tuple(Pose(rotation_from_angles(*row), np.zeros(2), 100.0) for row in angles.tolist())
    covariance = SIGMA**2 * np.eye(PARAMETERS * len(poses) + 1)
    return JointFit(poses, BODY, 0.0, Noise(), LOOSE, 0.0, covariance)


def sheet(rng, turned_deg, *, elevation_deg=0.7, roll_deg=0.3):
    """Return a sheet's true angles, and those that a fit of one body finds."""
    meant = np.column_stack([RING, np.full(VIEWS, 0.1), np.zeros(VIEWS)])
    true = meant + np.radians([3.0, elevation_deg, roll_deg]) * rng.normal(size=(VIEWS, 3))
    turned = np.radians(turned_deg) * np.array([YAW, 1.0, ROLL]) * rng.normal(size=(VIEWS, 3))
    return true, true + turned + SIGMA * rng.normal(size=(VIEWS, 3))


def errors(fit, true):
    found = np.array([angles_from_rotation(pose.rotation) for pose in fit.poses])
    return (found - true + np.pi) % (2 * np.pi) - np.pi


def yaw_sigmas(fit):
    blocks = [
        fit.covariance[i : i + 3, i : i + 3] for i in range(0, PARAMETERS * VIEWS, PARAMETERS)
    ]
    slopes = [yaw_slope(pose) for pose in fit.poses]
    return np.sqrt([by @ own @ by for by, own in zip(slopes, blocks, strict=True)])


def test_turned_bodies_are_seen_and_their_sigmas_are_true():
    rng = np.random.default_rng(0)
    before, after, scores, taus = [], [], [], []
    for _ in range(200):
        true, apparent = sheet(rng, 1.5)
        fit = fit_of(apparent)
        found = account_for_turned_bodies(fit, TURN)
        before.append(errors(fit, true))
        after.append(errors(found, true))
        scores.append(after[-1][:, 0] / yaw_sigmas(found))
        taus.append(np.degrees(found.noise.turned))
    assert np.median(taus) == pytest.approx(1.5, abs=0.2)
    better = np.sqrt((np.array(after) ** 2).mean((0, 1)) / (np.array(before) ** 2).mean((0, 1)))
    assert (better < (0.85, 0.65, 0.75)).all()  # yaw, elevation, roll
    assert np.median(np.abs(scores)) / 0.6745 == pytest.approx(1.0, abs=0.25)


def test_a_view_that_was_meant_elsewhere_stays_there():
    rng = np.random.default_rng(3)
    moved = []
    for _ in range(50):
        _, apparent = sheet(rng, 1.5)
        apparent[1, 0] += np.radians(25)
        found = account_for_turned_bodies(fit_of(apparent), TURN)
        if found.noise.turned > np.radians(1):
            moved.append(np.degrees(abs(errors(found, apparent)[1, 0])))
    assert len(moved) > 30
    assert np.median(moved) < 4  # as a share of the variance alone it would be 10


@pytest.mark.parametrize("scatter", [{"elevation_deg": 6.0, "roll_deg": 0.0}, {"roll_deg": 3.0}])
def test_cameras_that_differ_in_one_way_only_are_no_turned_bodies(scatter):
    rng = np.random.default_rng(1)
    moved = []
    for _ in range(50):
        _, apparent = sheet(rng, 0.0, **scatter)
        found = account_for_turned_bodies(fit_of(apparent), TURN)
        moved.append(np.degrees(np.abs(errors(found, apparent)).max()))
    assert np.median(moved) < 1.0


def test_steady_drawings_few_views_and_unknown_turns_are_left_alone():
    rng = np.random.default_rng(2)
    steady = fit_of(np.column_stack([RING, np.full(VIEWS, 0.1), np.zeros(VIEWS)]))
    assert account_for_turned_bodies(steady, TURN) is steady
    _, apparent = sheet(rng, 2.0)
    few = fit_of(apparent[:3])
    assert account_for_turned_bodies(few, Turn(RING[:3])) is few
    found = account_for_turned_bodies(fit_of(apparent), Turn(np.full(VIEWS, np.nan)))
    assert found.noise.turned > 0
    assert errors(found, apparent)[:, 0] == pytest.approx(0, abs=1e-9)
