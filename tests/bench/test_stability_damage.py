"""What goes wrong with a drawing keeps its truth: the camera still sees what is drawn."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from bench.stability.damage import (
    MIRROR,
    mirrored,
    padded,
    rolled,
    stretched,
    with_capsule,
    with_gaps_closed,
    without_feet,
    without_pieces,
)
from bench.stability.draws import LOSSLESS, blurred, compressed
from bench.stability.sheet import BASE, DrawnSheet, draw_sheet
from toonset.calib.outline.occluding_contour import silhouette_mask
from toonset.camera import Camera
from toonset.mesh import Mesh
from toonset.view import View

PLAIN = replace(BASE, outline_px=0, cell_px=120, views=3)


@pytest.fixture(scope="module")
def sheet():
    return draw_sheet(3, PLAIN)


def overlap(view, camera, mesh: Mesh) -> float:
    """Return intersection over union of the drawing and the mesh seen by the camera."""
    pixels, _, _ = camera.project(mesh.vertices)
    faces = np.ascontiguousarray(mesh.faces, dtype=np.int32)
    seen = silhouette_mask(pixels, faces, camera.size_wh) > 0
    assert seen.shape == view.mask.shape
    return float((seen & view.mask).sum() / (seen | view.mask).sum())


def test_padding_and_rolling_keep_the_camera_true(sheet: DrawnSheet):
    for drawn in sheet.drawings:
        plain = overlap(*drawn, sheet.mesh)
        assert plain > 0.97
        assert overlap(*padded(*drawn, 17), sheet.mesh) == plain
        for roll in (-0.3, 0.5):
            turned = rolled(*drawn, roll)
            assert overlap(*turned, sheet.mesh) > 0.96
            _, elevation, angle = turned[1].angles
            np.testing.assert_allclose([elevation, angle], [drawn[1].angles[1], roll], atol=1e-9)


def test_rolling_there_and_back_returns_the_camera(sheet):
    view, camera = sheet.drawings[0]
    back_view, back = rolled(*rolled(view, camera, 0.2), -0.2)
    np.testing.assert_allclose(back.rotation, camera.rotation, atol=1e-12)
    grown = (np.array(back.size_wh) - camera.size_wh) / 2
    np.testing.assert_allclose(back.center - grown, camera.center, atol=1e-9)
    dx, dy = grown.astype(int)
    inner = back_view.mask[dy : dy + camera.size_wh[1], dx : dx + camera.size_wh[0]]
    assert (inner == view.mask).mean() > 0.99


def test_a_mirrored_drawing_is_the_mirrored_body(sheet: DrawnSheet):
    other = replace(sheet.mesh, vertices=sheet.mesh.vertices @ MIRROR, faces=sheet.mesh.faces)
    for drawn in sheet.drawings:
        view, camera = mirrored(*drawn)
        assert overlap(view, camera, other) > 0.97
        assert np.linalg.det(camera.rotation) == pytest.approx(1)
        again, back = mirrored(view, camera)
        np.testing.assert_array_equal(again.rgba, drawn[0].rgba)
        np.testing.assert_allclose(back.rotation, drawn[1].rotation)


def test_cropping_takes_the_lowest_rows_and_nothing_else(sheet):
    view, camera = sheet.drawings[1]
    cut, cropped = without_feet(view, camera, 0.25)
    rows, left = (np.flatnonzero(v.mask.any(axis=1)) for v in (view, cut))
    assert cropped.size_wh == cut.rgba.shape[1::-1]
    points = np.random.default_rng(0).normal(size=(5, 3))
    np.testing.assert_array_equal(cropped.project(points)[0], camera.project(points)[0])
    assert left[-1] == len(cut.rgba) - 1  # the picture's edge cuts the figure
    assert len(left) == pytest.approx(0.75 * len(rows), abs=1)
    np.testing.assert_array_equal(cut.rgba[: left[-1] + 1], view.rgba[: left[-1] + 1])
    assert without_feet(view, camera, 0)[0] is view


def test_missing_pieces_reach_their_share_and_grow_from_step_to_step(sheet):
    view, camera = sheet.drawings[0]
    before, kept = view.mask.sum(), [view.mask]
    for share in (0.0, 0.1, 0.4, 0.9):
        less, _ = without_pieces(view, camera, share, np.random.default_rng(1))
        gone = 1 - less.mask.sum() / before
        assert share <= gone < share + 0.1
        assert not (less.mask & ~kept[-1]).any()
        kept.append(less.mask)
    parts, _ = cv2.connectedComponents(kept[-1].astype(np.uint8))
    assert parts > 2  # background and at least two fragments


def test_a_ball_covers_its_disc_where_the_camera_sees_it(sheet):
    view, camera = sheet.drawings[0]
    top = sheet.mesh.vertices[sheet.mesh.vertices[:, 1].argmax()]
    radius = 0.3
    hairy, shown = with_capsule(view, camera, np.stack([top, top]), radius, (10, 20, 30))
    at, _, _ = shown.project(top[None])
    away = np.linalg.norm(shown.pixel_grid() - at[0], axis=-1)
    assert hairy.mask[away < radius * camera.scale - 0.5].all()
    own, _ = padded(view, camera, (hairy.mask.shape[0] - view.mask.shape[0]) // 2)
    outside = away > radius * camera.scale + 0.5
    np.testing.assert_array_equal(hairy.mask[outside], own.mask[outside])
    assert (hairy.rgba[away < 3, :3] == (10, 20, 30)).all()


def test_no_radius_is_no_ball(sheet):
    view, camera = sheet.drawings[0]
    same, _ = with_capsule(view, camera, np.zeros((2, 3)), 0.0, (0, 0, 0))
    assert same is view


@pytest.mark.parametrize("growth", [-0.2, 0.3])
def test_a_stretched_drawing_is_seen_by_pixels_that_are_as_tall(growth):
    sheet = draw_sheet(3, replace(BASE, outline_px=0, cell_px=120, views=1))
    view, camera = stretched(*sheet.drawings[0], growth)
    assert camera.pixel_aspect == pytest.approx((1 + growth) ** 2, rel=0.02)
    assert overlap(view, camera, sheet.mesh) > 0.95


def test_only_gaps_narrower_than_their_share_are_painted_shut():
    rgba = np.zeros((100, 60, 4), np.uint8)
    rgba[10:90, 5:15] = rgba[10:90, 19:29] = rgba[10:90, 45:55] = (200, 40, 40, 255)
    view = View(rgba, (0, 0, 60, 100), 0.0, "x.png")
    camera = Camera.looking_at(np.zeros(3), 0.0, 0.0, 1.0, (60, 100))
    assert with_gaps_closed(view, camera, 0.0)[0] is view
    closed = with_gaps_closed(view, camera, 0.1)[0]
    assert (closed.rgba[30:70, 5:29] == (200, 40, 40, 255)).all()  # 4 px between the first two
    assert not closed.mask[:, 30:44].any()
    assert not closed.mask[:9].any()  # nothing grows beyond the figure
    assert not closed.mask[91:].any()


def test_cut_out_of_a_sheet_drawings_keep_their_cameras():
    for sheet in (compressed(LOSSLESS, 1), compressed(30, 1), blurred(1, 1)):
        for view, camera in sheet.drawings:
            assert overlap(view, camera, sheet.mesh) > 0.85  # lines and blur make them larger
