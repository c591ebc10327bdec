"""A sheet as somebody named it, and what it is called."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Given:
    """One sheet as somebody named it.

    Attributes:
        where: that was, for messages.
        root: what its paths are relative to.
        inside: whether they must lie in there.
        name: of the sheet, made from its file's where nobody gave one.
        values: by column.
    """

    where: str
    root: Path
    inside: bool
    name: str
    values: Mapping[str, Any]


def clean_name(text: str) -> str:
    """Return a text as the name of a sheet: what may stand in no folder's name is "_"."""
    return re.sub(r"[^\w-]+", "_", unicodedata.normalize("NFC", text)).strip("_").lstrip("-")


def stem_of(name: str) -> str:
    """Return a file's name without its ending."""
    return name.rsplit(".", 1)[0] if "." in name[1:] else name
