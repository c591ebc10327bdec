"""Draw the overlay of a split: sheets with what was found on them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw, ImageFont

from toonset.dataset.split_folder.load import Sheet
from toonset.dataset.split_folder.panel import LEFT_OUT, MARGIN, WIDEST, Panel, draw_panel
from toonset.dataset.split_folder.tags import Line, Rgb, text_width
from toonset.palette.names import hex_of

GREY: Rgb = (40, 40, 40)


def draw_sheet(sheet: Sheet) -> UInt8[np.ndarray, "height width 3"]:
    """Return the picture of a sheet that a person checks."""
    return draw_split(_panels(sheet), sheet.warnings)


def draw_split(
    panels: Sequence[Panel], notes: Sequence[str] = ()
) -> UInt8[np.ndarray, "height width 3"]:
    """Return the overlay of one or more sheets; `notes` are written below them."""
    pictures = [_titled(panel, alone=len(panels) == 1) for panel in panels]
    rows: list[list[np.ndarray]] = [[]]
    for picture in pictures:
        if rows[-1] and sum(p.shape[1] for p in (*rows[-1], picture)) > WIDEST:
            rows.append([])
        rows[-1].append(picture)
    width = max(sum(p.shape[1] for p in row) for row in rows)
    parts = [_beside(row, width) for row in rows]
    parts += [_caption(note, width, 18, LEFT_OUT) for note in notes]
    return np.concatenate([*parts, np.full((6, width, 3), 255, np.uint8)])


def _titled(panel: Panel, *, alone: bool) -> UInt8[np.ndarray, "height width 3"]:
    picture = draw_panel(panel, alone=alone)
    return np.concatenate([picture, _caption(_title(panel), picture.shape[1], 20, GREY)])


def _title(panel: Panel) -> str:
    height, width = panel.rgba.shape[:2]
    ground = "transparent"
    if panel.background is not None:
        ground = f"background {hex_of(panel.background)}"
    text = f"{panel.title}: {width} x {height} px, {ground}"
    kinds = Counter(thing.kind for thing in panel.left_out)
    left = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    return f"{text}; left out (orange): {left}" if left else text


def _caption(text: str, width: int, size: int, color: Rgb) -> np.ndarray:
    """Return a strip with words on white, broken where the strip ends."""
    lines = _broken(text, size, width - 2 * MARGIN)
    step = round(1.3 * size)
    image = Image.new("RGB", (width, step * len(lines) + 6), "white")
    pen = ImageDraw.Draw(image)
    for number, line in enumerate(lines):
        pen.text((MARGIN, 3 + step * number), line, color, ImageFont.load_default(size))
    return np.array(image)


def _broken(text: str, size: int, room: int) -> list[str]:
    """Return the words in lines that fit; a word that is too long is broken, too."""
    lines = [""]
    for word in text.split():
        if lines[-1] and text_width(Line(f"{lines[-1]} {word}", size)) > room:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
        while len(lines[-1]) > 1 and text_width(Line(lines[-1], size)) > room:
            most = max(1, int(len(lines[-1]) * room / text_width(Line(lines[-1], size))))
            lines[-1:] = [lines[-1][:most], lines[-1][most:]]
    return lines


def _beside(row: Sequence[np.ndarray], width: int) -> np.ndarray:
    height = max(picture.shape[0] for picture in row)
    strip = np.full((height, width, 3), 255, np.uint8)
    x = 0
    for picture in row:
        strip[: picture.shape[0], x : x + picture.shape[1]] = picture
        x += picture.shape[1]
    return strip


def _panels(sheet: Sheet) -> list[Panel]:
    """Return the sheets for the overlay; a view whose sheet is not at hand stands alone."""
    panels, named = [], sheet.split
    for index, (source, picture) in enumerate(zip(named.sources, sheet.pictures, strict=True)):
        mine = [i for i, of in enumerate(named.source_of) if of == index]
        views, labels = [named.views[i] for i in mine], [named.labels[i] for i in mine]
        if picture is not None:
            ground = source.background
            panels.append(
                Panel(source.name, picture, ground, tuple(views), tuple(labels), source.left_out)
            )
            continue
        for view, label in zip(views, labels, strict=True):
            alone = replace(view, box=(0, 0, *view.box[2:]))
            panels.append(Panel(source.name, view.rgba, None, (alone,), (label,)))
    return panels
