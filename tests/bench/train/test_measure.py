"""The training bench: plan, snapshots, resuming, table and figure."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest
import torch

from bench.cases.cases import TrainCase
from bench.train import run as train_run
from bench.train.files import as_plain, from_plain, missing
from bench.train.measure import in_order, records_of, run_jobs, table_of
from bench.train.plan import (
    MANNEQUIN,
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
from bench.train.run import Look, RunResult, Seen, Snapshots, curve_frames, reached
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.errors import BundleError
from toonset.nerf.options import TrainOptions
from toonset.nerf.score.metrics_view import Judges
from toonset.nerf.train import box_rays
from toonset.nerf.train.labelling import without_palette
from toonset.nerf.train.loop import Moment
from toonset.nerf.train.loss import Model
from toonset.nerf.train.train import fit_field

# a grid in the whole box, of few rays a step: small scenes train in seconds
QUICK = TrainOptions(device="cpu", carve=False, field="triplane", register=False, unbend=False)


def ball(yaw: float, side: int, name: str) -> Frame:
    """Return a red ball with a blue right half, 2 units wide, drawn from `yaw`."""
    camera = Camera.looking_at(np.zeros(3), yaw, 0.1, side / 3, (side, side), k=0.0)
    pixel = camera.pixel_grid().reshape(-1, 2)
    origins, directions = camera.rays(pixel)
    b, c = (origins * directions).sum(-1), (origins**2).sum(-1) - 1
    hit = b * b > c
    point = origins + (-b - np.sqrt(np.maximum(b * b - c, 0)))[:, None] * directions
    rgba = np.zeros((side * side, 4), dtype=np.uint8)
    rgba[hit] = np.where(point[hit, :1] > 0, (40, 60, 200, 255), (200, 40, 40, 255))
    return Frame(name, camera, rgba.reshape(side, side, 4))


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
    short = {
        "default": Method(replace(QUICK, steps=60), curve=True),
        NEAREST: Method(None, first_seed_only=True),
    }
    known = dict(METHODS)
    METHODS.clear()
    METHODS.update(short)
    yield short
    METHODS.clear()
    METHODS.update(known)


def result(method: str, psnr: float, *curve: Seen, case: str = "a", seed: int = 0) -> RunResult:
    figures = {"psnr": psnr, "psnr_mask": None, "palette_psnr": psnr - 1}
    end = curve[-1].seconds if curve else 0.0
    return RunResult("exact 150 px 8 views", method, case, seed, figures, end, end, 0.1, 7, curve)


def test_what_tells_most_comes_first() -> None:
    cases = [case("big-exact", side=64), case("ball-exact"), case("ball-drawn", views=5)]
    jobs = plan(cases, 7, "", SCOPES["train", False])
    keys = [(job.seed, max(job.case.test.frames[0].camera.size_wh), -job.views) for job in jobs]
    assert keys == sorted(keys)
    assert {job.seed for job in jobs} == {7, 8, 9}
    assert {job.views for job in jobs if job.case.name == "ball-drawn"} == {5, 4, 3}
    own_palette = {name for name in METHODS if METHODS[name].palette == "hand-picked palette"}
    methods = set(SCOPES["train", False].methods) - {MANNEQUIN}  # these cases have none
    assert {job.method for job in jobs if job.seed == 7} == methods
    assert not methods & own_palette
    slow = {job.case.name for job in jobs if job.method == "mlp"}
    assert slow == {"big-exact", "ball-exact", "ball-drawn"}  # the first of each group
    assert {job.views for job in jobs if METHODS[job.method].most_views_only} == {8, 5}
    later = {job.method for job in jobs if job.seed > 7}
    assert later == {name for name in methods if not METHODS[name].first_seed_only}
    assert len({json.dumps(job.identity) for job in jobs}) == len(jobs)
    chosen = plan(cases, 0, "ball-drawn 32 px 4 views", SCOPES["train", False])
    assert {job.group for job in chosen} == {"drawn 32 px 4 views"}


def test_a_quick_plan_has_one_case_per_condition() -> None:
    cases = [case("ball-exact"), case("cube-exact"), case("ball-drawn")]
    scope = SCOPES["train", True]
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
    half = [job for job in plan([eight], 0, "", SCOPES["train", False]) if "half" in job.name]
    assert {job.group for job in half} == {"exact half turn 32 px 3 views"}
    names = [frame.name for frame in subset(half[0].case, 3).train.frames]
    assert names == ["000.png", "002.png", "004.png"]
    test = case(views=9).train
    assert [frame.name for frame in curve_frames(test)] == [
        "000.png",
        "002.png",
        "004.png",
        "007.png",
    ]


def test_a_training_and_its_curve(
    short_methods: dict[str, Method], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(train_run, "FIRST_LOOK_S", 0.0001)
    jobs = [Job(case(), 8, method, 0) for method in short_methods]
    trained, nearest = (found for _, found in run_jobs(jobs))
    assert [seen.seconds for seen in trained.curve] == sorted(s.seconds for s in trained.curve)
    assert len(trained.curve) > 1
    assert trained.curve[-1].seconds == trained.seconds > 0
    # all four held-out views are on the curve, so it ends at the figure
    assert trained.figures["psnr"] == pytest.approx(trained.curve[-1].psnr, abs=1e-6)
    assert trained.figures["label_accuracy"] is not None
    assert trained.figures["palette_psnr"] is not None
    assert nearest.curve[0].seconds == nearest.seconds == 0
    assert trained.curve[-1].psnr > trained.curve[0].psnr + 1


def test_snapshots_are_the_field_as_it_was_and_cost_no_training_time() -> None:
    """Looked at after every step, the last snapshot is the result; looking does not count."""
    options = replace(QUICK, steps=3)

    class Slow(Snapshots):
        def look(self, moment):
            self._next = 1e-6
            return super().look(moment)

    watch = Slow(time.perf_counter(), time.process_time(), carved=False)
    scene = without_palette(case().train)
    watched = fit_field(scene, options, watch=watch)
    alone = fit_field(scene, options)
    points = torch.rand(50, 3) - 0.5
    expected = alone.result.field(points)
    states = [trained for _, trained in watch.states()]
    assert len(states) == 3
    for found in (watched.result.field(points), states[-1].field(points)):
        for value, known in zip(found, expected, strict=True):
            torch.testing.assert_close(value, known, rtol=2e-2, atol=2e-2)  # stored in half
    first, last = states[0].field(points)[0], states[-1].field(points)[0]
    assert not torch.allclose(first, last)
    times = [spent for spent, _ in watch.kept]
    assert times == sorted(times)


class Watched(Snapshots):
    """Of a training whose parameters take a while to be copied."""

    takes_s = 0.0

    def _model(self) -> Model:
        time.sleep(self.takes_s)
        return cast(Model, torch.nn.Linear(1, 1))


MOMENT = Moment([], 1, 0.0)


def test_looking_stops_the_clock() -> None:
    watch = Watched(time.perf_counter(), time.process_time(), first_look_s=1e-6)
    watch.begin(None)  # type: ignore[arg-type]
    before = watch.spent()[0]
    watch.takes_s = 0.3
    watch.look(MOMENT)
    assert watch.spent()[0] - before < 0.2
    assert watch.kept[0][0][0] - before < 0.2


def test_the_first_look_comes_after_some_fitting_however_long_the_preparation() -> None:
    prepared_for_s = 10.0
    began, cpu_began = time.perf_counter() - prepared_for_s, time.process_time()
    watch = Watched(began, cpu_began, first_look_s=5.0)
    watch.begin(None)  # type: ignore[arg-type]
    watch.look(MOMENT)
    assert watch.kept == []
    watch.began -= 5.0
    watch.look(MOMENT)
    assert watch.kept[0][0][0] > prepared_for_s + 5.0


def test_what_had_nothing_to_do_is_not_left_out_by_training_again(
    short_methods: dict[str, Method],
) -> None:
    options = replace(QUICK, symmetric=False)
    METHODS["one-sided"] = Method(options, leaves_out="symmetry")
    METHODS["as placed"] = Method(options, leaves_out="alignment")
    alike = case()
    bent = replace(result("default", 30.0, case=alike.name), acted=("alignment",))
    bent = replace(bent, group="exact 32 px 8 views")
    jobs = [Job(alike, 8, method, 0) for method in ("one-sided", "as placed")]
    same, trained = (found for _, found in run_jobs(jobs, done=[bent]))
    assert same == replace(bent, method="one-sided")
    assert trained.figures["psnr"] != 30.0
    (default,) = (found for _, found in run_jobs([Job(alike, 4, "default", 0)]))
    assert default.acted == ()  # four sides of a ball, drawn exactly
    assert len(default.curve) == 1  # followed with the most views only


def test_a_refused_training_is_noted_and_the_others_go_on(short_methods: dict[str, Method]) -> None:
    alike = case()
    one_side = tuple(alike.train.frames[0] for _ in range(8))
    broken = replace(alike, train=replace(alike.train, frames=one_side))
    jobs = [Job(broken, 8, "default", 0), Job(alike, 8, NEAREST, 0)]
    failed, fine = (found for _, found in run_jobs(jobs))
    assert "look along one line" in failed.note
    assert (failed.figures, failed.curve) == ({}, ())
    assert in_order([failed, fine]) == [fine]
    text = table_of([failed, fine])
    assert "failed\nball-exact, exact 32 px 8 views, default, seed 0: " in text
    assert [record.method for record in records_of([failed], 0)] == []


def test_when_a_curve_comes_to_a_figure_for_good() -> None:
    curve = [Seen(1, 2, 20.0), Seen(2, 4, 29.8), Seen(3, 6, 29.0), Seen(5, 10, 30.0)]
    near = reached(curve, 29.5)  # 29.8 was past it, but 29.0 came after
    assert near == Seen(4.0, 8.0, 29.5)
    assert reached(curve, 10.0) == curve[0]
    assert reached(curve, 30.1) is None
    falling = [Seen(1, 1, 33.0), Seen(2, 2, 30.0)]
    assert reached(falling, 29.5) == falling[0]


def test_table_and_records() -> None:
    runs = [
        result(NEAREST, 18.0, Seen(0, 0, 18.0)),
        result("default", 30.0, Seen(1, 1, 20), Seen(4, 4, 30)),
        result("default", 31.0, Seen(1, 1, 20), Seen(6, 6, 31), case="b"),
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
    near = records["default", "seconds to 0.5 dB below the end"]
    assert near.median == pytest.approx((1 + 3 * 9.5 / 10 + 1 + 5 * 10.5 / 11) / 2)
    assert (NEAREST, "seconds to 0.5 dB below the end") not in records


def test_results_survive_the_disk() -> None:
    job = Job(case(), 8, "default", 0)
    found = result("default", 30.0, Seen(1, 2, 20.0), Seen(4, 5, 30.0))
    plain = json.loads(json.dumps(as_plain([(job.identity, found)], "1.0"), allow_nan=False))
    assert from_plain(plain, "1.0", "runs.json") == [(job.identity, found)]
    assert missing([job], from_plain(plain, "1.0", "")) == []
    assert missing([replace(job, seed=1), replace(job, views=4)], [(job.identity, found)])
    with pytest.raises(BundleError, match=r"made by toonset 1\.0, this is 2\.0; pass --force"):
        from_plain(plain, "2.0", "runs.json")
    for broken in ([], {}, {"format": 1, "version": "1.0", "runs": [{}]}, None):
        with pytest.raises(BundleError, match="holds no runs of a training bench"):
            from_plain(broken, "1.0", "runs.json")


def test_other_options_are_another_job(monkeypatch: pytest.MonkeyPatch) -> None:
    job = Job(case(), 8, "default", 0)
    before = job.identity
    monkeypatch.setitem(METHODS, "default", Method(TrainOptions(steps=77)))
    assert missing([job], [(before, result("default", 1.0))]) == [job]


def test_a_stopped_bench_goes_on(
    short_methods: dict[str, Method], bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import bench.cases.cases as cases
    import bench.train.measure as measure

    monkeypatch.setattr(cases, "train_cases", lambda *a, **k: iter([case()]))
    monkeypatch.setitem(SCOPES, ("train", True), Scope(tuple(short_methods)))
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
    names = ("chart-exact-32-px-8-views", "chart-exact-32-px-8-views-model-size")
    charts = {f"{name}.{form}" for name in names for form in ("png", "svg", "csv")}
    assert written == {
        "runs.json",
        "records.json",
        "report.html",
        "train.png",
        "train.svg",
        "views",
        *charts,
    }
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
