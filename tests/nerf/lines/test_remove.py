"""Contour lines: taken off the drawings, kept apart from features, and drawn again."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bench.cases.bodies import random_body
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.nerf.lines.nearest import depth_inside
from toonset.nerf.lines.remove import InkStyle, without_ink
from toonset.nerf.options import TrainOptions
from toonset.nerf.prepare.prepare import prepared
from toonset.nerf.render.line_drawing import draw_ink, ink_scale, inked
from toonset.nerf.run.records import InkRecord

INK = 128
STYLE = InkStyle((0, 0, 0), 2.0, 2.0, (2.0,), 50.0, 0.2, ((0, 1),))


@cache
def sheet(seed: int, outline: float, *, label_lines: bool = True) -> Turnaround:
    options = SynthOptions(cell_px=150, outline_px=outline, label_lines=label_lines)
    return make_turnaround(random_body(seed), options, seed)


def scene_of(made: Turnaround, *, labelled: bool = True) -> Scene:
    frames = tuple(
        Frame(view.name, camera, view.rgba, labels if labelled else None)
        for view, camera, labels in zip(made.views, made.cameras, made.labels, strict=True)
    )
    return Scene(frames, made.palette if labelled else None, "sheet")


@pytest.mark.parametrize("labelled", [True, False])
def test_a_sheet_without_outlines_is_left_as_it_is(labelled: bool) -> None:
    scene = scene_of(sheet(2, 0.0), labelled=labelled)
    bare, style = without_ink(scene)
    assert bare is scene
    assert style is None


@pytest.mark.parametrize(("seed", "outline"), [(2, 2.0), (5, 2.0), (2, 3.5)])
def test_lines_go_and_silhouettes_stay(seed: int, outline: float) -> None:
    made = sheet(seed, outline)
    bare, style = without_ink(scene_of(made))
    assert style is not None
    assert style.rgb == (0, 0, 0)
    assert style.outline_px == pytest.approx(outline, rel=0.25)
    assert len(style.views_px) == 8
    left = total = 0
    for view, frame, ink in zip(made.views, bare.frames, made.ink, strict=True):
        assert (frame.rgba[..., 3] == view.rgba[..., 3]).all()
        drawn = (ink >= INK) & (view.rgba[..., 3] == 255)
        total += int(drawn.sum())
        left += int((frame.rgba[drawn][:, :3].max(axis=1) < 20).sum())
    assert left < 0.12 * total


def test_paint_under_lines_is_a_paint_of_the_figure_with_its_label() -> None:
    made = sheet(2, 2.0)
    bare, _ = without_ink(scene_of(made))
    for view, frame in zip(made.views, bare.frames, strict=True):
        assert frame.labels is not None
        changed = (frame.rgba != view.rgba).any(axis=-1) & (frame.rgba[..., 3] == 255)
        assert changed.any()
        assert (frame.rgba[changed][:, :3] == made.palette[frame.labels[changed]]).all()


def test_borders_with_lines_are_known_only_where_they_are_drawn() -> None:
    lined, plain = (without_ink(scene_of(sheet(2, 2.0, label_lines=on)))[1] for on in (True, False))
    assert lined is not None
    assert plain is not None
    assert len(lined.borders) > len(plain.borders)
    _, unlabelled = without_ink(scene_of(sheet(2, 2.0), labelled=False))
    assert unlabelled is not None
    assert unlabelled.borders == ()


def test_a_mouth_stays() -> None:
    made = sheet(2, 2.0)
    scene = scene_of(made)
    rgba, labels = made.views[0].rgba.copy(), made.labels[0].copy()
    flat = np.max([depth_inside(labels == label) for label in range(len(made.palette))], axis=0)
    row, column = np.unravel_index(flat.argmax(), flat.shape)
    assert flat.max() > 6
    mouth = slice(row, row + 2), slice(column - 4, column + 5)
    rgba[mouth] = (0, 0, 0, 255)
    labels[mouth] = 255
    first = replace(scene.frames[0], rgba=rgba, labels=labels)
    bare, _ = without_ink(replace(scene, frames=(first, *scene.frames[1:])))
    assert (bare.frames[0].rgba[mouth] == (0, 0, 0, 255)).all()


def test_an_eye_that_hangs_free_stays_though_its_border_has_a_line() -> None:
    made = sheet(2, 2.0)
    scene = scene_of(made)
    _, style = without_ink(scene)
    assert style is not None
    rgba, labels = made.views[0].rgba.copy(), made.labels[0].copy()
    flat = np.stack([depth_inside(labels == label) for label in range(len(made.palette))])
    label, row, column = np.unravel_index(flat.argmax(), flat.shape)
    other = next(a + b - label for a, b in style.borders if label in (a, b))
    eye = slice(row - 4, row + 5), slice(column - 4, column + 5)
    pupil = slice(row - 2, row + 3), slice(column - 2, column + 3)
    rgba[eye], labels[eye] = (0, 0, 0, 255), 255
    rgba[pupil], labels[pupil] = (*made.palette[other], 255), other
    first = replace(scene.frames[0], rgba=rgba, labels=labels)
    bare, _ = without_ink(replace(scene, frames=(first, *scene.frames[1:])))
    assert (bare.frames[0].rgba[eye] == rgba[eye]).all()


def test_lines_are_as_wide_as_drawn_where_drawings_are_bent_first() -> None:
    options = SynthOptions(cell_px=120, outline_px=2.0, warp_percent=1.5)
    drawn = scene_of(make_turnaround(random_body(2), options, 2))
    ready, bent = (prepared(drawn, TrainOptions(ink=ink)) for ink in (True, False))
    (_, true), (_, blurred) = (without_ink(scene) for scene in (drawn, bent.scene))
    assert ready.unbending is not None
    assert ready.unbending.applied
    assert ready.ink is not None
    assert true is not None
    assert ready.ink.views_px == true.views_px
    assert blurred is None or blurred.views_px != true.views_px  # bending changes what is seen


def test_black_cloth_stays() -> None:
    body = random_body(2)
    assert body.face_colors is not None
    assert body.face_parts is not None
    colors = body.face_colors.copy()
    colors[body.face_parts == body.part_names.index("trunk")] = (8, 8, 10)
    options = SynthOptions(cell_px=150, outline_px=2.0)
    made = make_turnaround(replace(body, face_colors=colors), options, 2)
    bare, style = without_ink(scene_of(made))
    assert style is not None
    for view, frame, ink in zip(made.views, bare.frames, made.ink, strict=True):
        cloth = (view.rgba[..., :3] == (8, 8, 10)).all(axis=-1) & (ink == 0)
        assert cloth.sum() > 100
        assert (frame.rgba[cloth] == view.rgba[cloth]).all(axis=-1).mean() > 0.97


def disc(radius: float, depth: float = 0.0, side: int = 60) -> tuple[np.ndarray, np.ndarray]:
    down, right = np.mgrid[:side, :side] + 0.5 - side / 2
    alpha = np.clip(radius + 0.5 - np.hypot(down, right), 0, 1)
    return alpha, np.where(alpha >= 0.5, depth, np.nan)


@pytest.mark.parametrize(("radius", "scale"), [(20, 0.5), (20, 1.0), (20.4, 1.0), (25, 2.5)])
def test_outline_has_its_width_inside_the_silhouette(radius: float, scale: float) -> None:
    alpha, depth = disc(radius)
    ink = draw_ink(alpha, depth, None, STYLE, scale)
    width = 2 * scale
    area = np.pi * (radius**2 - (radius - width) ** 2)
    assert ink.sum() == pytest.approx(area, rel=0.08)
    assert (ink <= alpha).all()
    assert ink[30, 30] == 0


def test_nothing_seen_has_no_lines() -> None:
    empty = np.zeros((8, 8))
    ink = draw_ink(empty, np.full((8, 8), np.nan), None, STYLE, 1.0)
    assert not ink.any()


@pytest.mark.parametrize("turned", [False, True])
def test_a_step_is_drawn_on_the_nearer_side_and_a_slope_is_not(turned: bool) -> None:
    alpha = np.ones((40, 40))
    slope = np.repeat(np.linspace(0, 12, 40)[None], 40, axis=0)
    step = np.repeat(np.where(np.arange(40) < 20, 0.0, 1.0)[None], 40, axis=0)
    drawn = []
    for depth in (slope, step, slope + step):
        ink = draw_ink(alpha, depth.T if turned else depth, None, STYLE, 1.0)
        drawn.append((ink.T if turned else ink)[10:30])
    assert not drawn[0][:, 5:35].any()
    for ink in drawn[1:]:
        assert ink[:, 18:20] == pytest.approx(1, abs=0.3)
        assert ink[:, 20:35].max() < 0.3
        assert ink[:, 5:35].sum(axis=1) == pytest.approx(2, abs=0.3)


def test_only_borders_of_known_pairs_are_drawn() -> None:
    shares = np.zeros((40, 40, 3))
    shares[:, :15, 0] = shares[:, 15:25, 1] = shares[:, 25:, 2] = 1
    ink = draw_ink(np.ones((40, 40)), np.zeros((40, 40)), shares, STYLE, 1.0)
    assert ink[10:30, 12:18].sum(axis=1) == pytest.approx(2, abs=0.3)
    assert not ink[10:30, 20:30].any()


def test_ink_over_paint_keeps_alpha_and_covers_all_where_it_is_full() -> None:
    alpha, depth = disc(20)
    ink = draw_ink(alpha, depth, None, STYLE, 1.0)
    mixed = inked(np.repeat(alpha[..., None], 3, axis=2), alpha, ink, (0, 0, 0))
    assert mixed == pytest.approx(np.repeat((alpha - ink)[..., None], 3, axis=2), abs=1e-5)


def test_scale_follows_the_camera() -> None:
    camera = Camera.looking_at(np.zeros(3), 0.0, 0.0, 75.0, (40, 40))
    assert ink_scale(camera, STYLE) == 1.5
    assert ink_scale(camera.resized(2), STYLE) == 3.0


def test_a_record_gives_its_style_back() -> None:
    record = InkRecord.of(STYLE)
    assert InkRecord.model_validate_json(record.model_dump_json()).style == STYLE
    unlined = replace(STYLE, jump=None, borders=())
    assert InkRecord.of(unlined).style == unlined
