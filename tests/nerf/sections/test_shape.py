"""From few drawings of ellipsoids to their shape."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from tests.nerf.ellipsoids import Parts, first_hit
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame
from toonset.errors import BundleError
from toonset.nerf.sections.drawing import working_drawings
from toonset.nerf.sections.grid import VOXEL_PX, Solid, silhouette
from toonset.nerf.sections.shape import shape_of

SIDE, FINE = 80, 3
FRONT, DIAGONAL, LEFT, BACK = 0.0, 45.0, 90.0, 180.0
BODY = ((0.1, 0.2, 0.0), (0.5, 1.0, 0.35))
ARM = ((0.95, 0.3, 0.0), (0.15, 0.5, 0.15))


def drawn(
    yaw_deg: float, parts: Parts, side: int = SIDE, unit: float = 1.0, elevation: float = 0.0
) -> Frame:
    """Return a drawing of ellipsoids without distance, `side` pixels high."""
    yaw, middle = math.radians(yaw_deg), np.array([0.0, 0.2, 0.0])
    camera = Camera.looking_at(middle, yaw, math.radians(elevation), side / 2.8, (side, side))
    which, _ = first_hit(camera.resized(FINE), parts)
    cover = (which >= 0).reshape(side, FINE, side, FINE).mean(axis=(1, 3))
    rgba = np.full((side, side, 4), 200, np.uint8)
    rgba[..., 3] = np.rint(255 * cover)
    moved = replace(camera, target=camera.target * unit, scale=camera.scale / unit)
    return Frame(f"{yaw_deg:.0f}", moved, rgba)


def sheet(yaws_deg: Sequence[float], parts: Parts, **options: float) -> list[Frame]:
    return [drawn(yaw, parts, **options) for yaw in yaws_deg]  # type: ignore[arg-type]


def off_surface(solid: Solid, middle: Sequence[float], axes: Sequence[float]) -> np.ndarray:
    """Return f, world units, at points of an ellipsoid's surface that are spread evenly."""
    number = np.arange(500) + 0.5
    height, turn = 1 - 2 * number / 500, math.pi * (1 + math.sqrt(5)) * number
    round_ = np.sqrt(1 - height**2)
    unit = np.stack([round_ * np.cos(turn), height, round_ * np.sin(turn)], axis=-1)
    points = (np.array(middle) + unit * axes).astype(np.float32)
    return solid.grid.at(solid.f, points) * solid.grid.per_px


def volume(solid: Solid) -> float:
    return float((solid.f < 0).sum()) * solid.grid.voxel**3


@pytest.mark.parametrize("yaws", [(FRONT, LEFT, BACK), (FRONT, DIAGONAL, LEFT, BACK)])
def test_an_ellipsoid_is_that_ellipsoid(yaws: tuple[float, ...]) -> None:
    """A visual hull of three drawings is a fifth larger at its corners, and a quarter in volume."""
    solid = shape_of(sheet(yaws, [BODY]), plane_x=BODY[0][0])
    assert np.abs(off_surface(solid, *BODY)).max() < 0.025 * 2
    assert volume(solid) == pytest.approx(4 / 3 * math.pi * np.prod(BODY[1]), rel=0.04)


def test_front_and_back_alone_are_round() -> None:
    solid = shape_of(sheet((FRONT, BACK), [BODY]))
    assert volume(solid) == pytest.approx(4 / 3 * math.pi * 0.5 * 1.0 * 0.5, rel=0.06)


def test_two_side_drawings_agree_with_one() -> None:
    one = shape_of(sheet((FRONT, LEFT, BACK), [BODY]))
    two = shape_of(sheet((FRONT, LEFT, BACK, -LEFT), [BODY]))
    assert volume(two) == pytest.approx(volume(one), rel=0.02)


@pytest.mark.parametrize("yaws", [(45, 135), (45, -45), (45, 135, -135)])
def test_diagonals_alone_have_a_shape(yaws: tuple[float, ...]) -> None:
    """No drawing looks along an axis of the grid."""
    solid = shape_of(sheet(yaws, [BODY]))
    assert volume(solid) == pytest.approx(4 / 3 * math.pi * np.prod(BODY[1]), rel=0.25)


def test_sheets_without_front_or_back() -> None:
    """Two diagonals and the side between them tell as much."""
    solid = shape_of(sheet((50, 90, 130), [BODY]))
    assert np.abs(off_surface(solid, *BODY)).max() < 0.1 * 2


def test_size_of_drawings_and_unit_of_the_world_do_not_matter() -> None:
    small = shape_of(sheet((FRONT, LEFT, BACK), [BODY, ARM]))
    large = shape_of(sheet((FRONT, LEFT, BACK), [BODY, ARM], side=3 * SIDE, unit=10.0))
    assert small.f.shape == pytest.approx(large.f.shape, abs=2)
    assert volume(large) / 1e3 == pytest.approx(volume(small), rel=0.01)


def covered(solid: Solid, frames: Sequence[Frame]) -> list[float]:
    """Return the share of each drawing's pixels that the body covers within a voxel."""
    drawings, _ = working_drawings(frames)
    seen = [silhouette(solid.grid, solid.f, drawing) < VOXEL_PX for drawing in drawings]
    return [float(s[d.mask].mean()) for s, d in zip(seen, drawings, strict=True)]


def test_an_arm_in_another_pose_is_still_there() -> None:
    """Each drawing holds the arm elsewhere: a hull has none of it."""
    frames = [
        drawn(FRONT, [BODY, ARM]),
        drawn(DIAGONAL, [BODY, ((0.8, 0.7, 0.3), (0.15, 0.45, 0.15))]),
        drawn(LEFT, [BODY, ((0.95, 0.5, 0.55), (0.1, 0.1, 0.4))]),
        drawn(BACK, [BODY, ((1.0, 0.4, 0.0), (0.15, 0.5, 0.15))]),
    ]
    solid = shape_of(frames, plane_x=BODY[0][0])
    assert min(covered(solid, frames)) > 0.97


def test_a_limb_is_no_deeper_than_it_is_wide() -> None:
    """The body is as deep as the side drawing; the arm beside it is not."""
    body = ((0.0, 0.2, 0.0), (0.45, 1.0, 0.6))
    solid = shape_of(sheet((FRONT, LEFT, BACK), [body, ARM]))
    arm = np.array([[0.95, 0.3, z] for z in (0.0, 0.45, -0.45)], np.float32)
    assert (np.sign(solid.grid.at(solid.f, arm)) == [-1, 1, 1]).all()


def test_a_diagonal_says_how_deep_a_limb_lies() -> None:
    body, arm = ((0.0, 0.2, 0.0), (0.45, 1.0, 0.6)), ((0.85, 0.3, 0.35), (0.15, 0.5, 0.15))
    solid = shape_of(sheet((FRONT, 45, 90, 180), [body, arm]))
    places = np.array([[0.85, 0.3, z] for z in (0.35, -0.35)], np.float32)
    assert (np.sign(solid.grid.at(solid.f, places)) == [-1, 1]).all()


@pytest.mark.parametrize("elevation", [0.0, 2.0])
def test_an_arm_reaches_as_far_as_what_it_holds_out(elevation: float) -> None:
    forearm = ((0.95, 0.0, 0.4), (0.14, 0.14, 0.6))
    yaws = (FRONT, DIAGONAL, LEFT, BACK)
    solid = shape_of(sheet(yaws, [BODY, ARM, forearm], elevation=elevation))
    assert np.abs(off_surface(solid, *forearm)).mean() < 0.022


def test_an_arm_beside_the_head_takes_no_depth_from_it() -> None:
    """A head sticks out over the trunk in the side drawing, as a fist would."""
    trunk, head = ((0.0, -0.1, 0.0), (0.25, 0.75, 0.1)), ((0.0, 0.8, 0.0), (0.25, 0.22, 0.3))
    arm = ((0.55, 0.75, 0.0), (0.1, 0.4, 0.1))
    solid = shape_of(sheet((FRONT, LEFT, BACK), [trunk, head, arm]))
    ends = np.array([[0.0, 0.8, z] for z in (0.25, -0.25)], np.float32)
    assert (solid.grid.at(solid.f, ends) < 0).all()


def test_fewer_than_two_figures_are_refused() -> None:
    frame = drawn(FRONT, [BODY])
    with pytest.raises(BundleError, match="two views are needed"):
        shape_of([frame, replace(frame, rgba=np.zeros_like(frame.rgba))])
