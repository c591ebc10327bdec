"""Cases of the sweep: small, of every kind, drawn here or read from a folder.

A folder of cases holds `inputs/sheets/*`, `real/*`, `sheets/*/sheet.*` and `painted/*/sheet.*`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from lab.bench.sweep.drawings import drawings
from lab.bench.sweep.outcomes import Outcome, palette_outcome, split_outcome
from lab.bench.sweep.sheets import sheets
from toonset.dataset.images.picture import load_rgba
from toonset.dataset.split.sheet import split_picture

SHEETS = ("inputs/sheets/*", "real/*", "sheets/*/sheet.*")
SUFFIXES = (".png", ".jpg", ".jpeg")


@dataclass(frozen=True, eq=False)
class Case:
    """One case: its name, and what runs it."""

    name: str
    run: Callable[[], Outcome]


def cases_of(folder: Path | None, *, large: bool) -> list[Case]:
    """Return all cases: the usual few, or many others.

    Args:
        folder: of cases for the many; None: only what is drawn here.
        large: many, none of which is among the few.
    """
    found = [Case(name, partial(split_outcome, rgba)) for name, rgba in sheets(large=large)]
    found += [
        Case(name, partial(palette_outcome, images, printed))
        for name, images, printed in drawings(large=large)
    ]
    return found + (list(_read(folder)) if folder and large else [])


def _read(folder: Path) -> Iterator[Case]:
    for pattern in (*SHEETS, "painted/*/sheet.*"):
        for path in sorted(folder.glob(pattern)):
            name = path.parent.name if path.stem == "sheet" else path.stem
            if path.suffix.lower() not in SUFFIXES:
                continue
            rgba = load_rgba(path)
            if "painted" in pattern:
                views = tuple(view.rgba for view in split_picture(rgba).views)
                yield Case(name, partial(palette_outcome, views, ()))
            else:
                yield Case(name, partial(split_outcome, rgba))
