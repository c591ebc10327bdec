"""`python -m lab.bench.studio`: few drawings of one side, by their number and how far they differ.

Draws sheets as `toonset synth --condition studio` does, finds their cameras without a mannequin,
and trains with the true ones, with mirror images and without. The same command goes on where it was
stopped; a sheet takes 6 to 18 CPU s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from lab.bench.records.kept import keep_rows, kept_rows
from lab.bench.records.record import CPU_SECONDS, Record, as_dicts
from lab.bench.studio.grid import Cell, grid
from lab.bench.studio.measure import CAMERAS, FLIP, IOU, NO_MIRROR, SIDES, Seen, measure, records_of
from toonset import __version__
from toonset.write import write_json

SHEETS, RECORDS = "sheets.json", "records.json"
BOTH = " / ".join(SIDES).replace("side /", "/")
HEAD = ("sheet", "cameras, deg", "mirror images", f"{IOU}, {BOTH}", f"{FLIP}, {BOTH}", "CPU s")


def main(
    out: Annotated[Path, typer.Option("-o", "--out")] = Path("bench-results/studio"),
    seed: Annotated[int, typer.Option(help="Of the first body.")] = 0,
    count: Annotated[int, typer.Option(min=1, help="Bodies per cell.")] = 1,
    only: Annotated[str, typer.Option(help="Cells whose sheet contains this: '4 drawings'.")] = "",
    quick: Annotated[
        bool, typer.Option("--quick", help="8, 4 and 3 drawings, one pose difference.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Start afresh.")] = False,
) -> None:
    """Measure every cell that is not measured yet, then print the table of all."""
    key = {"version": __version__}
    done = kept_rows(out / SHEETS, key, _read, (SHEETS, RECORDS), force=force)
    for cell in (cell for cell in grid(quick=quick) if only in cell.sheet):
        for number in range(seed, seed + count):
            if (cell, number) in {(seen.cell, seen.seed) for seen in done}:
                continue
            done.append(measure(cell, number))
            keep_rows(out / SHEETS, key, [asdict(seen) for seen in done])
            typer.echo(f"{cell.sheet}, mirrored {cell.mirrored}, seed {number}", err=True)
    order = {cell: number for number, cell in enumerate(grid(quick=False))}
    records = records_of(sorted(done, key=lambda seen: (order[seen.cell], seen.seed)))
    write_json(out / RECORDS, as_dicts(records))
    typer.echo(table(records))


def table(records: Sequence[Record]) -> str:
    """Return a row per sheet and way of mirroring, in Markdown; medians over the bodies."""
    lines = ["| " + " | ".join(HEAD) + " |", "|" + "---|" * len(HEAD)]
    rows = dict.fromkeys((record.group, record.method) for record in records)
    for group, method in rows:
        own = {r.metric: r for r in records if (r.group, r.method) == (group, method)}
        cameras = own.get(CAMERAS)
        cells = (
            group,
            f"{cameras.median:.1f}, {cameras.p95:.1f}" if cameras else "",
            "no" if method == NO_MIRROR else "yes",
            " / ".join(f"{own[f'{IOU}, {side}'].median:.3f}" for side in SIDES),
            " / ".join(f"{own[f'{FLIP}, {side}'].median:.3f}" for side in SIDES),
            f"{own[CPU_SECONDS].median:.0f}",
        )
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _read(row: dict[str, Any]) -> Seen:
    lists: dict[str, Any] = {name: tuple(row[name]) for name in ("iou", "flip", "cameras_deg")}
    return Seen(Cell(**row["cell"]), row["seed"], cpu_s=row["cpu_s"], **lists)


if __name__ == "__main__":
    typer.run(main)
