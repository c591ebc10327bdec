"""Read and write palette.json; read lists of hex colours such as Lospec's."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from toonset.errors import PaletteError
from toonset.json_file import validation_reason
from toonset.palette.formats.tones import SUFFIX
from toonset.palette.names import NamedColor, clean_name, one_line, rgb_of_hex
from toonset.palette.palette import Palette
from toonset.read import parse_json, read_whole, schema_version

NAME, VERSION = "toonset-palette", 1  # toonset.palette.palette says what may change
MAX_BYTES = 2**20  # of a palette file: thousands of colours fit
SELDOM = ("sure", "factor")  # of a colour: written where known

_palette = cache(lambda: TypeAdapter(Palette))  # not before it is needed: it takes its time


def read_json(data: bytes, where: str) -> list[NamedColor]:
    """Return the colours of a list, or of an object's "colors"; tones follow their colour.

    An entry is "#rrggbb", or an object with "hex" and perhaps "name" and "tones".

    Raises:
        PaletteError: no JSON, no such list, or an entry that is not a colour.
    """
    content = parse_json(data, where, PaletteError)
    entries = content.get("colors") if isinstance(content, dict) else content
    if not isinstance(entries, list):
        raise PaletteError(f'{where}: has no list of colours; ["#aabbcc", ...] is needed')
    return [
        swatch
        for i, entry in enumerate(entries, start=1)
        for swatch in _swatches(entry, f"{where}: colour {i}")
    ]


def json_title(data: bytes) -> str:
    """Return an object's title, as toonset and Lospec write it; "" if missing."""
    content = parse_json(data, "palette", PaletteError)
    said = [content.get(key) for key in ("title", "name")] if isinstance(content, dict) else []
    return next((clean_name(text) for text in said if isinstance(text, str)), "")


def to_json(palette: Palette) -> dict[str, Any]:
    """Return the content of palette.json."""
    content: dict[str, Any] = _palette().dump_python(palette, mode="json", by_alias=True)
    for key in ("printed", "stepped"):  # written where there are any
        if not content[key]:
            del content[key]
    content["colors"] = [
        {k: value for k, value in one.items() if k not in SELDOM or value is not None}
        | {"name": one_line(one["name"])}
        for one in content["colors"]
    ]
    return {"schema": f"{NAME}/{VERSION}", **content}


def read_palette_json(path: Path) -> Palette:
    """Return the palette of a palette.json.

    Raises:
        PaletteError: the file is missing, damaged, of another schema or of a newer toonset.
    """
    data = read_whole(path, "palette", PaletteError, MAX_BYTES)
    return palette_of(parse_json(data, str(path), PaletteError), str(path))


def palette_of(content: Any, where: str) -> Palette:
    """Return the palette that the content of a palette.json states.

    Raises:
        PaletteError: of another schema, of a newer toonset, or not fitting its schema.
    """
    if schema_version(content, NAME, VERSION, where, PaletteError) is None:
        raise PaletteError(
            f"{where}: states no schema, '{NAME}/{VERSION}' is needed; write it again with "
            "`toonset palette`"
        )
    try:
        return _palette().validate_json(json.dumps(content), strict=True)
    except ValidationError as error:
        raise PaletteError(f"{where}: {validation_reason(error)}") from error
    except PaletteError as error:
        raise PaletteError(f"{where}: {error}") from error


def _swatches(entry: Any, where: str) -> list[NamedColor]:
    """Return an entry's colour, and after it its tone in shadow, of a ramp the darkest."""
    if not isinstance(entry, dict):
        return [NamedColor(rgb_of_hex(entry, where))]
    name, tones = entry.get("name"), entry.get("tones")
    name = clean_name(name) if isinstance(name, str) else ""
    found = [NamedColor(rgb_of_hex(entry.get("hex"), where), name)]
    for tone in tones[1:][-1:] if isinstance(tones, list) and name else ():
        rgb = rgb_of_hex(tone.get("hex") if isinstance(tone, dict) else tone, where)
        found.append(NamedColor(rgb, name + SUFFIX))
    return found
