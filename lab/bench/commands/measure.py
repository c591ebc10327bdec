"""What `python -m lab.bench` measures for each subject: records, their table, pictures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from lab.bench.commands.chosen import DEFAULT_COUNT, Chosen, Subject
from lab.bench.commands.results import file_name
from toonset.cli.common.output import Printer

if TYPE_CHECKING:
    from lab.bench.records.record import Record
    from lab.bench.split.cases import SplitCase

WRITTEN = ("wrong.png", "look.png", "look.svg", "views-*.png")


@dataclass(frozen=True, eq=False)
class Measured:
    """Records, their table, pictures by file name, and those that the page shows, by title."""

    records: list[Record]
    text: str
    pictures: dict[str, bytes] = field(default_factory=dict)
    shown: dict[str, bytes] = field(default_factory=dict)


def measure(chosen: Chosen, printer: Printer) -> Measured:
    """Return what one run measures; `stability` and `train` have modules of their own.

    Raises:
        ToonsetError: no case of that name, or a folder without cases.
    """
    if chosen.subject is Subject.splitting:
        return _splitting(chosen, printer)
    if chosen.subject is Subject.look:
        return _look(chosen, printer)
    if chosen.subject is Subject.calib:
        return _cameras(chosen, printer)
    if chosen.subject is Subject.palette:
        from lab.bench.palette.measure import bench_palette as bench
    else:
        from lab.bench.palette.labels import bench_labels as bench
    quick, progress = chosen.quick, printer.progress
    return Measured(*bench(chosen.cases, chosen.seed, quick=quick, progress=progress))


def _cameras(chosen: Chosen, printer: Printer) -> Measured:
    from lab.bench.calib.measure import bench_calibration, sheets_table
    from lab.bench.cases.cases import calib_cases
    from lab.bench.cases.sprites import bench_sprites, sprite_cases, sprites_table

    if chosen.sprites is not None:
        characters = sprite_cases(chosen.sprites, chosen.only)
        records = bench_sprites(characters, chosen.seed, printer.progress)
        return Measured(records, sprites_table(records))
    count = chosen.count or DEFAULT_COUNT
    sheets = list(calib_cases(chosen.cases, chosen.seed, count, chosen.only))
    if not sheets:
        raise chosen.none_of
    quick, progress = chosen.quick, printer.progress
    records = bench_calibration(sheets, chosen.seed, quick=quick, progress=progress)
    return Measured(records, sheets_table(records))


def _splitting(chosen: Chosen, printer: Printer) -> Measured:
    from lab.bench.split.measure import bench_split, contact_sheet
    from toonset.dataset.images.picture import encode_png

    found = bench_split(_split_cases(chosen), chosen.seed, printer.progress)
    if not found.records:
        raise chosen.none_of
    if not found.wrong:
        return Measured(found.records, found.text)
    wrong = encode_png(contact_sheet(found.wrong))
    shown = {"Sheets that are split wrongly": wrong}
    return Measured(found.records, found.text, {"wrong.png": wrong}, shown)


def _split_cases(chosen: Chosen) -> Iterator[SplitCase]:
    """Yield the folders' sheets; synthetic ones where no folder is given."""
    from lab.bench.split.cases import messy_cases, sheet_cases, sprite_sheet_cases

    if chosen.cases is not None:
        yield from sheet_cases(chosen.cases, chosen.only)
    if chosen.sprites is not None:
        yield from sprite_sheet_cases(chosen.sprites, chosen.only)
    if chosen.cases is None and chosen.sprites is None:
        count = chosen.count or (1 if chosen.quick else DEFAULT_COUNT)
        yield from messy_cases(chosen.seed, count, chosen.only)


def _look(chosen: Chosen, printer: Printer) -> Measured:
    from lab.bench.look.cases import look_cases
    from lab.bench.look.measure import COLUMNS, bench_look, panels_of, records_of
    from lab.bench.look.picture import look_sheet
    from lab.bench.records.drawing import FORMS, draw_panels
    from lab.bench.records.record import machine, methods_table
    from toonset.dataset.images.picture import encode_png

    count = chosen.count or (1 if chosen.quick else DEFAULT_COUNT)
    cases = look_cases(chosen.cases, chosen.seed, count, chosen.only, quick=chosen.quick)
    results = bench_look(cases, chosen.seed, progress=printer.progress)
    if not results:
        raise chosen.none_of
    records = records_of(results, chosen.seed)
    sheets = list(dict.fromkeys((one.case.name, one.case.group) for one in results))
    across = "CPU seconds of training, laying the drawings out and 16 views; logarithmic"
    axis = f"{across}\nMean of {len(sheets)} sheets; seed {chosen.seed}; {machine()}.", ""
    files = {f"look.{form}": draw_panels(panels_of(records), axis, 4, form) for form in FORMS}
    for name, group in sheets:
        own = [one for one in results if (one.case.name, one.case.group) == (name, group)]
        files[f"views-{file_name(f'{name} {group}')}.png"] = encode_png(look_sheet(own))
    shown = {"All measures of new views": files["look.svg"]}
    return Measured(records, methods_table(records, COLUMNS), files, shown)
