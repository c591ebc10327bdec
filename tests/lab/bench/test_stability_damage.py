"""What goes wrong with drawings, bodies and cameras keeps its truth, and is as large as said."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from lab.bench.stability import scenes
from lab.bench.stability.bodies import with_arms_raised, with_head_grown
from lab.bench.stability.damage import (
    MIRROR,
    mirrored,
    padded,
    stretched,
    with_ball,
    without_pieces,
)
from lab.bench.stability.fields import TRAINING
from lab.bench.stability.pages import PAGES
from lab.bench.stability.scenes import draw_scene
from lab.bench.stability.sheets import DrawnSheet, draw_sheet
from toonset.dataset.mesh.rasterize import silhouette_mask
from toonset.mesh import Mesh

PLAIN: dict[str, Any] = {"outline_px": 0, "cell_px": 120, "views": 3}
PAGE = {page.name: page for page in PAGES}


@pytest.fixture(scope="module")
def sheet():
    return draw_sheet(3, **PLAIN)


def overlap(view, camera, mesh: Mesh) -> float:
    """Return intersection over union of the drawing and the mesh seen by the camera."""
    pixels, _, _ = camera.project(mesh.vertices)
    faces = np.ascontiguousarray(mesh.faces, dtype=np.int32)
    seen = silhouette_mask(pixels, faces, camera.size_wh) > 0
    assert seen.shape == view.mask.shape
    return float((seen & view.mask).sum() / (seen | view.mask).sum())


def test_padding_keeps_the_camera_and_a_mirrored_drawing_is_the_mirrored_body(sheet: DrawnSheet):
    other = replace(sheet.mesh, vertices=sheet.mesh.vertices @ MIRROR, faces=sheet.mesh.faces)
    for drawn in sheet.drawings:
        plain = overlap(*drawn, sheet.mesh)
        assert plain > 0.97
        assert overlap(*padded(*drawn, 17), sheet.mesh) == plain
        view, camera = mirrored(*drawn)
        assert overlap(view, camera, other) > 0.97
        assert np.linalg.det(camera.rotation) == pytest.approx(1)
        again, back = mirrored(view, camera)
        np.testing.assert_array_equal(again.rgba, drawn[0].rgba)
        np.testing.assert_allclose(back.rotation, drawn[1].rotation)


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
    hairy, shown = with_ball(view, camera, top, radius, (10, 20, 30))
    at, _, _ = shown.project(top[None])
    away = np.linalg.norm(shown.pixel_grid() - at[0], axis=-1)
    assert hairy.mask[away < radius * camera.scale - 0.5].all()
    own, _ = padded(view, camera, (hairy.mask.shape[0] - view.mask.shape[0]) // 2)
    outside = away > radius * camera.scale + 0.5
    np.testing.assert_array_equal(hairy.mask[outside], own.mask[outside])
    assert (hairy.rgba[away < 3, :3] == (10, 20, 30)).all()


@pytest.mark.parametrize("growth", [-0.2, 0.3])
def test_a_stretched_drawing_is_seen_by_pixels_that_are_as_tall(growth):
    sheet = draw_sheet(3, outline_px=0, cell_px=120, views=1)
    view, camera = stretched(*sheet.drawings[0], growth)
    assert camera.pixel_aspect == pytest.approx((1 + growth) ** 2, rel=0.02)
    assert overlap(view, camera, sheet.mesh) > 0.95


def part(body: Mesh, name: str) -> np.ndarray:
    assert body.face_parts is not None
    number = body.part_names.index(name)
    return body.vertices[np.unique(body.faces[body.face_parts == number])]


def test_arms_rise_heads_grow_and_nothing_else_does() -> None:
    body = random_body(4)
    up, large = with_arms_raised(body, math.radians(30)), with_head_grown(body, 0.5)
    for name, side in (("left arm", 1), ("right arm", -1)):
        hands = [p[(side * p[:, 0]).argmax()] for p in (part(body, name), part(up, name))]
        assert side * (hands[1] - hands[0])[0] > 0
        assert (hands[1] - hands[0])[1] > 0
    for name in ("head", "nose", "hair"):
        sizes = [np.ptp(part(b, name), axis=0) for b in (body, large)]
        np.testing.assert_allclose(sizes[1], 1.5 * sizes[0])
    np.testing.assert_array_equal(part(up, "trunk"), part(body, "trunk"))
    np.testing.assert_array_equal(part(large, "left leg"), part(body, "left leg"))


# ---- scenes


def cameras(scene):
    return [frame.camera for frame in scene.train.frames]


def test_errors_of_cameras_are_as_large_as_said_and_none_of_the_body(monkeypatch):
    monkeypatch.setattr(scenes, "HELD_OUT", 2)
    true = cameras(draw_scene(5))
    turned = PAGE["train yaw"].draw(10, 5).train.frames
    yaws = [(a.camera.angles[0], b.angles[0]) for a, b in zip(turned, true, strict=True)]
    off = [math.remainder(a - b, math.tau) for a, b in yaws]
    np.testing.assert_allclose(np.abs(off), math.radians(10))
    assert sum(off) == pytest.approx(0, abs=1e-9)
    pairs = list(zip(cameras(PAGE["train scale"].draw(5, 5)), true, strict=True))
    sizes = [math.log(a.scale / b.scale) for a, b in pairs]
    np.testing.assert_allclose(np.abs(sizes), math.log(1.05))
    assert sum(sizes) == pytest.approx(0, abs=1e-9)
    pairs = list(zip(cameras(PAGE["train shift"].draw(2, 5)), true, strict=True))
    moves = [a.center - b.center for a, b in pairs]
    assert math.sqrt(np.square(moves).sum() / len(moves)) == pytest.approx(0.02 * 80)
    of_body = np.concatenate([camera.rotation[:2] for camera in true])
    np.testing.assert_allclose(of_body.T @ np.concatenate(moves), 0, atol=1e-9)


def test_the_base_step_of_a_page_is_the_base_scene(monkeypatch):
    small = replace(scenes.SCENE, cell_px=32, supersample=1)
    monkeypatch.setattr(scenes, "SCENE", small)
    monkeypatch.setattr(scenes, "HELD_OUT", 2)
    base = draw_scene(1)
    for page in PAGE.values():
        if page.kind is TRAINING and page.base is not None:
            of_size = page.name == "train resolution"
            drawn = page.draw(small.cell_px if of_size else page.base, 1)
            for a, b in zip(drawn.train.frames, base.train.frames, strict=True):
                np.testing.assert_array_equal(a.rgba, b.rgba, err_msg=page.name)
                np.testing.assert_allclose(a.camera.center, b.camera.center)
