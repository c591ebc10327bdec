"""Paint that lies elsewhere in every drawing, and is mixed anew: found, and set right."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
import torch

from tests.nerf.look.painted import SIDE, draw, ring, scene_of
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.silhouettes.outlines import Square
from toonset.nerf.hull.hull import carve
from toonset.nerf.hull.march import surface_depth
from toonset.nerf.options import TrainOptions
from toonset.nerf.prepare.paint_agreement import Depths, with_paint_agreed
from toonset.nerf.prepare.prepare import Prepared, agree_on_paint, prepare
from toonset.nerf.prepare.unwarp import Warp

WRONG = 0  # the drawing that is wrong: from the front


@cache
def body_of(scene: Scene) -> tuple[Depths, float]:
    """Return how deep the hull of a scene lies, and its height."""
    alphas = [torch.as_tensor(f.rgba[..., 3] / np.float32(255)) for f in scene.frames]
    hull = carve([frame.camera for frame in scene.frames], alphas, 96, 0)
    height = float(hull.inside.any(dim=2).any(dim=0).sum()) * hull.voxel
    return partial(surface_depth, hull), height


def nearly_none() -> Warp:
    """Return a warp that says the drawing bends, but by nothing that matters."""
    return Warp(Square(np.array([5.0, 5.0]), 110.0), np.full(len(Warp.none().numbers), 1e-9))


def swollen(pixels: float) -> np.ndarray:
    """Return a displacement that is `pixels` to the right in the middle, none along the outline."""
    y, x = (np.mgrid[:SIDE, :SIDE] - SIDE / 2) / (SIDE / 2)
    size = np.exp(-((x / 0.35) ** 2) - (y / 0.5) ** 2)
    return np.dstack([-pixels * size, 0 * size])


@cache
def sheet(pixels: float = 0.0, gain: tuple[float, float, float] = (1, 1, 1)) -> Scene:
    scene = scene_of(ring())
    camera = scene.frames[WRONG].camera
    rgba = draw(camera, bend=swollen(pixels), gain=gain)
    frames = list(scene.frames)
    frames[WRONG] = Frame("wrong.png", camera, rgba)
    return replace(scene, frames=tuple(frames))


def test_paint_that_one_drawing_has_elsewhere_goes_back() -> None:
    drawn, exact = sheet(3.0), sheet()
    warps = [nearly_none()] * 8
    found, _, report = with_paint_agreed(drawn, drawn, warps, *body_of(exact))
    assert report.applied
    assert report.gain_nats > 0

    def apart(scene: Scene) -> float:
        a, b = (one.frames[WRONG].rgba[25:85, 30:90, :3].astype(float) for one in (scene, exact))
        return float(((a - b) ** 2).mean())

    assert apart(found) < 0.6 * apart(drawn)
    for one, other in zip(found.frames, drawn.frames, strict=True):
        a, b = (frame.rgba[..., 3] >= 128 for frame in (one, other))
        assert (a ^ b).sum() < 0.6 * 2 * np.pi * 45  # outlines stay: less than 0.6 px all round


def test_paint_that_was_mixed_anew_becomes_one_paint() -> None:
    gain = (0.96, 1.03, 1.0)
    drawn = sheet(0.0, gain)
    _, _, report = with_paint_agreed(drawn, drawn, [nearly_none()] * 8, *body_of(drawn))
    assert report.applied
    np.testing.assert_allclose(report.gains[WRONG], 1 / np.array(gain), atol=0.012)
    others = [row for i, row in enumerate(report.gains) if i != WRONG]
    np.testing.assert_allclose(others, 1, atol=0.012)


def test_exact_drawings_are_untouched_to_the_bit() -> None:
    scene = scene_of(ring())
    ready = prepare(scene, TrainOptions())
    after = agree_on_paint(ready, *body_of(scene))
    assert after.paint is None
    unbent = Prepared(drawn := sheet(3.0), drawn, None, None, None, None)
    assert agree_on_paint(unbent, *body_of(drawn)) is unbent  # drawings that did not bend stay
    for one, other in zip(after.scene.frames, scene.frames, strict=True):
        assert one.rgba.tobytes() == other.rgba.tobytes()


@pytest.mark.parametrize("shown", [0, 1, 2])
def test_too_few_drawings_say_nothing(shown: int) -> None:
    """Opposite drawings share no place, and empty ones have none."""
    scene = scene_of(ring(2))
    frames = [
        frame if i < shown else replace(frame, rgba=np.zeros_like(frame.rgba))
        for i, frame in enumerate(scene.frames)
    ]
    few = replace(scene, frames=tuple(frames))
    warps = [nearly_none() if i < shown else Warp.none() for i in range(2)]
    found, kept, report = with_paint_agreed(few, few, warps, *body_of(sheet()))
    assert found is few
    assert kept == tuple(warps)
    assert not report.applied
