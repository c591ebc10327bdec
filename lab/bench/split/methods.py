"""The ways of splitting that are compared: ours, and the simplest thing that people do today."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from lab.bench.split.cases import Drawn, drawn_at
from toonset.dataset.split.corrections import CORRECTIONS
from toonset.dataset.split.sheet import PictureOptions, split_picture
from toonset.errors import ToonsetError
from toonset.view import Box

CORNER_PX = 5  # side of the patch in the upper left corner whose colour is taken as the ground's
DIFFERENT = 30  # in some channel: no ground
LEAST_AREA = 0.1  # of the largest patch


@dataclass(frozen=True, eq=False)
class Found:
    """A method's split of a sheet: figures in order, whether it warns, what it left out."""

    figures: tuple[Drawn, ...]
    warned: bool
    left_out: tuple[Box, ...]
    seconds: float


Method = Callable[[UInt8[np.ndarray, "height width 4"]], Found]


def by_toonset(rgba: UInt8[np.ndarray, "height width 4"], *without: str) -> Found:
    """Return what `split_picture` finds without some corrections; a refusal is a warning."""
    start = time.process_time()
    try:
        sheet = split_picture(rgba, PictureOptions(without=without))
    except ToonsetError:
        return Found((), True, (), time.process_time() - start)
    seconds = time.process_time() - start
    figures = tuple(drawn_at(view.rgba[..., 3], *view.box[:2]) for view in sheet.views)
    left_out = tuple(left.box for left in sheet.left_out)
    return Found(figures, bool(sheet.warnings), left_out, seconds)


def by_corner_color(rgba: UInt8[np.ndarray, "height width 4"]) -> Found:
    """Return connected patches that differ from the corner's colour, without small ones."""
    start = time.process_time()
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        _differs(rgba).astype(np.uint8), connectivity=8
    )
    areas = stats[1:, cv2.CC_STAT_AREA]
    kept = [i + 1 for i in range(count - 1) if areas[i] >= LEAST_AREA * areas.max()]
    figures = []
    for number in _in_rows(kept, stats):
        x, y, width, height = (int(n) for n in stats[number, :4])
        patch = labels[y : y + height, x : x + width] == number
        figures.append(Drawn((x, y, width, height), patch.astype(np.uint8) * 255))
    return Found(tuple(figures), False, (), time.process_time() - start)


def _without(name: str, rgba: UInt8[np.ndarray, "height width 4"]) -> Found:
    return by_toonset(rgba, name)


METHODS: dict[str, Method] = {
    "default": by_toonset,
    **{f"without {name}": partial(_without, name) for name in CORRECTIONS},
    "corner colour": by_corner_color,
}


def _differs(rgba: UInt8[np.ndarray, "height width 4"]) -> Bool[np.ndarray, "height width"]:
    if (rgba[..., 3] < 255).any():
        return rgba[..., 3] >= 128
    corner = np.median(rgba[:CORNER_PX, :CORNER_PX, :3], axis=(0, 1)).astype(np.int16)
    away: Bool[np.ndarray, "height width"] = (
        np.abs(rgba[..., :3].astype(np.int16) - corner).max(axis=-1) > DIFFERENT
    )
    return away


def _in_rows(numbers: list[int], stats: np.ndarray) -> list[int]:
    """Return patches row by row; a new row begins under the middle of the last one's first."""
    waiting = sorted(numbers, key=lambda n: int(stats[n, 1]))
    ordered: list[int] = []
    while waiting:
        middle = stats[waiting[0], 1] + stats[waiting[0], 3] / 2
        row = [n for n in waiting if stats[n, 1] < middle]
        ordered += sorted(row, key=lambda n: int(stats[n, 0]))
        waiting = [n for n in waiting if n not in row]
    return ordered
