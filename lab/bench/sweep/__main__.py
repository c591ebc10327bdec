"""`python -m lab.bench.sweep`: what half and double of every named number change.

Made-up sheets and drawings are split and their palettes found with each number of a room halved and
doubled; what changes is one line of a file, which the same command goes on with. Numbers whose
value has changed are measured again. `--still` tries 0 and a thousand times of what moved nothing
on many other cases: a number that moves nothing even then is of no use there. `--table` prints what
is known.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lab.bench.sweep.cases import cases_of
from lab.bench.sweep.measure import baseline, load, measure
from lab.bench.sweep.numbers import PALETTE_ROOMS, SPLIT_ROOMS, named_numbers, read_sources, uses_of
from lab.bench.sweep.table import kept_in, table

FILE = Path("bench-results/sweep.jsonl")


def main(
    rooms: Annotated[
        list[str] | None, typer.Argument(help="Such as dataset/split (default: split, palette).")
    ] = None,
    cases: Annotated[
        Path | None, typer.Option(help="Folder of cases; without, what is drawn here.")
    ] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="File of results.")] = FILE,
    still: Annotated[
        bool,
        typer.Option("--still", help="0 and very much of what moved nothing, on many other cases."),
    ] = False,
    only: Annotated[str, typer.Option(help="Numbers whose module.NAME contains this.")] = "",
    show: Annotated[bool, typer.Option("--table", help="Only print what is known.")] = False,
) -> None:
    """Measure what is not yet known of the numbers, then print the table."""
    sources = read_sources()
    numbers = [
        one
        for room in rooms or (*SPLIT_ROOMS, *PALETTE_ROOMS)
        for one in named_numbers(sources, [room])
        if only in f"{one.module}.{one.name}"
    ]
    kept = kept_in(out)
    if not show:
        load(sources)
        todo = [one for one in numbers if kept.lacks(one, large=still)]
        places = frozenset(
            place for one in todo for use in uses_of(one, sources) for place in use.places
        )
        usual = baseline(cases_of(cases, large=still), places)
        typer.echo(f"{len(todo)} numbers, {len(usual.cases)} cases", err=True)
        for number, one in enumerate(todo):
            typer.echo(f"{number + 1}/{len(todo)} {one.module}.{one.name}", err=True)
            found = list(measure(one, sources, usual, extremes=still))
            kept.add(one, found, large=still)
    typer.echo(table(numbers, kept))


if __name__ == "__main__":
    typer.run(main)
