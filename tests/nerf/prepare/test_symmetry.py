"""Laws of mirror images: which body has them, and that they are drawings of the other side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.cases.bodies import random_body
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.nerf.options import TrainOptions
from toonset.nerf.prepare.symmetry import ALIKE, add_mirrored_views, likeness, mirrored
from toonset.nerf.train.fit_field import fit_field

FLAT = SynthOptions(cell_px=80, outline_px=0, elevation_deg=8)
FRONT_SIDE_BACK = (0, 2, 4)


def turn(seed: int, *, symmetric: bool, options: SynthOptions = FLAT) -> Scene:
    made = make_turnaround(random_body(seed, symmetric=symmetric), options, seed)
    pairs = zip(made.views, made.cameras, strict=True)
    frames = tuple(Frame(view.name, camera, view.rgba) for view, camera in pairs)
    return Scene(frames, None, "body")


def some(scene: Scene, numbers: tuple[int, ...]) -> Scene:
    return replace(scene, frames=tuple(scene.frames[i] for i in numbers))


@pytest.mark.parametrize("k", [0.0, 0.1])
def test_a_mirrored_camera_sees_mirrored_points_where_the_flipped_picture_has_them(
    k: float,
) -> None:
    rng = np.random.default_rng(0)
    camera = Camera.looking_at(rng.normal(size=3), 0.7, 0.2, 20.0, (64, 48), k=k)
    rgba = rng.integers(0, 256, (48, 64, 4), dtype=np.uint8)
    labels = rng.integers(0, 5, (48, 64), dtype=np.uint8)
    frame = Frame("a", camera, rgba, labels)
    plane_x = 0.3
    other = mirrored(frame, plane_x)
    points = rng.normal(size=(50, 3))
    opposite = points * [-1, 1, 1] + [2 * plane_x, 0, 0]
    pixels, depth, *_ = camera.project(points)
    found, same, *_ = other.camera.project(opposite)
    np.testing.assert_allclose(found, np.column_stack([64 - pixels[:, 0], pixels[:, 1]]), atol=1e-9)
    np.testing.assert_allclose(same, depth, atol=1e-9)
    again = mirrored(other, plane_x)
    np.testing.assert_allclose(again.camera.target, camera.target)
    np.testing.assert_array_equal(again.rgba, rgba)
    np.testing.assert_array_equal(other.labels, labels[:, ::-1])


@pytest.mark.parametrize("distance", [0.0, 2.5])
def test_a_symmetric_bodys_undrawn_side_is_completed(distance: float) -> None:
    whole = turn(3, symmetric=True, options=replace(FLAT, distance_heights=distance))
    scene, found = add_mirrored_views(some(whole, FRONT_SIDE_BACK))
    assert found is not None
    assert found.mirrored == ("002.png",)
    assert min(found.alike) > 0.98
    side, true = scene.frames[-1], whole.frames[6]
    np.testing.assert_allclose(side.camera.rotation, true.camera.rotation, atol=1e-9)
    # within half a pixel, since the plane is found in pixels
    (seen,), (drawn,) = (
        side.camera.project(np.zeros((1, 3)))[0],
        true.camera.project(np.zeros((1, 3)))[0],
    )
    assert np.abs(seen - drawn).max() <= 0.5
    inside = side.rgba[..., 3] >= 128, true.rgba[..., 3] >= 128
    assert (inside[0] & inside[1]).sum() > 0.95 * (inside[0] | inside[1]).sum()


@pytest.mark.parametrize("seed", range(3))
def test_a_body_with_a_bag_is_left_as_drawn(seed: int) -> None:
    lopsided = some(turn(seed, symmetric=False), FRONT_SIDE_BACK)
    scene, found = add_mirrored_views(lopsided)
    assert scene is lopsided
    assert found is not None
    assert found.mirrored == ()
    assert min(found.alike) < ALIKE


def test_without_a_new_side_or_a_view_of_both_sides_nothing_is_asked() -> None:
    whole = turn(0, symmetric=True)
    for numbers in ((0, 2, 4, 6), (0, 3, 5), (0, 4), tuple(range(8)), (1, 2)):
        assert add_mirrored_views(some(whole, numbers))[1] is None, numbers


def test_what_is_alike_is_counted_in_pixels_of_either_side() -> None:
    rgba = np.zeros((20, 40, 4), dtype=np.uint8)
    rgba[5:15, 10:30] = (200, 40, 40, 255)
    assert likeness(rgba, 20.0) == 1.0
    rgba[5:15, 20:30, 1] = 200  # another colour: nothing has its like but along the border
    assert likeness(rgba, 20.0) == pytest.approx(4 / 20)
    rgba[5:15, 20:30] = 0
    assert likeness(rgba, 20.0) < 0.5


@pytest.mark.parametrize(("symmetric", "views"), [(True, 4), (False, 3)])
def test_a_training_sees_mirror_images_unless_it_is_told_not_to(
    symmetric: bool, views: int
) -> None:
    plain = TrainOptions(device="cpu", carve=False, field="triplane", register=False, unwarp=False)
    options = replace(plain, steps=1, symmetry=symmetric)
    training = fit_field(some(turn(3, symmetric=True), FRONT_SIDE_BACK), options)
    assert training.counts["views"] == views
    assert (training.symmetry is None) == (not symmetric)
