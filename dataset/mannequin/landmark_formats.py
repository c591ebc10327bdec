"""Parse landmark files, JSON or CSV, into plain records."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toonset.errors import LandmarkError, did_you_mean
from toonset.read import read_whole

SCHEMA = "toonset-landmarks/1"
KEYS = ("schema", "units", "pixels", "points", "views")
PAIR_KEYS = ("name", "world", "pixel")
COLUMNS = ("view", "name", "u", "v")
WORLD_COLUMNS = ("x", "y", "z")
MOST_POINTS = 1000  # per view; people click ten
MAX_BYTES = 8 * 2**20

Numbers = tuple[float, ...]


@dataclass(frozen=True)
class Pair:
    """One point of a file: `world` is None if only its name is given."""

    name: str
    pixel: Numbers
    world: Numbers | None = None


@dataclass(frozen=True)
class LandmarkFile:
    """A landmark file as it stands.

    Attributes:
        views: the pairs by the file's own word for the view.
        points: world coordinates by name.
        in_sheet: pixels are those of the sheet, not of the view's crop.
    """

    views: dict[str, tuple[Pair, ...]]
    points: dict[str, Numbers]
    in_sheet: bool = True


def read_landmark_file(path: Path) -> LandmarkFile:
    """Return the content of a .csv file, or of JSON with any other ending.

    Raises:
        LandmarkError: the file is missing or broken, or a number is invalid.
    """
    data = read_whole(path, "landmark", LandmarkError, MAX_BYTES)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise LandmarkError(f"{path}: is no UTF-8 text; save it as JSON or CSV") from error
    return _from_csv(path, text) if path.suffix.lower() == ".csv" else _from_json(path, text)


def closest(word: str, choices: Sequence[str]) -> str:
    """Return advice: the choice most like `word`, or the list of choices."""
    listed = ", ".join(choices[:20]) + (", ..." if len(choices) > 20 else "")
    return did_you_mean(word, choices) or f"choose one of: {listed}"


def _from_csv(path: Path, text: str) -> LandmarkFile:
    rows = csv.DictReader(io.StringIO(text, newline=""), skipinitialspace=True)
    header = tuple(rows.fieldnames or ())
    if header not in (COLUMNS, COLUMNS + WORLD_COLUMNS):
        raise LandmarkError(
            f"{path}: the first line is {','.join(header)!r}, {','.join(COLUMNS)} with or without "
            f",{','.join(WORLD_COLUMNS)} is needed; correct it"
        )
    views: dict[str, list[Pair]] = {}
    try:
        for row in rows:
            views.setdefault(row["view"], []).append(_csv_pair(f"{path}:{rows.line_num}", row))
    except csv.Error as error:
        raise LandmarkError(f"{path}:{rows.line_num}: {error}; correct the line") from error
    return LandmarkFile({k: _distinct(f"{path}: view {k}", v) for k, v in views.items()}, {})


def _csv_pair(where: str, row: dict[Any, Any]) -> Pair:
    if None in row or None in (row[column] for column in COLUMNS):
        raise LandmarkError(f"{where}: has another number of cells than the first line; correct it")
    cells = [row.get(column) or "" for column in WORLD_COLUMNS]
    name = row["name"] or f"line {where.rpartition(':')[2]}"
    world = _numbers(f"{where}: x, y, z", cells, 3) if any(cells) else None
    return Pair(name, _numbers(f"{where}: u, v", [row["u"], row["v"]], 2), world)


def _from_json(path: Path, text: str) -> LandmarkFile:
    try:
        content = json.loads(text, object_pairs_hook=lambda items: _unique(path, items))
    except (ValueError, RecursionError) as error:
        raise LandmarkError(f"{path}: is no valid JSON ({error}); correct it") from error
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise LandmarkError(f'{path}: is no landmark file; start it with {{"schema": "{SCHEMA}",')
    for key in content:
        if key not in KEYS:
            raise LandmarkError(f"{path}: unknown key {key!r}; {closest(key, KEYS)}")
    if content.get("pixels", "sheet") not in ("sheet", "view"):
        raise LandmarkError(f'{path}: "pixels" is {content["pixels"]!r}; write "sheet" or "view"')
    views, points = content.get("views", {}), content.get("points", {})
    if not isinstance(views, dict) or not isinstance(points, dict):
        raise LandmarkError(f'{path}: "views" and "points" must be objects {{...}}; correct them')
    return LandmarkFile(
        {
            k: _distinct(f"{path}: view {k}", _members(f"{path}: view {k}", v))
            for k, v in views.items()
        },
        {name: _numbers(f"{path}: points: {name}", p, 3) for name, p in points.items()},
        content.get("pixels", "sheet") == "sheet",
    )


def _unique(path: Path, items: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object; a key that stands twice is a mistake, not an update."""
    result: dict[str, Any] = {}
    for key, value in items:
        if key in result:
            raise LandmarkError(f"{path}: {key!r} is given twice; remove or rename one")
        result[key] = value
    return result


def _members(where: str, value: Any) -> list[Pair]:
    if isinstance(value, dict):
        return [Pair(name, _numbers(f"{where}: {name}", p, 2)) for name, p in value.items()]
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        raise LandmarkError(
            f'{where}: {{"name": [u, v], ...}} or a list of pairs is needed; write one'
        )
    return [_listed(where, f"pair {i}", item) for i, item in enumerate(value, 1)]


def _listed(where: str, place: str, item: dict[str, Any]) -> Pair:
    for key in item:
        if key not in PAIR_KEYS:
            raise LandmarkError(f"{where}: {place}: unknown key {key!r}; {closest(key, PAIR_KEYS)}")
    name, world = item.get("name", place), item.get("world")
    if not isinstance(name, str) or ("name" not in item and world is None):
        raise LandmarkError(f'{where}: {place} needs a "name" (text) or "world"; give one of them')
    pixel = _numbers(f"{where}: {name}: pixel", item.get("pixel"), 2)
    return Pair(name, pixel, None if world is None else _numbers(f"{where}: {name}", world, 3))


def _distinct(where: str, pairs: list[Pair]) -> tuple[Pair, ...]:
    if len(pairs) > MOST_POINTS:
        raise LandmarkError(
            f"{where}: {len(pairs)} pairs, at most {MOST_POINTS} are read; thin out"
        )
    names = [pair.name for pair in pairs]
    for name in names:
        if names.count(name) > 1:
            raise LandmarkError(f"{where}: {name!r} is given twice; remove or rename one")
    return tuple(pairs)


def _numbers(where: str, value: Any, count: int) -> Numbers:
    """Return `count` finite numbers; text counts as a number only where all cells are text."""
    try:
        if not isinstance(value, list) or any(isinstance(x, bool) for x in value):
            raise TypeError
        numbers = tuple(float(x) for x in value)
    except (TypeError, ValueError, OverflowError):
        numbers = ()
    if len(numbers) != count or not all(math.isfinite(x) for x in numbers):
        shown = json.dumps(value)[:60]
        raise LandmarkError(
            f"{where}: found {shown}, {count} finite numbers are needed; correct it"
        )
    return numbers
