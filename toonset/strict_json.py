"""JSON, read strictly: what two readers could understand differently is refused.

RFC 8259 leaves open what a repeated key means, how long numbers and how deep nestings may be, and
Python's own reader takes NaN and Infinity, which are no JSON. None of these occur in what toonset
and its neighbours write, so a file that holds one is damaged or hostile.
"""

from __future__ import annotations

import json
import math
from typing import Any

from toonset.errors import ToonsetError
from toonset.plain_text import printable

MAX_DEPTH = 64  # camera files nest eight deep
LARGEST_INT = 2**63  # beyond, other programs' integers end
MAX_DIGITS = 400  # as a float's longest; Python itself refuses 4300
BOM = b"\xef\xbb\xbf"


def parse_json(data: bytes, where: str, error_type: type[ToonsetError]) -> Any:
    """Return the content of a JSON text in UTF-8 (with or without byte order mark).

    Args:
        data: the text's bytes.
        where: the file, for messages.
        error_type: the error to raise.

    Raises:
        ToonsetError: as `error_type`: no JSON, no UTF-8, a repeated key, a number that is not
            finite or has more than 63 bits, or a nesting deeper than 64.
    """
    try:
        text = data.removeprefix(BOM).decode("utf-8")
        value = json.loads(text, object_pairs_hook=_object, parse_int=_whole)
        _check(value)
    except RecursionError as error:
        raise error_type(f"{where}: is no valid JSON that is read (nested too deep)") from error
    except UnicodeDecodeError as error:
        place = f"byte {error.start} is no UTF-8"
        raise error_type(f"{where}: is no valid JSON ({place}); save it as UTF-8") from error
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise error_type(f"{where}: is no valid JSON ({reason}); write it again") from error
    return value


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {twice[:40]!r} is there twice")
    return found


def _whole(digits: str) -> int:
    if len(digits) > MAX_DIGITS:
        raise ValueError(f"a number of {len(digits)} digits")
    return int(digits)


def _check(value: Any) -> None:
    """Refuse numbers that are not finite or too long, and deep nesting; say where."""
    pending: list[tuple[tuple[object, ...], Any]] = [((), {"the whole": value})]
    while pending:
        path, holder = pending.pop()
        inner = []
        for key, item in holder.items() if isinstance(holder, dict) else enumerate(holder):
            if isinstance(item, dict | list):
                inner.append(((*path, key), item))
            elif isinstance(item, float) and not math.isfinite(item):
                raise ValueError(f"{_place((*path, key))} is {item}, a finite number is needed")
            elif isinstance(item, int) and abs(item) >= LARGEST_INT:
                raise ValueError(f"{_place((*path, key))} has more than 63 bits")
        if inner and len(path) >= MAX_DEPTH:
            raise ValueError(f"nested deeper than {MAX_DEPTH}")
        pending += reversed(inner)


def _place(path: tuple[object, ...]) -> str:
    return printable(".".join(str(part)[:40] for part in path[1:] or path))
