"""Find and label the drawings' palette: all that `toonset palette` does between files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from jaxtyping import Bool, UInt8

from toonset.errors import PaletteError, UsageError
from toonset.palette.formats.registry import (
    names_tones,
    palette_title,
    parse_colors,
    parse_named_colors,
)
from toonset.palette.named import with_names
from toonset.palette.names import RGB
from toonset.palette.options import MAX_COLORS, PaletteOptions
from toonset.palette.paints.extract import PICKED, find_palette, pick_palette, rule_in_words
from toonset.palette.paints.features import find_features
from toonset.palette.paints.grainy_colors import read_drawn_colors
from toonset.palette.paints.places import add_places
from toonset.palette.paints.select import PaletteRule, nearest_found
from toonset.palette.palette import Palette, PaletteColor, Shadow, Tone
from toonset.palette.pixels.cel_tones import find_steps, step_labels, step_tones, with_steps
from toonset.palette.pixels.enlarged import common_grids
from toonset.palette.pixels.grain import LEAST_LEVELS, noise_levels, remove_grain
from toonset.palette.pixels.ink_lines import find_contours
from toonset.palette.pixels.labels import UNLABELLED, Space, label_pixels, nearest_labels
from toonset.palette.pixels.opacity import opaque_inside, see_through_notes
from toonset.palette.pixels.own_shadows import own_shadow_maps, with_own_shadows
from toonset.palette.pixels.ramp_labels import ramps_of
from toonset.palette.pixels.shadow import DRAWN, apply_shadow, find_shadow, find_tones, lit_pictures
from toonset.palette.pixels.view_gain import gain_notes, view_gains, with_gains
from toonset.palette.plain_sheets import plain_notes
from toonset.palette.printed import Printed, in_printed_order, occurring, with_printed
from toonset.palette.shaded import (
    find_shaded_palette,
    is_shaded,
    pick_shaded_palette,
    shaded_labels,
)
from toonset.raster import dilate, is_uniform
from toonset.view import View

Picture = UInt8[np.ndarray, "height width 4"]
Map = UInt8[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]

NEVER_IN_LIGHT = 0.95  # of a paint's pixels lie in shadow
LEAST_STEP = 0.008  # of the character: smaller tones are not told from blends
SMOOTHED_PX = 2  # from a tone's border: there smoothing has moved it
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
        flat = _of_sheet(lit, options, lines, shadow, printed) if shadow is None else None
        drawn = flat or find_palette(smooth, replace(options, keep=()), lines)
        steps = _find_steps(drawn, smooth, contours, options, 2 if shadow is None else 3)
        stepped = None if steps is None else _stepped(steps, pictures, smooth, lines, printed)
        if stepped is not None:
            return stepped
        palette = flat or _of_sheet(lit, options, lines, shadow, printed)
        invented = None if shadow is None else _never_in_light(lit, dark, palette)
        if shadow is not None and invented is not None:
            dark = [shade & ~off for shade, off in zip(dark, invented, strict=True)]
            lit = lit_pictures(smooth, contours, dark, shadow)
            palette = _of_sheet(lit, options, lines, shadow, printed)
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


@dataclass(frozen=True, eq=False)
class _Steps:
    """Plan of a palette whose paints are shaded in steps.

    Attributes:
        paints: the tones of paints that have several, from light to dark.
        stay: found colours that the user keeps.
        options: of the choice.
        rule: keeps all these tones, as colours of their own.
    """

    paints: list[list[RGB]]
    stay: tuple[RGB, ...]
    options: PaletteRule
    rule: PaletteRule


def _find_steps(
    found: Palette,
    pictures: Sequence[Picture],
    contours: Sequence[Map],
    options: PaletteRule,
    least: int,
) -> _Steps | None:
    """Return the steps that drawings are shaded in; None where they are not.

    Paints are tones that together reach the rule's share, the largest of them and of the other
    colours if there are too many. A colour to keep is no paint's darker tone.

    Args:
        found: their palette as they are drawn, each tone a colour.
        pictures: the drawings.
        contours: how far lines cover their pixels.
        options: of the choice.
        least: tones that some paint must have.
    """
    known = {one.rgb: one.share for one in found.dropped}
    known |= {one.rgb: one.share for one in found.colors}
    colors = [rgb for rgb, share in known.items() if share >= LEAST_STEP]
    steps = find_steps(pictures, contours, np.array(colors, np.uint8).reshape(-1, 3))
    if max(map(len, steps), default=0) < least:
        return None
    stay = tuple(dict.fromkeys(nearest_found(rgb, list(known)) for rgb in options.keep))
    chains = [[colors[n] for n in tones] for tones in steps]
    chains = [[tones[0], *(one for one in tones[1:] if one not in stay)] for tones in chains]
    chains = [tones for tones in chains if len(tones) > 1]
    shares = {tones[0]: sum(map(known.__getitem__, tones)) for tones in chains}
    others = known.keys() - {rgb for tones in chains for rgb in tones} - {*stay}
    room = options.max_colors - len(options.keep)
    rivals = sorted((*(shares.keys() - {*stay}), *others), key=lambda n: -shares.get(n, known[n]))
    first = {*stay, *rivals[:room]}
    paints = [
        tones
        for tones in chains
        if tones[0] in first and (tones[0] in stay or shares[tones[0]] >= options.min_share)
    ]
    tones = [rgb for own in paints for rgb in own if rgb not in stay]
    lights = sum(own[0] not in stay for own in paints)
    most = min(MAX_COLORS, options.max_colors + len(tones) - lights)
    if not paints or len(options.keep) + len(tones) > most:
        return None
    kept = {rgb for own in paints for rgb in own}
    shades = tuple(rgb for own in chains for rgb in own[1:] if rgb not in kept)
    rule = replace(options, keep=(*options.keep, *tones), max_colors=most, shades=shades)
    return _Steps(paints, stay, options, rule)


def _stepped(
    steps: _Steps,
    pictures: Sequence[Picture],
    smooth: Sequence[Picture],
    lines: Sequence[Mask],
    printed: Printed,
) -> Palette | None:
    """Return the palette of drawings that are shaded in steps.

    None where printed colours are the paints: which of them are tones of which is not known.

    Args:
        steps: of the drawings.
        pictures: with their grain.
        smooth: without it.
        lines: where lines are drawn.
        printed: the palette that the sheet prints.
    """
    palette = _of_sheet(smooth, steps.rule, lines, None, printed)
    if palette.evidence is None:
        return None
    meant = {one: one for own in steps.paints for one in own}
    if not meant.keys() <= {color.rgb for color in palette.colors}:
        return None
    stay = steps.stay
    if noise_levels(pictures) >= LEAST_LEVELS:
        labels = [nearest_labels(picture, palette.rgb) for picture in smooth]
        apart = [
            line | dilate(~is_uniform(own), SMOOTHED_PX)
            for line, own in zip(lines, labels, strict=True)
        ]
        read = read_drawn_colors(palette, pictures, smooth, apart)
        new = dict(zip((c.rgb for c in palette.colors), (c.rgb for c in read.colors), strict=True))
        if len(set(new.values())) == len(new):
            palette, meant = read, {rgb: new[rgb] for rgb in meant}
            stay = tuple(new.get(rgb, rgb) for rgb in stay)
    paints = [[meant[one] for one in own] for own in steps.paints]
    found = with_steps(palette, paints, steps.options.min_share, stay)
    found = replace(found, rule=rule_in_words(steps.options, palette.contour))
    return in_printed_order(found, palette.printed) if palette.printed else found


def _of_sheet(
    pictures: Sequence[Picture],
    options: PaletteRule,
    lines: Sequence[Mask],
    shadow: Shadow | None,
    printed: Printed,
) -> Palette:
    """Return the palette of pictures in light, with the printed colours that occur in them."""
    occurs = occurring(pictures, printed.colors) if printed.use is None else {}
    if not occurs:
        return _in_light(pictures, options, lines, shadow)
    found = with_printed(
        occurs,
        options,
        lambda wider: _in_light(pictures, wider, lines, shadow),
        lambda rgb: pick_palette(pictures, rgb, lines),
    )
    return in_printed_order(found, printed.colors)


def _never_in_light(
    lit: Sequence[Picture], dark: Sequence[Mask], palette: Palette
) -> list[Mask] | None:
    """Return where paints lie that have no pixel in light; None without such a paint.

    Their colours in light are no pixel's: what looks like their shadow is another paint's, or they
    are drawn as they are.
    """
    labels = [nearest_labels(picture, palette.rgb) for picture in lit]
    total, shade = (
        sum(np.bincount(one[part], minlength=256) for one, part in zip(labels, parts, strict=True))
        for parts in ([np.ones_like(one) for one in dark], dark)
    )
    gone = np.asarray(shade) > NEVER_IN_LIGHT * np.maximum(total, 1)
    gone[UNLABELLED] = False
    if not gone.any():
        return None
    return [gone[one] for one in labels]


def _in_light(
    pictures: Sequence[Picture],
    options: PaletteRule,
    lines: Sequence[Mask],
    shadow: Shadow | None = None,
) -> Palette:
    """Return the palette of pictures in light, with features."""
    palette = find_palette(pictures, options, lines)
    found = find_features(palette, pictures, shadow) if options.features is not False else ()
    found = tuple(rgb for rgb in found if rgb not in options.shades)
    found = found[: options.max_colors - len(palette.colors)]
    if found:
        wider = replace(options, keep=(*options.keep, *found))
        wide = find_palette(pictures, wider, lines)
        palette = replace(wide, features=found, rule=palette.rule)
    return add_places(palette, pictures)


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


def _typed(option: str, text: str) -> UInt8[np.ndarray, "colors 3"]:
    """Return the colours of an option, which messages name."""
    try:
        return parse_colors(text)
    except PaletteError as error:
        raise PaletteError(f"{option}: {error}") from error
