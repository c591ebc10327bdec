"""Looks side by side: their figures over CPU seconds, their pictures, faces with wrong eyes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import cv2
import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw

from bench.charts.chart import COLORS, DEFAULT, SHOWN
from bench.charts.figure import DARK, LIGHT, Form, figure_bytes, log_ticks, new_figure
from bench.look.eyes import FACE
from bench.look.measure import COLUMNS, FLICKER, Column, LookResult
from bench.look.plan import LOOKS
from toonset.dataset.silhouettes.mask import mask_of
from toonset.nerf.score.evaluation_picture import font_of
from toonset.view import over_white

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANELS = ("flip", "dirt", "sharpness", "ink_f1", "label_miou_shift", "psnr_blocks", FLICKER)
IDEAL = {"sharpness": 1.0, FLICKER: 1.0}  # as the truth's
ROWS, TILE_PX, TEXT_PX = 4, 230, 15
FACE_PX, MOST_FACES = 150, 24
STAR = SHOWN[-1]

Rgb = UInt8[np.ndarray, "height width 3"]


def draw_looks(results: Sequence[LookResult], caption: str, form: Form = "png") -> bytes:
    """Return the figure: a panel per measure, a point per look, mean over all sheets."""
    columns = [column for column in COLUMNS if column.name in PANELS]
    columns = [c for c in columns if any(one.figures[c.name] is not None for one in results)]
    figure = new_figure(11.4, 5.8)
    places = figure.subplots(2, 4).ravel()
    looks = [name for name in LOOKS if any(one.look == name for one in results)]
    for axes, column in zip(places, columns, strict=False):
        _draw_panel(axes, column, looks, results)
    for axes in places[len(columns) :]:
        axes.set_axis_off()
    handles = places[0].get_legend_handles_labels()
    places[-1].legend(*handles, loc="upper left", fontsize=9, frameon=False)
    figure.supxlabel(
        f"CPU seconds of training, laying the drawings out and 16 views; logarithmic\n{caption}",
        fontsize=8.5,
        color=DARK,
    )
    return figure_bytes(figure, form)


def _draw_panel(
    axes: Axes, column: Column, looks: Sequence[str], results: Sequence[LookResult]
) -> None:
    spent = []
    for number, name in enumerate(looks):
        own = [one for one in results if one.look == name and one.figures[column.name] is not None]
        if not own:
            continue
        spent.append(float(np.median([one.cpu_seconds for one in own])))
        value = np.mean([one.figures[column.name] or 0.0 for one in own])
        marker, size = (STAR, 190) if name == DEFAULT else (SHOWN[number % 7], 55)
        color = COLORS[1] if name == DEFAULT else COLORS[(0, 2, 3, 4, 5, 6, 7)[number % 7]]
        label = "default: drawn" if name == DEFAULT else name
        axes.scatter(
            [spent[-1]], [value], color=color, marker=marker, s=size, label=label, zorder=3
        )
    if column.name in IDEAL:
        axes.axhline(IDEAL[column.name], color=DARK, lw=0.9, ls=(0, (2, 3)))
    arrow = "\N{DOWNWARDS ARROW}" if column.direction == "lower" else "\N{UPWARDS ARROW}"
    unit = f", {column.unit}" if column.unit != "1" else ""
    better = "dotted: the truth's" if column.name in IDEAL else f"{arrow} is better"
    axes.set_title(f"{column.metric}{unit} ({better})", loc="left", fontsize=9.5)
    axes.set_xscale("log")
    left, right = min(spent) / 1.15, max(spent) * 1.15
    axes.set_xlim(left, right)
    log_ticks(axes.xaxis, left, right)
    axes.tick_params(labelsize=8)
    axes.grid(True, color=LIGHT, lw=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def look_sheet(results: Sequence[LookResult]) -> Rgb:
    """Return a case's held-out views: a row each, the truth and every look beside it.

    The views that are seen most from the front, whose figures fill a tile.
    """
    case = results[0].case
    front = sorted(
        range(len(case.test.frames)), key=lambda i: case.test.frames[i].camera.rotation[2, 2]
    )
    rows = []
    for i in sorted(front[:ROWS]):
        truth = case.test.frames[i].rgba
        part = _seen(truth)
        pictures = [truth, *(one.pictures[i] for one in results)]
        rows.append(np.concatenate([_tile(picture, part, TILE_PX) for picture in pictures], axis=1))
    return _headed(np.concatenate(rows), ["truth", *(one.look for one in results)], TILE_PX)


def face_sheet(results: Sequence[LookResult]) -> Rgb | None:
    """Return the faces whose eyes are wrong, each beside the truth; None without any."""
    cells = []
    for one in results:
        for i, check in enumerate(one.checks):
            if check.faults and check.expected:
                frame = one.case.test.frames[i]
                part = _face(one, i)
                pair = [_tile(p, part, FACE_PX) for p in (frame.rgba, one.pictures[i])]
                words = f"{one.case.name} {frame.name[:3]} {'+'.join(check.faults)}"
                cells.append(_headed(np.concatenate(pair, axis=1), [words], 2 * FACE_PX))
    if not cells:
        return None
    cells = cells[:MOST_FACES]
    cells += [np.full_like(cells[0], 255)] * (-len(cells) % 4)
    rows = [np.concatenate(cells[i : i + 4], axis=1) for i in range(0, len(cells), 4)]
    return np.concatenate(rows)


def _face(one: LookResult, number: int) -> tuple[slice, slice]:
    camera = one.case.test.frames[number].camera
    at = np.array([camera.project(eye.center[None])[0][0] for eye in one.case.eyes])
    room = FACE * max(eye.radius for eye in one.case.eyes) * camera.scale
    low, high = at.min(axis=0) - room, at.max(axis=0) + room
    side, middle = max(high - low) / 2, (low + high) / 2
    first, last = np.maximum(middle - side, 0).astype(int), (middle + side).astype(int) + 1
    return slice(first[1], last[1]), slice(first[0], last[0])


def _seen(rgba: UInt8[np.ndarray, "height width 4"]) -> tuple[slice, slice]:
    mask = mask_of(rgba)
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return slice(None), slice(None)
    return slice(max(rows[0] - 4, 0), rows[-1] + 5), slice(max(columns[0] - 4, 0), columns[-1] + 5)


def _tile(rgba: UInt8[np.ndarray, "height width 4"], part: tuple[slice, slice], side: int) -> Rgb:
    """Return a part of a picture on a white square."""
    shown = (over_white(rgba)[part] * 255 + 0.5).astype(np.uint8)
    factor = side / max(shown.shape[:2])
    size = max(round(shown.shape[1] * factor), 1), max(round(shown.shape[0] * factor), 1)
    way = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
    small = cv2.resize(shown, size, interpolation=way)
    tile = np.full((side, side, 3), 255, np.uint8)
    y, x = (side - size[1]) // 2, (side - size[0]) // 2
    tile[y : y + size[1], x : x + size[0]] = small
    return tile


def _headed(picture: Rgb, titles: Sequence[str], width: int) -> Rgb:
    """Return a picture under a line of titles, one every so many pixels."""
    head = Image.new("RGB", (picture.shape[1], TEXT_PX + 8), "white")
    pen = ImageDraw.Draw(head)
    for number, title in enumerate(titles):
        pen.text((number * width + 4, 3), title, "black", font=font_of(TEXT_PX - 3))
    return np.concatenate([np.asarray(head), picture])
