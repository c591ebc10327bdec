"""Draw evaluated views in one picture, the worst first, with an error heat map."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image, ImageDraw, ImageFont

from toonset.nerf.score.evaluate import LAYERS, ScoredView
from toonset.view import over_white

TILE_PX = 192  # longest side of a tile
MOST_VIEWS = 24  # shown of a section: the worst
COLUMNS = 2  # views side by side
RIM = 0.02  # of the picture's longest side, shown round the figure
GAP_PX, TEXT_PX = 8, 14
HEADING_PX, CAPTION_PX = 2 * TEXT_PX + 3 * GAP_PX, TEXT_PX + 2 * GAP_PX
WHITE, BLACK, GREY = (255, 255, 255), (20, 20, 20), (110, 110, 110)
TITLES = {"drawn": "drawn look", "rgb": "field", "palette": "in palette colours"}

Rgb = UInt8[np.ndarray, "height width 3"]


def contact_sheet(sections: Sequence[tuple[str, Sequence[ScoredView]]], errors_are: str) -> Rgb:
    """Return the picture of one or more sections of views, each sorted by PSNR, worst first.

    Args:
        sections: a heading and its views, all of one run; sections without views are left out.
        errors_are: what the heat map of the rendered colours shows, e.g. "FLIP".
    """
    shown = [(heading, views) for heading, views in sections if views]
    layers = [layer for layer in LAYERS if layer in shown[0][1][0].pictures]
    parts = [_section(heading, views, layers, errors_are) for heading, views in shown]
    return np.concatenate(parts)


def worst_first(views: Sequence[ScoredView]) -> list[ScoredView]:
    """Return the views sorted by PSNR of the rendered colours, the worst first."""
    return sorted(views, key=lambda view: (view.figures["rgb"]["psnr"] or 0.0, view.name))


def _section(
    heading: str, views: Sequence[ScoredView], layers: Sequence[str], errors_are: str
) -> Rgb:
    chosen = worst_first(views)[:MOST_VIEWS]
    blocks = [_block(view, layers) for view in chosen]
    height, width = blocks[0].shape[:2]
    rows = -(-len(blocks) // COLUMNS)
    sheet = np.full((HEADING_PX + rows * height, COLUMNS * width, 3), 255, dtype=np.uint8)
    for i, block in enumerate(blocks):
        y, x = HEADING_PX + i // COLUMNS * height, i % COLUMNS * width
        sheet[y : y + height, x : x + width] = block
    more = f", the worst {len(chosen)} of {len(views)}" if len(chosen) < len(views) else ""
    columns = ["truth", *(TITLES[layer] for layer in layers), f"{errors_are}, black 0, white 1"]
    image = Image.fromarray(sheet)
    pen = ImageDraw.Draw(image)
    pen.text((GAP_PX, 4), f"{heading}{more}, worst first", BLACK, font=font_of(TEXT_PX + 3))
    for column in range(min(COLUMNS, len(blocks))):
        for i, title in enumerate(columns):
            place = column * width + GAP_PX + i * (TILE_PX + GAP_PX), TEXT_PX + 2 * GAP_PX
            pen.text(place, title, GREY, font=font_of(TEXT_PX - 1))
    return np.asarray(image)


def _block(view: ScoredView, layers: Sequence[str]) -> Rgb:
    """Return one view's tiles in a row over its caption."""
    part = _seen(view)
    tiles = [over_white(view.drawn)]
    tiles += [over_white(view.pictures[layer]) for layer in layers]
    tiles = [tile[part] for tile in (*tiles, _heat(view.errors["rgb"]))]
    width = len(tiles) * (TILE_PX + GAP_PX) + GAP_PX
    image = Image.new("RGB", (width, TILE_PX + CAPTION_PX), WHITE)
    for i, tile in enumerate(tiles):
        image.paste(Image.fromarray(tile_of(tile)), (GAP_PX + i * (TILE_PX + GAP_PX), 0))
    caption = f"{view.name}   {_caption(view.figures['rgb'])}"
    ImageDraw.Draw(image).text((GAP_PX, TILE_PX + 2), caption, BLACK, font=font_of(TEXT_PX))
    return np.asarray(image)


def _seen(view: ScoredView) -> tuple[slice, slice]:
    """Return the part of the picture that holds all that is drawn or rendered, and a rim."""
    drawn = [view.drawn, *view.pictures.values()]
    covered = np.any([picture[..., 3] > 0 for picture in drawn], axis=0)
    if not covered.any():
        return slice(None), slice(None)
    rim = round(RIM * max(covered.shape))
    first, second = (np.flatnonzero(covered.any(axis=axis)) for axis in (1, 0))
    return (
        slice(max(first[0] - rim, 0), first[-1] + 1 + rim),
        slice(max(second[0] - rim, 0), second[-1] + 1 + rim),
    )


def _caption(figures: dict[str, float | None]) -> str:
    words = [("psnr", "PSNR {:.1f} dB"), ("psnr_mask", "in mask {:.1f}"), ("flip", "FLIP {:.3f}")]
    words.append(("label_accuracy", "labels {:.1%}"))
    return "   ".join(text.format(figures[n]) for n, text in words if figures[n] is not None)


def _heat(error: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "height width 3"]:
    """Return an error in [0, 1] as magma from black to white."""
    from matplotlib import colormaps

    return colormaps["magma"](error.clip(0, 1))[..., :3]


def tile_of(picture: Float[np.ndarray, "height width 3"]) -> Rgb:
    """Return a picture in [0, 1] at the tile's size on white, pixels kept square."""
    height, width = picture.shape[:2]
    factor = TILE_PX / max(height, width)
    size = max(round(width * factor), 1), max(round(height * factor), 1)
    way = cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR
    small = cv2.resize((picture * 255 + 0.5).astype(np.uint8), size, interpolation=way)
    tile = np.full((TILE_PX, TILE_PX, 3), 255, dtype=np.uint8)
    y, x = (TILE_PX - size[1]) // 2, (TILE_PX - size[0]) // 2
    tile[y : y + size[1], x : x + size[0]] = small
    return tile


def font_of(size_px: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Return the pictures' font."""
    return ImageFont.load_default(size_px)
