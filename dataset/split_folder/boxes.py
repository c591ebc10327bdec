"""Read figures' boxes from a JSON or CSV file.

JSON, any of:

    [[12, 8, 120, 300], [140, 8, 118, 301]]                 x, y, width, height in sheet pixels
    {"boxes": [{"x": 12, "y": 8, "width": 120, "height": 300}]}
    split.json of `toonset split`, whose boxes a person has corrected

or CSV: x,y,width,height per line; a first line with these names (w and h for short) may order them
differently and have other columns beside them. The sheet's top left corner is (0, 0); fractions of
a pixel are rounded outwards.
"""

from __future__ import annotations

import csv
import itertools
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from toonset.errors import SheetError
from toonset.read import BOM, describe, parse_json, read_whole
from toonset.view import Box

COLUMNS = ("x", "y", "width", "height")
SHORT = {"w": "width", "h": "height"}
MOST_BOXES = 1000  # a sheet has a few; more is another kind of file
MAX_BYTES = 8 * 2**20


def read_boxes(path: Path) -> tuple[tuple[Box, ...], ...]:
    """Return the boxes (x, y, width, height) of every sheet that the file speaks of, in its order.

    Only the split.json of several sheets speaks of more than one.

    Raises:
        SheetError: the file is missing, broken or without boxes, or a box is invalid.
    """
    data = read_whole(path, "boxes", SheetError, MAX_BYTES)
    if data.removeprefix(BOM).lstrip()[:1] in (b"[", b"{"):
        sheets = _from_json(path, parse_json(data, str(path), SheetError))
    else:
        sheets = (_from_csv(path, data),)
    return sheets


def check_boxes(boxes: Sequence[Box], size_wh: tuple[int, int], where: str) -> None:
    """Refuse boxes that the sheet does not have.

    Args:
        boxes: of one sheet.
        size_wh: the sheet's width and height.
        where: the file of the boxes, for the message.

    Raises:
        SheetError: a box leaves the sheet, or stands there twice.
    """
    width, height = size_wh
    for number, box in enumerate(boxes):
        x, y, wide, high = box
        if x < 0 or y < 0 or x + wide > width or y + high > height:
            raise SheetError(
                f"{where}: box {number} (x {x}, y {y}, {wide} x {high} px) leaves the sheet, which "
                f"is {width} x {height} px; correct it"
            )
        if box in boxes[:number]:
            raise SheetError(
                f"{where}: box {number} is the same as box {boxes.index(box)}; remove one"
            )


def _from_json(path: Path, content: Any) -> tuple[tuple[Box, ...], ...]:
    if isinstance(content, dict) and "views" in content:
        return _of_split(path, content)
    entries = content.get("boxes") if isinstance(content, dict) else content
    if not isinstance(entries, list):
        raise SheetError(f"{path}: holds no list of boxes; write [[x, y, width, height], ...]")
    _check_count(path, len(entries))
    return (tuple(_box(f"{path}: box {i}", entry) for i, entry in enumerate(entries)),)


def _of_split(path: Path, content: Mapping[str, Any]) -> tuple[tuple[Box, ...], ...]:
    """Return the boxes of every sheet of a split.json; views keep their order."""
    views, sheets = content["views"], content.get("sheets")
    if not isinstance(views, list) or not isinstance(sheets, list):
        raise SheetError(f'{path}: "views" and "sheets" must be lists, as `toonset split` writes')
    _check_count(path, len(views))
    found: list[list[Box]] = [[] for _ in sheets]
    for number, view in enumerate(views):
        where = f"{path}: box {number}"
        sheet = view.get("sheet", 0) if isinstance(view, dict) else None
        if type(sheet) is not int or not 0 <= sheet < len(sheets):
            raise SheetError(f'{where}: belongs to no sheet of this file; correct its "sheet"')
        found[sheet].append(_box(where, view))
    return tuple(tuple(boxes) for boxes in found)


def _from_csv(path: Path, data: bytes) -> tuple[Box, ...]:
    try:
        text = data.decode("utf-8-sig")
        rows = enumerate(csv.reader(text.splitlines(), _dialect(text)), 1)
        filled = ((number, [cell.strip() for cell in row]) for number, row in rows if any(row))
        drawn = ((number, row) for number, row in filled if any(row) and row[0][:1] != "#")
        lines = list(itertools.islice(drawn, MOST_BOXES + 2))  # with a head one too many
    except UnicodeDecodeError as error:
        raise SheetError(
            f"{path}: is {describe(data)}, no file of boxes; write JSON or CSV"
        ) from error
    except csv.Error as error:
        raise SheetError(f"{path}: is no valid CSV ({error}); correct it") from error
    order = list(range(len(COLUMNS)))
    if lines and not _is_number(lines[0][1][0]):
        order = _columns(path, lines.pop(0)[1])
    _check_count(path, len(lines))
    boxes = []
    for number, row in lines:
        if len(row) <= max(order):
            raise SheetError(
                f"{path}:{number}: {len(row)} cells, {','.join(COLUMNS)} are needed; correct it"
            )
        boxes.append(_box(f"{path}:{number}", [row[i] for i in order]))
    return tuple(boxes)


def _check_count(path: Path, count: int) -> None:
    if not 0 < count <= MOST_BOXES:
        found = "too many" if count else "0"
        raise SheetError(f"{path}: {found} boxes, 1 to {MOST_BOXES} are needed; correct the file")


def _dialect(text: str) -> type[csv.Dialect]:
    """Return how cells are divided: by semicolons or tabs where there are any, else commas."""

    class Divided(csv.excel):
        delimiter = next((mark for mark in ";\t" if mark in text), ",")

    return Divided


def _columns(path: Path, header: Sequence[str]) -> list[int]:
    names = [SHORT.get(name.lower(), name.lower()) for name in header]
    missing = [name for name in COLUMNS if name not in names]
    if missing:
        raise SheetError(
            f"{path}: the first line has no {', '.join(missing)}; write {','.join(COLUMNS)}, "
            "or numbers at once"
        )
    return [names.index(name) for name in COLUMNS]


def _box(where: str, entry: object) -> Box:
    """Return a box of whole pixels, rounded outwards."""
    numbers = _numbers(entry)
    if len(numbers) != len(COLUMNS) or not math.isfinite(sum(map(abs, numbers))):
        shown = json.dumps(entry)[:60]
        raise SheetError(
            f"{where}: found {shown}, four numbers x, y, width, height are needed; correct it"
        )
    x, y, width, height = numbers
    if width <= 0 or height <= 0:
        raise SheetError(
            f"{where}: {width:g} x {height:g} px is empty; give it a width and a height above 0"
        )
    left, top = math.floor(x), math.floor(y)
    return (left, top, math.ceil(x + width) - left, math.ceil(y + height) - top)


def _numbers(entry: object) -> list[float]:
    """Return an entry's numbers; empty if it is not a box."""
    if isinstance(entry, dict):
        named = {SHORT.get(key, key): value for key, value in entry.items()}
        entry = named.get("box", [named.get(name) for name in COLUMNS])
    if not isinstance(entry, list) or any(isinstance(value, bool) for value in entry):
        return []
    try:
        return [float(value) for value in entry]
    except (TypeError, ValueError, OverflowError):
        return []


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
