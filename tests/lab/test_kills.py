"""Killing batches (see lab/kills) loses nothing, and would be seen if it did."""

import shutil
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from lab.kills.kills import faults
from toonset.apps.batch.rows import Plan, StageRow
from toonset.apps.batch.stages import Entry
from toonset.apps.batch.table import Table
from toonset.apps.batch.table_file import TABLE

ROOT = Path(__file__).resolve().parents[2]


def batch(out: Path, states: dict[str, str]) -> Path:
    """Write a batch whose sheets ended as told."""
    out.mkdir()
    with closing(Table(out / TABLE, make=True)) as table:
        plans = [Plan(Entry(name, ("x",)), i, {"calibrate": "k"}) for i, name in enumerate(states)]
        table.plan(plans, lambda name: ())
        table.choose(states)
        while (row := table.claim("me", 60)) is not None:
            state, _, error = states[row.name].partition(": ")
            ended = StageRow("calibrate", "k", state, error=error)  # type: ignore[arg-type]
            table.record("me", row.name, [ended])
            bundle = out / "sheets" / row.name / "bundle"
            bundle.mkdir(parents=True)
            (bundle / "transforms.json").write_text(row.name)
    return out


def test_what_is_lost_or_left_is_seen(tmp_path: Path) -> None:
    good = {"s0": "done", "s1": "done", "torn0": "failed: the PNG file is damaged or cut off"}
    first = batch(tmp_path / "first", good)
    assert faults(first, batch(tmp_path / "same", good)) == []
    odd = batch(tmp_path / "odd", good | {"s1": "quarantined", "torn0": "done"})
    (odd / "sheets" / "s0" / "bundle" / "transforms.json").write_text("other")
    (odd / "sheets" / "s0" / ".bundle.abcdefgh.tmp").mkdir()
    shutil.rmtree(odd / "sheets" / "s1" / "bundle")
    said = faults(first, odd)
    for sign in ("s0/bundle/transforms.json", "s1/bundle", "s1: is quarantined", "torn0: is done"):
        assert any(line.startswith(sign) for line in said), sign
    assert any(line.endswith(".tmp: is left") for line in said)


@pytest.mark.slow
@pytest.mark.parametrize("more", [(), ("--ray",)], ids=["local", "ray"])
def test_killing_loses_nothing(more: tuple[str, ...]) -> None:
    command = [sys.executable, "-m", "lab.kills", "--sheets", "40", "--kills", "4", *more]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
