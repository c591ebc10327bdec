"""Find and label the paints of drawings that are shaded throughout: soft light, brush, airbrush.

Every drawing is parted into patches without an edge in them (`pixels.patches`); patches of one hue,
in whatever light, are one paint (`paints.ramps`); pixels get the ramp that their colour lies on
(`pixels.ramp_labels`). The palette keeps every paint's ramp as tones, from light to dark, so that
its labels follow from the palette alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, UInt8

from toonset.errors import PaletteError
from toonset.palette.color_names import name_of
from toonset.palette.colors import JUST_NOTICEABLE, shaded_oklab_from_rgb
from toonset.palette.names import RGB, hex_of
from toonset.palette.options import MAX_COLORS
from toonset.palette.paints.features import ALIKE, LEAST_PX, SMALL
from toonset.palette.paints.places import PLACES
from toonset.palette.paints.ramps import PRICE, UNIT_PX, Moments, join_patches, joined, moments_of
from toonset.palette.paints.select import KEEP_REACH, PaletteRule
from toonset.palette.palette import DroppedColor, Palette, PaletteColor, Tone
from toonset.palette.pixels.antialias import OPAQUE
from toonset.palette.pixels.grain import noise_levels
from toonset.palette.pixels.patches import (
    TALL_PX,
    Lab,
    Numbers,
    Patches,
    find_patches,
    shrunk,
    smooth_lab,
)
from toonset.palette.pixels.ramp_labels import (
    OF_SPREAD,
    Ramp,
    enlarged_labels,
    ramp_labels,
    ramp_of,
    savings,
)
from toonset.raster import dilate, erode

SHADED = 1.05 / 255  # lightness per pixel at `TALL_PX`, the median: less is flat paint
EDGE = 6.0 / 255  # lightness per pixel: steeper is an edge
SLOPE_SIGMA, AWAY_PX = 1.5, 3  # pixels: in which slopes are read, and how far from edges
OF_GRAIN = np.sqrt(np.log(4)) / (np.sqrt(8 * np.pi) * SLOPE_SIGMA**2)  # median slope of unit noise
LEAST_INNER = 0.01  # of the pixels are away from edges, or nobody can tell how they are shaded
QUANTILES = (0.95, 0.75, 0.5, 0.25, 0.05)  # of lightness: a ramp's tones
AROUND = 0.05  # of a paint's pixels to either side of a quantile are read
MIDDLE = 2  # of the tones: the paint's own colour
SURE = 0.5  # of a paint's pixels' chances, the mean: less is a guess
GUESSED = 0.25  # of the pixels: so much of a sheet may be a guess without a word

Picture = UInt8[np.ndarray, "height width 4"]
Map = UInt8[np.ndarray, "height width"]


@dataclass(frozen=True, eq=False)
class _Drawing:
    """A drawing, shrunk and without grain.

    Attributes:
        lab: see `smooth_lab`.
        opaque: where something is drawn.
        rgb: as drawn.
        parted: see `find_patches`.
    """

    lab: Lab
    opaque: Bool[np.ndarray, "height width"]
    rgb: UInt8[np.ndarray, "height width 3"]
    parted: tuple[Numbers, Patches]

    def labels(self, ramps: Sequence[Ramp]) -> tuple[Map, Float32[np.ndarray, "height width"]]:
        """Return `ramp_labels`."""
        return ramp_labels(self.lab, self.opaque, self.parted, ramps)


@dataclass(frozen=True, eq=False)
class _Paint:
    """A paint that was found.

    Attributes:
        color: with its ramp.
        places: in how many drawings it is at the height where it mostly is.
        pixels: there, in the shrunk drawings.
        saves: see `savings`, of independent pixels.
    """

    color: PaletteColor
    places: int
    pixels: int
    saves: float


def is_shaded(pictures: Sequence[Picture]) -> bool:
    """Return whether paint changes its light everywhere, away from edges, too.

    The median slope is looked at, less what fine grain alone gives.
    """
    slopes = []
    for picture in map(shrunk, pictures):
        opaque = picture[..., 3] >= OPAQUE
        tall = int(opaque.any(axis=1).sum()) / TALL_PX
        light = shaded_oklab_from_rgb(picture[..., :3])[..., 0].astype(np.float32)
        light = cv2.GaussianBlur(light, (0, 0), SLOPE_SIGMA)
        slope = np.hypot(*(cv2.Sobel(light, cv2.CV_32F, *way) / 8 for way in ((1, 0), (0, 1))))
        inner = ~dilate((slope > EDGE) | ~opaque, AWAY_PX)
        if inner.sum() > LEAST_INNER * opaque.sum():
            grain = OF_GRAIN * noise_levels([picture]) / 255
            slopes.append(tall**2 * (float(np.median(slope[inner])) ** 2 - grain**2))
    return bool(slopes) and float(np.mean(slopes)) >= SHADED**2


def find_shaded_palette(pictures: Sequence[Picture], options: PaletteRule) -> Palette:
    """Return the palette of shaded drawings: every paint with its ramp.

    Kept is what the rule says, and what is smaller but makes the character: paints unlike all
    larger ones that two drawings show at one height.

    Args:
        pictures: sRGB with straight alpha.
        options: of the choice.

    Raises:
        PaletteError: nothing is drawn, or nothing is found near a colour to keep.
    """
    drawings = [_drawing(picture) for picture in pictures]
    if not any(one.opaque.any() for one in drawings):
        raise PaletteError("palette: the pictures have no opaque pixel; save an opaque figure")
    patches = moments_of([one.parted[1] for one in drawings])
    ramps = _ramps(joined(patches, join_patches(patches)))
    ramps += _asked_for(patches, ramps, options.keep)
    found = _paints(drawings, ramps[:MAX_COLORS])
    kept, left = _choose(found, options)
    wanted = {_nearest(kept, rgb).color.rgb for rgb in options.keep}
    now = _paints(drawings, [ramp_of(one.color) for one in kept])
    while idle := [i for i in range(len(kept)) if _is_idle(kept[i], now[i], wanted)]:
        left.append(kept.pop(min(idle, key=lambda i: now[i].saves)))
        now = _paints(drawings, [ramp_of(one.color) for one in kept])
    colors = [_with_share(*pair) for pair in zip(kept, now, strict=True)]
    colors.sort(key=lambda color: (-color.share, color.rgb))
    small = tuple(c.rgb for c in colors if c.share < options.min_share and c.rgb not in wanted)
    palette = Palette(
        tuple(colors), _rule(options), tuple(_dropped(one, kept) for one in left), features=small
    )
    return replace(palette, warnings=_doubts(palette))


def pick_shaded_palette(
    pictures: Sequence[Picture], rgb: UInt8[np.ndarray, "colors 3"], rule: str
) -> Palette:
    """Return colours picked by hand with the ramps that shaded drawings have of them."""
    picked = [PaletteColor((r, g, b), 0.0, name_of((r, g, b))) for r, g, b in rgb.tolist()]
    drawings = [_drawing(one) for one in pictures]
    first = _paints(drawings, [ramp_of(color) for color in picked])
    ramps = [
        ramp_of(own.color if own.color.tones else color)
        for color, own in zip(picked, first, strict=True)
    ]
    found = _paints(drawings, ramps)
    colors = tuple(
        replace(color, share=own.color.share, tones=own.color.tones, sure=own.color.sure)
        for color, own in zip(picked, found, strict=True)
    )
    unused = [hex_of(color.rgb) for color in colors if not color.share]
    notes = (f"no pixel is nearest to {', '.join(unused)}",) if unused else ()
    return Palette(colors, rule, (), notes)


def shaded_labels(pictures: Sequence[Picture], ramps: Sequence[Ramp]) -> list[Map]:
    """Return which ramp every opaque pixel's paint is, 255 elsewhere."""
    return [
        enlarged_labels(_drawing(picture).labels(ramps)[0], picture, ramps) for picture in pictures
    ]


def with_own_tones(
    colors: Sequence[PaletteColor], pictures: Sequence[Picture], labels: Sequence[Map]
) -> list[PaletteColor]:
    """Return colours of which those without tones have the ramps that the drawings have of them."""
    opaque = [picture[..., 3] >= OPAQUE for picture in pictures]
    label = np.concatenate([own[there] for own, there in zip(labels, opaque, strict=True)])
    rgb = np.concatenate([own[..., :3][there] for own, there in zip(pictures, opaque, strict=True)])
    found = []
    for number, color in enumerate(colors):
        own = rgb[label == number]
        if not color.tones:
            light = shaded_oklab_from_rgb(own)[:, 0].astype(np.float32)
            color = replace(color, tones=_tones(light, own, len(label)))
        found.append(color)
    return found


def _drawing(picture: Picture) -> _Drawing:
    small = shrunk(picture)
    lab, opaque = smooth_lab(small)
    return _Drawing(lab, opaque, small[..., :3], find_patches(lab, opaque))


def _ramps(paints: Moments) -> list[Ramp]:
    """Return straight ramps of paints by their moments."""
    mean = paints.mean
    spread = paints.square[:, 0, 0] / paints.weight - mean[:, 0] ** 2
    spread = np.sqrt(np.maximum(spread, 0))
    way = np.concatenate([np.ones((len(mean), 1)), paints.slope], axis=1)
    reach = OF_SPREAD * spread[:, None] * way
    return [
        Ramp(np.stack([low, high]), float(middle[0]), float(wide))
        for low, high, middle, wide in zip(mean - reach, mean + reach, mean, spread, strict=True)
    ]


def _is_idle(paint: _Paint, now: _Paint, wanted: set[RGB]) -> bool:
    """Return whether a paint is hardly needed beside the others: mixtures, a shadow of several."""
    return now.saves < PRICE and paint.color.rgb not in wanted


def _with_share(paint: _Paint, now: _Paint) -> PaletteColor:
    """Return a paint's colour and ramp with the share that it has beside those kept."""
    color, share = paint.color, now.color.share
    tones = tuple(replace(t, share=t.share * share / color.share) for t in color.tones)
    return replace(color, share=share, tones=tones, sure=now.color.sure)


def _asked_for(patches: Moments, ramps: Sequence[Ramp], wanted: Sequence[RGB]) -> list[Ramp]:
    """Return ramps of patches near colours to keep, nearer than to any ramp there is."""
    found: list[Ramp] = []
    known = np.min([_away(ramp, patches.mean) for ramp in ramps], axis=0)
    for rgb in wanted:
        lab = shaded_oklab_from_rgb(np.array(rgb, np.uint8))
        if min(_away(ramp, lab) for ramp in (*ramps, *found)) <= JUST_NOTICEABLE:
            continue
        away = np.linalg.norm(patches.mean - lab, axis=1)
        near = (away <= KEEP_REACH) & (away < known)
        if near.any():
            own = patches.at(near)
            found += _ramps(joined(own, np.zeros(len(own.weight), dtype=np.int64)))
    return found


def _away(ramp: Ramp, lab: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n"]:
    """Return how far colours lie from a ramp in OKLab."""
    light = lab[..., :1].clip(ramp.stops[0, 0], ramp.stops[-1, 0])
    hue = ramp.hue_at(light[..., 0].astype(np.float32))
    return np.asarray(np.linalg.norm(lab - np.concatenate([light, hue], axis=-1), axis=-1))


def _paints(drawings: Sequence[_Drawing], ramps: Sequence[Ramp]) -> list[_Paint]:
    """Return the paints that the drawings have of these ramps, with tones as drawn."""
    parts = [one.labels(ramps) for one in drawings]
    label = np.concatenate([own[d.opaque] for (own, _), d in zip(parts, drawings, strict=True)])
    chance = np.concatenate([own[d.opaque] for (_, own), d in zip(parts, drawings, strict=True)])
    light = np.concatenate([d.lab[d.opaque][:, 0] for d in drawings])
    rgb = np.concatenate([d.rgb[d.opaque] for d in drawings])
    saved = np.sum(
        [savings(d.lab, own, ramps) for (own, _), d in zip(parts, drawings, strict=True)], axis=0
    )
    found = []
    for number in range(len(ramps)):
        own = np.flatnonzero(label == number)
        places, pixels = _recurrence(number, [one for one, _ in parts], drawings)
        tones = _tones(light[own], rgb[own], len(label))
        middle = tones[MIDDLE].rgb if tones else (0, 0, 0)
        share, sure = len(own) / len(label), float(chance[own].mean()) if len(own) else 0.0
        color = PaletteColor(middle, share, name_of(middle), tones, sure)
        found.append(_Paint(color, places, pixels, float(saved[number]) / UNIT_PX))
    return found


def _tones(
    light: Float32[np.ndarray, " n"], rgb: UInt8[np.ndarray, "n 3"], total: int
) -> tuple[Tone, ...]:
    """Return a paint's tones, the lightest first: medians of its pixels around quantiles."""
    if not len(light):
        return ()
    order = np.argsort(light, kind="stable")
    borders = [0.0, *np.convolve(QUANTILES[::-1], [0.5, 0.5], "valid"), 1.0]
    tones = []
    for number, quantile in enumerate(QUANTILES[::-1]):
        low, high = (round((quantile + side) * len(order)) for side in (-AROUND, AROUND))
        some = order[max(low, 0) : max(high, low + 1)]
        red, green, blue = (round(float(level)) for level in np.median(rgb[some], axis=0))
        share = (borders[number + 1] - borders[number]) * len(order) / total
        tones.append(Tone((red, green, blue), float(share)))
    return tuple(tones[::-1])


def _recurrence(
    number: int, labels: Sequence[Map], drawings: Sequence[_Drawing]
) -> tuple[int, int]:
    """Return in how many drawings a label is at the height where it mostly is; its pixels there."""
    rows = []
    for label, drawing in zip(labels, drawings, strict=True):
        own = np.flatnonzero(erode(label == number).any(axis=1))
        figure = np.flatnonzero(drawing.opaque.any(axis=1))
        counts = (label == number).sum(axis=1)
        if len(own):
            rows.append(((own - figure[0]) / len(figure), counts[own]))
    if not rows:
        return 0, 0
    middle = float(np.median([np.average(level, weights=count) for level, count in rows]))
    there = [count[np.abs(level - middle) <= ALIKE].sum() for level, count in rows]
    return sum(count > 0 for count in there), int(sum(there))


def _choose(found: Sequence[_Paint], options: PaletteRule) -> tuple[list[_Paint], list[_Paint]]:
    """Return the paints that stay and those left out, largest first."""
    there = sorted((one for one in found if one.color.tones), key=lambda one: -one.color.share)
    kept = [_nearest(there, rgb) for rgb in options.keep]
    for one in there:
        if one in kept or len(kept) >= options.max_colors:
            continue
        if one.color.share >= options.min_share or (
            options.features is not False and _is_feature(one, kept, len(found))
        ):
            kept.append(one)
    kept = kept or there[:1]
    return kept, [one for one in there if one not in kept]


def _is_feature(paint: _Paint, kept: Sequence[_Paint], drawings: int) -> bool:
    lab = shaded_oklab_from_rgb(np.array(paint.color.rgb, np.uint8))
    unlike = all(_away(ramp_of(one.color), lab) >= JUST_NOTICEABLE for one in kept)
    small = paint.color.share < SMALL
    return small and unlike and paint.pixels >= LEAST_PX and paint.places >= min(PLACES, drawings)


def _nearest(found: Sequence[_Paint], rgb: RGB) -> _Paint:
    lab = shaded_oklab_from_rgb(np.array(rgb, np.uint8))
    away = [_away(ramp_of(one.color), lab) for one in found]
    best = found[int(np.argmin(away))]
    if min(away) > KEEP_REACH:
        raise PaletteError(
            f"--keep: {hex_of(rgb)}: no such colour was found; the nearest is "
            f"{hex_of(best.color.rgb)}: name that one, or give the whole palette with --colors"
        )
    return best


def _dropped(paint: _Paint, kept: Sequence[_Paint]) -> DroppedColor:
    color = paint.color
    lab = shaded_oklab_from_rgb(np.array(color.rgb, np.uint8))
    cost = float(min(_away(ramp_of(one.color), lab) for one in kept))
    return DroppedColor(color.rgb, color.share, color.name, cost)


def _rule(options: PaletteRule) -> str:
    words = [
        f"shaded drawings: paints of at least {100 * options.min_share:g} % of the character, each "
        "a ramp from light to dark"
    ]
    if options.features is not False:
        words.append("smaller ones that drawings show at one height")
    if options.max_colors < MAX_COLORS:
        words.append(f"at most {options.max_colors} colours")
    if options.keep:
        words.append(f"kept by hand: {', '.join(map(hex_of, options.keep))}")
    return "; ".join(words)


def _doubts(palette: Palette) -> tuple[str, ...]:
    guessed = [color for color in palette.colors if (color.sure or 0) < SURE]
    share = sum(color.share for color in guessed)
    if share < GUESSED:
        return ()
    named = ", ".join(hex_of(color.rgb) for color in guessed)
    return (
        f"the paints of {100 * share:.0f} % of the character are a guess ({named}): texture or "
        "blended paint; name the colours with --colors",
    )
