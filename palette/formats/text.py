"""Decode the text of foreign palette files: encodings and line ends."""

from __future__ import annotations

import codecs
import re

from toonset.errors import PaletteError

UTF16_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def without_mark(data: bytes) -> bytes:
    """Return the bytes with the mark that Windows editors put first gone; UTF-16 becomes UTF-8."""
    if data.startswith(UTF16_MARKS):
        return data.decode("utf-16", errors="replace").encode("utf-8", errors="replace")
    return data.removeprefix(codecs.BOM_UTF8)


def text_of(data: bytes, where: str) -> str:
    """Return the text; what is not UTF-8 is read as Latin-1, so that old names survive.

    Raises:
        PaletteError: a zero byte, which no text holds.
    """
    if b"\0" in data:
        raise PaletteError(f"{where}: is no text, as its kind of palette is; export it again")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def lines_of(data: bytes, where: str) -> list[str]:
    """Return the lines of a text, whatever program wrote the line ends.

    Raises:
        PaletteError: a zero byte, which no text holds.
    """
    return re.split(r"\r\n|\r|\n", text_of(data, where))
