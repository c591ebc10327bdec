"""What `python -m bench` measures for each subject: records, their table, pictures to look at."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from bench.commands.chosen import DEFAULT_COUNT, Baseline, Chosen, Subject
from toonset.cli.common.output import Printer
from toonset.errors import BundleError

if TYPE_CHECKING:
    from bench.look.measure import LookResult
    from bench.records.record import Record
    from bench.records.report import Picture
    from bench.split.cases import SplitCase

WRONG_SPLITS = "wrong.png"
LOOKS, LOOK_VIEWS, FACES = "look", "views", "faces"
QUICK_LOOKS = 1


@dataclass(frozen=True, eq=False)
class Measured:
    """Records, their table, pictures by file name, and those that the page shows."""

    records: list[Record]
    text: str
    pictures: dict[str, bytes] = field(default_factory=dict)
    shown: tuple[Picture, ...] = ()


def measure(chosen: Chosen, printer: Printer) -> Measured:
    """Return what one run measures; `stability` and `train` have modules of their own.

    Raises:
        ToonsetError: no case of that name, or a folder without cases.
    """
    if chosen.subject is Subject.splitting:
        return _splitting(chosen, printer)
    if chosen.subject is Subject.look:
        return _look(chosen, printer)
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


def _look(chosen: Chosen, printer: Printer) -> Measured:
    from bench.look.cases import look_cases
    from bench.look.measure import bench_look, eyes_text, records_of, table_of
    from bench.look.plan import LOOKS as NAMES

    count = chosen.count or (QUICK_LOOKS if chosen.quick else DEFAULT_COUNT)
    cases = look_cases(chosen.cases, chosen.seed, count, chosen.only, quick=chosen.quick)
    results = bench_look(cases, chosen.seed, tuple(NAMES), printer.progress)
    if not results:
        raise _none_of(chosen)
    text = "\n\n".join(part for part in (table_of(results), eyes_text(results)) if part)
    pictures, shown = _look_pictures(results, chosen.seed)
    return Measured(records_of(results, chosen.seed), text, pictures, shown)


def _look_pictures(
    results: list[LookResult], seed: int
) -> tuple[dict[str, bytes], tuple[Picture, ...]]:
    from bench.charts.figure import FORMS
    from bench.commands.charts import file_name
    from bench.look.picture import draw_looks, face_sheet, look_sheet
    from bench.records.record import machine
    from bench.records.report import Picture
    from toonset.dataset.images.picture import encode_png

    sheets: dict[tuple[str, str], list[LookResult]] = {}
    for one in results:
        sheets.setdefault((one.case.name, one.case.group), []).append(one)
    caption = f"Mean of {len(sheets)} sheets; seed {seed}; {machine()}."
    files = {f"{LOOKS}.{form}": draw_looks(results, caption, form) for form in FORMS}
    for (name, group), own in sheets.items():
        files[f"{LOOK_VIEWS}-{file_name(f'{name} {group}')}.png"] = encode_png(look_sheet(own))
    for name in dict.fromkeys(one.look for one in results):
        faces = face_sheet([one for one in results if one.look == name])
        if faces is not None:
            files[f"{FACES}-{file_name(name)}.png"] = encode_png(faces)
    shows = "What eyes see, against CPU seconds: the default look, and without each of its parts"
    return files, (Picture(files[f"{LOOKS}.svg"], shows),)


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
