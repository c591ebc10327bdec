"""Stand-ins for the measuring functions of the bench: the rest of its commands runs as it is."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lab.bench.cases.cases import TrainCase
from lab.bench.commands import check
from lab.bench.landmarks.measure import Clicks, Outcome
from lab.bench.look.measure import METRICS, LookResult
from lab.bench.records.gate import from_plain
from lab.bench.split.measure import SplitBench
from lab.bench.stability import pages
from lab.bench.stability.trials import Trial
from lab.bench.studio.grid import Cell
from lab.bench.studio.measure import Seen
from lab.bench.train.run import RunResult
from lab.bench.verdict.measure import Judged
from tests.lab.bench.records import record
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.json_file import read_json

CAMERA = Camera.looking_at(np.zeros(3), 0.0, 0.1, 4.0, (8, 8), k=0.0)
FRAME = Frame("000.png", CAMERA, np.full((8, 8, 4), 200, np.uint8))
SCENE = Scene((FRAME,) * 8, None, "body")


def measure_nothing(monkeypatch: pytest.MonkeyPatch, folder: Path) -> list[str]:
    """Replace what draws or measures sheets; return the subjects that are measured from now on.

    Args:
        monkeypatch: puts all back.
        folder: committed figures are renewed in a copy that lies here.
    """
    asked: list[str] = []

    def stand_in(place: str, answer: Any, subject: str = "") -> None:
        module, _, name = place.rpartition(".")

        def told(*arguments: Any, **options: Any) -> Any:
            asked.extend([subject] * bool(subject))
            return answer(*arguments, **options)

        monkeypatch.setattr(importlib.import_module(f"lab.bench.{module}"), name, told)

    figures = [record("F1", "default", {"a": 1.0}), record("seconds", "default", {"a": 1.0})]
    committed = from_plain(read_json(check.COMMITTED), str(check.COMMITTED))
    monkeypatch.setattr(check, "COMMITTED", folder / "committed.json")
    check.COMMITTED.write_bytes((Path(check.__file__).parents[1] / "committed.json").read_bytes())
    stand_in("cases.cases._synthetic_calib", lambda *_: None)
    stand_in("calib.measure.bench_calibration", lambda *_, **__: figures, "calib")
    stand_in("split.measure.bench_split", lambda *_: SplitBench(figures, "table", ()), "split")
    stand_in("palette.measure.bench_palette", lambda *_, **__: (figures, "table"), "palette")
    stand_in("palette.labels.bench_labels", lambda *_, **__: (figures, "table"), "labels")
    stand_in("look.cases._synthetic", _look_case)
    stand_in("look.measure.bench_look", _looks, "look")
    stand_in("cases.cases.train_cases", _train_cases)
    stand_in("train.measure.run_job", _trained, "train")
    kinds = {page.kind.subject: page for page in pages.PAGES}
    monkeypatch.setattr(pages, "PAGES", tuple(kinds.values()))  # a page takes half a second to draw
    stand_in("stability.run.usable_workers", lambda: 1)
    stand_in("stability.run.run_job", lambda job: ((Trial(job[2], 0.0, "ok"),), b""), "stability")
    stand_in("commands.check.measured", lambda *_: committed, "check")
    stand_in("verdict.__main__._drawn", lambda *_: (SCENE, SCENE, None))
    stand_in("verdict.__main__.judge", _judged, "verdict")
    stand_in("studio.__main__.measure", _studied, "studio")
    stand_in("landmarks.__main__.click_cases", lambda *_: [SimpleNamespace(name="body 0")])
    stand_in("landmarks.__main__.measure", _clicked, "landmarks")
    stand_in("landmarks.__main__.measure_pnp", _clicked, "landmarks")
    return asked


def _look_case(body: int, *, calibrated: bool, px: int) -> SimpleNamespace:
    group = f"drawn, {px} px" + ", calibrated" * calibrated
    return SimpleNamespace(name=f"body {body}", group=group, test=SCENE)


def _looks(cases: Any, seed: int, **_: Any) -> list[LookResult]:
    scores: dict[str, float | None] = {name: 0.5 for name, *_ in METRICS}
    shown = (FRAME.rgba,) * len(SCENE.frames)
    return [LookResult(case, "default", seed, scores, 1.0, shown) for case in cases]


def _train_cases(folder: None, seed: int, count: int) -> Iterator[TrainCase]:
    for body in range(seed, seed + count):
        yield TrainCase(f"body {body}", "clean", SCENE, SCENE)


def _trained(job: Any, *_: Any) -> RunResult:
    return RunResult(job.group, job.method, job.case.name, job.seed, {"psnr": 30.0}, 1.0, 1.0)


def _judged(name: str, *_: Any) -> tuple[Judged, bytes]:
    off = 0.001 * len(name)
    return Judged(name, "ok", (), off, (off,)), b""


def _clicked(case: Any, clicks: Clicks, *_: Any, **__: Any) -> Outcome:
    return Outcome("exact", case.name, clicks, (1.0,), (2.0,), 1, 1, 0, 0, 1.0)


def _studied(cell: Cell, seed: int, **_: Any) -> Seen:
    return Seen(cell, seed, (0.9, 0.8), (0.1, 0.2), 1.0, (2.0,))
