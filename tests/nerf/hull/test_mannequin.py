"""The mannequin as the character's shape: when it is, what it encloses, what cameras see of it."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
import trimesh

from tests.nerf.bodies import Hand, body, camera_at, depths, moved, own_shape, ring, sheet
from toonset.errors import MeshError
from toonset.mesh import Mesh
from toonset.nerf.hull import mannequin_shape
from toonset.nerf.hull.mannequin_fit import MannequinFit, mannequin_fit
from toonset.nerf.hull.mannequin_shape import FINER, shape_of
from toonset.nerf.hull.mannequin_volume import hull_of_shape


def test_a_shape_is_the_mesh_to_a_quarter_of_a_pixel() -> None:
    mesh = body()
    shape = shape_of(mesh, ring())
    assert len(shape.faces) == len(mesh.faces)
    a, b = (
        np.sort(v[f].reshape(-1, 3), axis=0)
        for v, f in ((mesh.vertices, mesh.faces), (shape.vertices, shape.faces))
    )
    assert np.abs(a - b).max() <= 0.5 * shape.step + 1e-9
    assert shape.step * ring()[0].scale == pytest.approx(0.25)


def test_what_no_picture_holds_is_left_out() -> None:
    below = moved(body(arm=False), (0, -30, 0))
    mesh = body()
    both = Mesh(
        np.concatenate([mesh.vertices, below.vertices]),
        np.concatenate([mesh.faces, below.faces + len(mesh.vertices)]),
    )
    assert len(shape_of(both, ring()).faces) == len(mesh.faces)
    with pytest.raises(MeshError, match="none of the pictures"):
        shape_of(below, ring())
    with pytest.raises(MeshError, match="smaller than a pixel"):  # a mesh in other units
        shape_of(replace(mesh, vertices=mesh.vertices / 1000), ring())


def test_fine_meshes_get_a_coarser_grid(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mannequin_shape, "MOST_FACES", 1000)
    shape = shape_of(body(), ring())
    assert 100 < len(shape.faces) <= 1000
    seen, exact = shape.seen(camera_at(0.3)), depths(body(), camera_at(0.3))
    assert ((seen.alpha > 0.5) ^ np.isfinite(exact)).mean() < 0.03


@pytest.mark.parametrize("k", [0.0, 0.2])
def test_a_camera_sees_its_outline_between_pixels_and_its_depth_at_them(k: float) -> None:
    camera, mesh = replace(camera_at(0.4), k=k), body()
    sight = shape_of(mesh, [camera]).seen(camera, normals=True)
    exact = depths(mesh, camera)
    both = np.isfinite(exact) & np.isfinite(sight.depth)
    assert both.sum() > 0.99 * np.isfinite(exact).sum()
    assert np.median(np.abs(sight.depth - exact)[both]) < 0.005
    finer = np.isfinite(depths(mesh, camera.resized(FINER)))
    assert sight.alpha.sum() == pytest.approx(finer.sum() / FINER**2, rel=0.01)
    assert np.all(sight.normal[both][:, 2] <= 1e-6)


@pytest.mark.parametrize("holes", [False, True])
def test_the_hull_encloses_what_the_surface_does(holes: bool) -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    faces = ball.faces[:-3] if holes else ball.faces
    shape = shape_of(Mesh(np.array(ball.vertices) * 0.5, np.array(faces)), ring())
    hull = hull_of_shape(shape, 0.02)
    outer = 0.5 + 0.5 * hull.voxel  # what the surface touches is inside
    assert float(hull.inside.sum()) * 0.02**3 == pytest.approx(4 / 3 * np.pi * outer**3, rel=0.02)


def test_a_sheet_without_thickness_is_there() -> None:
    square = Mesh(
        np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0.0]]),
        np.array([[0, 1, 2], [0, 2, 3]]),
    )
    hull = hull_of_shape(shape_of(square, ring()), 0.02)
    assert hull.inside.any(dim=2).sum() > 0.95 * 50 * 50
    assert float(hull.support.max()) > 0.55


@pytest.mark.parametrize("bend", [0.0, 0.008])
def test_the_drawn_body_is_recognised(bend: float) -> None:
    scene = sheet(body(), Hand(bend=bend))
    fit = mannequin_fit(scene, own_shape())
    assert fit is not None
    assert fit.chosen
    assert fit.drawings is not None
    assert fit.mannequin < 0.8 * fit.drawings


@pytest.mark.parametrize("other", [body(scale=1.3), body(arm=False), moved(body(), (0.15, 0, 0))])
def test_another_body_is_not(other: Mesh) -> None:
    fit = mannequin_fit(sheet(body(), Hand(bend=0.008)), shape_of(other, ring()))
    assert fit is not None
    assert not fit.chosen


def test_a_hull_that_predicts_better_wins() -> None:
    assert MannequinFit(0.010, 0.012).chosen
    assert not MannequinFit(0.012, 0.010).chosen
    assert not MannequinFit(0.03, 0.05).chosen  # both are far off
    assert not MannequinFit(0.010, 0.012, left=0.02).chosen  # a part is missing


def test_outlines_outside_of_the_shape_are_seen_there() -> None:
    shape, camera = own_shape(), camera_at(0.4)
    beyond = replace(shape, beyond=2 / camera.scale)
    inner, outer = shape.seen(camera), beyond.seen(camera)
    away = cv2.distanceTransform((inner.alpha < 0.5).astype(np.uint8), cv2.DIST_L2, 5)
    assert np.all(outer.alpha[away <= 1.5] > 0.5)
    assert np.all(outer.alpha[away >= 3.5] == 0)
    both = np.isfinite(inner.depth)
    np.testing.assert_array_equal(outer.depth[both], inner.depth[both])
    for one, sight in ((shape, inner), (beyond, outer)):
        rows, columns = one.box(camera) or (slice(0), slice(0))
        assert sight.alpha[rows, columns].sum() == pytest.approx(sight.alpha.sum(), rel=1e-6)
    assert shape.box(camera.moved((10_000, 0), (50, 50))) is None
    wider = hull_of_shape(beyond, 0.02).inside.sum() / hull_of_shape(shape, 0.02).inside.sum()
    assert 1.05 < float(wider) < 1.25


def test_two_drawings_and_unseen_mannequins_say_nothing() -> None:
    assert mannequin_fit(sheet(body(), views=2), own_shape()) is None
    cut = [
        replace(f, camera=f.camera.moved((400, 0), f.camera.size_wh)) for f in sheet(body()).frames
    ]
    assert mannequin_fit(replace(sheet(body()), frames=tuple(cut)), own_shape()) is None


def test_a_speck_among_the_drawings_is_no_outline() -> None:
    scene = sheet(body())
    speck = np.zeros_like(scene.frames[0].rgba)
    speck[74:77, 74:77] = 255
    frames = (replace(scene.frames[0], rgba=speck), *scene.frames[1:])
    fit = mannequin_fit(replace(scene, frames=frames), own_shape())
    assert fit is not None
    assert np.isfinite([fit.mannequin, fit.drawings or 0.0]).all()


def test_faces_partly_in_the_picture_are_kept() -> None:
    """Long thin faces whose middles lie outside."""
    tube = trimesh.creation.cylinder(radius=0.4, height=20, sections=24)
    mesh = Mesh(np.array(tube.vertices)[:, [0, 2, 1]], np.array(tube.faces))
    camera = camera_at(0.2)
    exact = depths(mesh, camera)
    seen = shape_of(mesh, [camera]).seen(camera).depth
    both = np.isfinite(exact) & np.isfinite(seen)
    assert both.sum() > 0.99 * np.isfinite(exact).sum()
    assert np.abs(seen - exact)[both].max() < 0.03


def test_very_fine_meshes_keep_their_place() -> None:
    ball = trimesh.creation.icosphere(subdivisions=6)
    mesh = Mesh(np.array(ball.vertices) * 0.9, np.array(ball.faces))
    camera = camera_at(0.3, 800)
    shape = shape_of(mesh, [camera])
    assert len(shape.faces) <= 40_000
    exact, seen = depths(mesh, camera), shape.seen(camera).depth
    assert (np.isfinite(exact) ^ np.isfinite(seen)).sum() < 400
    both = np.isfinite(exact) & np.isfinite(seen)
    assert np.sqrt(np.mean((exact - seen)[both] ** 2)) * camera.scale < 0.5
