"""What a trained field shows: layers, other colours, a turntable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.nerf.ellipsoids import PARTS, draw, train_scene
from toonset.errors import PaletteError
from toonset.nerf.render.animation import encode_gif
from toonset.nerf.render.layers import alpha_picture, color_picture, depth_picture, palette_picture
from toonset.nerf.render.recolor import recolor_run
from toonset.nerf.render.turntable import turntable
from toonset.nerf.render.views import render
from toonset.nerf.train.result import Training
from toonset.palette.color_names import name_of


def test_layers_agree_with_the_geometry(training: Training) -> None:
    camera = train_scene().frames[0].camera
    view = render(training.result, camera)
    truth = draw(camera)
    alpha = alpha_picture(view)
    assert (np.abs(alpha[..., 0].astype(int) - truth[..., 3]) > 128).mean() < 0.01
    assert (alpha[..., 3] == 255).all()
    assert view.labels is not None
    palette = training.result.palette
    assert palette is not None
    body = view.labels[36, 24]
    assert np.abs(palette[body].astype(int) - [200, 40, 40]).max() < 12
    assert view.labels[0, 0] == 255
    # The body's front is 0.35 before its middle, the target lies in the middle.
    assert view.depth[30, 24] == pytest.approx(-0.35, abs=0.12)
    assert np.isnan(view.depth[0, 0])
    grey = depth_picture(view)
    assert grey[0, 0, 3] == 0
    assert grey[..., 0][grey[..., 3] >= 128].min() == 0
    assert grey[..., 0].max() == 255
    straight = color_picture(view.rgb, view.alpha)
    edge = (straight[..., 3] > 60) & (straight[..., 3] < 200)
    assert edge.any()
    near = np.abs(straight[edge][:, None, :3].astype(int) - [c for *_, c in PARTS]).max(-1).min(1)
    assert np.median(near) < 40  # straight colour: no halo of white or black on soft edges


def test_recolor_replaces_one_colour_and_nothing_else(training: Training) -> None:
    palette = training.result.palette
    assert palette is not None
    index = int(np.abs(palette.astype(int) - [40, 80, 200]).sum(1).argmin())
    old = "#{:02x}{:02x}{:02x}".format(*palette[index].tolist())
    changed = recolor_run(training.result, [f"{old}=#00ff00"])
    camera = train_scene().frames[4].camera
    before, after = render(training.result, camera), render(changed, camera)
    a, b = palette_picture(before, palette), palette_picture(after, changed.palette)
    assert before.shares is not None
    untouched = before.shares[..., index] == 0
    np.testing.assert_array_equal(a[untouched], b[untouched])
    full = (before.shares[..., index] > 0.99 * before.alpha) & (before.alpha > 0.5)
    assert full.sum() > 20
    assert np.abs(b[full][:, :3].astype(int) - [0, 255, 0]).max() <= 3
    by_name = recolor_run(training.result, [f"{name_of(tuple(palette[index].tolist()))}=#00ff00"])
    assert by_name.palette is not None
    assert changed.palette is not None
    assert (by_name.palette == changed.palette).all()
    for change, said in (("#123456=#000000", "choose one of them"), ("#123456", "OLD=NEW")):
        with pytest.raises(PaletteError, match=said):
            recolor_run(training.result, [change])
    with pytest.raises(PaletteError, match="without palette"):
        recolor_run(replace(training.result, palette=None), [f"{old}=#00ff00"])


def test_turntable_frames_the_figure(training: Training) -> None:
    cameras = turntable(training.result, 4, 0.2, 40)
    pictures = []
    for camera in cameras:
        view = render(training.result, camera)
        pictures.append(color_picture(view.rgb, view.alpha))
        assert view.alpha[[0, -1]].max() == 0
        assert view.alpha[:, [0, -1]].max() == 0
        assert np.ptp(np.flatnonzero((view.alpha > 0.5).any(axis=1))) > 20
    assert cameras[0].angles[0] == pytest.approx(0)
    assert cameras[1].angles[0] == pytest.approx(np.pi / 2)
    assert encode_gif(pictures)[:6] == b"GIF89a"
