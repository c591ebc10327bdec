"""Palettes as text: what people type, GIMP's .gpl, hex lists, JSON."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from toonset.errors import PaletteError
from toonset.palette.names import hex_of
from toonset.palette.palette import MAX_COLORS, DroppedColor, Palette, PaletteColor
from toonset.reading import read_whole

SCHEMA = "toonset-palette/1"
MAX_BYTES = 2**20
HEX = re.compile(r"#?([0-9a-fA-F]{3}|[0-9a-fA-F]{6})")
EXTENSIONS = (".gpl", ".hex", ".txt", ".json")


def parse_colors(text_or_path: str) -> UInt8[np.ndarray, "colors 3"]:
    """Return the sRGB colours of a typed list or of a palette file; repeated ones count once.

    Args:
        text_or_path: "#aabbcc,#123" (commas or spaces, # may be left out), or the path of a
            .gpl (GIMP), .hex or .txt (one colour per line) or .json file.

    Raises:
        PaletteError: not a colour, no colour, more than 255, or a file that cannot be read.
    """
    words = re.split(r"[,;\s]+", text_or_path.strip().strip(",;"))
    if not any(words):
        raise PaletteError("colours: none given; write them as '#aabbcc,#123' or name a file")
    typed = "#" in text_or_path or all(HEX.fullmatch(word) for word in words)
    path = Path(text_or_path)
    if path.suffix.lower() in EXTENSIONS or not typed:
        return _checked(_read_colors(path), str(path))
    return _checked([_color(word, "colours") for word in words], "colours")


def to_gpl(palette: Palette, title: str = "toonset") -> str:
    """Return the palette as GIMP's .gpl text, which Krita, Inkscape and Aseprite read too."""
    rows = [
        f"{red:3d} {green:3d} {blue:3d}\t{color.name} {100 * color.share:.1f}%"
        for color in palette.colors
        for red, green, blue in [color.rgb]
    ]
    return "\n".join(
        ["GIMP Palette", f"Name: {' '.join(title.split())}", "Columns: 0", "#", *rows, ""]
    )


def to_json(palette: Palette) -> dict[str, Any]:
    """Return the content of palette.json."""
    return {
        "schema": SCHEMA,
        "colors": [
            {"hex": hex_of(color.rgb), "share": round(color.share, 6), "name": color.name}
            for color in palette.colors
        ],
        "rule": palette.rule,
        "dropped": [
            {
                "hex": hex_of(color.rgb),
                "share": round(color.share, 6),
                "name": color.name,
                "oklab_cost": round(color.cost, 6),
            }
            for color in palette.dropped
        ],
        "warnings": list(palette.warnings),
    }


def read_palette_json(path: Path) -> Palette:
    """Return the palette of a palette.json.

    Raises:
        PaletteError: the file is missing, damaged, or of another schema.
    """
    value = _json(path)
    if not isinstance(value, dict) or value.get("schema") != SCHEMA:
        found = value.get("schema") if isinstance(value, dict) else type(value).__name__
        raise PaletteError(
            f"{path}: schema {found!r}, {SCHEMA!r} is needed; write it again with `toonset palette`"
        )
    try:
        return Palette(
            colors=tuple(
                PaletteColor(_color(entry["hex"], str(path)), *_share_and_name(entry))
                for entry in value["colors"]
            ),
            rule=str(value["rule"]),
            dropped=tuple(
                DroppedColor(
                    _color(entry["hex"], str(path)),
                    *_share_and_name(entry),
                    float(entry["oklab_cost"]),
                )
                for entry in value.get("dropped", [])
            ),
            warnings=tuple(str(warning) for warning in value.get("warnings", [])),
        )
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise PaletteError(
            f"{path}: is damaged ({type(error).__name__}: {error}); write it again with "
            "`toonset palette`"
        ) from error
    except PaletteError as error:
        raise PaletteError(f"{path}: {str(error).removeprefix(f'{path}: ')}") from error


def _share_and_name(entry: dict[str, Any]) -> tuple[float, str]:
    share = float(entry["share"])
    if not 0 <= share <= 1:
        raise ValueError(f"share {share} is not within 0 to 1")
    return share, str(entry["name"])


def _read_colors(path: Path) -> list[tuple[int, int, int]]:
    if path.suffix.lower() not in EXTENSIONS:
        raise PaletteError(
            f"{path}: neither colours such as '#aabbcc,#123' nor a palette file "
            f"({', '.join(EXTENSIONS)})"
        )
    if path.suffix.lower() == ".json":
        return _colors_of_json(_json(path), path)
    lines = _text(path).splitlines()
    if path.suffix.lower() == ".gpl":
        return _colors_of_gpl(lines, path)
    paint_net = any("paint.net" in line.lower() for line in lines[:1])  # writes AARRGGBB
    words = [line.split(";")[0].strip() for line in lines]
    return [
        _color(word[2:] if paint_net and len(word) == 8 else word, f"{path}: line {number}")
        for number, word in enumerate(words, start=1)
        if word
    ]


def _colors_of_gpl(lines: list[str], path: Path) -> list[tuple[int, int, int]]:
    if not lines or lines[0].strip() != "GIMP Palette":
        raise PaletteError(
            f"{path}: does not begin with 'GIMP Palette'; export it again as GIMP palette"
        )
    colors = []
    for number, line in enumerate(lines[1:], start=2):
        words = line.split()
        if not words or words[0].startswith("#") or words[0] in ("Name:", "Columns:", "Channels:"):
            continue
        numbers = [int(word) for word in words[:3] if word.isascii() and word.isdigit()]
        if len(numbers) != 3 or max(numbers) > 255:
            raise PaletteError(
                f"{path}: line {number}: '{line.strip()[:40]}' is no colour; three numbers from 0 "
                "to 255 are needed"
            )
        colors.append((numbers[0], numbers[1], numbers[2]))
    return colors


def _colors_of_json(value: Any, path: Path) -> list[tuple[int, int, int]]:
    entries = value.get("colors") if isinstance(value, dict) else value
    if not isinstance(entries, list):
        raise PaletteError(f'{path}: has no list of colours; ["#aabbcc", ...] is needed')
    words = [entry.get("hex") if isinstance(entry, dict) else entry for entry in entries]
    return [_color(word, str(path)) for word in words]


def _color(word: Any, where: str) -> tuple[int, int, int]:
    match = HEX.fullmatch(word) if isinstance(word, str) else None
    if match is None:
        raise PaletteError(f"{where}: {str(word)[:40]!r} is no colour; write it as #rrggbb or #rgb")
    digits = match[1] if len(match[1]) == 6 else "".join(2 * digit for digit in match[1])
    return int(digits[:2], 16), int(digits[2:4], 16), int(digits[4:], 16)


def _checked(colors: list[tuple[int, int, int]], where: str) -> UInt8[np.ndarray, "colors 3"]:
    unique = list(dict.fromkeys(colors))
    if not 1 <= len(unique) <= MAX_COLORS:
        raise PaletteError(f"{where}: {len(unique)} colours; 1 to {MAX_COLORS} are needed")
    return np.array(unique, dtype=np.uint8)


def _text(path: Path) -> str:
    data = read_whole(path, "palette", PaletteError, MAX_BYTES)
    if b"\0" in data:
        raise PaletteError(f"{path}: is no text; a palette file ({', '.join(EXTENSIONS)}) is text")
    return data.removeprefix(b"\xef\xbb\xbf").decode("utf-8", errors="replace")


def _json(path: Path) -> Any:
    try:
        return json.loads(_text(path))
    except (ValueError, RecursionError) as error:
        raise PaletteError(f"{path}: is no valid JSON ({error}); write it again") from error
