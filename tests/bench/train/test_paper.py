"""The paper's table and figure: what they say, that a stopped run goes on, and their files."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bench.cases.cases import TrainCase
from bench.paper.picture import drawn_strip, figure_of, shown_frames
from bench.paper.plan import CASES, QUICK_CASES, SEEDS, paper_plan
from bench.paper.table import as_csv, as_text, outdone, outdone_text, paper_rows
from bench.train.plan import METHODS, PAPER, Job, Method
from bench.train.run import RunResult, Seen, run_job
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.options import USUAL_STEPS, TrainOptions
from toonset.nerf.score.evaluation_picture import TILE_PX
from toonset.nerf.score.metrics_view import Judges

LAST = "paper, automatic palette, 2000 steps"
QUICK = [name for name in PAPER if name.endswith(" 200 steps")]
OWN = np.array([[200, 40, 40], [40, 60, 200]], dtype=np.uint8)


def block(views: int, turn: float) -> Scene:
    """Return views of an upright round block, red above and blue below."""
    frames, side = [], 24
    rgba = np.zeros((side, side, 4), dtype=np.uint8)
    rgba[4:12, 8:16], rgba[12:20, 8:16] = (200, 40, 40, 255), (40, 60, 200, 255)
    for i in range(views):
        yaw = turn + 2 * np.pi * i / views
        camera = Camera.looking_at(np.zeros(3), yaw, 0.1, 8.0, (side, side), k=0.0)
        frames.append(Frame(f"{i:03d}.png", camera, rgba))
    return Scene(tuple(frames), None, "block")


def case() -> TrainCase:
    return TrainCase("block-exact", "exact", block(8, 0.0), block(4, np.pi / 8))


def found(method: str, *curve: Seen, case: str = "a", **figures: float | None) -> RunResult:
    end = curve[-1]
    seconds = end.seconds, end.cpu_seconds
    return RunResult("exact 150 px 8 views", method, case, 0, figures, *seconds, 0.1, 7, curve)


def runs() -> list[RunResult]:
    slow = found(LAST, Seen(10, 20, 20.0), Seen(90, 180, 25.0), psnr=25.5, palette_psnr=24.0)
    fast = found("default", Seen(1, 2, 23.0), Seen(5, 10, 27.0), psnr=27.5, palette_psnr=27.2)
    bare = found("paper, no palette, 200 steps", Seen(9, 9, 20.0), psnr=20.0)
    return [fast, bare, slow]


def test_the_table_has_a_row_per_palette_steps_and_layer() -> None:
    other = replace(runs()[2], case="b")
    more = [replace(other, seed=n, figures={"psnr": 26.0 + n}) for n in (0, 1)]  # 26.5 of case b
    rows = paper_rows([*runs(), *more])
    keys = [(row["method"], row["palette"], row["iterations"], row["layer"]) for row in rows]
    assert keys == [
        ("paper", "no palette", 200, "field"),
        ("paper", "automatic palette", 2000, "field"),
        ("paper", "automatic palette", 2000, "classifier"),
        ("default", "automatic palette", USUAL_STEPS, "field"),
        ("default", "automatic palette", USUAL_STEPS, "classifier"),
    ]
    assert [row["psnr"] for row in rows] == [20.0, 26.0, 24.0, 27.5, 27.2]
    assert rows[1]["lpips"] is None
    assert (rows[1]["n"], rows[1]["trainings"], rows[1]["cpu_seconds"]) == (2, 3, 180)
    read = list(csv.DictReader(io.StringIO(as_csv(rows))))
    assert [float(row["psnr"]) for row in read] == [row["psnr"] for row in rows]
    assert read[0]["lpips"] == ""
    assert len(as_text(rows).splitlines()) == 2 + len(rows)
    both = paper_rows([*runs(), *(replace(run, group="drawn") for run in runs())])
    assert [row["condition"] for row in both] == [rows[0]["condition"]] * 5 + ["drawn"] * 5


def test_when_the_default_outdoes_the_paper() -> None:
    fast, _, slow = runs()
    (entry,) = outdone([fast, slow])
    assert entry["passed_after_cpu_s"] == 6.0  # half way from 23 to 27 dB, from 2 to 10 s
    assert entry["share"] == pytest.approx(1 / 30)
    assert "passes that after 6.0 CPU s (1/30) and ends at 27.00 dB" in outdone_text(entry)
    (behind,) = outdone([replace(fast, curve=(Seen(0, 0, 23.0), Seen(1, 1, 24.0))), slow])
    assert behind["share"] is None
    assert "does not get there (24.00 dB)" in outdone_text(behind)
    assert outdone([slow]) == []
    assert outdone([replace(fast, curve=fast.curve[-1:]), slow]) == []  # nobody followed it
    assert outdone([replace(fast, seed=1), slow]) == []


def test_a_stopped_plan_has_all_palettes_of_what_it_has_come_to() -> None:
    own = [
        replace(case(), name=f"{i}", train=replace(case().train, palette=OWN)) for i in range(CASES)
    ]
    jobs = paper_plan(own, 5, "", quick=False)
    assert len(jobs) == CASES * (len(PAPER) * SEEDS + 1)
    options = [METHODS[job.method].options for job in jobs]
    steps = [found.steps or USUAL_STEPS for found in options if found]
    assert steps == sorted(steps)
    few = jobs[: steps.count(200)]
    keys = [(job.seed, job.case.name) for job in few]
    assert keys == sorted(keys)
    assert {keys.count(key) for key in keys} == {3}
    assert {job.seed for job in jobs if job.method == "default"} == {5}
    assert {job.method for job in jobs if job.curve} == {"default"}
    quick = paper_plan(own, 5, "", quick=True)
    assert len(quick) == QUICK_CASES * 4
    assert {job.seed for job in quick} == {5}
    drawn = [replace(one, group="drawn") for one in own]
    assert len(paper_plan([*own, *drawn], 5, "", quick=True)) == 2 * len(quick)
    assert {job.case.name for job in paper_plan(own, 5, "3 24 px", quick=False)} == {"3"}


def test_hand_picked_palettes_are_those_that_cases_come_with() -> None:
    bare = case()
    own = replace(bare, train=replace(bare.train, palette=OWN))
    assert not any("hand-picked" in job.method for job in paper_plan([bare], 0, "", quick=False))
    jobs = paper_plan([own], 0, "", quick=False)
    assert {job.method for job in jobs} == {"default", *PAPER}
    with_it = Method(TrainOptions(steps=1, field="triplane", device="cpu"), "hand-picked palette")
    seen = []
    METHODS["own"] = with_it
    try:
        run_job(Job(own, 4, "own", 0), Judges("", ""), lambda *given: seen.append(given[2].palette))
    finally:
        del METHODS["own"]
    np.testing.assert_array_equal(seen, [OWN])


def test_the_figure_is_put_together_of_drawings_and_strips() -> None:
    two = case()
    names = [frame.name for frame in shown_frames(two)]
    assert names == ["001.png", "005.png", "000.png", "002.png"]  # two trained on, two held out
    drawn = drawn_strip(two)
    assert drawn.shape == (4 * TILE_PX, TILE_PX, 3)
    red = np.full((4 * TILE_PX, 2 * TILE_PX, 3), (255, 0, 0), dtype=np.uint8)
    figure = figure_of(drawn, {"one": red, "two": red})
    assert (figure == (255, 0, 0)).all(axis=-1).sum() == 2 * red.shape[0] * red.shape[1]


@pytest.fixture
def short_methods() -> Iterator[None]:
    """Let the quick bench train for few steps."""
    known = dict(METHODS)
    for name in ("default", *QUICK):
        options = TrainOptions(
            steps=2, field="triplane", register=False, unbend=False, device="cpu"
        )
        METHODS[name] = replace(METHODS[name], options=replace(options, carve=name == "default"))
    yield
    METHODS.update(known)


def test_the_command_writes_table_and_figure_and_goes_on(
    short_methods: None, bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import bench.cases.cases as cases

    two = [replace(case(), name=name) for name in ("block-exact", "brick-exact")]
    monkeypatch.setattr(cases, "train_cases", lambda *a, **k: iter(two))
    out = tmp_path / "paper"
    command = ("paper", "--quick", "-o", out)
    first = bench(*command, "--json")
    assert first.code == 0, first
    written = json.loads((out / "table1.json").read_text())
    assert {name: written[name] for name in first.json} == first.json
    layers = [row["layer"] for row in first.json["rows"]]
    assert layers == ["field", "field", "classifier", "field", "classifier"]
    assert {row["n"] for row in first.json["rows"]} == {2}
    assert len((out / "table1.csv").read_text().splitlines()) == 6
    compared = first.json["differences"]
    assert {(d["n"], d["palette"]) for d in compared} == {(2, "automatic palette")}
    assert len((out / "differences.csv").read_text().splitlines()) == 1 + len(compared)
    assert (out / "differences-exact-24-px-8-views.png").is_file()
    figure = Image.open(out / "figure4-block-exact-24px.png")
    assert figure.width > 5 * TILE_PX  # drawings, and two pairs
    names = {path.name for path in out.iterdir() if path.is_file()}
    drawn = {name: (out / name).read_bytes() for name in names - {"report.html"}}  # has the command
    for name in names - {"runs.json"}:
        (out / name).unlink()
    again = bench(*command)
    assert {name: (out / name).read_bytes() for name in drawn} == drawn
    assert "0 trainings, 6 are there already" in again.err
    assert "Does a palette help?" in again.out
    (out / "mine.txt").write_text("mine")
    assert "holds 'mine.txt'" in bench(*command, "--force").reason


def test_a_stopped_run_has_the_table_of_what_it_has_found(
    short_methods: None, bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import bench.cases.cases as cases
    import bench.train.measure as measure

    count = 0

    def stopping(*given: object) -> RunResult:
        nonlocal count
        count += 1
        if count == 3:
            raise KeyboardInterrupt
        return run_job(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(cases, "train_cases", lambda *a, **k: iter([case()]))
    monkeypatch.setattr(measure, "run_job", stopping)
    command = ("paper", "--quick", "-o", tmp_path / "paper")
    assert bench(*command).code != 0
    rows = json.loads((tmp_path / "paper" / "table1.json").read_text())["rows"]
    assert [row["palette"] for row in rows] == ["no palette"] + ["automatic palette"] * 2
    assert "1 trainings, 2 are there already" in bench(*command).err
