"""`python -m lab.bench.batch [PART...]`: what a batch of many sheets costs.

The parts:

table   how many operations a second its table takes
loop    what the command takes of a sheet that it gives out and records
page    how soon its page is shown and answers
sheets  sheets per hour on one worker, on two, and with one command each
ray     on two nodes of Ray beside two workers; needs `toonset[ray]`

Sheets are small ones of two drawings each (`bench.batch.sheets`).
"""

from __future__ import annotations

import tempfile
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from lab.bench.batch import loop, page, table, throughput
from lab.bench.batch.sheets import MANIFEST, write_sheets

LOOPED = 20_000
OF_PAGES = (10_000, 100_000)
TRIED = 2_000


class Part(StrEnum):
    """What is measured."""

    table = "table"
    loop = "loop"
    page = "page"
    sheets = "sheets"
    ray = "ray"


def main(
    parts: Annotated[list[Part] | None, typer.Argument(help="All without any.")] = None,
    sheets: Annotated[int, typer.Option(help="How many.")] = 1000,
    alone: Annotated[int, typer.Option(help="Of them with one command each.")] = 20,
    library: Annotated[Path | None, typer.Option(help="Where they are, or are to be kept.")] = None,
    rows: Annotated[int, typer.Option(help="Sheets in the table.")] = 100_000,
) -> None:
    """Print figures of batches."""
    with tempfile.TemporaryDirectory() as place:
        work, folder = Path(place), library or Path(place, "library")
        if {Part.sheets, Part.ray} & {*(parts or Part)} and not (folder / MANIFEST).is_file():
            write_sheets(folder, sheets)
        for part in parts or Part:
            (mine := work / part).mkdir()
            if part == Part.table:
                table.report(mine, rows, TRIED, print)
            elif part == Part.loop:
                loop.report(mine, LOOPED, print)
            elif part == Part.page:
                for count in OF_PAGES:
                    page.report(mine, count, print)
            elif part == Part.sheets:
                throughput.report(folder, mine, alone, print)
            else:
                throughput.report_ray(folder, mine, print)


if __name__ == "__main__":
    typer.run(main)
