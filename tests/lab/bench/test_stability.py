"""Stability sweeps: pages draw what they say, figures count right, runs resume and repeat."""

from __future__ import annotations

import json
import math
import os
from dataclasses import asdict, replace

import numpy as np
import pytest

from lab.bench.cases.workers import THREADS, in_order
from lab.bench.stability import cameras, colors, fields, scenes, sheets
from lab.bench.stability import pages as listed
from lab.bench.stability import run as stability
from lab.bench.stability.cameras import CALIBRATION
from lab.bench.stability.colors import EYE
from lab.bench.stability.fields import TRAINING
from lab.bench.stability.pages import PAGES
from lab.bench.stability.run import Key, run_job, run_steps, tried_pages
from lab.bench.stability.sheets import BASE, DrawnSheet, draw_sheet
from lab.bench.stability.trials import (
    REFUSED,
    UNJUDGED,
    Page,
    Trial,
    TriedPage,
    TriedStep,
    as_plain,
    as_records,
    fails_from,
    shares,
    summary_csv,
    summary_rows,
    tally,
)
from toonset.errors import SheetError
from toonset.nerf.score import verdict
from toonset.nerf.score.verdict import OK, WEAK
from toonset.palette.names import hex_of

PAGE = {page.name: page for page in PAGES}
CAMERAS = [page for page in PAGES if page.kind is CALIBRATION]
KEY = Key("1", 0, 2, 1)


# ---- pages


def test_every_quick_step_is_one_of_the_full_run() -> None:
    assert len(PAGE) == len(PAGES)
    for page in PAGES:
        assert set(page.quick) <= set(page.steps), page.name
        assert page.reference in page.quick
        assert {page.steps[0], page.steps[-1]} <= set(page.quick)
        assert len(set(map(str, page.steps))) == len(page.steps)


@pytest.mark.parametrize("page", [p for p in CAMERAS if p.base is not None], ids=lambda p: p.name)
def test_the_base_step_is_the_base_sheet(page: Page, monkeypatch) -> None:
    monkeypatch.setattr(sheets, "BASE", replace(BASE, cell_px=60, views=1, supersample=1))
    step = 60 if page.name == "resolution" else page.base
    pairs = zip(page.draw(step, 5).drawings, draw_sheet(5).drawings, strict=True)
    for (view, camera), (plain, same) in pairs:
        np.testing.assert_array_equal(view.rgba, plain.rgba)
        np.testing.assert_array_equal(camera.center, same.center)


@pytest.mark.parametrize("page", CAMERAS, ids=lambda page: page.name)
def test_the_worst_step_can_be_drawn_twice_alike(page: Page, monkeypatch) -> None:
    monkeypatch.setattr(sheets, "BASE", replace(BASE, cell_px=80, views=2, supersample=1))
    of_artist = replace(sheets.ARTIST, cell_px=120, views=2, supersample=1)
    monkeypatch.setattr(sheets, "ARTIST", of_artist)
    first, second = (page.draw(page.steps[-1], 5) for _ in range(2))
    for (view, camera), (again, same) in zip(first.drawings, second.drawings, strict=True):
        np.testing.assert_array_equal(view.rgba, again.rgba)
        np.testing.assert_array_equal(camera.rotation, same.rotation)


# ---- trials of cameras


@pytest.fixture(scope="module")
def sheet() -> DrawnSheet:
    return draw_sheet(3, outline_px=0, cell_px=120, views=3)


def test_a_refused_and_a_crashed_sheet_are_results(sheet: DrawnSheet, monkeypatch) -> None:
    for error, voice in ((SheetError("too faint"), "failed"), (KeyError("k"), "crashed")):

        def broken(*_arguments, error=error):
            raise error

        monkeypatch.setattr(cameras, "find_cameras", broken)
        trials, picture = cameras.try_cameras(lambda: sheet, 0)
        assert picture.startswith(b"\x89PNG")
        assert [(one.voice, one.value) for one in trials] == [(voice, 180.0)] * 3
        assert trials[0].words in ("too faint", "KeyError: 'k'")


# ---- trials of trainings, palettes, labels, looks


def test_a_single_drawing_is_refused_and_a_weak_run_says_why(monkeypatch) -> None:
    monkeypatch.setattr(fields, "STEPS", 2)
    monkeypatch.setattr(scenes, "SCENE", replace(scenes.SCENE, cell_px=40))
    monkeypatch.setattr(scenes, "HELD_OUT", 4)
    stability._base_tried.cache_clear()
    ((refused,), picture) = run_job(("train views", 1, 0))
    assert (refused.voice, refused.value, picture) == (REFUSED, TRAINING.worst, b"")
    assert "at least two views" in refused.words
    ((clean,), picture) = run_job(("train views", 8, 0))
    assert picture.startswith(b"\x89PNG")
    assert clean.voice == WEAK
    assert "these were 2 steps" in clean.words
    assert 0 < clean.value < refused.value
    assert run_job(("train warp", 0, 0))[0][0] is clean  # the same scene, tried once
    stability._base_tried.cache_clear()
    monkeypatch.setattr(verdict, "MOST_OFF", 1.0)
    assert run_job(("train views", 8, 0))[0][0].voice == OK
    stability._base_tried.cache_clear()


def test_two_colours_are_found_where_they_differ_and_one_where_they_do_not(monkeypatch) -> None:
    monkeypatch.setattr(colors, "PICTURES", replace(colors.PICTURES, views=2, cell_px=80))
    ((apart,), _), ((alike,), _) = (run_job(("palette near", step, 0)) for step in (20, 0.5))
    assert (apart.value, alike.value) == (0, 50)
    ((eye,), picture) = run_job(("palette tiny", 5, 0))
    assert eye.value == 100
    assert picture.startswith(b"\x89PNG")
    assert "left out" in eye.words
    assert hex_of(EYE) in eye.words


# ---- figures

WARP = PAGE["warp"]
FINE, ALARM = Trial(0, 1.0, "ok"), Trial(0, 2.0, "weak", "21 % of the outlines")
BETWEEN = Trial(0, 10.0, "weak")
SAID, UNSAID = Trial(1, 50.0, "failed", "54 % of the outlines"), Trial(1, 20.0, "ok")


def page_of(*steps: list[Trial]) -> TriedPage:
    named = zip(map(str, WARP.steps), steps, strict=False)
    return TriedPage(WARP, tuple(TriedStep(n, tuple(t)) for n, t in named))


def test_trials_are_counted_by_their_bounds() -> None:
    trials = (FINE, ALARM, BETWEEN, SAID, UNSAID, Trial(0, 90.0, UNJUDGED))
    counts = {"n": 6, "failed": 3, "judged": 2, "announced": 1, "fine": 2, "alarms": 1}
    assert asdict(tally(trials, CALIBRATION)) == counts
    fates = shares(TriedStep("1", trials), CALIBRATION)
    assert [round(6 * share) for share in fates] == [1, 1, 1, 1, 2]


def test_a_page_fails_from_where_more_than_a_tenth_fail() -> None:
    nine = [FINE] * 9
    page = page_of(nine, [*nine, SAID], [*nine, SAID, UNSAID], [FINE])
    first = fails_from(page)
    assert first is not None
    assert first.step == str(WARP.steps[2])
    assert fails_from(page_of(nine)) is None
    assert as_plain([page])[0] | {"n": 0} == {
        "page": "warp",
        "fails_from": str(WARP.steps[2]),
        "n": 0,
        "failed": 3,
        "judged": 3,
        "announced": 2,
        "fine": 28,
        "alarms": 0,
    }
    assert summary_rows([page])[-1][:2] == ("all pages: calibration", "")
    assert summary_csv([page]).startswith(b"page,fails from,n,failed")
    records = {(r.method, r.metric): r for r in as_records([page], 4)}
    assert records["1", "rotation error"].n == 11
    assert records["1", "failed in silence"].value == 1


def test_the_sheet_that_pages_share_counts_once_for_all_of_them() -> None:
    page = page_of([FINE], [SAID])
    other = replace(page, page=PAGE["squash"])
    assert page.page.base == other.page.base == 0
    rows = summary_rows([page, other])
    assert [row[2] for row in rows] == ["2", "2", "3"]


def test_a_training_loses_against_its_own_bodys_clean_scene() -> None:
    done = {
        ("train warp", "0"): (Trial(0, 0.5, OK), Trial(1, 0.75, OK)),
        ("train warp", "4"): (Trial(0, 0.75, WEAK), Trial(1, 2, WEAK)),
        ("train jpeg", "60"): (Trial(0, 0.75, OK),),  # without its clean step
    }
    (page,) = tried_pages(done)
    assert [trial.value for trial in page.steps[1].trials] == [0.25, 1.25]
    found = tally(page.steps[1].trials, TRAINING)
    assert (found.fine, found.failed, found.alarms, found.announced) == (1, 1, 1, 1)


# ---- the report


# ---- runs


def tiny(step: float, seed: int) -> DrawnSheet:
    return draw_sheet(seed, views=1, cell_px=60, outline_px=0, warp_percent=step)


TINY = Page(CALIBRATION, "tiny", "x", (0, 1, 2), None, tiny)


def test_the_same_seed_gives_the_same_trials_and_another_seed_others(monkeypatch) -> None:
    monkeypatch.setattr(listed, "PAGES", (TINY,))

    def found(seed: int) -> list[tuple[Trial, ...]]:
        steps = run_steps([(TINY, 0), (TINY, 2)], replace(KEY, seed=seed))
        return [trials for _, _, (trials, _) in steps]

    once = found(0)
    assert once == found(0)
    assert [len(trials) for trials in once] == [2, 2]
    assert once != found(7)


def test_workers_keep_the_order_and_use_one_thread_each() -> None:
    assert list(in_order(math.sqrt, [4, 9, 16], 2)) == list(in_order(math.sqrt, [4, 9, 16], 1))
    assert list(in_order(os.getenv, THREADS, 2)) == ["1"] * len(THREADS)


def test_a_second_run_takes_the_first_ones_steps(bench, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(stability, "usable_workers", lambda: 1)
    out = tmp_path / "out"
    command = ("stability", "-o", out, "--count", 1, "--json", "--quiet", "--only", "tiny")
    monkeypatch.setattr(listed, "PAGES", (replace(TINY, steps=(0, 1)),))
    first = bench(*command)
    assert first.code == 0, first
    assert first.json["pages"][0]["n"] == 2
    assert {path.name for path in out.iterdir()} == set(stability.WRITTEN)
    rows = json.loads((out / "steps.json").read_text())["rows"]
    monkeypatch.setattr(listed, "PAGES", (TINY,))
    more = bench(*command)
    assert more.json["pages"][0]["n"] == 3
    assert json.loads((out / "steps.json").read_text())["rows"][:2] == rows
    assert {path.name for path in (out / "pictures").iterdir()} == {
        f"tiny-{step}.png" for step in (0, 1, 2)
    }
    page = (out / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 3
    assert "'seed': 0" in bench(*command, "--seed", 1).reason
    afresh = bench(*command, "--seed", 1, "--quick", "--force")
    assert afresh.json["pages"][0]["n"] == 3
    (out / "steps.json").write_text('{"key": 3}')
    assert "holds no results" in bench(*command).reason


def test_mistakes_are_refused_before_any_work(bench, tmp_path) -> None:
    wrong = bench("stability", "--only", "hat", "-o", tmp_path / "out")
    assert "takes one of views, angles" in wrong.reason
    (tmp_path / "drawing.png").write_bytes(b"x")
    assert "--force" in bench("stability", "-o", tmp_path).reason
    assert "drawing.png" in bench("stability", "-o", tmp_path, "--force").reason
    assert bench("stability", "--cases", tmp_path).code == 2
