"""Stability sweeps: damage keeps its truth, figures count right, runs resume and repeat."""

from __future__ import annotations

import json
import math
import os
from dataclasses import asdict, replace

import numpy as np
import pytest

from bench.__main__ import resumable
from bench.atlas.run import Counts, TriedStepResult, all_pages, run_steps
from bench.atlas.training import Tried
from bench.calib.measure import ViewError
from bench.cases.bodies import random_body
from bench.cases.workers import THREADS, in_order
from bench.stability import artist
from bench.stability import steps as stability
from bench.stability.chart import draw_stability
from bench.stability.files import RunKey, as_plain, from_plain, in_table_order, name_of
from bench.stability.page import chosen
from bench.stability.sheet import BASE, draw_sheet
from bench.stability.steps import SheetResult, StepResult, align_from, run_sheet
from bench.stability.sweeps import SWEEPS, Sweep
from bench.stability.table import as_csv, as_records, row
from toonset.cli.common.output import Printer
from toonset.errors import BundleError, SheetError

PLAIN = replace(BASE, outline_px=0, cell_px=120, views=3)
KEY = RunKey("1", 0, Counts(1, 1))


@pytest.fixture(scope="module")
def sheet():
    return draw_sheet(3, PLAIN)


# ---- sweeps


def test_every_quick_step_is_one_of_the_full_run():
    pages = all_pages()
    assert len({page.name for page in pages}) == len(pages)
    for page in pages:
        assert set(page.quick) <= set(page.steps), page.name
        assert len(set(map(str, page.steps))) == len(page.steps)


@pytest.mark.parametrize("sweep", [s for s in SWEEPS if s.base is not None], ids=lambda s: s.name)
def test_the_base_step_is_the_base_sheet(sweep, monkeypatch):
    small = replace(BASE, cell_px=60, views=1, supersample=1)
    for place in ("sheet", "draws"):
        monkeypatch.setattr(f"bench.stability.{place}.BASE", small)
    step = 60 if sweep.name == "resolution" else sweep.base
    for (view, camera), (plain, same) in zip(
        sweep.draw(step, 5).drawings, draw_sheet(5, small).drawings, strict=True
    ):
        np.testing.assert_array_equal(view.rgba, plain.rgba)
        np.testing.assert_array_equal(camera.center, same.center)


@pytest.mark.parametrize("sweep", SWEEPS, ids=lambda sweep: sweep.name)
def test_the_worst_step_can_be_drawn_twice_alike(sweep, monkeypatch):
    small = replace(BASE, cell_px=80, views=2, supersample=1)
    for place in ("sheet", "draws"):
        monkeypatch.setattr(f"bench.stability.{place}.BASE", small)
    of_artist = replace(artist.SHEET, cell_px=120, views=2, supersample=1)
    monkeypatch.setattr(artist, "SHEET", of_artist)
    first, second = (sweep.draw(sweep.steps[-1], 5) for _ in range(2))
    for (view, camera), (again, same) in zip(first.drawings, second.drawings, strict=True):
        np.testing.assert_array_equal(view.rgba, again.rgba)
        np.testing.assert_array_equal(camera.rotation, same.rotation)


# ---- runs


def test_alignment_from_the_truth_stays_and_from_behind_is_lost(sheet):
    near = align_from(sheet, math.radians(5), 0)
    far = align_from(sheet, math.radians(150), 0)
    assert np.median([view.raw for view in near]) < math.radians(1)
    assert min(view.raw for view in far) > math.radians(15)
    assert {view.verdict for view in near} == {""}


def test_a_refused_and_a_crashed_sheet_are_results(sheet, monkeypatch):
    sweep = Sweep("x", "x", (0,), (0,), "", None, lambda step, seed: sheet)
    for error, verdict in ((SheetError("too faint"), "failed"), (KeyError("k"), "crashed")):

        def broken(*_arguments, error=error):
            raise error

        monkeypatch.setattr(stability, "find_cameras", broken)
        result, picture = run_sheet(sweep, 0, 0)
        assert picture.startswith(b"\x89PNG")
        assert [view.verdict for view in result.views] == [verdict] * 3
        assert "too faint" in result.note or result.note == "KeyError: 'k'"


def test_a_missing_mannequin_is_what_users_get_without_one(sheet, monkeypatch):
    asked = []

    def found(views, mesh):
        asked.append(mesh)
        raise SheetError("stop")

    monkeypatch.setattr(stability, "calibrate", found)
    monkeypatch.setattr(stability, "find_cameras", found)
    for given in ("own", "plain", "none"):
        same = replace(sheet, given=given)
        run_sheet(Sweep("x", "x", (0,), (0,), "", None, lambda step, seed, s=same: s), 0, 0)
    assert asked == [sheet.mesh, None, "none"]


def tiny(step, seed):
    return draw_sheet(seed, replace(PLAIN, views=1, cell_px=60))


def test_the_same_seed_gives_the_same_table_and_another_seed_another():
    sweep = Sweep("start", "x", (10, 20), (10,), "", None, tiny, from_start=True)
    plan = [(sweep, step) for step in sweep.steps]

    def table(seed):
        results = [result for result, _ in run_steps(plan, seed, Counts(2, 1))]
        return as_csv([row(r) for r in results if isinstance(r, StepResult)], seed)

    once = table(0)
    assert once == table(0)
    assert once.splitlines()[1:] != table(7).splitlines()[1:]
    assert [line.split(b",")[:4] for line in once.splitlines()[1:]] == [
        [b"start", b"10", b"2", b"2"],
        [b"start", b"20", b"2", b"2"],
    ]


def test_workers_keep_the_order_and_use_one_thread_each():
    assert list(in_order(math.sqrt, [4, 9, 16], 2)) == list(in_order(math.sqrt, [4, 9, 16], 1))
    assert list(in_order(os.getenv, THREADS, 2)) == ["1"] * len(THREADS)


# ---- figures


def result_of(*views, sweep="warp", step="1") -> StepResult:
    errors = tuple(ViewError(math.radians(r), math.radians(m), v) for r, m, v in views)
    return StepResult(sweep, step, (SheetResult(errors, 1.0, ""),))


def test_figures_count_what_they_say():
    found = row(
        result_of(
            (1, 1, "ok"),
            (2, 2, "weak"),  # solved, but called weak
            (170, 2, "ok"),  # flipped in silence
            (175, 3, "ambiguous"),  # flipped and said so
            (60, 40, "failed"),
            (10, 10, "ok"),  # neither solved nor wrong
        )
    )
    assert found.solved_modulo_twin == pytest.approx(4 / 6)
    assert found.solved == pytest.approx(2 / 6)
    assert (found.median_deg, found.median_raw_deg) == (pytest.approx(2.5), pytest.approx(35))
    assert (found.ok, found.weak, found.ambiguous, found.failed, found.crashed) == (3, 1, 1, 1, 0)
    assert (found.wrong, found.silent_wrong, found.false_alarms) == (3, 1, 1)
    assert found.announced == pytest.approx(2 / 3)


def test_an_alignment_without_verdict_is_neither_silent_nor_an_alarm():
    found = row(result_of((1, 1, ""), (90, 90, "")))
    assert (found.wrong, found.silent_wrong, found.false_alarms) == (1, 0, 0)
    assert found.announced is None


def test_csv_does_not_know_the_seconds():
    one = result_of((1, 1, "ok"))
    slow = replace(one, sheets=(replace(one.sheets[0], seconds=99.0),))
    assert as_csv([row(one)], 4) == as_csv([row(slow)], 4)
    assert as_csv([row(one)], 4).endswith(b",4\n")
    metrics = {record.metric: record.value for record in as_records([slow], 4)}
    assert metrics["seconds"] == 99.0


def test_steps_survive_the_way_through_json_and_sort_as_listed():
    steps = [
        result_of((1 / 3, 0.1, "ok"), step="2"),
        result_of((2, 2, ""), step="5", sweep="start"),
        result_of((9, 9, "weak"), step="0.5"),
        TriedStepResult(
            "train jpeg", "60", (Tried(3, 30.5, "silent", "", {"apart_px": 0.5}, 2.0),)
        ),
    ]
    text = json.dumps(as_plain(KEY, steps))
    assert from_plain(json.loads(text), KEY, "x") == steps
    assert [name_of(s) for s in in_table_order([*steps, result_of(sweep="gone")])] == [
        ("start", "5"),
        ("warp", "0.5"),
        ("warp", "2"),
        ("train jpeg", "60"),
    ]


@pytest.mark.parametrize(
    "broken",
    [[], {}, {"format": 1}, {"format": 2}, None, {**asdict(KEY), "format": 2, "steps": [3]}],
)
def test_foreign_steps_are_refused(broken):
    with pytest.raises(BundleError, match="--force"):
        from_plain(broken, KEY, "steps.json")


def test_steps_of_another_seed_are_refused():
    with pytest.raises(BundleError, match="seed=1"):
        from_plain(as_plain(replace(KEY, seed=1), []), KEY, "steps.json")


def test_a_picture_is_drawn_of_one_sweep_and_of_many():
    rows = [row(result_of((1, 1, "ok"), sweep=s.name, step=str(s.steps[0]))) for s in SWEEPS]
    for some in (rows[:1], rows[:5]):
        assert draw_stability(some, "n = 1").startswith(b"\x89PNG")


# ---- the command


def test_a_second_run_takes_the_first_ones_steps(bench, tmp_path, monkeypatch):
    sweep = Sweep("start", "x", (0, 5), (0,), "", None, tiny, from_start=True)
    for place in ("atlas.run.SWEEPS", "stability.chart.SWEEPS"):
        monkeypatch.setattr(f"bench.{place}", (sweep,))
    monkeypatch.setattr("bench.cases.workers.usable_workers", lambda: 1)
    out = tmp_path / "out"
    command = ("stability", "-o", out, "--count", 1, "--json", "--quiet")
    first = bench(*command, "--quick", "--only", "start")
    assert first.code == 0, first
    assert [found["step"] for found in first.json["rows"]] == ["0"]
    assert {path.name for path in out.iterdir()} == {
        "steps.json",
        "stability.csv",
        "stability.png",
        "records.json",
        "pages.csv",
        "pictures",
        "report.html",
    }
    kept = json.loads((out / "steps.json").read_text())["steps"][0]
    more = bench(*command, "--only", "start")
    assert [found["step"] for found in more.json["rows"]] == ["0", "5"]
    assert {path.name for path in (out / "pictures").iterdir()} == {"start-0.png", "start-5.png"}
    page = (out / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 3  # two steps, and the worst of them again
    assert page.count('<section id="') == 1
    assert json.loads((out / "steps.json").read_text())["steps"][0] == kept  # seconds, too
    assert "seed=0" in bench(*command, "--seed", 1).reason
    afresh = bench(*command, "--seed", 1, "--quick", "--only", "start", "--force")
    assert [found["step"] for found in afresh.json["rows"]] == ["0"]


def test_mistakes_are_refused_before_any_work(bench, tmp_path):
    wrong = bench("stability", "--only", "hat", "-o", tmp_path / "out")
    assert "takes one of start, views" in wrong.reason
    (tmp_path / "drawing.png").write_bytes(b"x")
    assert "--force" in bench("stability", "-o", tmp_path).reason
    assert "drawing.png" in bench("stability", "-o", tmp_path, "--force").reason
    assert bench("stability", "--cases", tmp_path).code == 2


def test_a_body_of_a_seed_is_the_sheets_body():
    np.testing.assert_array_equal(draw_sheet(3, PLAIN).mesh.vertices, random_body(3).vertices)
    assert [step for _, step in chosen("mirror", SWEEPS, quick=True)] == [0, 1, 2]


def test_an_interrupted_bench_says_that_it_goes_on(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(KeyboardInterrupt), resumable(Printer(as_json=False, quiet=True)):
        raise KeyboardInterrupt
    assert capsys.readouterr().err == "what is done is kept; the same command goes on\n"
