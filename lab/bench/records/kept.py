"""What a stopped bench has done already, in a file of its folder that a later run goes on from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from toonset.errors import BundleError
from toonset.json_file import read_json
from toonset.write import check_output, write_json

Row = TypeVar("Row")


def kept_rows(
    file: Path,
    key: dict[str, Any],
    read: Callable[[Any], Row],
    written: Sequence[str],
    *,
    force: bool,
) -> list[Row]:
    """Return the rows of an earlier run; none if the folder is new or to be replaced.

    Args:
        file: of the rows.
        key: what they depend on: rows of another key serve nobody.
        read: a row from plain data.
        written: what the folder may hold.
        force: replace what is there.

    Raises:
        ToonsetError: the file holds no rows, or those of another key; the folder is not to be used.
    """
    if not file.is_file() or force:
        check_output(file.parent, [], written, force=force)
        keep_rows(file, key, [])
        return []
    data = read_json(file)
    try:
        found, rows = dict(data["key"]), list(data["rows"])
        if found == key:
            return [read(row) for row in rows]
    except (KeyError, TypeError, ValueError) as error:
        raise BundleError(f"{file}: holds no results; pass --force to start afresh") from error
    raise BundleError(
        f"{file}: results of {found}, this run is {key}; pass --force to start afresh, or choose "
        "another -o"
    )


def keep_rows(file: Path, key: dict[str, Any], rows: Sequence[Any]) -> None:
    """Write rows of plain data with what they depend on."""
    write_json(file, {"key": key, "rows": list(rows)})
