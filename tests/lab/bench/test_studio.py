"""The bench of studio sheets: its grid, its table, and that it goes on where it was stopped."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import lab.bench.studio.__main__ as command
from lab.bench.studio.grid import HELD_OUT, Cell, draw, grid, train_options
from lab.bench.studio.measure import Seen, measure, records_of
from toonset.json_file import read_json


def seen(cell: Cell, seed: int, worse: float = 0.0) -> Seen:
    cameras = (1.0, 2.0, 9.0) if cell.mirrored else ()
    return Seen(cell, seed, (0.9 - worse, 0.8 - worse), (0.1, 0.2 + worse), 7.0, cameras)


def test_every_sheet_is_tried_with_mirror_images_and_without() -> None:
    whole, quick = grid(quick=False), grid(quick=True)
    assert set(quick) <= set(whole)
    assert len(set(whole)) == len(whole)
    for some in (whole, quick):
        for one, other in zip(some[::2], some[1::2], strict=True):
            assert (one.sheet, one.mirrored, other.mirrored) == (other.sheet, True, False)
            own, others = (asdict(train_options(cell, 3)) for cell in (one, other))
            assert len([name for name in own if own[name] != others[name]]) == 1
    assert {cell.views for cell in whole} == set(range(2, 9))


def test_a_cells_sheet_has_its_drawings_and_true_views_of_either_side() -> None:
    made, exact = draw(Cell(3, 2.0, mirrored=True), 1)
    assert (len(made.views), len(exact.views)) == (3, HELD_OUT)
    assert made.options.artist.body.arm_swing_deg == 16
    side = math.sin(made.yaws[1])
    drawn, other = np.split(np.sin(exact.yaws), 2)
    assert (drawn * side > 0).all()
    assert (other * side < 0).all()


def test_the_table_has_medians_over_bodies(tmp_path: Path, monkeypatch) -> None:
    asked: list[tuple[Cell, int]] = []

    def stand_in(cell: Cell, seed: int) -> Seen:
        asked.append((cell, seed))
        return seen(cell, seed, 0.1 * seed)

    monkeypatch.setattr(command, "measure", stand_in)
    app = typer.Typer()
    app.command()(command.main)
    run = ("--quick", "-o", str(tmp_path))
    first = CliRunner().invoke(app, [*run, "--only", "4 drawings", "--count", "2"])
    assert first.exit_code == 0
    assert len(asked) == 4
    rows = [line for line in first.stdout.splitlines() if line.startswith("| 4 drawings")]
    assert "| 2.0, 9.0 | yes | 0.850 / 0.750 | 0.100 / 0.250 | 7 |" in rows[0]
    assert "|  | no | 0.850 / 0.750 |" in rows[1]
    again = CliRunner().invoke(app, [*run])
    assert len(asked) == 4 + 4  # the other two numbers of drawings, of the first body alone
    lines = [line.split(",")[0] for line in again.stdout.splitlines()[2:]]
    assert lines == [f"| {count} drawings" for count in (8, 8, 4, 4, 3, 3)]
    assert {record["group"] for record in read_json(tmp_path / "records.json")} == {
        cell.sheet for cell in grid(quick=True)
    }
    monkeypatch.setattr(command, "__version__", "another")
    refused = CliRunner().invoke(app, ["-o", str(tmp_path)])
    assert "--force" in str(refused.exception)


def test_records_say_which_way_is_better() -> None:
    cell = Cell(4, 1.0, mirrored=True)
    found = {record.metric: record for record in records_of([seen(cell, 0), seen(cell, 1, 0.2)])}
    assert found["IoU, drawn side"].direction == "higher"
    assert found["IoU, other side"].p95 < found["IoU, other side"].median < 0.8
    assert found["FLIP, other side"].p95 > found["FLIP, other side"].median
    assert found["rotation error"].n == 6


@pytest.mark.slow
def test_a_sheet_is_measured_whole() -> None:
    found = measure(Cell(4, 1.0, mirrored=False), 0)
    assert all(0.8 < iou < 0.97 for iou in found.iou)
    assert all(0.01 < flip < 0.2 for flip in found.flip)
    assert found.cameras_deg == ()
