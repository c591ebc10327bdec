"""`toonset train` as a user lives with it: stopping, going on, and what it says on the way."""

import json
import shutil
import signal
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from toonset.cli.common.refusals import RENAMED
from toonset.cli.common.train_watch import LOG_S, RateLimit, Stopper
from toonset.nerf.options import TrainOptions
from toonset.nerf.score.between import VIEWS

FAST = ("--steps", 12, "--threads", 1, "--device", "cpu")
RUN_FILES = {
    *("model.safetensors", "config.json", "metrics.json", "history.csv", "preview.png"),
    *("drawings.png", "paint.png", "drawings.safetensors"),
}


@pytest.fixture
def ctrl_c_after(monkeypatch):
    """Return what makes the training hear Ctrl-C after a number of steps."""

    def set_up(steps: int) -> None:
        asked = iter(range(1, 10_000))
        real = Stopper.__call__

        def call(self: Stopper) -> bool:
            if next(asked) == steps:
                self._hear(signal.SIGINT, None)
            return real(self)

        monkeypatch.setattr(Stopper, "__call__", call)

    return set_up


def test_a_run_that_is_stopped_is_whole_and_a_rerun_gives_the_same_bytes(
    bundle, toonset, ctrl_c_after, tmp_path, snapshot, monkeypatch
):
    before = snapshot(bundle)
    whole, cut, again = (tmp_path / name for name in ("whole", "cut", "again"))
    assert toonset("train", bundle, "-o", whole, *FAST, "-q").code == 0
    assert {path.name for path in whole.iterdir()} == RUN_FILES
    ctrl_c_after(5)
    done = toonset("train", bundle, "-o", cut, *FAST, "--preview-every", "0.1", "--json")
    monkeypatch.undo()
    assert (done.code, done.json["stopped"]) == (130, "interrupted")
    assert (done.json["steps"], done.json["steps_asked"]) == (5, 12)
    assert "stopping after this step" in done.err
    assert f"{cut}: stopped after step 5 of 12\n" in done.err
    assert {path.name for path in cut.iterdir()} == RUN_FILES
    assert not list(tmp_path.glob("*.unfinished"))
    assert toonset("check", cut).code == 0
    turn = ("--turntable", 1, "--size", 16, "-o", tmp_path / "turn", "-q")
    assert toonset("render", cut, *turn).code == 0
    assert "5 steps" in toonset("info", cut).out
    assert toonset("train", bundle, "-o", again, *FAST, "-q").code == 0
    for name in RUN_FILES - {"metrics.json", "history.csv"}:
        assert (again / name).read_bytes() == (whole / name).read_bytes()
    assert "exists already; pass --force" in toonset("train", bundle, "-o", cut, *FAST).reason
    assert "No such option: --resume" in toonset("train", bundle, "--resume").reason
    assert snapshot(bundle) == before


def test_ctrl_c_writes_the_run_as_it_stands(bundle: Path, tmp_path, interrupted):
    done = interrupted(
        *("training", tmp_path, "train", bundle, "--threads", 1, "--device", "cpu"),
        *("--steps", 1_000_000),
    )
    assert done.code == 130
    assert "of 1000000" in done.err
    assert done.err.endswith("toonset: interrupted\n")
    assert "Traceback" not in done.err
    assert {path.name for path in (bundle / "run").iterdir()} == RUN_FILES
    assert not (bundle / "run.unfinished").exists()


def test_held_out_views_are_looked_at_and_reported(bundle: Path, toonset, tmp_path):
    shutil.copytree(bundle / "images", bundle / "test" / "images")
    shutil.copy(bundle / "transforms.json", bundle / "test")
    done = toonset("train", bundle, *FAST, "--json")
    assert done.code == 0
    assert done.json["verdict"] | {"off_height": None, "between": None} == {
        "verdict": "ok",
        "reasons": [],
        "off_height": None,
        "between": None,
    }
    between = done.json["verdict"]["between"]
    assert len(between) == VIEWS
    assert all(view["whole"] <= view["features"] for view in between)
    assert done.json["test"]["psnr"] == pytest.approx(done.json["train"]["psnr"])
    assert "left" in done.err  # how long it will take
    flags = ("--json", "--no-palette", "--verbose")
    without = toonset("train", bundle, "-o", tmp_path / "o", *FAST, *flags)
    assert without.json["test"] is not None  # found beside the bundle's pictures
    assert "1 CPU thread" in without.err


def test_a_weak_run_says_why_and_is_a_failure_only_to_the_strict(bundle: Path, toonset, tmp_path):
    short = (*FAST, "--steps", 2, "--json")
    done = toonset("train", bundle, "-o", tmp_path / "weak", *short)
    assert (done.code, done.json["verdict"]["verdict"]) == (0, "weak")
    assert all(reason in done.err for reason in done.json["verdict"]["reasons"])
    assert toonset("train", bundle, *short, "--strict", "-o", tmp_path / "strict").code == 3


def test_a_training_that_went_wrong_is_written_with_its_reason(bundle: Path, toonset, monkeypatch):
    monkeypatch.setattr("toonset.nerf.train.loop.TABLES_RATE", float("inf"))
    done = toonset("train", bundle, *FAST, "--quiet")
    assert done.code == 3
    assert "training stopped early: " in done.err
    assert "kept the state of step 0" in done.err
    metrics = json.loads((bundle / "run" / "metrics.json").read_text())
    assert "kept the state of step 0" in metrics["stopped"]
    assert toonset("check", bundle / "run").code == 0


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (RuntimeError("DefaultCPUAllocator: can't allocate memory: you tried to"), "this machine"),
        (torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2.00 GiB"), "the GPU"),
    ],
)
def test_running_out_of_memory_is_one_line(bundle, toonset, monkeypatch, snapshot, error, said):
    before = snapshot(bundle)

    def full(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("toonset.nerf.train.fit_field.make_batches", full)
    done = toonset("train", bundle, *FAST, "-q")
    assert done.reason.startswith(f"out of memory (training asked for more than {said} has)")
    assert snapshot(bundle) == before


@pytest.mark.parametrize("text", ["0", "-1", "auto", "1.5", "2000"])
@pytest.mark.parametrize("line", [["train"], ["render", "-o", "t"], ["mesh", "-o", "t.glb"]])
def test_threads_are_a_number(line: list[str], text: str, toonset, bundle: Path):
    assert "--threads" in toonset(*line, bundle, f"--threads={text}").reason


def test_a_log_gets_a_line_now_and_then_and_a_terminal_a_live_one():
    now = [0.0]

    def lines(live: bool, seconds: float, steps: int) -> int:
        pace = RateLimit(live, lambda: now[0])
        said = 0
        for step in range(steps):
            said += pace.due((step + 1) / steps)
            now[0] += seconds / steps
        return said

    assert lines(False, 6, 300) in (3, 4)
    assert lines(False, 60, 3000) in (10, 11)  # every tenth
    assert lines(False, 3600, 10_000) in range(int(3600 / LOG_S) - 5, int(3600 / LOG_S) + 12)
    assert lines(False, 0.5, 300) == 1
    assert lines(True, 6, 300) in range(50, 62)


def test_a_switch_of_before_names_the_one_of_now(toonset) -> None:
    for before, now in RENAMED.items():
        assert f"No such option: {before}; did you mean {now}?" in toonset("train", before).reason


def test_every_switch_switches_its_option(toonset, monkeypatch) -> None:
    asked: list[TrainOptions] = []
    monkeypatch.setattr("toonset.cli.train.run", lambda request, _: asked.append(request.options))
    switches = {
        ("--no-fairing",): {"fairing": False},
        ("--no-register",): {"register": False},
        ("--no-unwarp",): {"unwarp": False},
        ("--symmetric", "off"): {"symmetric": "off"},
    }
    for words in ((), *switches):
        assert toonset("train", *words).code == 0
    default = asked[0]
    assert asked[1:] == [replace(default, **changed) for changed in switches.values()]
