"""`python -m bench.batch`: the table's pace; sheets per hour; what a batch costs beside its stages.

Small sheets of two drawings each (`bench.batch.sheets`) run on one worker, on two, and with one
command each.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from bench.batch import table, throughput
from bench.batch.sheets import MANIFEST, write_sheets


def main(
    sheets: Annotated[int, typer.Option(help="How many.")] = 1000,
    alone: Annotated[int, typer.Option(help="Of them with one command each.")] = 20,
    library: Annotated[Path | None, typer.Option(help="Where they are, or are to be kept.")] = None,
    rows: Annotated[int, typer.Option(help="Sheets in the table.")] = 100_000,
    tried: Annotated[int, typer.Option(help="Operations of a kind on it.")] = 2_000,
) -> None:
    """Print figures of a table and of batches."""
    with tempfile.TemporaryDirectory() as place:
        work, folder = Path(place), library or Path(place, "library")
        table.report(work, rows, tried, print)
        if not (folder / MANIFEST).is_file():
            write_sheets(folder, sheets)
        throughput.report(folder, work, alone, print)


if __name__ == "__main__":
    typer.run(main)
