"""The training bench: plan, snapshots, resuming, table and figure."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lab.bench.cases.cases import TrainCase
from lab.bench.train.measure import in_order, records_of, run_jobs, table_of
from lab.bench.train.plan import (
    METHODS,
    NEAREST,
    SCOPES,
    Job,
    Method,
    Scope,
    plan,
    subset,
    view_counts,
)
from lab.bench.train.run import Look, RunResult
from tests.nerf.ellipsoids import first_hit
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.options import TrainOptions
from toonset.nerf.score.metrics_view import Judges
from toonset.nerf.train import box_rays

# a grid in the whole box, of few rays a step: small scenes train in seconds
QUICK = TrainOptions(device="cpu", carve=False, field="triplane", register=False, unwarp=False)


def ball(yaw: float, side: int, name: str) -> Frame:
    """Return a red ball with a blue right half, 2 units wide, drawn from `yaw`."""
    camera = Camera.looking_at(np.zeros(3), yaw, 0.1, side / 3, (side, side), k=0.0)
    which, points = first_hit(camera, [(np.zeros(3), np.ones(3))])
    colors = np.where(points[..., :1] > 0, (40, 60, 200, 255), (200, 40, 40, 255))
    return Frame(name, camera, np.where(which[..., None] == 0, colors, 0).astype(np.uint8))


def case(name: str = "ball-exact", views: int = 8, side: int = 32) -> TrainCase:
    def scene(count: int, turn: float) -> Scene:
        yaws = [turn + 2 * np.pi * i / count for i in range(count)]
        frames = [ball(yaw, side, f"{i:03d}.png") for i, yaw in enumerate(yaws)]
        return Scene(tuple(frames), None, name)

    return TrainCase(name, name.rsplit("-", 1)[-1], scene(views, 0.0), scene(4, np.pi / 8))


@pytest.fixture
def short_methods(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, Method]]:
    """Replace the methods by quick ones; their order, which is that of tables, comes back too."""
    monkeypatch.setattr(box_rays, "RAYS_PER_STEP", 256)
    short = {"default": Method(replace(QUICK, steps=60), seeds=True), NEAREST: Method(None)}
    known = dict(METHODS)
    METHODS.clear()
    METHODS.update(short)
    yield short
    METHODS.clear()
    METHODS.update(known)


def result(method: str, psnr: float, seconds: float, case: str = "a", seed: int = 0) -> RunResult:
    figures = {"psnr": psnr, "psnr_mask": None, "palette_psnr": psnr - 1}
    return RunResult("exact 150 px 8 views", method, case, seed, figures, seconds, seconds, 7)


def test_what_tells_most_comes_first() -> None:
    cases = [case("big-exact", side=64), case("ball-exact"), case("ball-drawn", views=5)]
    jobs = plan(cases, 7, "", SCOPES[False])
    keys = [(job.seed, max(job.case.test.frames[0].camera.size_wh), -job.views) for job in jobs]
    assert keys == sorted(keys)
    assert {job.seed for job in jobs} == {7, 8, 9}
    assert {job.views for job in jobs if job.case.name == "ball-drawn"} == {5, 4, 3}
    own_palette = {name for name in METHODS if METHODS[name].palette == "hand-picked palette"}
    methods = set(METHODS) - own_palette  # these cases have none
    assert {job.method for job in jobs if job.seed == 7} == methods
    slow = {job.case.name for job in jobs if job.method == "mlp"}
    assert slow == {"big-exact", "ball-exact", "ball-drawn"}  # the first of each group
    assert {job.views for job in jobs if not METHODS[job.method].fewer} == {8, 5}
    later = {job.method for job in jobs if job.seed > 7}
    assert later == {name for name in methods if METHODS[name].seeds}
    assert len({json.dumps(job.identity) for job in jobs}) == len(jobs)
    chosen = plan(cases, 0, "ball-drawn 32 px 4 views", SCOPES[False])
    assert {job.group for job in chosen} == {"drawn 32 px 4 views"}


def test_a_quick_plan_has_one_case_per_condition() -> None:
    cases = [case("ball-exact"), case("cube-exact"), case("ball-drawn")]
    scope = SCOPES[True]
    jobs = plan(cases, 0, "", scope)
    assert {job.case.name for job in jobs} == {"ball-exact", "ball-drawn"}
    assert {(job.views, job.seed) for job in jobs} == {(8, 0)}
    assert {job.method for job in jobs} == set(scope.methods) <= set(METHODS)


def test_views_are_taken_evenly() -> None:
    eight = case()
    names = [frame.name for frame in subset(eight, 4).train.frames]
    assert names == ["000.png", "002.png", "004.png", "006.png"]
    assert subset(eight, 8).train.frames == eight.train.frames
    assert len(subset(eight, 3).train.frames) == 3
    assert subset(eight, 3).test is eight.test
    assert view_counts(case(views=3), (8, 4, 3)) == [3]


def test_a_training_and_its_figures(short_methods: dict[str, Method]) -> None:
    jobs = [Job(case(), 8, method, 0) for method in short_methods]
    trained, nearest = (found for _, found in run_jobs(jobs))
    assert trained.cpu_seconds > 0
    assert trained.parameters > 0
    assert trained.model_bytes > 0
    assert trained.figures["label_accuracy"] is not None
    assert trained.figures["palette_psnr"] is not None
    assert (nearest.seconds, nearest.parameters, nearest.model_bytes) == (0, 0, 0)
    assert 10 < (nearest.figures["psnr"] or 0) < 120


def test_a_refused_training_is_noted_and_the_others_go_on(short_methods: dict[str, Method]) -> None:
    alike = case()
    one_side = tuple(alike.train.frames[0] for _ in range(8))
    broken = replace(alike, train=replace(alike.train, frames=one_side))
    jobs = [Job(broken, 8, "default", 0), Job(alike, 8, NEAREST, 0)]
    failed, fine = (found for _, found in run_jobs(jobs))
    assert "look along one line" in failed.note
    assert failed.figures == {}
    assert in_order([failed, fine]) == [fine]
    text = table_of([failed, fine])
    assert "failed\nball-exact, exact 32 px 8 views, default, seed 0: " in text
    assert [record.method for record in records_of([failed], 0)] == []


def test_table_and_records() -> None:
    runs = [
        result(NEAREST, 18.0, 0.0),
        result("default", 30.0, 4.0),
        result("default", 31.0, 6.0, case="b"),
    ]
    lines = table_of(runs).splitlines()
    assert lines[0] == "exact 150 px 8 views"
    rows = {line[:15].strip(): line[15:].split() for line in lines[2:]}
    assert list(rows) == ["default", NEAREST]  # as the methods are listed
    assert rows["default"][:2] == ["2", "5.0"]
    assert "30.50" in rows["default"]
    assert "18.00" in rows[NEAREST]
    records = {(r.method, r.metric): r for r in records_of(runs, 3)}
    psnr = records["default", "held-out PSNR"]
    assert (psnr.n, psnr.median, psnr.seed, psnr.direction) == (2, 30.5, 3, "higher")
    assert psnr.p95 == pytest.approx(30.05)  # the bad end
    assert psnr.by_case == {"a": 30, "b": 31}
    assert ("default", "held-out PSNR in mask") not in records


def test_a_stopped_bench_goes_on(
    short_methods: dict[str, Method], bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import lab.bench.cases.cases as cases
    import lab.bench.train.measure as measure

    monkeypatch.setattr(cases, "train_cases", lambda *a, **k: iter([case()]))
    monkeypatch.setitem(SCOPES, True, Scope(tuple(short_methods)))
    done: list[str] = []
    honest, stop = measure.run_job, True

    def counted(job: Job, judges: Judges, look: Look) -> RunResult:
        if stop and done:
            raise KeyboardInterrupt
        done.append(job.method)
        return honest(job, judges, look)

    monkeypatch.setattr(measure, "run_job", counted)
    out = tmp_path / "bench"
    command = ("train", "--quick", "-o", out)
    assert bench(*command).code != 0
    written = {path.name for path in out.iterdir()}
    charts = {f"chart-exact-32-px-8-views.{form}" for form in ("png", "svg", "csv")}
    assert written == {"runs.json", "records.json", "report.html", "views", *charts}
    stop = False
    again = bench(*command, "--json")
    assert again.code == 0, again
    assert done == ["default", NEAREST]  # each once
    assert "1 trainings, 1 are there already" in again.err
    assert {r["method"] for r in again.json["records"]} == set(short_methods)
    assert json.loads((out / "records.json").read_text()) == again.json["records"]
    drawn = {path.name: path.read_bytes() for path in out.iterdir() if path.is_file()}
    for name in drawn.keys() - {"runs.json"}:
        (out / name).unlink()
    assert bench(*command, "--json").json == again.json  # redrawn, not trained again
    assert done == ["default", NEAREST]
    assert {path.name: path.read_bytes() for path in out.iterdir() if path.is_file()} == drawn
    assert bench(*command, "--only", "hat").reason.startswith("no training's name contains 'hat'")
    (out / "drawing.png").write_bytes(b"mine")
    assert "holds 'drawing.png'" in bench(*command, "--force").reason
