"""Laws of mirror images: which body has them, and that they are drawings of the other side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.nerf.options import TrainOptions
from toonset.nerf.prepare.symmetry import (
    LEAST_ALIKE,
    Halves,
    Symmetry,
    add_mirrored_views,
    differences,
    find_symmetry,
    mirrored,
)
from toonset.nerf.train.fit_field import fit_field
from toonset.options import Symmetric

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
    half = some(whole, FRONT_SIDE_BACK)
    found = find_symmetry(half)
    assert found is not None
    assert found.mirrored == ("002.png",)
    assert min(found.alike) > 0.98
    side, true = add_mirrored_views(half, found).frames[-1], whole.frames[6]
    assert side.mirrored
    np.testing.assert_allclose(side.camera.rotation, true.camera.rotation, atol=1e-9)
    # within a pixel, since the plane is found at 96 px
    (seen,), (drawn,) = (
        side.camera.project(np.zeros((1, 3)))[0],
        true.camera.project(np.zeros((1, 3)))[0],
    )
    assert np.abs(seen - drawn).max() <= 1.0


@pytest.mark.parametrize("seed", range(3))
def test_a_bag_does_not_forbid_the_other_side_but_is_seen(seed: int) -> None:
    lopsided = some(turn(seed, symmetric=False), FRONT_SIDE_BACK)
    found = find_symmetry(lopsided)
    assert found is not None
    assert found.mirrored == ("002.png",)
    front, side, back = differences(lopsided)
    assert side is None
    assert front is not None
    assert back is not None
    assert front.any() or back.any()
    even = differences(some(turn(seed, symmetric=True), FRONT_SIDE_BACK))
    counts = [
        sum(int(part.sum()) for part in parts if part is not None)
        for parts in ((front, back), even)
    ]
    assert counts[0] > 4 * counts[1]


def two_halves(seed: int) -> Scene:
    """Return front, side and back of a body whose left half is another colour."""
    scene = some(turn(seed, symmetric=True), FRONT_SIDE_BACK)
    frames = []
    for frame in scene.frames:
        rgba = frame.rgba.copy()
        if frame is not scene.frames[1]:
            rgba[:, : rgba.shape[1] // 2, :3] = (20, 220, 60)
        frames.append(replace(frame, rgba=rgba))
    return replace(scene, frames=tuple(frames))


@pytest.mark.parametrize(("asked", "views"), [("auto", ()), ("on", ("002.png",)), ("off", None)])
def test_halves_in_two_colours_are_mirrored_only_when_asked(
    asked: Symmetric, views: tuple[str, ...] | None
) -> None:
    found = find_symmetry(two_halves(3), asked)
    assert (found and found.mirrored) == views
    if found is not None:
        assert found.contradicted
        assert min(found.alike) < LEAST_ALIKE


def test_without_a_new_side_nothing_is_asked() -> None:
    whole = turn(0, symmetric=True)
    for numbers in ((0, 2, 4, 6), (0, 3, 5), (0, 4), tuple(range(8))):
        assert find_symmetry(some(whole, numbers)) is None, numbers


@pytest.mark.parametrize("times", [1, 2, 4])
def test_what_is_alike_does_not_depend_on_the_size(times: int) -> None:
    front = turn(3, symmetric=False).frames[0].rgba
    once = Halves.of(front)
    large = Halves.of(np.repeat(np.repeat(front, times, 0), times, 1))
    assert large.alike == pytest.approx(once.alike, abs=0.02)
    assert large.middle / times == pytest.approx(once.middle, abs=0.6)


def test_what_is_alike_is_counted_where_both_halves_are() -> None:
    rgba = np.zeros((60, 80, 4), dtype=np.uint8)
    rgba[5:55, 20:60] = (200, 40, 40, 255)
    assert Halves.of(rgba).alike == 1.0
    arm = rgba.copy()
    arm[20:25, 60:70] = (200, 40, 40, 255)  # an arm that only one half has
    found = Halves.of(arm)
    assert found.alike > 0.98
    assert found.differs[20:25, 64:70].mean() >= 0.8
    rgba[5:55, 40:60, 1] = 200  # another colour: nothing has its like but along the border
    assert Halves.of(rgba).alike < 0.3


@pytest.mark.parametrize(("symmetric", "views"), [("auto", 4), (None, 4), ("off", 3)])
def test_a_training_sees_mirror_images_unless_it_is_told_not_to(
    symmetric: Symmetric | None, views: int
) -> None:
    plain = TrainOptions(device="cpu", carve=False, field="triplane", register=False, unwarp=False)
    options = replace(plain, steps=1, symmetric=symmetric)
    training = fit_field(some(turn(3, symmetric=True), FRONT_SIDE_BACK), options)
    assert training.counts["views"] == views
    assert (training.symmetry is None) == (symmetric == "off")
    assert len(training.seen.frames) == views


def test_a_training_follows_what_its_bundle_says() -> None:
    plain = TrainOptions(device="cpu", carve=False, field="triplane", register=False, unwarp=False)
    scene = replace(some(turn(3, symmetric=True), FRONT_SIDE_BACK), symmetric="off")
    assert fit_field(scene, replace(plain, steps=1)).symmetry is None
    asked = fit_field(scene, replace(plain, steps=1, symmetric="on")).symmetry
    assert isinstance(asked, Symmetry)
    assert asked.asked == "on"
