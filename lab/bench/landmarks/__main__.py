"""`python -m lab.bench.landmarks`: cameras from clicked landmarks, by their number and error.

Clicks on drawings with true cameras (synthetic sheets, or case folders whose mannequin is what was
drawn) are solved by the points alone, with `--outlines` also together with the outlines, and by
plain PnP that is told the lens. A sheet takes about 0.6 CPU s, with outlines 2.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from lab.bench.landmarks.measure import (
    ALONE,
    FALSE,
    GRID,
    NAMED,
    OUTLINES,
    PLACE,
    PNP,
    QUICK,
    ROTATION,
    SILENT,
    Outcome,
    click_cases,
    measure,
    measure_pnp,
    records_of,
)
from lab.bench.records.record import CPU_SECONDS, Column, Record, as_dicts, methods_table
from toonset.write import write_json

RECORDS, TABLE = "records.json", "table.txt"
COLUMNS = (
    Column(ROTATION, "deg", "{:.2f}", "median"),
    Column(ROTATION, "p95", "{:.1f}", "p95"),
    Column(PLACE, "px", "{:.2f}", "median"),
    Column(PLACE, "p95", "{:.1f}", "p95"),
    Column(NAMED, "named", "{:.0f}", scale=100),
    Column(FALSE, "false", "{:.3f}"),
    Column(SILENT, "bad", "{:.0f}"),
    Column(CPU_SECONDS, "CPU", "{:.2f}"),
)


def main(
    out: Annotated[Path, typer.Option("-o", "--out")] = Path("bench-results/landmarks"),
    seed: Annotated[int, typer.Option(help="Of bodies and clicks.")] = 0,
    count: Annotated[int, typer.Option(min=1, help="Synthetic sheets per condition.")] = 2,
    only: Annotated[str, typer.Option(help="Sheets whose name contains this.")] = "",
    cases: Annotated[
        Path | None, typer.Option(help="Case folders with views/ and the drawn mannequin.obj.")
    ] = None,
    outlines: Annotated[bool, typer.Option("--outlines", help="Fit outlines, too.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Six pairs, 1 % off.")] = False,
) -> None:
    """Measure all sheets, then print the table and write it with the records."""
    found: dict[str, list[Outcome]] = {PNP: [], ALONE: [], OUTLINES: []}
    for case in (case for case in click_cases(cases, seed, count) if only in case.name):
        typer.echo(case.name, err=True)
        for clicks in QUICK if quick else GRID:
            found[PNP].append(measure_pnp(case, clicks, seed))
            found[ALONE].append(measure(case, clicks, seed, outlines=False))
            if outlines:
                found[OUTLINES].append(measure(case, clicks, seed, outlines=True))
    records: Sequence[Record] = [
        record for method, own in found.items() for record in records_of(own, method, seed)
    ]
    out.mkdir(parents=True, exist_ok=True)
    write_json(out / RECORDS, as_dicts(records))
    table = methods_table(records, COLUMNS)
    (out / TABLE).write_text(table + "\n", encoding="utf-8")
    typer.echo(table)


if __name__ == "__main__":
    typer.run(main)
