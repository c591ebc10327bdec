"""Detect two-tone shading: its factor, its place in the drawings, the colours in light.

    colour in shadow = factor * colour in light           levels of sRGB, one factor per sheet

The factor is the commonest ratio of colours across borders that darken every channel, borders with
the light on their left counted against those with it on their right: around paint both occur alike,
at shadows, whose light stays with the viewer, one of them. Every such piece of border says on which
side the light is, one bit without a shadow. There is a shadow if the bits that one side for all of
them saves exceed those that state the factor.

Sources: ratios across shadow borders, Barnard and Finlayson, "Shadow identification using colour
ratios" (2000); J. Rissanen, "Modeling by shortest data description" (1978).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, UInt8

from toonset.palette.palette import Shadow
from toonset.palette.pixels.antialias import OPAQUE
from toonset.raster import erode, nearest, sized_parts

SIDE_PX = 3  # from a border to where the colours on both its sides are read
NARROWEST_PX = 2 * SIDE_PX  # a picture; there is no border in it to look across
FLAT = 0.03  # logarithms per pixel: steeper is not a flat paint
BETWEEN = 0.1  # logarithms: a line between the sides is darker than both by more
LEAST_DROP, MOST_DROP = 0.1, 1.4  # logarithms: weaker is noise, deeper is another paint
ALIKE = 0.12  # logarithms that a channel's ratio may be off the factor
FLOOR = 4 / 255  # added before logarithms: black says nothing of ratios
TALL_PX = 400  # figures are looked at no taller: a shadow's border is long
LINE = 64  # of 255: so much of a pixel is a drawn line's, or of what lies beside it
DRAWN = 128  # of 255: covered by half, a pixel is a drawn line's
LEAST_PIECE = 4  # pixels of a border: shorter ones are noise
PRICE_BITS = 3 * float(np.log2(MOST_DROP / (2 * ALIKE)))  # of a factor: which of all that differ
WAYS = ((0, 1), (1, 0), (1, 1), (1, -1))  # rows and columns across a border
SURE, SPREAD, SIMILAR = 8.0, 300.0, 3.0  # of a border's vote; of its spreading, over which levels
LEVELS = 255 / float(-np.log(FLOOR))  # of a logarithm: as many as fit into a byte
COLOR_CELL = 12  # levels: colours that shadows' borders speak of together
FEW_VOTES = 3.0  # of a cell: says next to nothing
MIXED_PX = 2  # beside a tone's border

Picture = UInt8[np.ndarray, "height width 4"]
Map = UInt8[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]
Way = tuple[int, int]


@dataclass(frozen=True, eq=False)
class _Borders:
    """Borders between flat colours of one picture in one direction.

    Attributes:
        rows: of the pixels on them.
        columns: likewise.
        drop: (n, 3) logarithms of the darker side over the lighter one.
        ahead: whether the lighter side lies ahead of the border, right or below.
        way: (rows, columns) of a step ahead.
    """

    rows: np.ndarray
    columns: np.ndarray
    drop: Float[np.ndarray, "n 3"]
    ahead: Bool[np.ndarray, " n"]
    way: Way


def find_shadow(pictures: Sequence[Picture], contours: Sequence[Map]) -> Shadow | None:
    """Return the shadow that the pictures of a character share; None without one.

    Args:
        pictures: the drawings.
        contours: how far lines cover each of their pixels.
    """
    tall = max((int((p[..., 3] >= OPAQUE).any(axis=1).sum()) for p in pictures), default=0)
    shrink = min(1.0, TALL_PX / max(tall, 1))
    borders = []
    for picture, contour in zip(pictures, contours, strict=True):
        small, line = (_shrunk(each, shrink) for each in (picture, contour))
        if min(line.shape) <= NARROWEST_PX:
            continue
        borders.append((line.shape, _borders(smoothed(small), _clear(small, line))))
    factor = _commonest([each for _, found in borders for each in found])
    if factor is None:
        return None
    bits = _direction_bits(borders, factor)
    if bits <= PRICE_BITS:
        return None
    drops = [each.drop[_fits(each.drop, factor)] for _, found in borders for each in found]
    off = np.median(np.abs(np.concatenate(drops) - factor), axis=0)
    (red, green, blue), spread = np.exp(factor).tolist(), off.tolist()
    return Shadow((red, green, blue), (spread[0], spread[1], spread[2]), bits)


def _shrunk(picture: np.ndarray, shrink: float) -> np.ndarray:
    if shrink == 1 or not picture.size:  # OpenCV wants a pixel at least
        return picture
    size = tuple(max(1, round(shrink * n)) for n in picture.shape[1::-1])
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def smoothed(picture: Picture) -> UInt8[np.ndarray, "height width 3"]:
    """Return a picture's colours without grain, borders kept."""
    rgb = np.ascontiguousarray(picture[..., :3])
    return cv2.bilateralFilter(cv2.bilateralFilter(rgb, 5, 30, 3), 5, 15, 3)


def _clear(picture: Picture, contour: Map) -> Mask:
    """Return pixels that are paint, and have none but paint around."""
    paint = (picture[..., 3] >= OPAQUE) & (contour < LINE)
    return erode(paint)


def _logs(rgb: UInt8[np.ndarray, "*n 3"]) -> Float32[np.ndarray, "*n 3"]:
    return np.log(rgb.astype(np.float32) / 255 + np.float32(FLOOR))


def _borders(rgb: UInt8[np.ndarray, "height width 3"], clear: Mask) -> list[_Borders]:
    """Return borders without a line on them that darken every channel, a way after the other."""
    logs = _logs(rgb)
    light = logs.mean(axis=-1)
    across, down = (cv2.Sobel(light, cv2.CV_32F, *axis) / 8 for axis in ((1, 0), (0, 1)))
    flat = clear & (np.hypot(across, down) < FLAT)
    flat[:SIDE_PX] = flat[-SIDE_PX:] = flat[:, :SIDE_PX] = flat[:, -SIDE_PX:] = False
    found = []
    for way in WAYS:
        before, after = (_moved(light, way, steps) for steps in (-SIDE_PX, SIDE_PX))
        dark, bright = np.minimum(before, after), np.maximum(before, after)
        border = _moved(flat, way, -SIDE_PX) & _moved(flat, way, SIDE_PX)
        border &= bright - dark > LEAST_DROP
        for steps in range(1 - SIDE_PX, SIDE_PX):
            between = _moved(light, way, steps)
            border &= _moved(clear, way, steps)
            border &= (between > dark - BETWEEN) & (between < bright + BETWEEN)
        rows, columns = np.nonzero(border)
        step = SIDE_PX * way[0], SIDE_PX * way[1]
        change = logs[rows + step[0], columns + step[1]] - logs[rows - step[0], columns - step[1]]
        ahead = change.mean(axis=1) > 0
        drop = np.where(ahead[:, None], -change, change).astype(np.float64)
        shade = (drop < 0).all(axis=1) & (drop > -MOST_DROP).all(axis=1)
        found.append(_Borders(rows[shade], columns[shade], drop[shade], ahead[shade], way))
    return found


def _moved(values: np.ndarray, way: Way, steps: int) -> np.ndarray:
    """Return the values so many steps along a way from every pixel."""
    return np.roll(values, (-steps * way[0], -steps * way[1]), (0, 1))


def _commonest(borders: Sequence[_Borders]) -> Float[np.ndarray, " 3"] | None:
    """Return the ratio that is commonest with the light on one side; None without any."""
    if not borders:
        return None
    drop = np.concatenate([each.drop for each in borders])
    side = np.concatenate([each.way[1] * np.where(each.ahead, 1, -1) for each in borders])
    cells = int(np.ceil(MOST_DROP / ALIKE))
    counts = np.zeros((cells, cells, cells))
    np.add.at(counts, tuple((-drop / ALIKE).astype(int).clip(0, cells - 1).T), side)
    best = np.array(np.unravel_index(np.abs(counts).argmax(), counts.shape))
    factor = -(best + 0.5) * ALIKE
    for _ in range(10):
        near = _fits(drop, factor)
        if not near.any():
            return None
        factor = np.median(drop[near], axis=0)
    return factor


def _fits(drop: Float[np.ndarray, "n 3"], factor: Float[np.ndarray, " 3"]) -> np.ndarray:
    return np.abs(drop - factor).max(axis=1, initial=0) < ALIKE


def _direction_bits(
    borders: Sequence[tuple[tuple[int, ...], list[_Borders]]], factor: Float[np.ndarray, " 3"]
) -> float:
    """Return the bits that one side of the light saves, over all pieces of upright borders.

    The chance of sides so uneven by coin flips, each piece weighed by its length.
    """
    lengths: list[int] = []
    for shape, found in borders:
        for each in (one for one in found if one.way == (0, 1)):
            fits = _fits(each.drop, factor)
            for side in (True, False):
                own = fits & (each.ahead == side)
                mask = np.zeros(shape[:2], dtype=bool)
                mask[each.rows[own], each.columns[own]] = True
                pieces = sized_parts(mask)[1][1:]
                lengths += [int(n) if side else -int(n) for n in pieces if n >= LEAST_PIECE]
    if not lengths:
        return 0.0
    uneven = abs(sum(lengths)) / np.sqrt(float(np.square(lengths).sum()))
    return coin_bits(float(uneven))


def coin_bits(deviations: float) -> float:
    """Return the bits that a side of the light saves: coins fall as unevenly that seldom.

    Args:
        deviations: by which the sides are uneven, of as many flips of a coin.
    """
    from scipy.special import log_ndtr

    return float(-log_ndtr(-deviations) / np.log(2) - 1)


def find_tones(pictures: Sequence[Picture], contours: Sequence[Map], shadow: Shadow) -> list[Mask]:
    """Return where every picture lies in shadow.

    Borders of the shadow's ratio vote, and so do the colours that they have on either side, on all
    pictures; votes spread over paint of similar colour, so tones end where the drawing's own
    borders are.

    Args:
        pictures: the drawings.
        contours: how far lines cover each of their pixels.
        shadow: of them.
    """
    factor = np.log(shadow.factor)
    wide = [n for n, contour in enumerate(contours) if min(contour.shape) > NARROWEST_PX]
    smooth = [smoothed(pictures[number]) for number in wide]
    clear = [_clear(pictures[number], contours[number]) for number in wide]
    votes = [_votes(*both, factor) for both in zip(smooth, clear, strict=True)]
    table = _votes_of_colors(smooth, votes)
    dark = [np.zeros(contour.shape, dtype=bool) for contour in contours]
    for number, rgb, paint, own in zip(wide, smooth, clear, votes, strict=True):
        dark[number] = _in_shadow(rgb, paint, own, table)
    return dark


def border_votes(
    picture: Picture, contour: Map, shadow: Shadow
) -> Float32[np.ndarray, "height width"]:
    """Return 1 on the dark side of a drawing's borders of the shadow, -1 on the light side, else 0.

    Args:
        picture: the drawing.
        contour: how far lines cover each of its pixels.
        shadow: of the sheet.
    """
    if min(contour.shape) <= NARROWEST_PX:
        return np.zeros(contour.shape, dtype=np.float32)
    return _votes(smoothed(picture), _clear(picture, contour), np.log(shadow.factor))


def _votes(rgb: np.ndarray, clear: Mask, factor: np.ndarray) -> Float32[np.ndarray, "height width"]:
    """Return 1 on the dark side of the shadow's borders, -1 on the light side, 0 elsewhere."""
    votes = np.zeros(clear.shape, dtype=np.float32)
    for each in _borders(rgb, clear):
        fits = _fits(each.drop, factor)
        sign = np.where(each.ahead[fits], -1, 1)
        for steps, own in ((-SIDE_PX, -sign), (SIDE_PX, sign)):
            rows = each.rows[fits] + steps * each.way[0]
            np.add.at(votes, (rows, each.columns[fits] + steps * each.way[1]), own)
    return np.clip(votes, -1, 1)


def _cell(rgb: np.ndarray) -> np.ndarray:
    side = 256 // COLOR_CELL + 1
    red, green, blue = np.moveaxis(rgb // COLOR_CELL, -1, 0).astype(np.int64)
    return (red * side + green) * side + blue


def _votes_of_colors(smooth: Sequence[np.ndarray], votes: Sequence[np.ndarray]) -> np.ndarray:
    """Return for every cell of colours the logits of shadow that borders give it."""
    side = 256 // COLOR_CELL + 1
    dark, light = (
        sum(
            np.bincount(_cell(rgb[own * sign > 0]), minlength=side**3).astype(np.float32)
            for rgb, own in zip(smooth, votes, strict=True)
        )
        for sign in (1, -1)
    )
    dark, light = (_blurred(np.asarray(n).reshape(side, side, side)) for n in (dark, light))
    logit: np.ndarray = np.log((dark + FEW_VOTES) / (light + FEW_VOTES))
    return logit.ravel()


def _blurred(counts: np.ndarray) -> np.ndarray:
    from scipy.ndimage import gaussian_filter

    return np.asarray(gaussian_filter(counts, 0.7, mode="constant")) * 4


def _in_shadow(rgb: np.ndarray, clear: Mask, votes: np.ndarray, table: np.ndarray) -> Mask:
    """Return where a picture lies in shadow."""
    said = SURE * votes + table[_cell(rgb)].astype(np.float32)
    guide = np.rint((_logs(rgb) - np.log(FLOOR)) * LEVELS).clip(0, 255).astype(np.uint8)
    weight = (clear * (1 + 2 * np.abs(votes))).astype(np.float32)
    total, mean = (
        cv2.ximgproc.fastGlobalSmootherFilter(guide, values, SPREAD, SIMILAR)
        for values in (weight, said * weight)
    )
    return np.asarray((mean > 0) & (total > 0))


def lit_pictures(
    pictures: Sequence[Picture], contours: Sequence[Map], dark: Sequence[Mask], shadow: Shadow
) -> list[Picture]:
    """Return drawings as they would be without shadow and grain; drawn lines stay as they are.

    Args:
        pictures: the drawings.
        contours: how far lines cover each of their pixels.
        dark: where they lie in shadow.
        shadow: of the sheet.
    """
    drawn = zip(pictures, contours, dark, strict=True)
    return [_lit(*each, shadow) if each[2].any() else each[0] for each in drawn]


def _lit(picture: Picture, contour: Map, dark: Mask, shadow: Shadow) -> Picture:
    rgb = smoothed(picture)
    light = np.where(dark[..., None], apply_shadow(rgb, 1 / np.array(shadow.factor)), rgb)
    edge = _beside(dark)
    pure = _clear(picture, contour) & ~edge
    if pure.any():
        light = np.where((edge & (contour < LINE))[..., None], light[nearest(pure)], light)
    lit = picture.copy()
    paint = (contour < DRAWN)[..., None]
    lit[..., :3] = np.where(paint, light, picture[..., :3])
    return lit


def apply_shadow(
    rgb: np.ndarray, factor: Sequence[float] | Float[np.ndarray, " 3"]
) -> UInt8[np.ndarray, "*n 3"]:
    """Return colours multiplied by a shadow's factor, or by its inverse: in light again."""
    floor = 255 * FLOOR
    return np.rint(np.clip((rgb + floor) * np.asarray(factor) - floor, 0, 255)).astype(np.uint8)


def _beside(dark: Mask) -> Mask:
    square = np.ones((2 * MIXED_PX + 1, 2 * MIXED_PX + 1), dtype=np.uint8)
    return cv2.morphologyEx(dark.view(np.uint8), cv2.MORPH_GRADIENT, square) > 0
