"""Drawings to a palette and label maps: what `toonset palette` does between reading and writing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

import numpy as np
from jaxtyping import UInt8

from toonset.errors import PaletteError, UsageError
from toonset.palette.formats.registry import parse_colors
from toonset.palette.paints.extcolors import extcolors_palette
from toonset.palette.paints.extract import find_palette, pick_palette
from toonset.palette.paints.places import with_places
from toonset.palette.paints.select import PaletteOptions
from toonset.palette.palette import MAX_COLORS, Palette
from toonset.palette.pixels.ink_lines import find_contour
from toonset.palette.pixels.labels import UNLABELLED, Space, label_pixels
from toonset.view import View

Picture = UInt8[np.ndarray, "height width 4"]
Map = UInt8[np.ndarray, "height width"]

LINE = 128  # of 255: covered by half, a pixel is a drawn line's
METHODS = ("toonset", "extcolors")


def extract_palette(
    views: Sequence[View | Picture],
    *,
    min_share: float = 0.05,
    max_colors: int = MAX_COLORS,
    keep: str = "",
    contour: bool = True,
    colors: str | None = None,
    method: str = "toonset",
) -> Palette:
    """Return the colours that make up at least 5 % of a character, the most frequent first.

    Args:
        views: the drawings, or RGBA pictures; one palette for all.
        min_share: least share of the character's pixels, 0 to 1.
        max_colors: at most so many, the largest.
        keep: colours to keep however small they are: "#aabbcc,...".
        contour: count drawn lines to their colour; without, only what is painted with it.
        colors: a palette of your own instead: "#aabbcc,#123,white", or a palette file.
        method: "toonset", or "extcolors", the paper's tool.

    Raises:
        ToonsetError: no opaque pixel, a colour that cannot be understood or found, or arguments
            that contradict each other.
    """
    pictures = [picture_of(view) for view in views]
    contours = [find_contour(picture) for picture in pictures]
    options = options_of(min_share, max_colors, keep, contour=contour)
    return choose_palette(pictures, contours, options, colors, method)


def label_image(view: View | Picture, palette: Palette, *, space: Space = "rgb") -> Map:
    """Return which palette colour every pixel is: its index, or 255.

    255 stands for the background, blends of two colours, and drawn lines whose colour is not in
    the palette.

    Args:
        view: a drawing, or an RGBA picture.
        palette: the colours.
        space: in which the nearest colour is meant: "rgb" or "oklab".

    Raises:
        PaletteError: it is neither a view nor an RGBA picture.
        UsageError: no such space.
    """
    if space not in get_args(Space):
        raise UsageError(f"--space: {space!r} is none of {', '.join(get_args(Space))}")
    picture = picture_of(view)
    return label_drawing(picture, find_contour(picture), palette, space)


def picture_of(view: View | Picture) -> Picture:
    """Return the pixels of a drawing.

    Raises:
        PaletteError: it is neither a view nor an RGBA picture.
    """
    rgba = view.rgba if isinstance(view, View) else np.asarray(view)
    if rgba.ndim != 3 or rgba.shape[2] != 4 or rgba.dtype != np.uint8:
        raise PaletteError(
            f"a drawing is {rgba.dtype} of shape {rgba.shape}; a view, or RGBA bytes (height, "
            "width, 4) as `load_picture` returns them, are needed"
        )
    return rgba


def options_of(min_share: float, max_colors: int, keep: str, *, contour: bool) -> PaletteOptions:
    """Return the rule that the arguments of `extract_palette` state.

    Raises:
        PaletteError: out of range, or a colour that cannot be understood.
    """
    kept = _typed("--keep", keep).tolist() if keep else []
    return PaletteOptions(min_share, max_colors, tuple((r, g, b) for r, g, b in kept), contour)


def choose_palette(
    pictures: Sequence[Picture],
    contours: Sequence[Map],
    options: PaletteOptions,
    colors: str | None,
    method: str,
) -> Palette:
    """Return the palette of pictures whose drawn lines are known; see `extract_palette`."""
    if method not in METHODS:
        raise UsageError(f"--method: {method!r} is none of {', '.join(METHODS)}")
    if colors is not None and (options.keep or method != "toonset"):
        raise UsageError("--colors is the whole palette; leave --keep and --method away")
    if options.keep and method != "toonset":
        raise UsageError("--keep belongs to --method toonset")
    lines = [contour >= LINE for contour in contours]
    if colors is not None:
        return pick_palette(pictures, _typed("--colors", colors), lines)
    if method == "extcolors":
        return with_places(extcolors_palette(pictures, options), pictures)
    return with_places(find_palette(pictures, options, lines), pictures)


def label_drawing(picture: Picture, contour: Map, palette: Palette, space: Space = "rgb") -> Map:
    """Return the label map of a picture whose drawn lines are known; see `label_image`."""
    labels = label_pixels(picture, palette.rgb, space=space)
    ink = palette.contour
    if ink is not None and ink.rgb not in [color.rgb for color in palette.colors]:
        labels[contour >= LINE] = UNLABELLED
    return labels


def _typed(option: str, text: str) -> UInt8[np.ndarray, "colors 3"]:
    """Return the colours of an option, which messages name."""
    try:
        return parse_colors(text)
    except PaletteError as error:
        raise PaletteError(f"{option}: {error}") from error
