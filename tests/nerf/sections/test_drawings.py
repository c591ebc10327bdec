"""Working drawings, their roles and their merging."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.nerf.sections.test_shape import BODY, drawn, sheet
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame
from toonset.nerf.sections.drawing import TALL, Drawing, mirrored, sample, working_drawings
from toonset.nerf.sections.merge import merged
from toonset.nerf.sections.roles import mirror_images, roles_of, wants_sections

PLACES = np.array([[0.1, 1.2, 0.0], [0.6, 0.2, 0.0], [0.1, -0.5, 0.3]], np.float32)


def disc(middle: tuple[float, float], radius: float, yaw: float = 0.0, side: int = 120) -> Drawing:
    """Return a drawing of a disc, in pixels."""
    camera = Camera.looking_at(np.zeros(3), yaw, 0.0, 1.0, (side, side))
    away = np.linalg.norm(camera.pixel_grid() - middle, axis=-1)
    alpha = np.clip(radius + 0.5 - away, 0, 1).astype(np.float32)
    return Drawing(camera, np.dstack([np.full((side, side, 3), 0.5, np.float32), alpha]))


@pytest.mark.parametrize(("elevation", "k", "side"), [(0, 0, 80), (0.1, 0.1, 61), (0, 0.2, 700)])
def test_working_drawings_are_what_their_cameras_say(elevation: float, k: float, side: int) -> None:
    """Where a point appears in the drawing as given, it appears in the working one."""
    frames = []
    for yaw in (0.0, 1.5):
        camera = Camera.looking_at(
            np.array([0.3, 0.1, 0.0]), yaw, elevation, side / 3, (side, side), k=k
        )
        ramp = camera.pixel_grid() / side
        rgba = np.zeros((side, side, 4), np.uint8)
        rgba[..., :2] = np.rint(255 * ramp)
        rgba[side // 10 : -side // 10, side // 5 : -side // 5, 3] = 255
        frames.append(Frame("", camera, rgba))
    drawings, per_px = working_drawings(frames)
    for frame, drawing in zip(frames, drawings, strict=True):
        pixels = drawing.pixels(PLACES)
        np.testing.assert_allclose(pixels, drawing.camera.project(PLACES)[0], atol=1e-2)
        color = np.stack([sample(drawing.rgba[..., i], pixels) for i in range(2)], axis=-1)
        inside = sample(drawing.rgba[..., 3], pixels) > 0.999
        place = frame.camera.project(PLACES)[0] / side
        np.testing.assert_allclose(color[inside], place[inside], atol=1.5 / side + 1 / 255)
        assert drawing.camera.scale * per_px == pytest.approx(1)
    rows = [np.flatnonzero(drawing.mask.any(axis=1)) for drawing in drawings]
    assert max(row[-1] - row[0] + 1 for row in rows) == pytest.approx(TALL, abs=1)


def test_a_row_shows_one_height_in_all_drawings() -> None:
    drawings, _ = working_drawings([drawn(0, [BODY]), drawn(90, [BODY], side=133)])
    rows = [drawing.pixels(PLACES[:1])[0, 1] for drawing in drawings]
    assert rows[0] == pytest.approx(rows[1], abs=1)
    assert len({len(drawing.mask) for drawing in drawings}) == 1


def test_mirroring_twice_changes_nothing() -> None:
    drawing = disc((40, 60), 20, yaw=0.7)
    there = mirrored(drawing, 3.0)
    points = np.array([[1.0, 5.0, 2.0], [9.0, -5.0, 7.0]], np.float32)
    image = points * [-1, 1, 1] + [6, 0, 0]
    distances = there.distance_at(image.astype(np.float32))
    np.testing.assert_allclose(distances, drawing.distance_at(points), atol=1e-3)
    back = mirrored(there, 3.0)
    np.testing.assert_allclose(back.camera.target, drawing.camera.target)
    np.testing.assert_array_equal(back.rgba, drawing.rgba)


def test_roles() -> None:
    drawings, _ = working_drawings(sheet((181, 3, 88, 44, -90), [BODY]))
    roles = roles_of(drawings)
    assert [round(math.degrees(d.yaw)) for d in roles.facing] == [3, -179]
    assert [round(math.degrees(d.yaw)) for d in roles.aside] in ([-90, 88], [88, -90])
    images = mirror_images(roles.between, drawings, 0.0)
    assert [round(math.degrees(d.yaw)) for d in images] == [-44]
    more, _ = working_drawings(sheet((0, 44, 90, 136, 180), [BODY]))
    assert not mirror_images(roles_of(more).between, more, 0.0)


@pytest.mark.parametrize(
    ("yaws", "elevation", "wanted"),
    [
        ((0, 90, 180), 0, True),
        ((0, 45, 90, 180), 5, True),
        ((0, 180), 0, True),
        ((0, 45, 90, 135, 180), 0, True),
        ((0, 72, 144, 216, 288), 0, False),
        ((0, 90, 180), 20, False),
        (range(0, 360, 45), 0, False),
    ],
)
def test_few_outlines_at_eye_level_want_sections(
    yaws: tuple[int, ...], elevation: float, *, wanted: bool
) -> None:
    angles = [(math.radians(yaw), math.radians(elevation)) for yaw in yaws]
    cameras = [Camera.looking_at(np.zeros(3), *angle, 1.0, (9, 9)) for angle in angles]
    assert wants_sections(cameras) == wanted


def middle_of(drawing: Drawing) -> np.ndarray:
    return np.argwhere(drawing.mask).mean(axis=0)[::-1] + 0.5


def test_drawings_meet_half_way() -> None:
    """The back drawing is seen through: what lies left in it lies right in the front one."""
    pair = merged(disc((58, 60), 30), disc((54, 60), 30, yaw=math.pi))
    assert 4 < pair.bend_px < 10
    np.testing.assert_allclose(middle_of(pair.first), (62, 60), atol=0.7)
    np.testing.assert_allclose(middle_of(pair.second), (58, 60), atol=0.7)


def test_like_drawings_stay_and_unlike_poses_are_not_merged() -> None:
    front, back = disc((60, 60), 30), disc((60, 60), 30, yaw=math.pi)
    pair = merged(front, back)
    assert pair.bend_px < 0.2
    assert np.abs(pair.first.rgba[..., 3] - front.rgba[..., 3]).max() < 0.1
    left = disc((45, 60), 30)
    far = merged(left, disc((45, 60), 30, yaw=math.pi))
    assert far.bend_px > 12
    assert far.first is left
