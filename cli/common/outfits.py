"""Take every outfit of a sheet: `--outfit all` of `split` and `calibrate`.

Results are kept by the letter of their row, and a row's folder is `out / letter`. Without
`--outfit all` there is one result: its letter is "", so its folder is `out`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toonset.cli.common.output import Printer
from toonset.errors import SheetError, ToonsetError, UsageError
from toonset.write import check_output, new_folder

if TYPE_CHECKING:
    from toonset.dataset.split_folder.load import Sheet
    from toonset.dataset.split_folder.options import SheetOptions

ALL, FIRST = "all", "A"
FOLDERS = ("[A-Z]",)  # names of what `--outfit all` writes


def is_all(outfit: str) -> bool:
    """Return whether `--outfit` names every row."""
    return outfit.strip().lower() == ALL


def first_row(outfit: str, **of_one_row: object) -> str:
    """Return the row that is cut first.

    Args:
        outfit: as typed.
        of_one_row: options that speak of the views of one row, by name; empty: not given.

    Raises:
        UsageError: such an option beside `--outfit all`.
    """
    if not is_all(outfit):
        return outfit
    for name, value in of_one_row.items():
        if value:
            raise UsageError(
                f"--{name} speaks of the views of one row; take rows one by one, as with "
                f"--outfit {FIRST}"
            )
    return FIRST


def check_outfit_output(
    out: Path,
    outfit: str,
    inputs: Iterable[str | Path | None],
    written: Sequence[str],
    *,
    force: bool,
) -> None:
    """Refuse an output as `check_output` does, with `--outfit all` that of every row, too."""
    inputs = [*inputs]
    if is_all(outfit):
        check_output(out, inputs, FOLDERS, force=force)
        places = sorted(out.glob(FOLDERS[0]))
    else:
        places = [out]
    for place in places:
        check_output(place, inputs, written, force=force)


def cut_outfits(
    sheets: Sequence[Path], options: SheetOptions, split: Callable[[SheetOptions], Sheet]
) -> Mapping[str, Sheet]:
    """Return the drawings of every row that `--outfit` names, by its letter.

    Whether rows are outfits is read from the first row's cut. Where figures of the other rows touch
    it cannot tell, since only figures that are taken are cut apart: then the whole group is cut.

    Args:
        sheets: as typed.
        options: as typed.
        split: `split_sheet` of these sheets.

    Raises:
        UsageError: `--outfit all` with several sheets.
        SheetError: the sheet has no outfits, or one of them cannot be cut.
    """
    if not is_all(options.outfit):
        return {"": split(options)}
    _check_one_sheet(sheets)
    first = split(replace(options, outfit=FIRST))
    letters = first.outfits
    if not letters:
        whole = split(replace(options, outfit="", labels=""))
        letters = whole.outfits
        if not letters:
            raise SheetError(_without_outfits(whole))
    found = {FIRST: first}
    for letter in letters[1:]:
        with naming(letter):
            found[letter] = split(replace(options, outfit=letter))
    return found


@contextmanager
def naming(letter: str) -> Iterator[None]:
    """Name the outfit in the refusals of a block."""
    try:
        yield
    except ToonsetError as error:
        if not letter:
            raise
        raise SheetError(f"outfit {letter}: {error}") from error


def about(printer: Printer, letter: str) -> Printer:
    """Return a printer whose lines for people name the outfit."""
    return replace(printer, subject=f"outfit {letter}: ") if letter else printer


@contextmanager
def outfit_folders(out: Path, letters: Iterable[str], *, force: bool) -> Iterator[Path]:
    """Yield the folder to write `folder / letter` in; all of them appear as `out` or none."""
    if "" in letters:
        yield out
        return
    with new_folder(out, force=force) as folder:
        yield folder


def print_results(out: Path, values: Mapping[str, dict[str, Any]], printer: Printer) -> None:
    """Print what was written: JSON by outfit, or a line with each folder."""
    places = "\n".join(str(out / letter) for letter in values)
    printer.result(values.get("") or {"outfits": values}, places)


def _check_one_sheet(sheets: Sequence[Path]) -> None:
    from toonset.dataset.split_folder.places import sheet_places

    count = len(sheet_places(sheets)[0])
    if count > 1:
        raise UsageError(f"--outfit {ALL} takes the rows of one sheet, {count} are given; give one")


def _without_outfits(sheet: Sheet) -> str:
    source = sheet.split.sources[0]
    counts = [len(row) for group in source.groups if group.taken for row in group.rows]
    if len(counts) < 2:
        figures = f"{len(sheet.views)} figure{'s' * (len(sheet.views) != 1)}"
        return f"--outfit {ALL}: {source.name} shows one row of {figures}; leave --outfit out"
    listed = " and ".join(map(str, counts))
    return (
        f"--outfit {ALL}: the rows of {source.name} ({listed} figures) do not show the same "
        "directions; leave --outfit out, or take a row, as with --outfit A"
    )
