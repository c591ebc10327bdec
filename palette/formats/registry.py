"""Parse typed palettes and choose the format of palette files."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from toonset.errors import PaletteError
from toonset.palette.formats.adobe import ase_title, read_aco, read_ase, to_ase
from toonset.palette.formats.gpl import gpl_title, read_gpl, to_gpl
from toonset.palette.formats.hex import is_color, read_hex, rgb_of_typed, to_hex
from toonset.palette.formats.jasc import read_jasc
from toonset.palette.formats.json import MAX_BYTES, json_title, read_json, to_json
from toonset.palette.formats.text import without_mark
from toonset.palette.formats.tones import paints_of
from toonset.palette.names import NamedColor, clean_name
from toonset.palette.options import MAX_COLORS
from toonset.palette.palette import Palette
from toonset.read import describe, read_whole

UNTITLED = "toonset"
SHOWN = 80  # characters of what was typed, in messages


@dataclass(frozen=True)
class Format:
    """One kind of palette file.

    Attributes:
        extensions: the names' ends; the content decides, these only where it says nothing.
        magic: how its content begins, leading spaces left out; () where anything may.
        read: the colours of a file's bytes; the second argument names the file in messages.
        write: the bytes of a palette with a title; None where toonset does not write it.
        title: the palette's own name in a file's bytes; None where the format has none.
    """

    extensions: tuple[str, ...]
    magic: tuple[bytes, ...]
    read: Callable[[bytes, str], list[NamedColor]]
    write: Callable[[Palette, str], bytes] | None = None
    title: Callable[[bytes], str] | None = None


def _json_bytes(palette: Palette, _: str) -> bytes:
    return (json.dumps(to_json(palette), indent=2, allow_nan=False) + "\n").encode()


FORMATS = (
    Format(
        (".gpl",),
        (b"GIMP Palette",),
        read_gpl,
        lambda palette, title: to_gpl(palette, title).encode(),
        title=gpl_title,
    ),
    Format((".ase",), (b"ASEF",), read_ase, to_ase, title=ase_title),
    Format((".aco",), (b"\0\1", b"\0\2"), read_aco),
    Format((".pal",), (b"JASC-PAL",), read_jasc),
    Format((".json",), (b"[", b"{"), read_json, _json_bytes, title=json_title),
    Format((".hex", ".txt"), (), read_hex, lambda palette, _: to_hex(palette).encode()),
)
EXTENSIONS = tuple(extension for kind in FORMATS for extension in kind.extensions)
WRITTEN = tuple(kind.extensions[0] for kind in FORMATS if kind.write is not None)


def parse_colors(text_or_path: str) -> UInt8[np.ndarray, "colors 3"]:
    """Return the sRGB colours of a typed list or of a palette file; repeated ones count once.

    Swatches that a file names as another one's tone in shadow are left out.

    Args:
        text_or_path: "#aabbcc,#123,white" (commas or spaces, # may be left out), or the path of a
            palette file (see FORMATS), which is recognised by its content.

    Raises:
        PaletteError: not a colour, no colour, more than 255, or a file that cannot be read.
    """
    named = parse_named_colors(text_or_path)
    return np.array([color.rgb for color in named], dtype=np.uint8)


def parse_named_colors(text_or_path: str) -> tuple[NamedColor, ...]:
    """Return what `parse_colors` returns, with the names that the file gives.

    Raises:
        PaletteError: as `parse_colors`.
    """
    words = re.split(r"[,;\s]+", text_or_path.strip().strip(",;"))
    if not any(words):
        raise PaletteError("colours: none given; write them as '#aabbcc,#123' or name a file")
    typed = "#" in text_or_path or all(map(is_color, words))
    path = Path(text_or_path)
    if path.suffix.lower() not in EXTENSIONS and typed:
        return _checked([NamedColor(rgb_of_typed(word, "colours")) for word in words], "colours")
    if "\0" in text_or_path or not (path.suffix.lower() in EXTENSIONS or _exists(path)):
        shown = text_or_path if text_or_path.isprintable() else repr(text_or_path)
        raise PaletteError(
            f"{shown[:SHOWN]}: neither colours such as '#aabbcc,#123,white' nor a palette file "
            f"({', '.join(EXTENSIONS)}); correct it"
        )
    return _checked(paints_of(_read(path)), str(path))


def names_tones(text_or_path: str) -> bool:
    """Return whether something that `parse_colors` understands has tones in shadow."""
    path = Path(text_or_path)
    if path.suffix.lower() not in EXTENSIONS:
        return False
    swatches = _read(path)
    return len(paints_of(swatches)) < len(swatches)


def palette_title(text_or_path: str) -> str:
    """Return a palette file's title; "" if missing, and of typed colours."""
    path = Path(text_or_path)
    if path.suffix.lower() not in EXTENSIONS:
        return ""
    data, kind = _whole(path)
    return "" if kind.title is None else kind.title(data)


def palette_names(texts_or_paths: Sequence[str], *taken: str) -> list[str]:
    """Return what to call several of what `parse_colors` understands; no two are called alike.

    A file is called by its title, or by its own name where it has none or shares it; typed colours
    by their place.

    Args:
        texts_or_paths: what was given.
        taken: names that none may have.
    """
    titles = [palette_title(one) for one in texts_or_paths]
    names = list(taken)
    for number, (given, title) in enumerate(zip(texts_or_paths, titles, strict=True), start=1):
        path, own = Path(given), title
        if own in ("", UNTITLED) or titles.count(own) > 1:
            named = path.suffix.lower() in EXTENSIONS or ("#" not in given and _exists(path))
            own = clean_name(path.stem) if named else ""
        own = own or f"colours {number}"
        again = (f"{own} {count}" for count in itertools.count(2))
        names.append(own if own not in names else next(one for one in again if one not in names))
    return names[len(taken) :]


def encode_palette(palette: Palette, extension: str) -> bytes:
    """Return the palette as a file of the format that the extension names, always the same bytes.

    Args:
        palette: the colours.
        extension: one of WRITTEN, such as ".ase".

    Raises:
        PaletteError: a format that is not written.
    """
    for kind in FORMATS:
        if extension.lower() in kind.extensions and kind.write is not None:
            return kind.write(palette, palette.title or UNTITLED)
    raise PaletteError(f"{extension}: is not written; choose one of {', '.join(WRITTEN)}")


def _read(path: Path) -> list[NamedColor]:
    data, kind = _whole(path)
    return kind.read(data, str(path))


def _whole(path: Path) -> tuple[bytes, Format]:
    """Return a palette file's bytes, and which format they have."""
    data = without_mark(read_whole(path, "palette", PaletteError, MAX_BYTES))
    kinds = [
        kind for kind in FORMATS if kind.magic and data.lstrip(b" \t\r\n").startswith(kind.magic)
    ]
    kinds += [kind for kind in FORMATS if path.suffix.lower() in kind.extensions]
    if not kinds and describe(data) == "text":
        kinds = [kind for kind in FORMATS if not kind.magic]
    if not kinds:
        raise PaletteError(
            f"{path}: is {describe(data)}; give a palette file ({', '.join(EXTENSIONS)})"
        )
    return data, kinds[0]


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:  # a name that is too long, a loop of links
        return False


def _checked(colors: list[NamedColor], where: str) -> tuple[NamedColor, ...]:
    unique: dict[tuple[int, int, int], NamedColor] = {}
    for color in colors:
        unique.setdefault(color.rgb, color)
    if not 1 <= len(unique) <= MAX_COLORS:
        found = f"{len(unique)} colours, 1 to {MAX_COLORS} are needed"
        raise PaletteError(f"{where}: {found}; correct it")
    return tuple(unique.values())
