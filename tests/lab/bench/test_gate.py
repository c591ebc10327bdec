"""The regression gate: what counts as worse, and what `bench --check` says and returns."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from lab.bench.commands import check as bench_check
from lab.bench.records.gate import Guard, as_plain, as_text, compared, from_plain, guards_of
from lab.bench.records.record import Record, Recorder
from toonset.cli.common.output import Printer
from toonset.errors import BundleError

YARD_S = 0.02


def record(metric: str = "held-out PSNR", value: float = 30.0, unit: str = "dB") -> Record:
    direction = "lower" if unit in ("s", "deg") else "higher"
    return Recorder("default", "clean", 0).samples(metric, [value], unit, direction)


def guards(*records: Record) -> list[Guard]:
    return guards_of("train", records, YARD_S)


def test_only_the_default_is_guarded() -> None:
    peer = replace(record(), method="75 steps")
    (guard,) = guards(record(), peer)
    assert guard.key == ("train", "clean", "held-out PSNR")


@pytest.mark.parametrize(
    ("now", "fails"), [(30.0, False), (29.8, False), (29.6, True), (33, False)]
)
def test_worse_by_more_than_it_may_lose(now: float, fails: bool) -> None:
    (row,) = compared(guards(record()), guards(record(value=now)))
    assert row.fails is fails
    assert row.lost == pytest.approx(30.0 - now)


def test_an_error_is_worse_when_it_grows() -> None:
    known = record("rotation error", 1.0, "deg")
    rows = [compared(guards(known), guards(replace(known, value=v)))[0] for v in (0.2, 1.25, 1.4)]
    assert [row.fails for row in rows] == [False, False, True]


def test_seconds_are_compared_as_multiples_of_the_machines_own() -> None:
    """A machine of half the speed takes twice as long for both, which is no loss."""
    known = record("CPU seconds", 4.0, "s")
    here = guards_of("train", [known], YARD_S)
    there = guards_of("train", [replace(known, value=8.0)], 2 * YARD_S)
    assert here[0].value == there[0].value == 200
    assert here[0].unit == "yardsticks"
    assert not compared(here, there)[0].fails
    assert not guards_of("train", [replace(known, metric="seconds")], YARD_S)  # of the clock
    slower = guards_of("train", [replace(known, value=8.0)], YARD_S)
    assert compared(here, slower)[0].fails


def test_a_figure_that_is_gone_fails_and_is_named_first() -> None:
    lost = replace(record(), metric="held-out SSIM", unit="1", value=0.9)
    committed = guards(record(), lost)
    rows = compared(committed, guards(record(value=29.0)))
    assert [row.fails for row in rows] == [True, True]
    lines = as_text(rows).splitlines()
    assert "held-out SSIM" in lines[1]
    assert "missing" in lines[1]
    assert "held-out PSNR" in lines[2]
    assert lines[-1] == "2 figures: 2 worse, 0 better than they may vary"


def test_files_hold_all_there_is() -> None:
    known = guards(record(), record("CPU seconds", 4.0, "s"))
    assert from_plain(json.loads(json.dumps(as_plain(known))), "x") == known
    with pytest.raises(BundleError, match="x: holds no figures"):
        from_plain({"guards": [{"value": 3}]}, "x")
    with pytest.raises(BundleError, match="format 0"):
        from_plain(as_plain(known) | {"format": 0}, "x")


def test_the_committed_figures_can_be_read_and_cover_every_subject() -> None:
    known = from_plain(json.loads(bench_check.COMMITTED.read_text()), "committed")
    assert {guard.subject for guard in known} == {s.value for s in bench_check.SUBJECTS}
    assert len({guard.key for guard in known}) == len(known)
    assert all(row.fails is False for row in compared(known, known))


def test_check_ends_with_3_where_something_is_worse(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bench_check, "COMMITTED", tmp_path / "committed.json")
    found = [record()]
    monkeypatch.setattr(bench_check, "_records", lambda chosen, printer: found)
    printer = Printer(as_json=False, quiet=True)
    bench_check.check(0, printer, renew=True)
    bench_check.check(0, printer, renew=False)
    assert "6 figures: 0 worse" in capsys.readouterr().out
    found[0] = record(value=20.0)
    with pytest.raises(bench_check.typer.Exit) as stop:
        bench_check.check(0, printer, renew=False)
    assert stop.value.exit_code == bench_check.WORSE
    assert "6 worse" in capsys.readouterr().out
    with pytest.raises(BundleError, match="figures of seed 0, not 7"):
        bench_check.check(7, printer, renew=False)


@pytest.mark.parametrize("other", [["calib"], ["--quick"], ["--only", "exact"], ["--renew"]])
def test_check_takes_no_other_option(bench, other: list[str]) -> None:
    found = bench("--check", *other)
    assert found.code == 2
    assert "stand alone" in found.err


@pytest.mark.parametrize(
    "wrong",
    ["split --half", "train --sprites x", "calib --sprites x --cases y", "palette --only x",
     "palette --count 3", "labels --only x", "stability --cases x"],
)  # fmt: skip
def test_options_of_other_subjects_are_refused(bench, tmp_path: Path, wrong: str) -> None:
    assert bench(*wrong.split(), "-o", tmp_path / "out").code == 2
    assert not (tmp_path / "out").exists()


def test_a_wrong_subject_is_one_line(bench) -> None:
    said = bench("nerf").reason
    assert all(word in said for word in ("nerf", "calib", "train", "see `bench -h`")), said
