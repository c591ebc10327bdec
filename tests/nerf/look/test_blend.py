"""Views in the drawn look: crisp, whole, and the drawing itself where it was drawn."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.nerf.look.painted import (
    ARM,
    BELT,
    INK,
    LINE_PX,
    PALETTE,
    camera_at,
    depth_of,
    draw,
    drawings,
    geometry,
    ring,
    scene_of,
    unseen,
    with_an_arm,
)
from toonset.nerf.look import blend
from toonset.nerf.look.blend import _extended, blend_view
from toonset.nerf.look.build import drawings_of
from toonset.nerf.look.drawing import Original
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.look.drawn_view import DRAWN, GUESSED, MIRRORED
from toonset.nerf.look.outline import Outline
from toonset.nerf.render.layers import color_picture
from toonset.nerf.score.metrics import compare
from toonset.raster import dilate
from toonset.view import over_white


@pytest.mark.parametrize("degrees", [10.0, 22.5, 100.0])
def test_a_view_between_drawings_is_what_would_have_been_drawn(
    egg: Drawings, degrees: float
) -> None:
    camera = camera_at(np.radians(degrees))
    view = blend_view(egg, geometry(camera))
    found = compare(color_picture(view.rgb, view.alpha), draw(camera))["psnr"]
    assert found is not None
    assert found > 24  # the grey field alone has 12
    assert view.by_field < 0.01


@pytest.mark.parametrize("number", [0, 3])
def test_a_drawn_camera_returns_its_own_drawing(egg: Drawings, number: int) -> None:
    own = egg.views[number]
    view = blend_view(egg, geometry(own.camera))
    apart = over_white(color_picture(view.rgb, view.alpha)) - over_white(own.rgba)
    assert np.abs(apart).max() <= 1.01 / 255


def test_nothing_pops_where_one_pair_of_drawings_follows_another(egg: Drawings) -> None:
    """A hundredth of a degree beside a drawing the view is nearly the same, from either side."""
    yaw = egg.views[1].camera.angles[0]
    at, before, after = (
        blend_view(egg, geometry(camera_at(yaw + turn))).rgb for turn in (0, -2e-4, 2e-4)
    )
    assert np.abs(before - at).mean() < 2e-4
    assert np.abs(after - at).mean() < 2e-4


def test_both_eyes_stay_whole(egg: Drawings) -> None:
    view = blend_view(egg, geometry(camera_at(np.radians(12))))
    count, _, about, _ = cv2.connectedComponentsWithStats((view.labels == 1).astype(np.uint8))
    sizes = sorted(about[1:, cv2.CC_STAT_AREA])
    assert count == 3
    assert sizes[0] > 80


def test_what_no_drawing_shows_is_a_guess_in_the_drawings_own_paints() -> None:
    """Two drawings of the front say nothing of the back."""
    few = drawings([camera_at(0.0), camera_at(0.8)])
    view = blend_view(few, geometry(camera_at(np.pi)))
    assert view.by_field > 0.9
    solid = (view.alpha > 0.99) & (view.ink == 0)
    apart = np.abs(view.rgb[solid][:, None] * 255 - PALETTE.astype(float)).max(axis=-1)
    assert (apart.min(axis=1) < 4).mean() > 0.95


def test_a_view_from_above_has_no_hole(egg: Drawings) -> None:
    view = blend_view(egg, geometry(camera_at(0.3, np.radians(60))))
    assert np.isfinite(view.rgb).all()
    assert view.alpha[60, 60] == 1
    assert 0 < view.by_field < 1


def test_a_view_of_nothing_is_empty(egg: Drawings) -> None:
    view = blend_view(egg, unseen(geometry(camera_at(0.1))))
    assert not view.alpha.any()
    assert not view.rgb.any()


def test_the_outline_is_as_wide_as_it_was_drawn_and_can_be_another(egg: Drawings) -> None:
    shown = geometry(camera_at(0.4))
    area = blend_view(egg, shown).ink.sum()
    wide = replace(egg, pen=Outline((90, 0, 120), 4.0))
    other = blend_view(wide, shown)
    assert 1.8 < other.ink.sum() / area < 2.1
    assert blend_view(replace(egg, pen=None), shown).ink.sum() == 0
    line = other.ink > 0.99
    np.testing.assert_allclose(other.rgb[line].mean(axis=0) * 255, (90, 0, 120), atol=1)
    bare = blend_view(replace(egg, pen=None), geometry(egg.views[2].camera))  # a drawn view
    assert not ((bare.rgb.max(axis=-1) < 0.2) & (bare.alpha > 0.9)).any()


def test_drawings_without_lines_stay_without() -> None:
    bare = drawings(line_px=0.0)
    assert bare.outline is None
    view = blend_view(bare, geometry(camera_at(0.4)))
    assert view.ink.sum() == 0
    assert (view.rgb.max(axis=-1)[view.alpha > 0.9] > 0.3).all()


def test_a_line_between_paints_goes_on_over_the_seam_of_two_drawings() -> None:
    scene = scene_of(ring())
    frames = []
    for number, frame in enumerate(scene.frames):
        rgba = frame.rgba.copy()
        belt = (np.abs(rgba[..., :3].astype(int) - BELT).sum(axis=-1) < 30).astype(np.uint8)
        rgba[(dilate(belt > 0, 2) & (belt == 0)) & (rgba[..., 3] == 255), :3] = INK
        if number % 2:  # the hand slips: lines of neighbours do not meet
            rgba = np.roll(rgba, 10, axis=0)
        frames.append(replace(frame, rgba=rgba))
    scene = replace(scene, frames=tuple(frames))
    found = drawings_of(scene, scene, depth_of, bent=False)
    assert found is not None
    assert len(found.lined_pairs) == 1

    def gaps() -> int:
        view = blend_view(found, geometry(camera_at(np.pi / 8)))
        paint = (view.rgb * 255).astype(int)
        skin, belt = (
            np.abs(paint - color).sum(axis=-1) < 60 for color in (PALETTE[0], np.array(BELT))
        )
        return int((dilate(skin, 1) & belt).sum())

    with_rule = gaps()
    found.__dict__["lined_pairs"] = np.zeros(0, np.uint16)
    assert with_rule == 0
    assert gaps() > 2


def test_a_part_that_hides_its_own_paint_has_a_line_where_many_drawings_gave_the_surface(
    egg: Drawings,
) -> None:
    shown = geometry(camera_at(0.35))
    right = np.arange(shown.depth.shape[1]) > shown.depth.shape[1] // 2
    nearer = replace(shown, depth=shown.depth - 0.2 * egg.height * right)
    few = replace(egg, views=egg.views[:5], flows=())
    mirrored = tuple(replace(view, mirrored=True) for view in egg.views[5:])

    def darker(found: Drawings) -> int:
        whole, stepped = (blend_view(found, view).rgb.max(axis=-1) for view in (shown, nearer))
        inner = np.abs(np.arange(len(right)) - len(right) // 2) < 4
        return int(((stepped < 0.3) & (whole > 0.5) & inner).sum())

    assert darker(egg) > 20
    assert darker(few) == 0
    assert darker(replace(few, views=(*few.views, *mirrored))) == 0
    assert darker(replace(few, views=mirrored)) == 0


def test_recolouring_changes_one_paint_and_leaves_the_others(egg: Drawings) -> None:
    shown = geometry(camera_at(0.35))
    before = blend_view(egg, shown)
    palette = PALETTE.copy()
    palette[2] = (40, 200, 220)
    after = blend_view(replace(egg, repaint=palette), shown)
    belt = (before.labels == 2) & (before.ink == 0)
    inner = belt & np.roll(belt, 2, 0) & np.roll(belt, -2, 0)
    np.testing.assert_allclose(np.median(after.rgb[inner] * 255, axis=0), palette[2], atol=3)
    far = (before.labels == 1) & (before.ink == 0)
    np.testing.assert_array_equal(after.rgb[far], before.rgb[far])
    same = blend_view(replace(egg, repaint=PALETTE), shown)
    assert same.rgb.tobytes() == before.rgb.tobytes()


@pytest.mark.parametrize("color", [(0, 0, 0), (200, 40, 40)])
def test_a_figure_of_one_colour_has_no_hole(egg: Drawings, color: tuple[int, int, int]) -> None:
    flat = np.full((120, 120, 3), color, np.uint8)
    views = tuple(
        replace(view, rgba=np.dstack([flat, view.rgba[..., 3]]), paint=flat) for view in egg.views
    )
    view = blend_view(replace(egg, views=views), geometry(camera_at(0.4)))
    solid = view.alpha > 0.99
    assert np.isfinite(view.rgb).all()
    paint = solid & (view.ink == 0)
    np.testing.assert_allclose(view.rgb[paint] * 255, np.array([color] * paint.sum()), atol=1)
    assert egg.outline is not None
    np.testing.assert_allclose(egg.outline.rgb, INK, atol=6)


@pytest.mark.parametrize("side", [60, 30])
def test_a_small_view_is_a_large_one_seen_from_afar(egg: Drawings, side: int) -> None:
    """No line is dotted: drawings are averaged before they are looked up."""
    small = blend_view(egg, geometry(camera_at(0.4, side=side)))
    large = blend_view(egg, geometry(camera_at(0.4)))
    block = 120 // side
    mean = large.rgb.reshape(side, block, side, block, 3).mean(axis=(1, 3))
    assert np.abs(small.rgb - mean).mean() < 0.012
    assert egg.fitting(60.0) is egg
    assert egg.fitting(16.0) is egg.half.half


def test_half_a_drawing_lies_where_the_whole_one_does() -> None:
    odd = drawings([camera_at(0.0, side=121), camera_at(0.7, side=121)])
    for whole, half in zip(odd.views, odd.half.views, strict=True):
        at, _, _ = whole.camera.project(np.array([0.22, 0.35, 0.2]))
        there, _, _ = half.camera.project(np.array([0.22, 0.35, 0.2]))
        np.testing.assert_allclose(there, at / 2)
        assert half.rgba.shape == (61, 61, 4)
    assert odd.half.outline is not None
    assert odd.outline is not None
    assert odd.half.outline.width_px == odd.outline.width_px / 2


def test_bent_drawings_have_a_narrower_figure_between_them_and_their_own_where_drawn(
    egg: Drawings,
) -> None:
    bent = replace(egg, bent=True)
    between, drawn = geometry(camera_at(0.4)), geometry(camera_at(0.0))
    assert blend_view(bent, between).alpha.sum() < blend_view(egg, between).alpha.sum() - 20
    own = (blend_view(each, drawn).alpha for each in (bent, egg))
    np.testing.assert_allclose(next(own), next(own), atol=1e-6)


@pytest.mark.parametrize("line_px", [0.0, LINE_PX])
@pytest.mark.parametrize("number", [0, 3])
def test_at_a_drawings_own_camera_the_view_is_that_drawing_whatever_the_surface(
    line_px: float, number: int
) -> None:
    """Also where the drawing was bent, and where the surface lacks what it shows."""
    found = drawings(line_px=line_px)
    own = found.views[number]
    sheet = own.rgba.copy()
    sheet[5:15, 2:30] = (200, 30, 90, 255)  # an arm that no surface has
    view = replace(own, original=Original(own.camera, sheet))
    found = replace(found, views=(*found.views[:number], view, *found.views[number + 1 :]))
    bare = geometry(own.camera)
    smaller = replace(bare, alpha=np.where(np.indices(bare.alpha.shape)[0] < 70, bare.alpha, 0))
    for surface in (bare, smaller):
        seen = blend_view(found, surface)
        shown = np.dstack([seen.rgb, seen.alpha])
        wanted = sheet / 255 * np.dstack([sheet[..., 3:] / 255] * 3 + [np.ones(sheet.shape[:2])])
        np.testing.assert_allclose(shown, wanted, atol=1 / 255)
        assert seen.share(DRAWN) == 1.0


def test_a_view_settles_where_its_drawings_meet_and_only_there(
    egg: Drawings, monkeypatch: pytest.MonkeyPatch
) -> None:
    between, own = (geometry(camera_at(yaw)) for yaw in (np.pi / 8, 0.0))
    settled = [blend_view(egg, view).paint for view in (between, own)]
    monkeypatch.setattr(blend, "settled", lambda color, labels, *_: (color, labels))
    ragged = [blend_view(egg, view).paint for view in (between, own)]
    assert (settled[0] != ragged[0]).any()
    np.testing.assert_array_equal(settled[1], ragged[1])


def test_what_only_mirror_images_show_is_told() -> None:
    half = [camera_at(yaw) for yaw in (0.0, 0.8, 1.6)]
    found = drawings([*half, camera_at(-1.6)])
    views = (*found.views[:3], replace(found.views[3], mirrored=True))
    seen = blend_view(replace(found, views=views), geometry(camera_at(-1.5)))
    assert seen.share(MIRRORED) > 0.3
    assert seen.share(DRAWN) + seen.share(MIRRORED) + seen.share(GUESSED) == pytest.approx(1)
    assert blend_view(found, geometry(camera_at(-1.5))).share(MIRRORED) == 0


def test_an_arm_that_one_drawing_has_is_whole_near_it_and_gone_near_the_others() -> None:
    found = with_an_arm()
    assert [view.limbs is not None for view in found.views] == [True] + 7 * [False]

    def arm_px(yaw: float) -> int:
        view = blend_view(found, geometry(camera_at(yaw)))
        like = np.abs(view.paint - np.array(ARM) / 255).max(axis=-1) < 0.2
        return int((like & (view.alpha > 0.5)).sum())

    drawn = arm_px(0.0)
    assert drawn > 100
    for yaw in (0.2, 0.35, -0.35):
        assert arm_px(yaw) > 0.6 * np.cos(yaw) * drawn
    for yaw in (0.5, 1.6, 3.1):
        assert arm_px(yaw) < 3


def test_what_the_nearest_drawing_denies_is_not_shown() -> None:
    found = drawings(ring(4))
    front = geometry(camera_at(0.2))
    alpha, depth = front.alpha.copy(), front.depth.copy()
    alpha[54:64, 90:116], depth[54:64, 90:116] = 1, 0
    view = blend_view(found, replace(front, alpha=alpha, depth=depth))
    assert view.alpha[54:64, 100:].max() == 0


def test_paint_goes_on_beyond_a_line_and_the_line_does_not() -> None:
    """Where nothing is drawn behind an arm's outline, its skin goes on."""
    color = np.full((40, 60, 3), 0.8, np.float32)
    color[:, 28:32] = np.array(INK) / 255
    labels = np.zeros((40, 60), np.uint8)
    labels[:, 28:32] = 1
    kept = np.broadcast_to(np.arange(60) < 32, (40, 60))
    filled, own = _extended(kept, color, labels, (LINE_PX, INK))
    np.testing.assert_array_equal(filled[:, :32], color[:, :32])
    assert np.abs(filled[:, 32:] - 0.8).max() < 1e-6
    assert (own[:, 32:] == 0).all()
