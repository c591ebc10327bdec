"""Drawings of the mannequin's own body are bent until they show it; others are left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.nerf.bodies import Hand, body, camera_at, drawing, own_shape, ring, sheet, with_bobble
from toonset.dataset.bundle.scene import Scene
from toonset.nerf.hull.mannequin_shape import shape_of
from toonset.nerf.options import TrainOptions
from toonset.nerf.prepare.prepare import prepare
from toonset.nerf.prepare.to_mannequin import bent_to, posed

BEND = Hand(bend=0.012)


def outlines_apart(scene: Scene) -> float:
    """Return the share of pixels that differ from exact drawings."""
    exact = sheet(body())
    wrong = [
        ((a.rgba[..., 3] > 127) != (b.rgba[..., 3] > 127)).mean()
        for a, b in zip(scene.frames, exact.frames, strict=True)
    ]
    return float(np.mean(wrong))


def test_outlines_become_the_mannequins() -> None:
    drawn = sheet(body(), BEND, body())
    bent, found = bent_to(drawn, own_shape())
    assert found.applied
    assert found.gain_nats > 0
    assert found.apart_px[1] < 0.4 * found.apart_px[0]
    assert outlines_apart(bent) < 0.35 * outlines_apart(drawn)
    exact = sheet(body(), Hand(), body())
    same, found = bent_to(exact, own_shape())
    assert not found.applied
    assert same is exact  # to the bit


def test_lines_at_steps_pull_where_outlines_say_nothing() -> None:
    """The arm is drawn aside, within the figure: no outline tells."""
    aside = body()
    arm = aside.vertices[:, 2] > 0.5
    vertices = np.where(arm[:, None], aside.vertices + np.array([0.05, 0, 0]), aside.vertices)
    cameras = [camera_at(yaw) for yaw in (-0.3, 0.0, 0.3)]
    shape = shape_of(body(), cameras)
    wrong = replace(aside, vertices=vertices)

    def apart(lines: bool) -> float:
        """Return how far the arm lies from its place in the front view after bending, pixels."""
        hand = Hand(lines=lines, bend=0.004)
        base = sheet(body(), hand)
        frames = tuple(
            replace(base.frames[0], camera=c, rgba=drawing(wrong, c, hand, i))
            for i, c in enumerate(cameras)
        )
        bent, found = bent_to(replace(base, frames=frames), shape)
        assert found.applied
        shown = (bent.frames[1].rgba, drawing(body(), cameras[1]))
        green = [rgba[..., 1].astype(float) - rgba[..., 0] > 20 for rgba in shown]
        middles = [np.argwhere(mask).mean(axis=0) for mask in green]
        return float(np.abs(middles[0] - middles[1])[1])

    assert apart(lines=True) < 0.5 * apart(lines=False)


def test_preparation_takes_the_mannequin_where_it_is_the_body() -> None:
    ready = prepare(sheet(body(), BEND, body()), TrainOptions())
    assert ready.shape is not None
    assert ready.bent
    assert ready.registration is None
    report = ready.to_json()["mannequin"]
    assert report["chosen"] is True
    assert report["mannequin_off"] < report["drawings_off"]


def test_preparation_leaves_another_body_alone() -> None:
    other = body(scale=1.3)
    with_it, without = (
        prepare(sheet(body(), BEND, mannequin), TrainOptions()) for mannequin in (other, None)
    )
    assert with_it.shape is None
    assert with_it.mannequin is not None
    for one, two in zip(with_it.scene.frames, without.scene.frames, strict=True):
        assert one.rgba.tobytes() == two.rgba.tobytes()


def test_switched_off_or_too_few_it_is_not_asked() -> None:
    for views, options in ((2, TrainOptions()), (3, TrainOptions(mannequin=False))):
        ready = prepare(sheet(body(), BEND, body(), views=views), options)
        assert ready.shape is ready.mannequin is None
    scene = sheet(body(), BEND, body())
    ready = prepare(scene, TrainOptions(unwarp=False))  # the shape is taken, drawings are not bent
    assert ready.shape is not None
    assert ready.scene is scene


@pytest.mark.parametrize("beyond_px", [0.0, 1.0, 2.0])
def test_lines_outside_of_the_silhouette_are_no_part_of_the_body(beyond_px: float) -> None:
    hand = Hand(bend=0.004, beyond_px=beyond_px)
    found = posed(sheet(body(), hand, body()))
    assert found.shape is not None
    assert found.shape.beyond * ring()[0].scale == pytest.approx(beyond_px, abs=0.3)
    assert found.fit is not None
    assert found.fit.mannequin < 0.006


def test_a_mannequin_that_lacks_a_small_part_is_another_body() -> None:
    """It predicts drawings better than they do each other, but the part would be lost."""
    scene = sheet(with_bobble(body()), BEND, body())
    assert posed(replace(scene, mannequin=with_bobble(body()))).shape is not None
    found = posed(scene)
    assert found.shape is None
    assert found.scene is scene
    assert posed(sheet(body(), Hand(beyond_px=9), body())).shape is None  # fatter all round
    assert found.fit is not None
    assert found.fit.left > 0.006
    assert found.fit.drawings is not None
    assert found.fit.mannequin < found.fit.drawings


def test_figures_that_bends_move_past_their_pictures_edge_stay_whole() -> None:
    scene = sheet(body(), BEND)
    tight = []
    for frame in scene.frames:
        mask = frame.rgba[..., 3] > 0
        rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
        box = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
        size = (columns[-1] + 1 - columns[0], rows[-1] + 1 - rows[0])
        camera = frame.camera.moved((columns[0], rows[0]), size)
        tight.append(replace(frame, camera=camera, rgba=frame.rgba[box]))
    found = posed(replace(scene, frames=tuple(tight), mannequin=body()))
    assert found.shape is not None
    for frame in found.scene.frames:
        seen = found.shape.seen(frame.camera).alpha
        alpha = frame.rgba[..., 3] / 255
        assert np.abs(alpha - seen).sum() < 0.02 * seen.sum()
        edge = np.concatenate([alpha[0], alpha[-1], alpha[:, 0], alpha[:, -1]])
        assert not edge.any()
