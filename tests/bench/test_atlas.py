"""The atlas of failures: what is drawn is what is said, figures count right, pages say it all."""

from __future__ import annotations

import math
import re
from dataclasses import asdict, replace

import numpy as np
import pytest

from bench.atlas import palette as atlas_palette
from bench.atlas import scenes as atlas_scenes
from bench.atlas import training as atlas_training
from bench.atlas.chart import draw_page
from bench.atlas.figures import (
    Trial,
    TriedPage,
    TriedStep,
    as_plain,
    commonest_words,
    fails_from,
    summary_rows,
    tally,
)
from bench.atlas.labels import try_labels
from bench.atlas.pages import LABEL_PAGES, PALETTE_PAGES, TRAIN_PAGES
from bench.atlas.palette import (
    EYE,
    SKIN_AND_HAIR,
    color_away,
    near_equal,
    tiny_feature,
    try_palette,
)
from bench.atlas.report import atlas_html
from bench.atlas.results import CALIBRATION, TRAINING, tried_pages
from bench.atlas.run import TriedStepResult
from bench.atlas.scenes import draw_scene, misscaled, misturned, shifted, squashed
from bench.atlas.training import REFUSED, REPAIRED, SILENT, Tried, try_training
from bench.cases.bodies import random_body
from bench.stability import artist
from bench.stability.bodies import (
    EARS,
    vase,
    with_arms_raised,
    with_contrast,
    with_ears,
    with_eyes,
    with_head_grown,
)
from bench.stability.draws import squashed as squashed_sheet
from bench.stability.sweeps import SWEEPS
from toonset.nerf.score import verdict
from toonset.nerf.score.verdict import MOST_OFF, WEAK
from toonset.palette.colors import oklab_from_rgb
from toonset.palette.names import hex_of


def part(body, *names):
    numbers = [i for i, name in enumerate(body.part_names) if name in names]
    return body.vertices[np.unique(body.faces[np.isin(body.face_parts, numbers)])]


# ---- drawings and bodies


def test_arms_rise_by_their_angle_about_the_shoulder():
    body = random_body(4)
    up = with_arms_raised(body, math.radians(30))
    for name, side in (("left arm", 1), ("right arm", -1)):
        before, after = part(body, name), part(up, name)
        assert after[:, 1].max() > before[:, 1].max()
        lengths = (np.linalg.norm(np.ptp(points, axis=0)) for points in (before, after))
        np.testing.assert_allclose(*lengths, rtol=0.2)
        hands = (points[(side * points[:, 0]).argmax()] for points in (before, after))
        turn = np.subtract(*hands)
        assert side * turn[0] < 0
        assert turn[1] < 0
    np.testing.assert_array_equal(part(up, "trunk"), part(body, "trunk"))


def test_a_head_grows_over_its_chin_and_nothing_else():
    body = random_body(4)
    large = with_head_grown(body, 0.5)
    for name in ("head", "nose", "hair"):
        sizes = [np.ptp(part(b, name), axis=0) for b in (body, large)]
        np.testing.assert_allclose(sizes[1], 1.5 * sizes[0])
    assert part(large, "head")[:, 1].min() == pytest.approx(part(body, "head")[:, 1].min())
    np.testing.assert_array_equal(part(large, "left leg"), part(body, "left leg"))


def test_ears_and_eyes_are_parts_of_the_radius_asked_for():
    body = random_body(2)
    for grown, names in ((with_ears(body, 0.1), EARS), (with_eyes(body, 0.02), ("left eye",))):
        points = part(grown, names[0])
        radius = 0.1 if names is EARS else 0.02
        np.testing.assert_allclose(np.ptp(points, axis=0)[:2], 2 * radius, rtol=0.02)
        assert points[:, 0].mean() > 0  # the character's left
    assert with_ears(body, 0) is body
    assert part(with_eyes(body, 0.02), "left eye")[:, 2].max() > part(body, "head")[:, 2].mean()


def test_contrast_goes_to_one_colour():
    body = random_body(0)
    colors = [np.asarray(with_contrast(body, kept).face_colors) for kept in (1, 0.5, 0.1, 0)]
    assert len(np.unique(colors[-1], axis=0)) == 1
    np.testing.assert_array_equal(colors[0], body.face_colors)
    spans = [np.ptp(some, axis=0).max() for some in colors]
    assert spans[0] > spans[1] > spans[2] > 0


def test_half_of_the_views_are_squashed_and_half_are_stretched():
    tall = [c.pixel_aspect > 1 for _, c in squashed_sheet(20, 0).drawings]
    assert 0 < sum(tall) < len(tall)


def test_a_vase_looks_the_same_from_all_round():
    mesh = vase()
    turn = 2 * math.pi / 96 * 7
    c, s = math.cos(turn), math.sin(turn)
    turned = mesh.vertices @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    gaps = np.linalg.norm(mesh.vertices[:, None] - turned[None], axis=-1)
    assert gaps.min(axis=1).max() < 1e-6
    assert mesh.height == pytest.approx(1.8)


# ---- scenes


def cameras(scene):
    return [frame.camera for frame in scene.train.frames]


def test_errors_of_cameras_are_as_large_as_said_and_none_of_the_body(monkeypatch):
    monkeypatch.setattr(atlas_scenes, "HELD_OUT", 2)
    true = cameras(draw_scene(5))
    turned = misturned(10, 5).train.frames
    yaws = [(a.camera.angles[0], b.angles[0]) for a, b in zip(turned, true, strict=True)]
    off = [math.remainder(a - b, math.tau) for a, b in yaws]
    np.testing.assert_allclose(np.abs(off), math.radians(10))
    assert sum(off) == pytest.approx(0, abs=1e-9)
    assert [frame.yaw_sigma for frame in turned] == pytest.approx([math.radians(10)] * 8)
    pairs = list(zip(cameras(misscaled(5, 5)), true, strict=True))
    sizes = [math.log(a.scale / b.scale) for a, b in pairs]
    np.testing.assert_allclose(np.abs(sizes), math.log(1.05))
    assert sum(sizes) == pytest.approx(0, abs=1e-9)
    pairs = list(zip(cameras(shifted(2, 5)), true, strict=True))
    moves = [a.center - b.center for a, b in pairs]
    assert math.sqrt(np.square(moves).sum() / len(moves)) == pytest.approx(0.02 * 80)
    of_body = np.concatenate([camera.rotation[:2] for camera in true])
    np.testing.assert_allclose(of_body.T @ np.concatenate(moves), 0, atol=1e-9)


def test_the_base_step_of_a_page_is_the_base_scene(monkeypatch):
    small = replace(atlas_scenes.SCENE, cell_px=32, supersample=1)
    monkeypatch.setattr(atlas_scenes, "SCENE", small)
    monkeypatch.setattr(atlas_scenes, "HELD_OUT", 2)
    base = draw_scene(1)
    for page in TRAIN_PAGES:
        if page.base is not None:
            of_size = page.name == "train resolution"
            drawn = page.draw(small.cell_px if of_size else page.base, 1)
            for a, b in zip(drawn.train.frames, base.train.frames, strict=True):
                np.testing.assert_array_equal(a.rgba, b.rgba, err_msg=page.name)
                np.testing.assert_allclose(a.camera.center, b.camera.center)


def test_a_squashed_drawing_is_believed_to_have_square_pixels(monkeypatch):
    monkeypatch.setattr(atlas_scenes, "HELD_OUT", 2)
    scene = squashed(20, 1)
    assert {camera.pixel_aspect for camera in cameras(scene)} == {1.0}
    heights = [frame.rgba.shape[0] for frame in scene.train.frames]
    assert min(heights) < 80 < max(heights)
    assert scene.test.frames[0].rgba.shape[0] == 80


# ---- trials


def test_a_single_drawing_is_refused_and_a_weak_run_says_why(monkeypatch):
    monkeypatch.setattr(atlas_training, "STEPS", 2)
    monkeypatch.setattr(atlas_scenes, "SCENE", replace(atlas_scenes.SCENE, cell_px=40))
    monkeypatch.setattr(atlas_scenes, "HELD_OUT", 4)
    atlas_training._base_tried.cache_clear()
    page = TRAIN_PAGES[0]
    tried, picture = try_training(page, 1, 0)
    assert tried.voice == REFUSED
    assert "at least two views" in tried.words
    assert -30 < tried.figure < -3  # white pictures
    assert picture.startswith(b"\x89PNG")
    clean, _ = try_training(page, page.reference, 0)
    assert clean.voice == WEAK
    assert "these were 2 steps" in clean.words
    assert clean.evidence["off"] > MOST_OFF
    assert clean.figure > tried.figure + 1
    assert clean.evidence["odd_views"] == 0
    assert try_training(TRAIN_PAGES[1], 0, 0)[0] is clean  # the same scene, tried once
    atlas_training._base_tried.cache_clear()
    monkeypatch.setattr(verdict, "MOST_OFF", 1.0)
    assert try_training(page, page.reference, 0)[0].voice == SILENT
    atlas_training._base_tried.cache_clear()


def test_a_colour_lies_as_far_away_as_asked():
    for distance in (0.02, 0.1, 0.2):
        color = color_away(*SKIN_AND_HAIR, distance)
        lab = oklab_from_rgb(np.array([SKIN_AND_HAIR[0], color], np.uint8))
        assert np.linalg.norm(np.diff(lab, axis=0)) == pytest.approx(distance, abs=0.003)


def test_two_colours_are_found_where_they_differ_and_one_where_they_do_not(monkeypatch):
    small = replace(atlas_palette.PICTURES, views=2, cell_px=80)
    monkeypatch.setattr(atlas_palette, "PICTURES", small)
    near, tiny = PALETTE_PAGES
    assert near.draw is near_equal
    assert tiny.draw is tiny_feature
    apart, _ = try_palette(near, 20, 0)
    alike, _ = try_palette(near, 0.5, 0)
    assert (apart.figure, alike.figure) == (100, 50)
    eye, picture = try_palette(tiny, 5, 0)
    assert eye.figure == 0
    assert picture.startswith(b"\x89PNG")
    assert "left out" in eye.words
    assert hex_of(EYE) in eye.words


def test_labels_are_right_where_paints_are_plain_and_wrong_in_deep_shadow(monkeypatch):
    monkeypatch.setattr(artist, "SHEET", replace(artist.SHEET, views=3, cell_px=150))
    page = next(page for page in LABEL_PAGES if page.name == "labels shadow")
    plain, picture = try_labels(page, 0, 0)
    deep, _ = try_labels(page, 80, 0)
    assert picture.startswith(b"\x89PNG")
    assert plain.figure > 95
    assert deep.figure < plain.figure - 5
    assert plain.evidence["right_of_labelled"] >= plain.figure


# ---- figures

PAGE = next(page for page in SWEEPS if page.name == "warp")


def page_of(*steps: list[Trial]) -> TriedPage:
    named = zip(map(str, PAGE.steps), steps, strict=False)
    return TriedPage(PAGE, CALIBRATION, tuple(TriedStep(n, tuple(t)) for n, t in named))


FINE, ALARM = Trial(0, 1.0, "ok"), Trial(0, 2.0, "weak", "21 % of the outlines")
BETWEEN = Trial(0, 10.0, "weak")
SAID, UNSAID = Trial(1, 50.0, "failed", "54 % of the outlines"), Trial(1, 20.0, "ok")


def test_trials_are_counted_by_their_bounds():
    found = tally([FINE, ALARM, BETWEEN, SAID, UNSAID, Trial(0, 90.0, "")], CALIBRATION)
    assert asdict(found) == {
        "n": 6,
        "failed": 3,
        "judged": 2,
        "announced": 1,
        "fine": 2,
        "alarms": 1,
    }
    assert (found.announced_share, found.alarm_share) == (0.5, 0.5)
    assert tally([], CALIBRATION).announced_share is None


def test_a_page_fails_from_where_more_than_a_tenth_fail():
    nine = [FINE] * 9
    page = page_of(nine, [*nine, SAID], [*nine, SAID, UNSAID], [FINE])
    first = fails_from(page)
    assert first is not None
    assert first.step == str(PAGE.steps[2])
    assert fails_from(page_of(nine)) is None
    assert as_plain([page])[0] | {"n": 0} == {
        "page": "warp",
        "subject": "calibration",
        "fails_from": str(PAGE.steps[2]),
        "n": 0,
        "failed": 3,
        "judged": 3,
        "announced": 2,
        "fine": 28,
        "alarms": 0,
    }
    assert summary_rows([page])[-1][:2] == ("all pages: calibration", "")


def test_the_sheet_that_pages_share_counts_once_for_all_of_them():
    page = page_of([FINE], [SAID])
    other = replace(page, page=next(page for page in SWEEPS if page.name == "squash"))
    assert page.page.base == other.page.base == 0
    rows = summary_rows([page, other])
    assert [row[2] for row in rows] == ["2", "2", "3"]


def test_reasons_that_differ_in_numbers_are_the_same():
    assert commonest_words([ALARM, SAID, FINE]) == ("21 % of the outlines", 2)
    assert commonest_words([FINE]) == ("", 0)


def test_a_training_loses_against_its_own_bodys_clean_scene():
    def tried(seed, figure, voice=SILENT):
        return Tried(seed, figure, voice, "")

    steps = [
        TriedStepResult("train warp", "0", (tried(0, -0.5), tried(1, -0.75))),
        TriedStepResult("train warp", "2", (tried(0, -0.75, REPAIRED), tried(1, -2, REPAIRED))),
        TriedStepResult("train warp", "4", (tried(0, -0.75, WEAK), tried(1, -2, WEAK))),
        TriedStepResult("train jpeg", "60", (tried(0, -0.75),)),  # without its clean step
    ]
    (page,) = tried_pages(steps)
    assert [trial.value for trial in page.steps[1].trials] == [0.25, 1.25]
    counts = [tally(step.trials, TRAINING) for step in page.steps[1:]]
    assert [(found.fine, found.failed) for found in counts] == [(1, 1)] * 2
    assert [(found.alarms, found.announced) for found in counts] == [(0, 0), (1, 1)]


# ---- the report


def test_every_word_of_a_chart_stands_apart_from_the_others():
    drawn = draw_page(page_of([FINE, ALARM], [BETWEEN, SAID], [UNSAID])).decode()
    words = re.findall(r">([^<>]+)</text>", drawn)
    assert {"failed", "fine", "failed, nothing said", PAGE.axis} <= set(words)


def test_a_report_names_the_worst_case_and_needs_nothing_else():
    page = page_of([FINE, ALARM], [SAID, SAID], [UNSAID])
    pictures = {("warp", str(step)): b"\x89PNG" for step in PAGE.steps[:3]}
    html = atlas_html("python -m bench stability", "1", "seed 0", [page], pictures)
    worst = "Worst case: outline warp, % of cell: 1; rotation error 20.0 degrees; ok"
    assert worst in html  # failed in silence: worse than what is farther off
    assert "Fails from 0.5 on: there 2 of 2 views fail, 2 of them announced." in html
    assert "67 % (2 of 3)" in html
    assert html.count("data:image/png") == 4
    assert not re.search(r"<script|src=\"(?!data:)|https?://(?!www.w3.org)", html)
    without = atlas_html("python -m bench stability", "1", "seed 0", [page], {})
    assert "<img" not in without
