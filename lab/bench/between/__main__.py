"""`python -m lab.bench.between`: what eyes see on a run's views between drawings.

One line a run: outlines and borders of paint beside the drawings' own, fragments, whole features,
guessed and mirrored shares, seconds; beside the truth where `--cases` knows it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import typer

from lab.bench.between.measure import GROUP, Row, measure
from lab.bench.between.sheets import sheets
from lab.bench.records.record import aligned
from lab.bench.verdict.measure import needed_flip
from toonset.cli.common.host import keep_freed_memory


def main(
    runs: Annotated[list[Path], typer.Argument(help="Run folders, or folders that hold run/.")],
    cases: Annotated[
        Path | None, typer.Option(help="Cases with truth, named as the folders are.")
    ] = None,
    only: Annotated[str, typer.Option(help="Folders whose name contains this.")] = "",
    essentials: Annotated[
        bool, typer.Option("--essentials", help="No turn, no sizes, fewer views.")
    ] = False,
) -> None:
    """Print a table of all runs, with the median and the worse 5 % of every figure."""
    keep_freed_memory()
    torch.set_num_threads(1)
    flip, rows = needed_flip(), {}
    for sheet in sheets(runs, cases, only):
        rows[sheet.name] = measure(sheet, flip, whole=not essentials)
        print(f"{sheet.name}: done", flush=True)
    print(table(rows))


def table(rows: dict[str, Row]) -> str:
    """Return a line a sheet, then median and 95th percentile; a table for every group."""
    names = list(dict.fromkeys(name for row in rows.values() for name in row))
    lines = []
    for title in dict.fromkeys(name.partition(GROUP)[0] for name in names):
        own = [name for name in names if name.startswith(title + GROUP)]
        values = {
            sheet: [row.get(name, np.nan) for name in own]
            for sheet, row in rows.items()
            if own[0] in row
        }
        at = {
            word: _percentile(list(values.values()), n) for word, n in (("median", 50), ("p95", 95))
        }
        body = [[sheet, *_numbers(found)] for sheet, found in (values | at).items()]
        heads = ["sheet", *(name.partition(GROUP)[2] for name in own)]
        lines += [title, *aligned([heads, *body], words=1), ""]
    return "\n".join(lines)


def _percentile(values: list[list[float]], at: float) -> list[float]:
    known = [column[np.isfinite(column)] for column in np.array(values).T]
    return [float(np.percentile(one, at)) if len(one) else float("nan") for one in known]


def _numbers(values: list[float]) -> list[str]:
    return ["-" if not np.isfinite(value) else f"{value:.3f}" for value in values]


if __name__ == "__main__":
    typer.run(main)
