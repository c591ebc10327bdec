"""The paper's Figure 4: training and new views, before and after the classifier."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw

from bench.cases.cases import TrainCase
from toonset.dataset.bundle.scene import Frame
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.layers import color_picture, palette_picture
from toonset.nerf.render.views import render
from toonset.nerf.score.evaluation_picture import (
    BLACK,
    GAP_PX,
    GREY,
    TEXT_PX,
    TILE_PX,
    font_of,
    tile_of,
)
from toonset.view import over_white

VIEWS = 2  # of each kind
KINDS = ("training views", "new views")
HEADING_PX, BAND_PX = 2 * TEXT_PX + 3 * GAP_PX, TEXT_PX + 2 * GAP_PX

Rgb = UInt8[np.ndarray, "height width 3"]


def strip_of(trained: TrainedField, case: TrainCase) -> Rgb:
    """Return the case's shown views under each other: left as the field has them, right labelled.

    The field must have a palette.
    """
    baked, rows = Baked.of(trained), []
    for frame in shown_frames(case):
        view = render(baked, frame.camera)
        pictures = color_picture(view.rgb, view.alpha), palette_picture(view, trained.palette)
        rows.append(np.hstack([tile_of(over_white(picture)) for picture in pictures]))
    return np.vstack(rows)


def drawn_strip(case: TrainCase) -> Rgb:
    """Return the drawings of the shown views."""
    return np.vstack([tile_of(over_white(frame.rgba)) for frame in shown_frames(case)])


def shown_frames(case: TrainCase) -> list[Frame]:
    """Return some training views, then some new ones, evenly taken."""
    shown: list[Frame] = []
    for frames in (case.train.frames, case.test.frames):
        shown += [frames[round((i + 0.5) * len(frames) / VIEWS) - 1] for i in range(VIEWS)]
    return shown


def figure_of(drawn: Rgb, strips: Mapping[str, Rgb]) -> Rgb:
    """Return the figure: drawings, then a strip per method under its name.

    Args:
        drawn: of `drawn_strip`.
        strips: of `strip_of`, by method.
    """
    columns: list[tuple[str, tuple[str, ...], Rgb]] = [("drawn", (), drawn)]
    columns += [
        (name, ("rendered", "after the classifier"), strip) for name, strip in strips.items()
    ]
    half = VIEWS * TILE_PX
    height = HEADING_PX + len(KINDS) * (BAND_PX + half)
    width = sum(strip.shape[1] + GAP_PX for _, _, strip in columns) + GAP_PX
    image = Image.new("RGB", (width, height), "white")
    pen, x = ImageDraw.Draw(image), GAP_PX
    for name, titles, strip in columns:
        pen.text((x, GAP_PX), name, BLACK, font=font_of(TEXT_PX))
        _write(pen, x, titles)
        for i in range(len(KINDS)):
            part = Image.fromarray(strip[i * half : (i + 1) * half])
            image.paste(part, (x, HEADING_PX + i * (BAND_PX + half) + BAND_PX))
        x += strip.shape[1] + GAP_PX
    for i, kind in enumerate(KINDS):
        y = HEADING_PX + i * (BAND_PX + half)
        pen.text((GAP_PX, y), kind, BLACK, font=font_of(TEXT_PX))
    return np.asarray(image)


def _write(pen: ImageDraw.ImageDraw, x: int, titles: Sequence[str]) -> None:
    for number, title in enumerate(titles):
        place = (x + number * TILE_PX, TEXT_PX + 2 * GAP_PX)
        pen.text(place, title, GREY, font=font_of(TEXT_PX - 1))
