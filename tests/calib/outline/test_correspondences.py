"""Outlines and matching: the fast ways equal the plain ones."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from toonset.calib.fit.align import align, align_all, measure
from toonset.calib.outline.correspondences import Drawing, Table, match, nearest
from toonset.calib.outline.mesh_edges import Surface, prepare_surface
from toonset.calib.outline.occluding_contour import find_occluding_contour, occluding_contour_at
from toonset.calib.outline.pose import Pose, project
from toonset.camera import rotation_distance, rotation_from_angles
from toonset.dataset.mesh.rasterize import silhouette_mask
from toonset.dataset.silhouettes.contour import drawn_contour
from toonset.errors import MeshError
from toonset.mesh import Mesh
from toonset.view import View

SIZE = (150, 140)


def ball() -> Mesh:
    shape = trimesh.creation.icosphere(subdivisions=3)
    return Mesh(np.array(shape.vertices) * [1.0, 1.4, 0.6], np.array(shape.faces))


def open_soup(seed: int) -> Mesh:
    """Return triangles that share vertices at random: borders, fins, mixed winding."""
    rng = np.random.default_rng(seed)
    faces = np.array([rng.choice(30, 3, replace=False) for _ in range(60)])
    return Mesh(rng.uniform(-1, 1, (30, 3)), faces)


def pose_at(seed: int, k: float = 0.0) -> Pose:
    rng = np.random.default_rng(seed)
    rotation = rotation_from_angles(*rng.uniform(-1, 1, 3) * [3, 0.8, 0.2])
    return Pose(rotation, np.array([75.0, 70.0]) + rng.uniform(-9, 9, 2), rng.uniform(20, 60), k)


def covered_by_folds(surface: Surface, pixels: np.ndarray) -> np.ndarray:
    from toonset.calib.outline.covered_pixels import covered
    from toonset.calib.outline.mesh_edges import folds_of

    a, b, c = (pixels[surface.faces[:, i]] for i in range(3))
    turned = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] > 0
    folds, layers = folds_of(surface, turned)
    edges = surface.edges[folds]
    return covered(pixels[edges[:, 0]], pixels[edges[:, 1]], layers, SIZE)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("shape", ["ball", "triangles"])
def test_folds_cover_what_the_triangles_cover(shape, seed):
    surface = prepare_surface(ball() if shape == "ball" else open_soup(seed))
    pixels = project(pose_at(seed, k=0.2), surface.vertices)  # parts leave the picture
    plain = silhouette_mask(pixels, surface.faces, SIZE)
    # a pixel centre within single precision of an edge may go either way
    assert (covered_by_folds(surface, pixels) != plain).sum() <= 2
    assert plain.any()


@pytest.mark.parametrize("seed", range(4))
def test_more_than_two_faces_at_an_edge_are_all_counted(seed):
    spine = [[0, -1, 0], [0, 1, 0]]
    tips = [[np.cos(a), 0, np.sin(a)] for a in np.arange(5) * 2 * np.pi / 5]
    fan = Mesh(np.array(spine + tips, dtype=float), np.array([[0, 1, i] for i in range(2, 7)]))
    surface = prepare_surface(fan)
    pixels = project(pose_at(seed), surface.vertices)
    plain = silhouette_mask(pixels, surface.faces, SIZE)
    assert (covered_by_folds(surface, pixels) != plain).sum() <= 2


@pytest.mark.parametrize("k", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(3))
def test_rim_from_planes_equals_rim_from_pixels(seed, k):
    surface, pose = prepare_surface(ball()), pose_at(seed, k)
    fast = occluding_contour_at(surface, pose, SIZE, 1.0)
    plain = find_occluding_contour(surface, project(pose, surface.vertices), SIZE, 1.0)
    np.testing.assert_allclose(fast.points, plain.points)
    np.testing.assert_allclose(fast.normals, plain.normals)
    np.testing.assert_allclose(np.linalg.norm(fast.normals, axis=1), 1)
    assert len(fast.points) > 50


def test_a_mesh_turned_inside_out_has_the_same_rim():
    mesh, pose = ball(), pose_at(1)
    inside_out = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    fast = occluding_contour_at(prepare_surface(mesh), pose, SIZE, 1.0)
    other = occluding_contour_at(prepare_surface(inside_out), pose, SIZE, 1.0)
    np.testing.assert_allclose(fast.points, other.points)
    np.testing.assert_allclose(fast.normals, other.normals)


@pytest.mark.parametrize("sizes", [(1, 1), (1, 300), (63, 64), (65, 200), (400, 430)])
def test_nearest_equals_a_search_tree(sizes):
    rng = np.random.default_rng(sum(sizes))
    spread = [300, 300, 15, 15]
    a, b = (rng.uniform(size=(n, 4)) * spread for n in sizes)
    far = np.linalg.norm(a - b[nearest(Table(a), Table(b))], axis=1)
    np.testing.assert_allclose(far, KDTree(b).query(a)[0], atol=1e-2)


def drawing_of(mesh: Mesh, pose: Pose) -> Drawing:
    mask = silhouette_mask(project(pose, prepare_surface(mesh).vertices), mesh.faces, SIZE)
    rgba = np.zeros((SIZE[1], SIZE[0], 4), np.uint8)
    rgba[..., 3] = 255 * mask
    return Drawing(drawn_contour(View(rgba, (0, 0, *SIZE), 0.0, "000.png")), 100, 160)


def test_matches_of_a_drawing_with_itself_are_close_on_both_sides():
    pose, surface = pose_at(5), prepare_surface(ball())
    drawing = drawing_of(ball(), pose)
    matches = match(drawing, surface, drawing.pose_in(pose))
    assert matches.drawn == len(drawing.points)
    assert np.median(matches.distances) < 1.0
    off = project(drawing.pose_in(pose), matches.points) - matches.targets
    assert np.median(np.abs((off * matches.normals).sum(axis=1))) < 0.3


WIDTHS = np.geomspace(0.06, 0.01, 8)


def test_an_outline_drawn_outside_meets_the_body_once_it_is_moved_in():
    surface, pose = prepare_surface(ball()), pose_at(3)
    drawing = drawing_of(ball(), pose)
    outside = drawing.inset(-0.03)
    off = [measure(d, surface, d.pose_in(pose)).error for d in (drawing, outside)]
    assert off[1] == pytest.approx(0.03, abs=0.004)
    back = outside.inset(0.03)
    np.testing.assert_allclose(back.points, drawing.points)
    assert measure(back, surface, back.pose_in(pose)).error == pytest.approx(off[0], rel=1e-3)


def test_starts_that_meet_end_as_one_where_each_would_alone():
    truth, surface = pose_at(5), prepare_surface(ball())
    drawing = drawing_of(ball(), truth)
    turned = truth.moved(np.array([0.05, 0.04, 0.0, 1.0, 0.0, 0.0]))
    starts = [turned, replace(truth, scale=1.05 * truth.scale)]
    together = align_all(drawing, surface, starts, WIDTHS)
    assert len(together) == 1
    for start in starts:
        alone = align(drawing, surface, start, WIDTHS)
        assert rotation_distance(alone.pose.rotation, together[0].pose.rotation) < 0.02


def test_views_in_threads_equal_views_in_a_row_bit_for_bit():
    surface = prepare_surface(ball())
    poses = [pose_at(seed) for seed in range(4)]
    drawings = [drawing_of(ball(), pose) for pose in poses]

    def fit(i: int) -> bytes:
        found = align_all(drawings[i], surface, [poses[i], poses[i].twin()], WIDTHS)
        return b"".join(f.pose.rotation.tobytes() + f.pose.shift.tobytes() for f in found)

    with ThreadPoolExecutor(2) as pool:
        threaded = list(pool.map(fit, range(4)))
    assert threaded == [fit(i) for i in range(4)]


def test_a_figure_outside_of_the_picture_is_far_from_everything():
    drawing = drawing_of(ball(), pose_at(5))
    away = Pose(np.eye(3), np.array([-1e4, 0.0]), 40.0)
    matches = match(drawing, prepare_surface(ball()), away)
    assert (matches.distances == drawing.height).all()
    assert matches.drawn == len(matches.points) == len(drawing.points)


def test_other_vertices_on_the_same_edges_have_planes_of_their_own():
    surface, pose = prepare_surface(ball()), pose_at(2)
    assert len(occluding_contour_at(surface, pose, SIZE, 1.0).points)  # the planes are there
    flat = replace(surface, vertices=surface.vertices * [1.0, 1.0, 0.1])
    plain = find_occluding_contour(flat, project(pose, flat.vertices), SIZE, 1.0)
    np.testing.assert_allclose(occluding_contour_at(flat, pose, SIZE, 1.0).points, plain.points)


def test_a_heap_of_triangles_is_no_surface():
    corners = np.random.default_rng(0).uniform(-1, 1, (3 * 900, 3))
    heap = Mesh(corners, np.arange(len(corners)).reshape(-1, 3))
    with pytest.raises(MeshError, match="a heap of triangles; export a surface"):
        prepare_surface(heap)
