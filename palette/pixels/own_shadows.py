"""Find paints whose shadow has a factor of its own: the sheet lists it as a paint beside them.

    colour in shadow = factor of the paint * colour in light

One factor fits a sheet's paints only about (`toonset.palette.pixels.shadow`): it is the middle of
a prior for theirs. A colour is another one's shadow if the borders between both, without a line,
have the light on the side where the sheet has it, drawing by drawing: the bits that this saves
exceed those that say whose shadow the colour is, and how far its factor is off the sheet's.

Sources: ratios across shadow borders, Barnard and Finlayson, "Shadow identification using colour
ratios" (2000); J. Rissanen, "Modeling by shortest data description" (1978).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.palette.names import RGB
from toonset.palette.options import MAX_COLORS
from toonset.palette.palette import Palette, PaletteColor, Tone
from toonset.palette.pixels.labels import (
    UNLABELLED,
    Space,
    label_pixels,
    nearest_colors,
    nearest_labels,
)
from toonset.palette.pixels.shadow import FLOOR, LEAST_PIECE, LINE, apply_shadow, coin_bits
from toonset.raster import sized_parts

SPREAD = 0.1  # logarithms: of paints' factors about the sheet's
MOST_OFF = 3  # deviations

Picture = UInt8[np.ndarray, "height width 4"]
Map = UInt8[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]


def with_own_shadows(
    palette: Palette,
    lit: Sequence[Picture],
    dark: Sequence[Mask],
    contours: Sequence[Map],
    stay: Sequence[RGB] = (),
) -> Palette:
    """Return a palette in which colours that are another one's shadow are its dark tone.

    Args:
        palette: of the drawings, with the sheet's shadow and tones.
        lit: the drawings without the shadow.
        dark: where it lay on paint.
        contours: how far lines cover the drawings' pixels.
        stay: colours that stay paints of their own.
    """
    maps = [
        np.where(contour < LINE, nearest_labels(picture, palette.rgb), UNLABELLED)
        for picture, contour in zip(lit, contours, strict=True)
    ]
    side = np.sign(sum(_sheet_side(*both) for both in zip(maps, dark, strict=True)))
    whose: dict[int, int] = {}
    for shade, light, price in _candidates(palette, stay):
        bits = _side_bits([side * _net_side(labels == light, labels == shade) for labels in maps])
        free = shade not in {*whose, *whose.values()} and light not in whose
        if free and bits > price and len(palette.colors) + 2 * len(whose) < MAX_COLORS:
            whose[shade] = light
    if not whose:
        return palette
    colors = [
        _united(color, [palette.colors[shade] for shade, light in whose.items() if light == number])
        for number, color in enumerate(palette.colors)
        if number not in whose
    ]
    colors.sort(key=lambda color: -color.share)
    features = tuple(rgb for rgb in palette.features if rgb in {color.rgb for color in colors})
    return replace(palette, colors=tuple(colors), features=features)


def factors_of(palette: Palette) -> Float[np.ndarray, "colors 3"] | None:
    """Return every paint's factor of colours in shadow; None of a sheet without a shadow."""
    if palette.shadow is None:
        return None
    return np.array([color.factor or palette.shadow.factor for color in palette.colors])


def own_shadow_maps(
    lit: Sequence[Picture], dark: Sequence[Mask], palette: Palette, space: Space = "rgb"
) -> list[tuple[Map, Mask]]:
    """Return labels of drawings of a sheet with a shadow, and where they lie in it.

    Paints with a factor of their own have the tone that they are drawn in, whatever the sheet's.

    Args:
        lit: the drawings without the shadow.
        dark: where it lay.
        palette: of the sheet.
        space: in which nearest is meant.
    """
    assert palette.shadow is not None
    own = [color.factor for color in palette.colors]
    whose = [number for number, factor in enumerate(own) if factor is not None]
    shades = apply_shadow(palette.rgb[whose], np.array([own[n] for n in whose]).reshape(-1, 3))
    factor = np.array(palette.shadow.factor)
    # as drawn, and where the sheet's shadow was taken off
    more = [shades, apply_shadow(shades, 1 / factor), apply_shadow(palette.rgb[whose], 1 / factor)]
    colors = np.concatenate([palette.rgb, *more])
    paints = np.arange(256, dtype=np.uint8)
    paints[len(palette.colors) : len(colors)] = 3 * whose
    found = []
    for picture, shade in zip(lit, dark, strict=True):
        labels = paints[label_pixels(picture, colors, space=space)]
        shade = shade.copy()
        for number, rgb in zip(whose, shades, strict=True):
            at = labels == number
            drawn = picture[at, :3]
            drawn = np.where(shade[at, None], apply_shadow(drawn, factor), drawn)
            shade[at] = nearest_colors(drawn, np.stack([palette.rgb[number], rgb])) == 1
        found.append((labels, shade))
    return found


def _drawn(color: PaletteColor) -> tuple[RGB, bool]:
    """Return a colour as it is mostly drawn, and whether that is in light."""
    main = max(color.tones, key=lambda tone: tone.share)
    return main.rgb, main.rgb == color.rgb


def _candidates(palette: Palette, stay: Sequence[RGB]) -> list[tuple[int, int, float]]:
    """Return pairs of colours of which the first may be the other's shadow, and the bits it costs.

    The cheapest first.
    """
    assert palette.shadow is not None
    drawn = [_drawn(color) for color in palette.colors]
    logs = np.log(np.array([rgb for rgb, _ in drawn]) / 255 + FLOOR)
    drop = logs[:, None] - logs[None, :]
    off = np.abs(drop - np.log(palette.shadow.factor)).max(axis=-1)
    price = np.log2(len(drawn)) + (off / SPREAD) ** 2 / (2 * np.log(2))
    possible = (drop < 0).all(axis=-1) & (off < MOST_OFF * SPREAD)
    pairs = [
        (int(shade), int(light), float(price[shade, light]))
        for shade, light in zip(*np.nonzero(possible), strict=True)
        if drawn[light][1] and palette.colors[shade].rgb not in stay
    ]
    return sorted(pairs, key=lambda pair: pair[2])


def _net_side(light: Mask, shade: Mask) -> float:
    """Return the length of upright borders with the light on the right, less that on the left.

    Pieces shorter than `LEAST_PIECE` are not counted.
    """
    net = 0
    for left, right, sign in ((light, shade, -1), (shade, light, 1)):
        border = left[:, :-1] & right[:, 1:]
        if border.any():
            pieces = sized_parts(border)[1][1:]
            net += sign * int(pieces[pieces >= LEAST_PIECE].sum())
    return float(net)


def _sheet_side(labels: Map, dark: Mask) -> float:
    """Return on which side of the sheet's shadows the light is: left below 0, right above."""
    same = (labels[:, :-1] == labels[:, 1:]) & (labels[:, 1:] != UNLABELLED)
    left, right = ~dark[:, :-1] & dark[:, 1:], dark[:, :-1] & ~dark[:, 1:]
    return float((same & right).sum()) - float((same & left).sum())


def _side_bits(nets: Sequence[float]) -> float:
    """Return bits that the light's side saves over drawings, each a coin of its border's length."""
    length = float(np.sqrt(np.square(nets).sum()))
    return coin_bits(sum(nets) / length) if length else 0.0


def _united(color: PaletteColor, shades: Sequence[PaletteColor]) -> PaletteColor:
    """Return a paint with its shades as one dark tone, of the largest one's colour."""
    if not shades:
        return color
    share = sum(one.share for one in (color, *shades))
    lit = sum(tone.share for tone in color.tones if tone.rgb == color.rgb)
    rgb = _drawn(max(shades, key=lambda one: one.share))[0]
    floor = 255 * FLOOR
    red, green, blue = ((np.array(rgb) + floor) / (np.array(color.rgb) + floor)).tolist()
    tones = Tone(color.rgb, lit), Tone(rgb, share - lit)
    return replace(color, share=share, tones=tones, factor=(red, green, blue))
