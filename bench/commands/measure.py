"""What `python -m bench` measures for each subject: records, their table, pictures to look at."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from bench.commands.chosen import DEFAULT_COUNT, Baseline, Chosen, Subject
from toonset.cli.common.output import Printer
from toonset.errors import BundleError

if TYPE_CHECKING:
    from bench.records.record import Record
    from bench.split.cases import SplitCase

WRONG_SPLITS = "wrong.png"


@dataclass(frozen=True, eq=False)
class Measured:
    """Records, their table, and PNG pictures by file name."""

    records: list[Record]
    text: str
    pictures: dict[str, bytes] = field(default_factory=dict)


def measure(chosen: Chosen, printer: Printer) -> Measured:
    """Return what one run measures; `stability` and `train` have modules of their own.

    Raises:
        ToonsetError: no case of that name, or a folder without cases.
    """
    if chosen.subject is Subject.splitting:
        return _splitting(chosen, printer)
    if chosen.subject is Subject.palette:
        return _palettes(chosen, printer)
    if chosen.subject is Subject.labels:
        return _labels(chosen, printer)
    records, text = _cameras(chosen, printer)
    return Measured(records, text)


def _cameras(chosen: Chosen, printer: Printer) -> tuple[list[Record], str]:
    if chosen.sprites is not None:
        from bench.calib.table import sprites_table
        from bench.cases.sprites import bench_sprites, sprite_cases

        characters = sprite_cases(chosen.sprites, chosen.only)
        records = bench_sprites(characters, chosen.seed, printer.progress)
        return records, sprites_table(records)
    return _calibration(chosen, printer)


def _calibration(chosen: Chosen, printer: Printer) -> tuple[list[Record], str]:
    from bench.calib.measure import bench_calibration, bench_colmap
    from bench.calib.table import sheets_table
    from bench.cases.cases import calib_cases

    count = chosen.count or DEFAULT_COUNT
    sheets = list(calib_cases(chosen.cases, chosen.seed, count, chosen.only))
    if not sheets:
        raise _none_of(chosen)
    quick, progress = chosen.quick, printer.progress
    records = bench_calibration(sheets, chosen.seed, quick=quick, progress=progress)
    if chosen.baseline is Baseline.colmap:
        records += bench_colmap(sheets, chosen.seed, quick=quick, progress=progress)
    return records, sheets_table(records)


def _splitting(chosen: Chosen, printer: Printer) -> Measured:
    from bench.split.measure import bench_split
    from bench.split.picture import contact_sheet
    from toonset.dataset.images.picture import encode_png

    found = bench_split(_split_cases(chosen), chosen.seed, printer.progress)
    if not found.records:
        raise _none_of(chosen)
    pictures = {WRONG_SPLITS: encode_png(contact_sheet(found.wrong))} if found.wrong else {}
    return Measured(found.records, found.text, pictures)


def _split_cases(chosen: Chosen) -> Iterator[SplitCase]:
    """Yield the folders' sheets; synthetic ones where no folder is given."""
    from bench.split.cases import messy_cases, sheet_cases, sprite_sheet_cases

    if chosen.cases is not None:
        yield from sheet_cases(chosen.cases, chosen.only)
    if chosen.sprites is not None:
        yield from sprite_sheet_cases(chosen.sprites, chosen.only)
    if chosen.cases is None and chosen.sprites is None:
        count = chosen.count or (1 if chosen.quick else DEFAULT_COUNT)
        yield from messy_cases(chosen.seed, count, chosen.only)


def _palettes(chosen: Chosen, printer: Printer) -> Measured:
    from bench.palette.measure import bench_palette

    records, text = bench_palette(
        chosen.cases, chosen.seed, quick=chosen.quick, progress=printer.progress
    )
    return Measured(records, text)


def _labels(chosen: Chosen, printer: Printer) -> Measured:
    from bench.palette.labels import bench_labels

    records, text = bench_labels(
        chosen.cases, chosen.seed, quick=chosen.quick, progress=printer.progress
    )
    return Measured(records, text)


def _none_of(chosen: Chosen) -> BundleError:
    return BundleError(f"no case's name contains {chosen.only!r}; correct --only")
