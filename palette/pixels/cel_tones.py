"""Find the tones of paints that are shaded in flat steps, and label pixels by them.

    tone k + 1 = factor of the paint and step * tone k            levels of sRGB

A colour is the next darker tone of another one if it darkens all channels about alike, if much of
its border without a line is with that one, and if the light is on the side where the sheet has it:
light stays with the viewer, so around paints of another kind both sides occur. There are steps if
the bits that one side saves over all such borders exceed `LEAST_BITS`. Highlights are not looked
for: light lies all around them.

Sources: toon shading by thresholds on the normal, Lake and others, "Stylized rendering techniques
for scalable real-time 3D animation" (2000); ratios across shadow borders, Barnard and Finlayson,
"Shadow identification using colour ratios" (2000).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.palette.names import RGB
from toonset.palette.palette import MOST_TONES, Palette, PaletteColor, Tone
from toonset.palette.pixels.antialias import OPAQUE
from toonset.palette.pixels.labels import (
    UNLABELLED,
    Space,
    label_pixels,
    nearest_colors,
    nearest_labels,
)
from toonset.palette.pixels.own_shadows import factors_of
from toonset.palette.pixels.ramp_recolor import turned
from toonset.palette.pixels.recolor import tones_of
from toonset.palette.pixels.shadow import FLOOR, LINE, coin_bits
from toonset.raster import dilate, is_uniform, nearest

LEAST_DROP, MOST_DROP = 0.06, 0.8  # logarithms, the channels' mean, from one tone to the next
UNLIKE = 0.2  # logarithms that channels may differ in: light that is not quite white
TOLD = 24  # levels of a channel in light: darker ones say nothing of a ratio
OF_DARK, OF_LIGHT = 0.28, 0.1  # share of its border without a line that a tone has with the next
ONE_SIDED = 0.6  # of upright borders, less those with the light on the other side
OPEN = 0.5  # of a shade's border with lighter tones, what does not cancel, across and upright
LEAST_PX = 12  # of borders between two tones
LEAST_BITS = 10.0
BLEND_PX = 2  # pixels that a border's blend reaches

Picture = UInt8[np.ndarray, "height width 4"]
Map = UInt8[np.ndarray, "height width"]
Areas = Int[np.ndarray, "height width"]
Colors = UInt8[np.ndarray, "colors 3"]


@dataclass(frozen=True, eq=False)
class _Touching:
    """How colours touch where no line is between them, in pixels.

    Attributes:
        length: (colors, colors) of borders.
        upright: (views, colors, colors) of upright borders.
        side: (views, colors, colors) of these, the first on the left less on the right.
        above: (views, colors, colors) of level borders, the first above less below.
    """

    length: Float[np.ndarray, "colors colors"]
    upright: Float[np.ndarray, "views colors colors"]
    side: Float[np.ndarray, "views colors colors"]
    above: Float[np.ndarray, "views colors colors"]


def find_steps(
    pictures: Sequence[Picture], contours: Sequence[Map], colors: Colors
) -> list[tuple[int, ...]]:
    """Return which colours are tones of one paint, from light to dark each.

    Args:
        pictures: the drawings, as they are drawn.
        contours: how far lines cover their pixels.
        colors: that they have, small areas' included.
    """
    if len(colors) < 2:
        return []
    logs = np.log(colors / 255 + FLOOR)
    shade = _darker(colors, logs)
    if not shade.any():
        return []
    areas = [_areas(*both, colors) for both in zip(pictures, contours, strict=True)]
    touching = _touching(areas, len(colors))
    whole = np.maximum(touching.length.sum(axis=1), 1)
    shade &= touching.length >= np.maximum(LEAST_PX, OF_DARK * whole[:, None])
    shade &= touching.length >= OF_LIGHT * whole[None, :]
    net = touching.side.transpose(0, 2, 1) * shade  # the light, second, on the left
    light = float(np.sign(net.sum()))
    total = touching.upright.sum(axis=0)
    shade &= light * net.sum(axis=0) >= ONE_SIDED * np.maximum(total, 1)
    if _bits(light * net[:, shade], touching.upright[:, shade]) < LEAST_BITS:
        return []
    brightness = logs.mean(axis=-1)
    chains = _chains(np.where(shade, touching.length, 0), brightness)
    found = [_one_sided(chain, touching, light) for chain in chains]
    return [
        tuple(sorted(chain, key=lambda n: -brightness[n])[:MOST_TONES])
        for chain in found
        if len(chain) > 1
    ]


def with_steps(
    palette: Palette, paints: Sequence[Sequence[RGB]], share: float, stay: Sequence[RGB]
) -> Palette:
    """Return a palette in which every paint has its tones.

    Args:
        palette: every tone a colour of its own.
        paints: the tones of those that have several, from light to dark.
        share: least share of a paint; features and what is to stay may be smaller.
        stay: colours to keep, however small.
    """
    known = {color.rgb: color for color in palette.colors}
    whose = {rgb: tones[0] for tones in paints for rgb in tones}
    found = []
    for rgb, color in known.items():
        if whose.get(rgb, rgb) != rgb:
            continue
        own = next((tones for tones in paints if tones[0] == rgb), (rgb,))
        tones = tuple(Tone(one, known[one].share) for one in own)
        found.append(replace(color, share=sum(tone.share for tone in tones), tones=tones))
    found.sort(key=lambda color: -color.share)
    small = {c.rgb for c in found if c.share < share and c.rgb not in stay}
    features = tuple(rgb for rgb in palette.features if rgb in small)
    return replace(palette, colors=tuple(found), features=features, stepped=True)


def step_labels(picture: Picture, contour: Map, palette: Palette, space: Space = "rgb") -> Map:
    """Return the paint of every pixel, 255 where there is none.

    A blend of two tones of one paint is that paint's.

    Args:
        picture: a drawing.
        contour: how far lines cover its pixels.
        palette: with steps.
        space: in which nearest is meant.
    """
    drawn = [_drawn(color) for color in palette.colors]
    paint = np.full(256, UNLABELLED, np.uint8)
    numbers = np.repeat(np.arange(len(drawn), dtype=np.uint8), [len(own) for own in drawn])
    paint[: len(numbers)] = numbers
    tones = np.concatenate(drawn)
    labels = paint[label_pixels(picture, tones, space=space)]
    known = labels != UNLABELLED
    if not known.any():
        return labels
    around = np.zeros(labels.shape, np.uint8)
    for one in np.unique(labels[known]):
        around += dilate(labels == one, BLEND_PX).view(np.uint8)
    blend = ~known & (around == 1) & (contour < LINE) & (picture[..., 3] >= OPAQUE)
    beside = labels[nearest(known)]
    blend &= paint[nearest_labels(picture, tones)] == beside
    return np.where(blend, beside, labels)


def step_tones(picture: Picture, labels: Map, palette: Palette) -> Map:
    """Return the tone of every pixel, from 0 in light on; 255 where it has no label."""
    tones = np.full(labels.shape, UNLABELLED, np.uint8)
    for paint, color in enumerate(palette.colors):
        own = labels == paint
        tones[own] = nearest_colors(picture[own][:, :3], _drawn(color))
    return tones


def tone_colors(palette: Palette, colors: Colors) -> Colors:
    """Return a palette's paints in light, then in their next tone and so on, in other colours.

    Every paint has as many: its darkest is repeated. Tones of steps turn as ramps do, those of a
    shadow have its factor.

    Args:
        palette: of the sheet.
        colors: of the paints in light, in its order.
    """
    if not palette.stepped:
        return tones_of(colors, factors_of(palette))
    drawn = [_drawn(color) for color in palette.colors]
    moved = [
        own if (own[0] == new).all() else turned(own, own[0], new)
        for own, new in zip(drawn, colors, strict=True)
    ]
    most = max(map(len, drawn))
    return np.concatenate([[own[min(n, len(own) - 1)] for own in moved] for n in range(most)])


def _drawn(color: PaletteColor) -> Colors:
    """Return a paint's tones from light to dark."""
    return np.array([tone.rgb for tone in color.tones] or [color.rgb], dtype=np.uint8)


def _darker(
    colors: Colors, logs: Float[np.ndarray, "colors 3"]
) -> Bool[np.ndarray, "colors colors"]:
    """Return which colours may be the next darker tone of which, by their channels alone.

    A channel that is nearly black in light, too, says nothing. All channels' mean is an order.
    """
    drop = logs[None, :] - logs[:, None]  # of the first, darker, below the second
    told = np.broadcast_to(colors[None, :] >= TOLD, drop.shape)
    least = np.where(told, drop, np.inf).min(axis=-1)
    most = np.where(told, drop, -np.inf).max(axis=-1)
    mean = np.where(told, drop, 0).sum(axis=-1) / np.maximum(told.sum(axis=-1), 1)
    alike = (least > 0) & (most - least <= UNLIKE)
    black = (told | (drop > -UNLIKE)).all(axis=-1) & told.any(axis=-1)
    order = drop.mean(axis=-1) > 0
    return np.asarray(alike & black & order & (mean >= LEAST_DROP) & (mean <= MOST_DROP))


def _areas(picture: Picture, contour: Map, colors: UInt8[np.ndarray, "n 3"]) -> Areas:
    """Return every paint pixel's colour, blends going to the area beside them; -1 elsewhere."""
    paint = (contour < LINE) & (picture[..., 3] >= OPAQUE)
    labels = np.where(paint, nearest_labels(picture, colors).astype(np.int16), np.int16(-1))
    pure = is_uniform(labels) & paint
    if not pure.any():
        return np.full(labels.shape, -1)
    return np.where(paint, labels[nearest(pure)], -1).astype(np.int64)


def _touching(areas: Sequence[Areas], count: int) -> _Touching:
    length = np.zeros((count, count))
    upright, side, above = np.zeros((3, len(areas), count, count))
    for view, area in enumerate(areas):
        for one, other in ((area[:, :-1], area[:, 1:]), (area[:-1], area[1:])):
            border = (one != other) & (one >= 0) & (other >= 0)
            met = np.zeros((count, count))
            np.add.at(met, (one[border], other[border]), 1)
            length += met + met.T
            if one.shape[1] < area.shape[1]:
                upright[view], side[view] = met + met.T, met - met.T
            else:
                above[view] = met - met.T
    return _Touching(length, upright, side, above)


def _bits(
    nets: Float[np.ndarray, "views pairs"], lengths: Float[np.ndarray, "views pairs"]
) -> float:
    """Return the bits that one side saves over the borders of pairs, a coin in every drawing."""
    coins = lengths >= LEAST_PX / 2
    sides = (nets / np.maximum(lengths, 1))[coins]
    return coin_bits(float(sides.sum() / np.sqrt(max(len(sides), 1))))


def _chains(
    length: Float[np.ndarray, "colors colors"], light: Float[np.ndarray, " colors"]
) -> list[list[int]]:
    """Return chains of tones: every colour's lighter one is that with the longest border."""
    lighter = {n: int(row.argmax()) for n, row in enumerate(length) if row.any()}

    def lightest(color: int) -> int:
        while color in lighter:
            color = lighter[color]
        return color

    groups: dict[int, list[int]] = {}
    for color in lighter:
        groups.setdefault(lightest(color), []).append(color)
    return [[first, *sorted(shades, key=lambda n: -light[n])] for first, shades in groups.items()]


def _one_sided(chain: Sequence[int], touching: _Touching, light: float) -> list[int]:
    """Return a chain without colours that have its lighter ones all around: garments on it.

    Args:
        chain: from light to dark.
        touching: of all colours.
        light: 1 where the sheet's light is on the left, -1 on the right.
    """
    kept = list(chain)
    while len(kept) > 1:
        parts = [_openness(kept[:n], kept[n], touching, light) for n in range(1, len(kept))]
        worst = int(np.argmin(parts))
        if parts[worst] >= 1:
            break
        del kept[worst + 1]
    return kept


def _openness(lighter: list[int], shade: int, touching: _Touching, light: float) -> float:
    """Return how far a shade's border with lighter tones is open; 1: far enough.

    All around it sides cancel; along a limb the light is on one of them.
    """
    upright, side, above, length = (
        values[..., lighter, shade].sum(axis=-1)
        for values in (touching.upright, touching.side, touching.above, touching.length)
    )
    sided = light * side.sum() / max(upright.sum(), 1)
    opened = (np.abs(side) + np.abs(above)).sum() / max(length, 1)
    return float(min(sided / ONE_SIDED, opened / OPEN))
