"""Choose the palette of drawings by how they are shaded, or as a person says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import UInt8

from toonset.errors import PaletteError
from toonset.palette.formats.registry import (
    names_tones,
    palette_title,
    parse_colors,
    parse_named_colors,
)
from toonset.palette.named import with_names
from toonset.palette.names import RGB
from toonset.palette.options import PaletteOptions
from toonset.palette.paints.extract import PICKED, find_palette, pick_palette
from toonset.palette.paints.grainy_colors import read_drawn_colors
from toonset.palette.paints.places import add_places
from toonset.palette.paints.select import PaletteRule
from toonset.palette.palette import Palette, PaletteColor, Shadow, Tone
from toonset.palette.pixels.enlarged import common_grids
from toonset.palette.pixels.grain import LEAST_LEVELS, noise_levels, remove_grain
from toonset.palette.pixels.labels import nearest_labels
from toonset.palette.pixels.opacity import opaque_inside, see_through_notes
from toonset.palette.pixels.own_shadows import with_own_shadows
from toonset.palette.pixels.shadow import DRAWN, apply_shadow, find_shadow, find_tones, lit_pictures
from toonset.palette.pixels.view_gain import gain_notes, view_gains, with_gains
from toonset.palette.plain_sheets import plain_notes
from toonset.palette.printed import Printed
from toonset.palette.shaded import find_shaded_palette, is_shaded, pick_shaded_palette
from toonset.palette.sheet_palette import Map, Mask, Picture, never_in_light, sheet_palette
from toonset.palette.stepped import stepped_palette, steps_of


def rule_of(options: PaletteOptions) -> PaletteRule:
    """Return the rule that options state.

    Raises:
        PaletteError: a colour to keep that cannot be understood, or too many of them.
    """
    kept = _typed("--keep", options.keep).tolist() if options.keep else []
    wanted = tuple((r, g, b) for r, g, b in kept)
    return PaletteRule(
        options.min_share, options.max_colors, wanted, options.contour, options.features
    )


def choose_palette(
    pictures: Sequence[Picture],
    contours: Sequence[Map],
    options: PaletteOptions = PaletteOptions(),
    swatches: Sequence[RGB] = (),
) -> Palette:
    """Return the palette of pictures whose drawn lines are known; see `extract_palette`.

    Args:
        pictures: sRGB with straight alpha.
        contours: how far drawn lines cover their pixels, of 255.
        options: of the choice.
        swatches: the palette that the sheets print.
    """
    rule, colors = rule_of(options), options.colors
    printed = Printed(tuple(swatches), options.swatches)
    if printed.use and colors is None:
        colors = printed.as_colors()
    solid = [opaque_inside(picture) for picture in pictures]
    gains = view_gains(solid)
    solid = with_gains(solid, gains)
    grids = common_grids(solid)
    read, lines = solid, list(contours)
    if grids is not None:
        read = [grid.reduced(picture) for grid, picture in zip(grids, solid, strict=True)]
        lines = [grid.reduced(contour) for grid, contour in zip(grids, contours, strict=True)]
    found = _chosen(read, lines, rule, colors, printed)
    notes = (*see_through_notes(pictures), *gain_notes(gains))
    if grids is not None:
        notes += (
            f"the drawings are enlarged {grids[0].times} times without smoothing: their colours "
            "are read at their own size, and places count its pixels",
        )
    if colors is None:
        notes += plain_notes(found, solid)
    found = replace(found, warnings=(*notes, *found.warnings))
    found = with_names(found, pictures)
    if printed.use:
        found = replace(found, printed=printed.colors)
    return found if colors is None else _as_given(found, colors)


def _as_given(found: Palette, given: str) -> Palette:
    """Return a palette with the title and the names that its file has; others stay."""
    names = {color.rgb: color.name for color in parse_named_colors(given) if color.name}
    colors = tuple(replace(one, name=names.get(one.rgb, one.name)) for one in found.colors)
    ink = found.contour
    if ink is not None:
        ink = replace(ink, name=names.get(ink.rgb, ink.name))
    return replace(found, colors=colors, contour=ink, title=palette_title(given))


def _chosen(
    pictures: Sequence[Picture],
    contours: Sequence[Map],
    options: PaletteRule,
    colors: str | None,
    printed: Printed,
) -> Palette:
    lines = [contour >= DRAWN for contour in contours]
    picked = None if colors is None else _typed("--colors", colors)
    smooth = remove_grain(pictures)
    if is_shaded(pictures):
        if picked is not None:
            return pick_shaded_palette(smooth, picked, PICKED)
        return add_places(find_shaded_palette(smooth, options), smooth)
    if picked is not None and not names_tones(colors or ""):
        return pick_palette(pictures, picked, lines)
    shadow = find_shadow(smooth, contours)
    if picked is not None and shadow is None:
        return pick_palette(pictures, picked, lines)
    dark = [np.zeros_like(line) for line in lines]
    lit: Sequence[Picture] = smooth
    if shadow is not None:
        dark = find_tones(smooth, contours, shadow)
        lit = lit_pictures(smooth, contours, dark, shadow)
    if picked is not None:
        palette = pick_palette(lit, picked, lines)
    else:
        flat = sheet_palette(lit, options, lines, shadow, printed) if shadow is None else None
        drawn = flat or find_palette(smooth, replace(options, keep=()), lines)
        steps = steps_of(drawn, smooth, contours, options, 2 if shadow is None else 3)
        stepped = (
            None if steps is None else stepped_palette(steps, pictures, smooth, lines, printed)
        )
        if stepped is not None:
            return stepped
        palette = flat or sheet_palette(lit, options, lines, shadow, printed)
        invented = None if shadow is None else never_in_light(lit, dark, palette)
        if shadow is not None and invented is not None:
            dark = [shade & ~off for shade, off in zip(dark, invented, strict=True)]
            lit = lit_pictures(smooth, contours, dark, shadow)
            palette = sheet_palette(lit, options, lines, shadow, printed)
        if noise_levels(pictures) >= LEAST_LEVELS and palette.evidence is not None:
            apart = [line | shade for line, shade in zip(lines, dark, strict=True)]
            palette = read_drawn_colors(palette, pictures, lit, apart)
    if shadow is None:
        return palette
    paint = [shade & ~line for shade, line in zip(dark, lines, strict=True)]
    palette = with_tones(palette, shadow, lit, paint)
    if palette.evidence is None:  # the colours were picked
        return palette
    return with_own_shadows(palette, lit, paint, contours, options.keep)


def with_tones(
    palette: Palette, shadow: Shadow, lit: Sequence[Picture], dark: Sequence[Mask]
) -> Palette:
    """Return a palette of drawings without their shadow with every paint's tones.

    Args:
        palette: of these drawings.
        shadow: of the sheet.
        lit: the drawings without it.
        dark: where it lay on paint; drawn lines count as in light.
    """
    pixels = np.zeros((2, 256))
    for picture, where in zip(lit, dark, strict=True):
        labels = nearest_labels(picture, palette.rgb)
        pixels += [np.bincount(labels[part], minlength=256) for part in (~where, where)]
    shares = pixels / np.maximum(pixels.sum(axis=0), 1)
    colors = tuple(
        replace(color, tones=_tones(color, shadow, float(in_shadow)))
        for color, in_shadow in zip(palette.colors, shares[1], strict=False)
    )
    return replace(palette, colors=colors, shadow=shadow)


def _tones(color: PaletteColor, shadow: Shadow, in_shadow: float) -> tuple[Tone, ...]:
    """Return a colour's tones that occur, the light one first."""
    red, green, blue = apply_shadow(np.array(color.rgb), shadow.factor).tolist()
    dark = Tone((red, green, blue), in_shadow * color.share)
    light = Tone(color.rgb, (1 - in_shadow) * color.share)
    return (light, dark) if in_shadow > 0 else (light,)


def _typed(option: str, text: str) -> UInt8[np.ndarray, "colors 3"]:
    """Return the colours of an option, which messages name."""
    try:
        return parse_colors(text)
    except PaletteError as error:
        raise PaletteError(f"{option}: {error}") from error
