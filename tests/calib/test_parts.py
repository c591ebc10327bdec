"""Building blocks of calibration: derivatives, outlines, contours, probabilities."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh

from tests.figures import boxes, drawn
from toonset.calib.evidence.face import FaceEvidence
from toonset.calib.fit.align import Fit, align
from toonset.calib.fit.tilt import ElevationPrior, tilt, upright_prior
from toonset.calib.outline.correspondences import Drawing
from toonset.calib.outline.occluding_contour import find_occluding_contour, prepare_surface
from toonset.calib.outline.pose import Pose, project, project_with_jacobian
from toonset.calib.search.candidates import Candidates
from toonset.calib.search.sheet_posterior import SheetPosterior, possible_turns
from toonset.calib.search.templates import build_templates, find_hypotheses
from toonset.camera import rotation_distance, rotation_from_angles
from toonset.dataset.mesh.rasterize import silhouette_mask
from toonset.dataset.silhouettes.contour import drawn_contour
from toonset.errors import SheetError
from toonset.mesh import Mesh
from toonset.projection import project_offsets as torch_project
from toonset.projection import rotate
from toonset.view import View


def pose_at(yaw=0.7, elevation=0.2, roll=0.1, k=0.0, scale=100.0) -> Pose:
    rotation = rotation_from_angles(yaw, elevation, roll)
    return Pose(rotation, np.array([150.0, 160.0]), scale, k)


def as_mesh(shape) -> Mesh:
    return Mesh(np.array(shape.vertices), np.array(shape.faces))


FIGURE = boxes(  # trunk, head in front, one arm out, one foot ahead
    ((0.5, 1.0, 0.3), (0, 0.5, 0)),
    ((0.4, 0.4, 0.5), (0, 1.2, 0.15)),
    ((0.6, 0.15, 0.15), (0.5, 0.8, 0)),
    ((0.2, 0.2, 0.6), (-0.15, 0.1, 0.3)),
)


def view_of(mesh: Mesh, pose: Pose) -> View:
    middle = prepare_surface(mesh).middle
    return drawn(mesh, lambda points: project(pose, points - middle), (300, 320))


@pytest.mark.parametrize("k", [0.0, 0.3])
def test_jacobian_equals_central_differences_and_kornia(k):
    pose, points = pose_at(k=k), np.random.default_rng(0).uniform(-1, 1, (7, 3))
    pixels, jacobian = project_with_jacobian(pose, points)
    np.testing.assert_allclose(pixels, project(pose, points))
    for axis in range(6):
        step = np.zeros(6)
        step[axis] = 1e-6
        slope = (project(pose.moved(step), points) - project(pose.moved(-step), points)) / 2e-6
        np.testing.assert_allclose(jacobian[..., axis], slope, atol=1e-4)
    deeper, nearer = replace(pose, k=k + 1e-7), replace(pose, k=k - 1e-7)
    slope = (project(deeper, points) - project(nearer, points)) / 2e-7
    np.testing.assert_allclose(jacobian[..., 6], slope, atol=1e-3)

    def kornia_pixels(step):
        return torch_project(
            rotate(torch.from_numpy(pose.rotation)[None], step[None, :3]),
            torch.from_numpy(pose.shift)[None] + step[None, 3:5],
            pose.scale * step[None, 5:6].exp().repeat(1, 2),
            pose.k + step[6:7],
            torch.from_numpy(points)[None],
        )[0]

    autodiff = torch.func.jacfwd(kornia_pixels)(torch.zeros(7, dtype=torch.float64))
    np.testing.assert_allclose(jacobian, autodiff, atol=1e-9)


def test_tilt_and_its_prior_have_the_right_slopes():
    pose, prior = pose_at(0.9, 0.35, -0.2), ElevationPrior(0.1, 0.3)
    (roll, elevation), slopes = tilt(pose)
    np.testing.assert_allclose((roll, elevation), (-0.2, 0.35), atol=1e-12)
    for axis in range(3):
        step = np.zeros(6)
        step[axis] = 1e-6
        change = np.subtract(tilt(pose.moved(step))[0], tilt(pose.moved(-step))[0]) / 2e-6
        np.testing.assert_allclose(slopes[:, axis], change, atol=1e-6)
    matrix, gradient = upright_prior(pose, prior)
    assert np.linalg.eigvalsh(matrix).min() > -1e-9
    np.testing.assert_allclose(gradient[3:], 0)


def test_contour_of_a_disc_is_a_circle_with_outward_normals():
    v, u = np.mgrid[:120, :120] + 0.5
    distance = np.hypot(u - 61.3, v - 57.8)
    rgba = np.zeros((120, 120, 4), np.uint8)
    rgba[..., 3] = np.round(np.clip(40.5 - distance, 0, 1) * 255)
    rgba[(distance < 12)] = 0  # and a hole
    contour = drawn_contour(View(rgba, (0, 0, 120, 120), 0.0, "000.png"))
    offset = contour.points - [61.3, 57.8]
    radius = np.linalg.norm(offset, axis=1)
    outer = radius > 26
    np.testing.assert_allclose(radius[outer], 40, atol=0.2)
    np.testing.assert_allclose(radius[~outer], 12, atol=0.5)
    outward = (offset * contour.normals).sum(axis=1) / radius
    assert outward[outer].min() > 0.98  # out of the disc
    assert outward[~outer].max() < -0.8  # into the hole, which is out of the figure
    assert contour.height_px == pytest.approx(80, abs=0.3)


@pytest.mark.parametrize(("cut", "share"), [(0, 0.0), (35, 0.1)])
def test_where_the_pictures_edge_cuts_a_figure_is_no_outline(cut, share):
    rows, columns = np.mgrid[:120, :120] + 0.5
    rgba = np.zeros((120, 120, 4), np.uint8)
    rgba[..., 3] = 255 * (np.abs(rows - 60) + np.abs(columns - 60) < 50)
    picture = rgba[10 : 110 - cut]  # a close crop touches the edge as well
    found = drawn_contour(View(picture, (0, 0, 120, len(picture)), 0.0, "000.png"))
    cut_off = ~found.free
    assert cut_off.mean() >= share
    assert cut_off.any() == (cut > 0)
    assert (found.points[cut_off, 1] > len(picture) - 2).all()


def test_silhouette_mask_covers_exactly_the_pixel_centres_inside():
    corners = np.array([[10.0, 10.0], [60.2, 20.0], [20.0, 70.7]])
    mask = silhouette_mask(corners, np.array([[0, 1, 2]], np.int32), (100, 80))
    v, u = np.mgrid[:80, :100] + 0.5
    inward = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = (b - a) / np.linalg.norm(b - a)
        inward.append(along[0] * (v - a[1]) - along[1] * (u - a[0]))
    distance = np.min(inward, axis=0)  # px to the nearest side, > 0 inside
    clear = np.abs(distance) > 0.01
    np.testing.assert_array_equal(mask[clear], distance[clear] > 0)


@pytest.mark.parametrize("k", [0.0, 0.25])
def test_rim_of_a_sphere_is_where_the_view_ray_grazes_it(k):
    surface = prepare_surface(as_mesh(trimesh.creation.icosphere(subdivisions=4)))
    pose = pose_at(k=k)
    occluding = find_occluding_contour(surface, project(pose, surface.vertices), (320, 320), 2.0)
    depth = (occluding.points @ pose.rotation.T)[:, 2]
    np.testing.assert_allclose(depth, -k, atol=0.09)  # the grazing circle: z = -r^2 k
    outward = project(pose, occluding.points) - pose.shift
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    assert (outward * occluding.normals).sum(axis=1).min() > 0.97
    angle = np.sort(np.arctan2(outward[:, 1], outward[:, 0]))
    assert np.diff(angle).max() < 0.2  # all the way round


def test_rim_of_an_open_sheet_is_its_border():
    square = trimesh.Trimesh(
        [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]]
    )
    surface = prepare_surface(as_mesh(square))
    pose = pose_at(0.4, 0.2, 0.0)
    occluding = find_occluding_contour(surface, project(pose, surface.vertices), (320, 320), 2.0)
    on_border = np.abs(np.abs(occluding.points[:, :2]).max(axis=1) - 1) < 1e-9
    assert on_border.all()
    assert len(occluding.points) > 100


def test_templates_find_the_direction_of_an_asymmetric_body():
    surface = prepare_surface(FIGURE)
    templates = build_templates(surface)
    for yaw in (0.0, 1.0, 2.5, 4.0, 5.5):
        truth = pose_at(yaw, 0.15, 0.0)
        found = find_hypotheses(view_of(FIGURE, truth), templates, 6)
        errors = [rotation_distance(h.pose.rotation, truth.rotation) for h in found]
        assert min(errors) < math.radians(15)
        best = found[int(np.argmin(errors))].pose
        assert best.scale == pytest.approx(truth.scale, rel=0.1)
        np.testing.assert_allclose(best.shift, truth.shift, atol=12)


@pytest.mark.parametrize("yaw", [0.4, 2.0, 3.9])
def test_alignment_recovers_the_pose_from_ten_degrees_off(yaw):
    truth = pose_at(yaw, 0.15, 0.0)
    drawing = Drawing(drawn_contour(view_of(FIGURE, truth)), 200, 300)
    start = replace(truth, rotation=rotation_from_angles(yaw + 0.17, 0.05, 0.02), scale=95.0)
    fit = align(drawing, prepare_surface(FIGURE), start, np.geomspace(0.06, 0.005, 12))
    assert math.degrees(rotation_distance(fit.pose.rotation, truth.rotation)) < 0.6
    assert fit.pose.scale == pytest.approx(truth.scale, rel=0.003)
    np.testing.assert_allclose(fit.pose.shift, truth.shift, atol=0.4)
    assert fit.coverage > 0.99


def candidates(*poses_and_energies) -> Candidates:
    fits = tuple(Fit(pose, 1.0, 0.0, 1.0) for pose, _ in poses_and_energies)
    return Candidates(fits, np.array([energy for _, energy in poses_and_energies]))


def sheet(views: int) -> SheetPosterior:
    return SheetPosterior(possible_turns(views))


def test_equal_twins_at_eye_level_are_a_coin_toss():
    twins = candidates((pose_at(0.5, 0.0, 0.0), 0.0), (pose_at(math.pi - 0.5, 0.0, 0.0), 0.0))
    for view in sheet(2).probabilities([twins, twins]):
        np.testing.assert_allclose(view, 0.5, atol=1e-9)


def test_one_sure_view_settles_the_elevation_of_the_others():
    sure = candidates((pose_at(0.5, 0.3, 0.0), 0.0), (pose_at(math.pi - 0.5, -0.3, 0.0), 25.0))
    torn = candidates((pose_at(math.pi - 2, -0.3, 0.0), 0.0), (pose_at(2.0, 0.3, 0.0), 0.5))
    assert sheet(2).choose([sure, torn])[0] == [0, 1]
    np.testing.assert_allclose(sheet(2).probabilities([sure, torn])[1], [0, 1], atol=0.05)
    alone = sheet(1).probabilities([torn])[0]
    assert alone[0] > 0.2  # alone the torn view stays torn


def test_the_more_alike_the_elevations_of_others_the_less_may_one_differ():
    def of_the_odd_one(apart: float) -> float:
        heights = 0.15 + apart * np.array([-1, 0.5, 1, -0.5, 0])
        agreed = [candidates((pose_at(0.5 * i, e, 0.0), 0.0)) for i, e in enumerate(heights)]
        odd = candidates((pose_at(1.5, 0.15, 0.0), 0.0), (pose_at(1.7, -0.06, 0.0), 0.0))
        return float(sheet(6).probabilities([*agreed, odd])[5][1])

    assert of_the_odd_one(math.radians(0.5)) < 0.5 * of_the_odd_one(math.radians(6.0))


def test_a_drawing_too_faint_for_an_outline_is_refused_by_name():
    rgba = np.zeros((40, 40, 4), np.uint8)
    rgba[10:30, 20] = (0, 0, 0, 140)
    with pytest.raises(SheetError, match=r"000\.png: too thin or faint"):
        drawn_contour(View(rgba, (0, 0, 40, 40), 0.0, "000.png"))


def test_outlines_that_put_the_faces_at_the_back_say_so():
    yaws = np.radians(np.arange(0.0, 360.0, 45.0))
    faces = FaceEvidence(4.0 * np.stack([np.cos(yaws), np.sin(yaws)], axis=1))
    sheet_with_faces = SheetPosterior(possible_turns(8), faces)
    right = [candidates((pose_at(yaw, 0.1, 0.0), 0.0)) for yaw in yaws]
    twins = [candidates((pose_at(math.pi - yaw, -0.1, 0.0), 0.0)) for yaw in yaws]
    assert sheet_with_faces.faces_contradict(right) < 0.05
    assert sheet_with_faces.faces_contradict(twins) > 0.9
    assert sheet(8).faces_contradict(twins) < 0.05
