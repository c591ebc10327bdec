"""Find the drawings' palette, the door of `toonset palette`, and label every pixel with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np

from toonset.errors import PaletteError, UsageError
from toonset.palette.choice import choose_palette
from toonset.palette.options import PaletteOptions
from toonset.palette.palette import Palette, Shadow
from toonset.palette.pixels.cel_tones import step_labels, step_tones
from toonset.palette.pixels.grain import remove_grain
from toonset.palette.pixels.ink_lines import find_contours
from toonset.palette.pixels.labels import UNLABELLED, Space, label_pixels
from toonset.palette.pixels.opacity import opaque_inside
from toonset.palette.pixels.own_shadows import own_shadow_maps
from toonset.palette.pixels.ramp_labels import ramps_of
from toonset.palette.pixels.shadow import DRAWN, find_tones, lit_pictures
from toonset.palette.pixels.view_gain import view_gains, with_gains
from toonset.palette.shaded import shaded_labels
from toonset.palette.sheet_palette import Map, Mask, Picture
from toonset.view import View

IN_LIGHT, IN_SHADOW = 0, 1  # tones; UNLABELLED where there is no paint


@dataclass(frozen=True, eq=False)
class PaintMap:
    """Paint of every pixel of a drawing.

    Attributes:
        labels: palette index; 255 = background, blend, or a drawn line whose colour is no paint's.
        tones: 0 = in light, 1 = in shadow, up to 3 for darker steps, 255 where there is no label;
            None: the sheet has no shadow. Drawn lines lie in light.
    """

    labels: Map
    tones: Map | None


def extract_palette(
    views: Sequence[View | Picture], options: PaletteOptions = PaletteOptions()
) -> Palette:
    """Return the colours that make up at least 5 % of a character, the most frequent first.

    Args:
        views: the drawings, or RGBA pictures; one palette for all.
        options: how they are chosen. Of `colors`, the title and names of a palette file are kept;
            where it has tones in shadow, a sheet's shadow is taken off, else name both tones.
            `swatches` takes the palette that the views' sheets print as the whole palette; None
            keeps its colours that the drawings are painted in, and adds what else there is; False
            does not look at it.

    Raises:
        ToonsetError: no opaque pixel, or a colour that cannot be understood or found.
    """
    pictures = [picture_of(view) for view in views]
    contours = find_contours(pictures)
    own = [rgb for view in views if isinstance(view, View) for rgb in view.swatches]
    return choose_palette(pictures, contours, options, tuple(dict.fromkeys(own)))


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
    return paint_maps([picture], find_contours([picture]), palette, space)[0].labels


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


def paint_maps(
    pictures: Sequence[Picture], contours: Sequence[Map], palette: Palette, space: Space = "rgb"
) -> list[PaintMap]:
    """Return labels and tones of pictures whose drawn lines are known; see `label_image`."""
    return maps_in_light(*in_light(pictures, contours, palette.shadow), contours, palette, space)


def in_light(
    pictures: Sequence[Picture], contours: Sequence[Map], shadow: Shadow | None
) -> tuple[list[Picture], list[Mask] | None]:
    """Return pictures without grain and shadow, and the shadow's place; None without one."""
    solid = [opaque_inside(picture) for picture in pictures]
    smooth = remove_grain(with_gains(solid, view_gains(solid)))
    if shadow is None:
        return list(smooth), None
    dark = find_tones(smooth, contours, shadow)
    return list(lit_pictures(smooth, contours, dark, shadow)), list(dark)


def maps_in_light(
    pictures: Sequence[Picture],
    dark: Sequence[Mask] | None,
    contours: Sequence[Map],
    palette: Palette,
    space: Space = "rgb",
) -> list[PaintMap]:
    """Return labels and tones of what `in_light` returns."""
    if palette.stepped:
        drawn = list(zip(pictures, contours, strict=True))
        maps = [step_labels(picture, contour, palette, space) for picture, contour in drawn]
        _take_out_lines(maps, contours, palette)
        return [
            PaintMap(labels, step_tones(picture, labels, palette))
            for picture, labels in zip(pictures, maps, strict=True)
        ]
    ramps = ramps_of(palette)
    if ramps:
        return [PaintMap(labels, None) for labels in shaded_labels(pictures, ramps)]
    if dark is not None and palette.shadow is not None:
        both = own_shadow_maps(pictures, dark, palette, space)
        maps, dark = [labels for labels, _ in both], [shade for _, shade in both]
    else:
        maps = [label_pixels(picture, palette.rgb, space=space) for picture in pictures]
    _take_out_lines(maps, contours, palette)
    if dark is None:
        return [PaintMap(labels, None) for labels in maps]
    return [
        PaintMap(labels, _tone_map(labels, shade & (contour < DRAWN)))
        for labels, shade, contour in zip(maps, dark, contours, strict=True)
    ]


def _take_out_lines(maps: Sequence[Map], contours: Sequence[Map], palette: Palette) -> None:
    """Take labels off drawn lines whose colour is no paint's."""
    ink = palette.contour
    if ink is not None and ink.rgb not in [color.rgb for color in palette.colors]:
        for labels, contour in zip(maps, contours, strict=True):
            labels[contour >= DRAWN] = UNLABELLED


def _tone_map(labels: Map, dark: Mask) -> Map:
    tones = np.where(dark, IN_SHADOW, IN_LIGHT)
    return np.where(labels == UNLABELLED, UNLABELLED, tones).astype(np.uint8)
