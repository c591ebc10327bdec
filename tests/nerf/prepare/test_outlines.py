"""Lines round figures are no paint of the body."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.nerf.ellipsoids import Parts, first_hit
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.options import TrainOptions
from toonset.nerf.prepare.outlines import without_outlines
from toonset.nerf.render.views import render
from toonset.nerf.train.fit_field import fit_field
from toonset.palette.pixels.labels import UNLABELLED
from toonset.raster import depth_inside

SIDE, FINE, LINE_PX = 150, 3, 5.0
BODY: Parts = [((0.0, 0.2, 0.0), (0.5, 1.0, 0.4)), ((0.0, 1.0, 0.0), (0.45, 0.4, 0.4))]
WHITE, INK = 250, 10


def drawn(yaw_deg: float, line_px: float = LINE_PX) -> Frame:
    """Return a white body with a black line along its outline, labelled 0 and 1."""
    middle = np.array([0.0, 0.2, 0.0])
    camera = Camera.looking_at(middle, math.radians(yaw_deg), 0.0, SIDE / 2.8, (SIDE, SIDE))
    which, _ = first_hit(camera.resized(FINE), BODY)
    cover = (which >= 0).reshape(SIDE, FINE, SIDE, FINE).mean(axis=(1, 3))
    inked = depth_inside(cover > 0.5) < line_px
    rgba = np.full((SIDE, SIDE, 4), WHITE, np.uint8)
    rgba[inked, :3] = INK
    rgba[..., 3] = np.rint(255 * cover)
    labels = np.where(cover > 0.5, inked, UNLABELLED).astype(np.uint8)
    return Frame(f"{yaw_deg:.0f}", camera, rgba, labels=labels)


def sheet(line_px: float = LINE_PX) -> Scene:
    palette = np.array([[WHITE] * 3, [INK] * 3], np.uint8)
    frames = tuple(drawn(yaw, line_px) for yaw in (0, 45, 90, 180))
    return Scene(frames, palette, "white")


def test_under_a_line_is_the_paint_beside_it_and_no_label() -> None:
    before, after = sheet(), without_outlines(sheet())
    for old, new in zip(before.frames, after.frames, strict=True):
        assert new.labels is not None
        assert old.labels is not None
        figure, inked = old.rgba[..., 3] > 127, old.labels == 1
        assert (new.rgba[figure, :3] == WHITE).all()
        np.testing.assert_array_equal(new.rgba[..., 3], old.rgba[..., 3])
        assert (new.labels[inked & figure] == UNLABELLED).all()
        np.testing.assert_array_equal(new.labels[~inked], old.labels[~inked])


def test_drawings_without_lines_stay_as_they_are() -> None:
    plain = sheet(line_px=0.0)
    assert without_outlines(plain) is plain
    unlabelled = replace(plain, frames=tuple(replace(f, labels=None) for f in sheet().frames))
    assert all(frame.labels is None for frame in without_outlines(unlabelled).frames)


def test_a_dark_line_does_not_thin_a_light_figure() -> None:
    """Fitted with their lines these figures lose a seventh of their area."""
    scene = sheet()
    training = fit_field(scene, TrainOptions(steps=60, resolution=48))
    assert training.prepared.to_json()["without_outlines"]
    for frame in scene.frames:
        found = render(training.result, frame.camera).alpha
        assert found.sum() == pytest.approx(frame.rgba[..., 3].sum() / 255, rel=0.04)
