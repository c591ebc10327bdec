"""Drawings against each other: right cameras agree; the wrong one, or their elevation, is found."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from tests import figures
from tests.figures import boxes
from toonset.calib.evidence.common_elevation import common_elevation
from toonset.camera import Camera
from toonset.dataset.silhouettes.coherence import coherence
from toonset.errors import CameraError
from toonset.view import View

SIZE = (150, 160)
YAWS = np.radians([0, 47, 88, 136, 181, 223, 272, 314])


BODY = boxes(  # about 1.6 high: trunk, head, one arm out, one foot ahead
    ((0.5, 1.0, 0.3), (0, 0, 0)),
    ((0.4, 0.4, 0.5), (0, 0.7, 0.15)),
    ((0.6, 0.15, 0.15), (0.5, 0.3, 0.2)),
    ((0.2, 0.2, 0.6), (-0.15, -0.4, 0.3)),
)


def cameras_at(yaws, elevation=0.12, k=0.0) -> list[Camera]:
    target = np.array([0.1, 0.2, 0.0])
    return [Camera.looking_at(target, yaw, elevation, 75.0, SIZE, k=k) for yaw in yaws]


def drawn(camera: Camera) -> View:
    return figures.drawn(BODY, lambda points: camera.project(points)[0], camera.size_wh)


def turned(camera: Camera, yaw: float) -> Camera:
    was, elevation, roll = camera.angles
    return Camera.looking_at(
        camera.target, was + yaw, elevation, camera.scale, camera.size_wh, roll, camera.center
    )


def lifted(camera: Camera, by: float) -> Camera:
    yaw, elevation, roll = camera.angles
    return Camera.looking_at(
        camera.target, yaw, elevation + by, camera.scale, camera.size_wh, roll, k=camera.k
    )


@pytest.fixture(scope="module")
def sheet() -> tuple[list[View], list[Camera]]:
    cameras = cameras_at(YAWS)
    return [drawn(camera) for camera in cameras], cameras


@pytest.mark.parametrize("k", [0.0, 0.15, 0.4])
def test_right_cameras_contradict_nothing(k):
    cameras = cameras_at(YAWS, k=k)
    found = coherence([drawn(camera) for camera in cameras], cameras)
    assert found.contradiction < 0.003
    assert found.odd_view is None
    for view in found.views:
        assert view.share == 1.0
        assert view.residuals.min() > -0.01
        assert np.median(view.residuals) < 0.02  # and the hull is not much larger than the body


def test_residuals_equal_a_dense_search_with_the_cameras_own_projection(sheet):
    views, cameras = sheet[0][:4], [turned(camera, 0.15 * i) for i, camera in enumerate(sheet[1])]
    agreed = coherence(views, cameras[:4]).views
    found = agreed[0]
    depths = np.linspace(-1.5, 1.5, 3001)
    for at in range(0, len(found.points), 23):
        pixels = np.broadcast_to(found.points[at], (len(depths), 2))
        world = cameras[0].unproject(pixels, depths)
        inside = [
            signed_distance(views[j], cameras[j].project(world)[0]) / np.ptp(agreed[j].points[:, 1])
            for j in (1, 2, 3)
        ]
        assert found.residuals[at] == pytest.approx(np.min(inside, axis=0).max(), abs=0.01)


def signed_distance(view: View, pixels: np.ndarray) -> np.ndarray:
    """Return the distance from the outline by trying every pixel, positive inside."""
    rows, columns = np.nonzero(view.mask)
    inside = np.stack([columns, rows], axis=1) + 0.5
    rows, columns = np.nonzero(~view.mask)
    outside = np.stack([columns, rows], axis=1) + 0.5
    to_inside, to_outside = (KDTree(centres).query(pixels)[0] for centres in (inside, outside))
    return np.where(to_outside > to_inside, to_outside - 0.5, 0.5 - to_inside)


def test_a_common_turn_and_the_common_twin_change_nothing(sheet):
    views, cameras = sheet
    wrong = [turned(camera, 0.1 * (i % 3)) for i, camera in enumerate(cameras)]
    before = coherence(views, wrong)
    for same in ([turned(c, 0.7) for c in wrong], [c.twin() for c in wrong]):
        after = coherence(views, same)
        for a, b in zip(before.views, after.views, strict=True):
            np.testing.assert_allclose(a.residuals, b.residuals, atol=2e-3)


def test_a_tighter_or_wider_crop_changes_nothing(sheet):
    views, cameras = sheet
    wrong = [turned(camera, 0.1 * (i % 3)) for i, camera in enumerate(cameras)]
    padded = [replace(view, rgba=np.pad(view.rgba, ((30, 5), (9, 0), (0, 0)))) for view in views]
    size = (SIZE[0] + 9, SIZE[1] + 35)
    before = coherence(views, wrong)
    after = coherence(padded, [camera.moved((-9.0, -30.0), size) for camera in wrong])
    for a, b in zip(before.views, after.views, strict=True):
        np.testing.assert_allclose(a.points + np.array([9, 30]), b.points, atol=1e-6)
        np.testing.assert_allclose(a.residuals, b.residuals, atol=1e-3)


@pytest.mark.parametrize("which", [1, 2, 5])
def test_contradiction_grows_with_a_views_wrong_turn(sheet, which):
    views, cameras = sheet
    found = [
        coherence(views, [*cameras[:which], turned(cameras[which], turn), *cameras[which + 1 :]])
        for turn in np.radians([0, 6, 15, 30])
    ]
    growing = [sheet.contradiction for sheet in found]
    assert growing == sorted(growing)
    assert growing[-1] > 5 * growing[0]
    assert found[-1].views[which].blame == max(view.blame for view in found[-1].views)


@pytest.mark.parametrize("which", [1, 3, 6])
def test_the_odd_view_is_a_wrong_camera_or_a_mirrored_drawing(sheet, which):
    views, cameras = list(sheet[0]), list(sheet[1])
    cameras[which] = turned(cameras[which], np.radians(45))
    assert coherence(views, cameras).odd_view == which
    views, cameras = list(sheet[0]), list(sheet[1])
    mirrored = np.ascontiguousarray(views[which].rgba[:, ::-1])
    views[which] = replace(views[which], rgba=mirrored)
    cameras[which] = replace(cameras[which], center=cameras[which].center * [-1, 1] + [SIZE[0], 0])
    assert coherence(views, cameras).odd_view == which


@pytest.mark.parametrize("turn", [0.0, np.pi, np.pi / 2])
def test_two_views_are_enough_whatever_their_turn(turn):
    cameras = cameras_at([0.3, 0.3 + turn])
    found = coherence([drawn(camera) for camera in cameras], cameras)
    assert found.contradiction < 0.003
    assert found.odd_view is None
    assert all(np.isfinite(view.residuals).all() for view in found.views)


def test_one_view_or_a_missing_camera_is_refused(sheet):
    views, cameras = sheet
    with pytest.raises(CameraError, match="found 1 views"):
        coherence(views[:1], cameras[:1])
    with pytest.raises(CameraError, match="8 views and 7 cameras"):
        coherence(views, cameras[:7])


@pytest.mark.parametrize("wrong", np.radians([-9, -3, 0, 8]))
@pytest.mark.parametrize("k", [0.0, 0.3])
def test_a_common_elevation_error_is_found_without_a_mesh(wrong, k):
    cameras = cameras_at(YAWS, k=k)
    found = common_elevation([drawn(c) for c in cameras], [lifted(c, wrong) for c in cameras])
    assert found.offset == pytest.approx(-wrong, abs=np.radians(1))
    assert np.isfinite(found.sigma)


def test_the_twins_elevation_error_has_the_other_sign(sheet):
    views, cameras = sheet
    twins = [lifted(camera, 0.1).twin() for camera in cameras]
    assert common_elevation(views, twins).offset == pytest.approx(0.1, abs=np.radians(1))


def test_front_and_back_alone_do_not_tell_the_elevation():
    cameras = cameras_at([0.0, np.pi], elevation=0.0)
    found = common_elevation([drawn(camera) for camera in cameras], cameras)
    assert np.isinf(found.sigma)
    assert found.offset == 0.0


def test_a_single_view_tells_no_elevation(sheet):
    with pytest.raises(CameraError, match="single drawing"):
        common_elevation(sheet[0][:1], sheet[1][:1])
