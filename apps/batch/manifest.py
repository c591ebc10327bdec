"""Read manifests: CSV tables or JSONL files that say more of a batch's sheets, one row for each.

Columns or keys:

    sheet       the drawing, or a folder of views; several as a list, in CSV with ";" between
    name        of its folder and in the data set (default: from the file's name)
    mesh        its mannequin, as of `toonset calibrate --mesh`
    views       what its views show, as of `--views`
    calibrate_options, palette_options, ...   of a stage, as typed after its verb
    character, license, source       for the data set

Paths are relative to the manifest's folder, and must lie in it, or in the folder of --root.
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from toonset.apps.batch.given import Given, clean_name, stem_of
from toonset.apps.batch.stages import STAGES
from toonset.apps.batch.storage import file_name
from toonset.errors import SheetError, one_line

MANIFESTS = (".csv", ".jsonl")
PLAIN = ("sheet", "name", "mesh", "views", "character", "license", "source")
OPTIONS = "_options"  # ends the name of a stage's column


def manifest_sheets(path: Path, root: Path | None) -> Iterator[Given]:
    """Yield the sheets of a manifest.

    Raises:
        SheetError: it cannot be read, or has a column that means nothing.
    """
    from toonset.read import read_whole

    data = read_whole(path, "manifest", SheetError)
    reader = _csv_rows if path.suffix.lower() == ".csv" else _jsonl_rows
    base = Path(os.path.abspath(root or path.parent))
    for line, values in reader(path, data):
        where = f"{path}: line {line}"
        _check_values(where, values)
        sheets = _sheets_of(values)
        if not sheets:
            raise SheetError(f"{where}: names no sheet; give its picture under 'sheet'")
        name = values.get("name") or clean_name(stem_of(file_name(sheets[0].replace("\\", "/"))))
        yield Given(where, base, True, name, {**values, "sheet": sheets})


def _csv_rows(path: Path, data: bytes) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield line and values of a CSV manifest; empty cells are left out."""
    try:
        rows = csv.reader(io.StringIO(data.decode("utf-8-sig"), newline=""), strict=True)
        head = [cell.strip() for cell in next(rows)]
        if len(head) == 1 and ";" in head[0]:
            raise SheetError(f"{path}: line 1: has ';' between cells; save it with ','")
        _check_columns(f"{path}: line 1", head)
        if double := next((name for name in head if head.count(name) > 1), None):
            raise SheetError(f"{path}: has two columns {double!r}; take one out")
        for row in rows:
            if len(row) > len(head):
                raise SheetError(f"{path}: line {rows.line_num}: has more cells than columns")
            values = {name: cell.strip() for name, cell in zip(head, row, strict=False)}
            if any(values.values()):
                yield rows.line_num, {name: cell for name, cell in values.items() if cell}
    except UnicodeDecodeError as error:
        raise SheetError(f"{path}: is no UTF-8 text; save it as UTF-8") from error
    except csv.Error as error:
        raise SheetError(f"{path}: is no CSV ({one_line(error)}); export it again") from error


def _jsonl_rows(path: Path, data: bytes) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield line and values of a JSONL manifest."""
    from toonset.read import parse_json

    for number, line in enumerate(data.split(b"\n"), 1):
        if not line.strip():
            continue
        values = parse_json(line, f"{path}: line {number}", SheetError)
        if not isinstance(values, dict):
            raise SheetError(f"{path}: line {number}: is no JSON object; write one per sheet")
        _check_columns(f"{path}: line {number}", values)
        for name, value in values.items():
            texts = value if isinstance(value, list) and name == "sheet" else [value]
            if not all(isinstance(text, str) for text in texts):
                raise SheetError(f"{path}: line {number}: {name!r} is no text; quote it")
        yield number, {name: value for name, value in values.items() if value}


def _check_values(where: str, values: Mapping[str, Any]) -> None:
    """Refuse text that no file's name can hold."""
    for name, value in values.items():
        if "\0" in "".join(value):
            raise SheetError(f"{where}: {name!r} holds a zero character; take it out")


def _check_columns(where: str, names: Iterable[str]) -> None:
    """Refuse a column that means nothing."""
    from toonset.errors import did_you_mean

    known = [*PLAIN, *(f"{stage}{OPTIONS}" for stage in STAGES)]
    for name in names:
        if name not in known:
            said = did_you_mean(name, known) or f"known are {', '.join(known)}"
            raise SheetError(f"{where}: {name!r} is no column of a manifest; {said}")


def _sheets_of(values: Mapping[str, Any]) -> list[str]:
    sheets = values.get("sheet", [])
    parts = sheets if isinstance(sheets, list) else sheets.split(";")
    return [part.strip() for part in parts if part.strip()]
