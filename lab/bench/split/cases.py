"""Sheets to split with their truth: messy synthetic ones, rendered characters, game sprites."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from lab.bench.cases.sprites import SHADOW_BELOW
from lab.bench.messy.figure import tight_window
from lab.bench.messy.options import DIFFICULTIES
from lab.bench.messy.sheet import make_messy_sheet
from toonset.dataset.images.picture import load_rgba
from toonset.errors import BundleError
from toonset.json_file import read_json
from toonset.view import Box

MIXED = "mixed"
MIXED_FOR_ONE = 15  # mixtures for every sheet of a difficulty alone: 60 at the default count of 4


@dataclass(frozen=True, eq=False)
class Drawn:
    """A figure where it lies in its sheet: alpha of its box, which is just around it."""

    box: Box
    alpha: UInt8[np.ndarray, "height width"]


@dataclass(frozen=True, eq=False)
class SplitCase:
    """A sheet and its figures in reading order."""

    name: str
    group: str
    rgba: UInt8[np.ndarray, "height width 4"]
    figures: tuple[Drawn, ...]


def drawn_at(alpha: UInt8[np.ndarray, "h w"], x: int, y: int) -> Drawn:
    """Return what a picture with its corner at (x, y) shows."""
    rows, columns = tight_window(alpha)
    crop = alpha[rows, columns]
    return Drawn((x + columns.start, y + rows.start, crop.shape[1], crop.shape[0]), crop)


def messy_cases(seed: int, count: int, only: str = "") -> Iterator[SplitCase]:
    """Yield `count` sheets of every difficulty alone and 15 times as many mixtures.

    Args:
        seed: of all of them; difficulties do not share characters.
        count: sheets per difficulty.
        only: leave out cases whose name does not contain this.
    """
    for group in (*DIFFICULTIES, MIXED):
        alone = () if group == MIXED else (group,)
        for i in range(count if alone else MIXED_FOR_ONE * count):
            if only in f"{group} {i}":
                yield _messy(f"{group} {i}", group, seed + i, alone)


def sheet_cases(folder: Path, only: str = "") -> Iterator[SplitCase]:
    """Yield sheets of rendered characters: sheet.png or .jpg, gt.json with `boxes`, views/*.png.

    Raises:
        BundleError: the folder holds none whose name contains `only`.
    """
    for place in _places(folder, "gt.json", only):
        cells = read_json(place / "gt.json")["boxes"]
        views = sorted((place / "views").glob("*.png"))
        figures = [
            drawn_at(load_rgba(path)[..., 3], int(cell["sheet_x"]), int(cell["sheet_y"]))
            for path, cell in zip(views, cells, strict=True)
        ]
        (sheet,) = place.glob("sheet.*")
        yield SplitCase(place.name, "rendered sheets", load_rgba(sheet), tuple(figures))


def sprite_sheet_cases(folder: Path, only: str = "") -> Iterator[SplitCase]:
    """Yield sheets of game sprites: sheet.png, info.json with `sheet_boxes_xywh`, view_0.png etc.

    Where the description speaks of a cast shadow, faint pixels are no part of the figure.

    Raises:
        BundleError: the folder holds none whose name contains `only`.
    """
    for place in _places(folder, "info.json", only):
        info = read_json(place / "info.json")
        yield SplitCase(
            place.name, "game sprites", load_rgba(place / "sheet.png"), _sprites(place, info)
        )


def _sprites(place: Path, info: Any) -> tuple[Drawn, ...]:
    scale, shadow = int(info["sheet_scale"]), "shadow" in str(info.get("alpha"))
    figures = []
    for number, (x, y, _, _) in enumerate(info["sheet_boxes_xywh"]):
        alpha = load_rgba(place / f"view_{number}.png")[..., 3]
        crop = alpha[tight_window(alpha)].repeat(scale, axis=0).repeat(scale, axis=1)
        if shadow:
            crop = np.where(crop < SHADOW_BELOW, np.uint8(0), crop)
        figures.append(drawn_at(crop, int(x), int(y)))
    return tuple(figures)


def _messy(name: str, group: str, seed: int, alone: Sequence[str]) -> SplitCase:
    own = zlib.crc32(f"{group} {seed}".encode())
    sheet = make_messy_sheet(own, alone)
    figures = tuple(Drawn(box, alpha) for box, alpha in zip(sheet.boxes, sheet.alphas, strict=True))
    title = name if alone else f"{name}: {', '.join(sheet.what)}"
    return SplitCase(title, group, sheet.rgba, figures)


def _places(folder: Path, needed: str, only: str) -> list[Path]:
    found = [path.parent for path in sorted(folder.glob(f"*/{needed}")) if only in path.parent.name]
    if not found:
        asked = f" whose name contains {only!r}" if only else ""
        raise BundleError(f"{folder}: no folder with {needed}{asked}; give another one")
    return found
