"""Every drawing as the others predict it: errors are as large as they were made, and found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.nerf.look.painted import EYE, SKIN, depth_of, draw, geometry, ring, scene_of
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.look.build import drawings_of
from toonset.nerf.score.left_out import (
    TALL_PX,
    LeftOut,
    by_pixel,
    difference,
    predicted,
    small_camera,
)
from toonset.view import over_white


def left_out(scene: Scene, drawn: Sequence[np.ndarray] | None = None) -> list[LeftOut]:
    """Return every drawing of a perfect field as the others predict it."""
    shown = [frame.rgba for frame in scene.frames] if drawn is None else drawn
    frames = [replace(f, rgba=rgba) for f, rgba in zip(scene.frames, shown, strict=True)]
    sheet = replace(scene, frames=tuple(frames))
    drawings = drawings_of(scene, sheet, depth_of, bent=False)
    assert drawings is not None
    drawings = drawings.fitting(TALL_PX / drawings.height)
    names = [frame.name for frame in frames]
    return [
        predicted(drawings, i, geometry(small_camera(drawings, i)), frames[i], names)
        for i in range(len(frames))
    ]


def with_one(scene: Scene, number: int, rgba: np.ndarray) -> Scene:
    frames = list(scene.frames)
    frames[number] = replace(frames[number], rgba=rgba)
    return replace(scene, frames=tuple(frames))


@pytest.fixture(scope="module")
def exact() -> Scene:
    return scene_of(ring())


@pytest.fixture(scope="module")
def exact_views(exact: Scene) -> list[LeftOut]:
    return left_out(exact)


@pytest.fixture(scope="module")
def exact_off(exact_views: list[LeftOut]) -> float:
    return max(view.off for view in exact_views)


def test_exact_drawings_predict_each_other(exact_views: list[LeftOut], exact_off: float) -> None:
    assert exact_off < 0.008
    assert sorted(exact_views[1].beside) == ["000.png", "002.png"]


@pytest.mark.parametrize("share", [0.02, 0.04])
def test_a_drawing_is_off_by_as_much_as_it_was_moved(
    exact: Scene, exact_off: float, share: float
) -> None:
    """Which the outlines had set right before training: it counts as it was drawn."""
    move = share * 2 * 0.9 * exact.frames[0].camera.scale
    moved = [frame.rgba for frame in exact.frames]
    to = np.array([[1, 0, 0], [0, 1, move]])
    moved[2] = cv2.warpAffine(moved[2], to, moved[2].shape[1::-1])
    views = left_out(exact, moved)
    worst = max(views, key=lambda view: view.off)
    assert worst.name == "002.png"
    assert worst.off == pytest.approx(share, rel=0.35)
    assert all(view.off < exact_off + 0.002 for view in views if view is not worst)


def test_a_feature_that_one_drawing_lacks_is_found_and_named(
    exact: Scene, exact_off: float
) -> None:
    front = exact.frames[0].rgba.copy()
    eyes = np.abs(front[..., :3].astype(int) - EYE).sum(axis=-1) < 120
    front[cv2.dilate(eyes.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0, :3] = SKIN
    found = left_out(with_one(exact, 0, front))[0]
    assert found.off > exact_off
    assert found.place.startswith("upper")
    assert found.paint in ("peach", "skin", "beige")
    assert 0 < found.differs < 0.3


def test_the_colours_of_a_field_count_if_they_are_farther_off(exact: Scene) -> None:
    drawings = drawings_of(exact, exact, depth_of, bent=False)
    assert drawings is not None
    drawings = drawings.fitting(TALL_PX / drawings.height)
    view, names = geometry(small_camera(drawings, 0)), [frame.name for frame in exact.frames]
    black = np.zeros((*view.alpha.shape, 3), np.float32)
    plain = predicted(drawings, 0, view, exact.frames[0], names)
    assert predicted(drawings, 0, view, exact.frames[0], names, black).off > 2 * plain.off
    shown = cv2.resize(
        over_white(exact.frames[0].rgba), view.camera.size_wh, interpolation=cv2.INTER_AREA
    )
    assert predicted(drawings, 0, view, exact.frames[0], names, shown) == plain


def test_it_does_not_depend_on_how_large_drawings_are(exact: Scene) -> None:
    def off(side: int) -> float:
        cameras = [camera.resized(side / 120) for camera in ring()]
        frames = tuple(_bent(i, c) for i, c in enumerate(cameras))
        return float(np.mean([v.off for v in left_out(replace(exact, frames=frames))]))

    assert off(240) == pytest.approx(off(120), rel=0.15)


def _bent(number: int, camera: Camera) -> Frame:
    """Return a drawing in which every other one is 4 % wider and lower."""
    change = 1.04 ** (1 if number % 2 else -1)
    wider = replace(camera, scale=camera.scale * change)
    return Frame(f"{number}", camera, draw(wider))


def test_two_measures_of_a_move_by_a_pixel_agree(exact: Scene) -> None:
    drawn = over_white(exact.frames[0].rgba)
    right = np.roll(drawn, 1, axis=1)
    assert float(difference(right, drawn).sum()) == pytest.approx(by_pixel(drawn), rel=0.25)
    assert by_pixel(np.ones_like(drawn)) == 0
