"""Warn of colours that the palette cannot tell: too small, or shaded throughout.

Spots too small: a colour is read from flat paint. A spot narrower than that has only blends of it
with what lies around and with a line, and nothing says which colour they are blends of. But that
there is another colour can be told where the spot lies alone in one paint: no known paint, blended
with the paint around and with the lines' ink, gives what is seen.

Paints too wide: shades that run into each other are one paint, however far they run, as a gradient
must be. Where a drawing is shaded throughout and has little flat paint, even different things can
so become one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

import cv2
import numpy as np
from jaxtyping import Bool, Int32, UInt8

from toonset.palette.colors import JUST_NOTICEABLE, even_oklab_from_rgb, oklab_from_rgb
from toonset.palette.names import hex_of
from toonset.palette.paints.blends import reach_of
from toonset.palette.paints.clusters import UNLIKE, Paint
from toonset.palette.paints.histogram import OPAQUE_WORD, Histogram, Picture, rgb_of_words
from toonset.palette.paints.places import PLACES
from toonset.palette.palette import Place

WIDEST = 7  # pixels: what is wider has a flat pixel within it, even with a line around
# That are looked at, or texture would take minutes: parts that are not flat, and pixels unlike what
# is around
MOST_PARTS, MOST = 4096, 512
ALL = 1e4  # weight, beside levels, of the demand that a blend's shares add up to one

Rgb = UInt8[np.ndarray, " 3"]
Boxes = Int32[np.ndarray, "n 4"]  # left, top, width, height
WIDE = 10 * JUST_NOTICEABLE  # in OKLab: a fifth of the way from black to white


def lone_spot_notes(histogram: Histogram, paints: Sequence[Paint]) -> tuple[str, ...]:
    """Return what a person should know of spots whose colour cannot be told.

    Args:
        histogram: of the character.
        paints: all its known colours, those of tiny features included.
    """
    spots = [
        (_apart(pixel, around, paints, histogram.noise), pixel, place)
        for place, around, pixel in islice(_spots(histogram), MOST)
    ]
    found = [spot for spot in spots if spot[0] > 0]
    places = {place for _, _, place in found}
    if len(places) < PLACES:
        return ()
    _, (red, green, blue), place = max(found, key=lambda spot: spot[0])
    x, y, width, height = place.box
    seen = hex_of((int(red), int(green), int(blue)))
    least = "at least " if len(spots) == MOST else ""
    return (
        f"{least}{len(places)} spots such as picture {place.view} at ({x}, {y}), "
        f"{width} x {height} px, are too small to tell their colour: {seen} there is no blend of "
        "the others; draw the sheet larger, or name all colours with --colors",
    )


def _spots(histogram: Histogram) -> Iterator[tuple[Place, Rgb, Rgb]]:
    """Yield spots that lie alone in a paint, that paint's colour, and pixels unlike it."""
    left = MOST_PARTS
    for view, picture in enumerate(histogram.pictures):
        if not left:
            return
        boxes = _small(picture)[:left]
        left -= len(boxes)
        for x, y, width, height in boxes[_alone(boxes, picture, histogram.noise)].tolist():
            colors = rgb_of_words(picture.words[y - 1 : y + height + 1, x - 1 : x + width + 1])
            inside = _inside(width, height)
            around = np.median(colors[~inside], axis=0).astype(np.uint8)
            spot = np.unique(colors[inside], axis=0)
            away = even_oklab_from_rgb(spot) - even_oklab_from_rgb(around)
            place = Place(view, (x, y + picture.top, width, height))
            for pixel in spot[np.linalg.norm(away, axis=1) >= UNLIKE]:
                yield place, around, pixel


def _alone(boxes: Boxes, picture: Picture, noise: int) -> Bool[np.ndarray, " n"]:
    """Return which boxes have one paint all round, and nothing transparent; equal sizes at once."""
    alone = np.zeros(len(boxes), dtype=bool)
    for width, height in np.unique(boxes[:, 2:], axis=0).tolist():
        equal = np.flatnonzero((boxes[:, 2:] == (width, height)).all(axis=1))
        x, y = boxes[equal, :2].T[..., None, None]
        words = picture.words[y + np.arange(-1, height + 1)[:, None], x + np.arange(-1, width + 1)]
        opaque = (words >= OPAQUE_WORD).all(axis=(1, 2))
        around = rgb_of_words(words[:, ~_inside(width, height)])
        alone[equal] = opaque & (np.ptp(around, axis=1).max(axis=1) <= 2 * noise)
    return alone


def _inside(width: int, height: int) -> Bool[np.ndarray, "rows columns"]:
    """Return where a box is that has one more pixel on every side."""
    return np.pad(np.ones((height, width), dtype=bool), 1)


def _small(picture: Picture) -> Boxes:
    """Return the boxes of small connected parts that are not flat, away from the border."""
    height, width = picture.words.shape
    if min(height, width) < 3:  # nothing is away from the border; OpenCV wants a pixel at least
        return np.zeros((0, 4), dtype=np.int32)
    rough = np.zeros((height, width), dtype=np.uint8)
    rough.ravel()[picture.rough] = 1
    stats = cv2.connectedComponentsWithStats(rough, connectivity=8)[2][1:]
    x, y, wide, high = stats[:, :4].T
    inside = (x > 0) & (y > 0) & (x + wide < width) & (y + high < height)
    return stats[inside & (np.maximum(wide, high) <= WIDEST), :4]


def _apart(pixel: Rgb, around: Rgb, paints: Sequence[Paint], noise: int) -> float:
    """Return how many levels a pixel is beyond all blends of what is around, a paint and the ink.

    At most zero: it is a blend, but for rounding and noise.
    """
    from scipy.optimize import nnls

    known = np.array([around, *(paint.rgb for paint in paints)], dtype=np.float64)
    inks = [number for number, paint in enumerate(paints, start=1) if paint.is_ink]
    always = [0, *inks]
    seen = np.append(pixel.astype(np.float64), ALL)
    blends = ([*always, number] for number in range(len(known)))
    parts = (np.vstack([known[blend].T, np.full(len(blend), ALL)]) for blend in blends)
    return min(float(nnls(part, seen)[1]) for part in parts) - reach_of(noise)


def wide_paint_notes(
    histogram: Histogram, paints: Sequence[Paint], least: float
) -> tuple[str, ...]:
    """Return what a person should know of paints with much that looks unlike them.

    Args:
        histogram: of the character.
        paints: those that are kept.
        least: share of the flat pixels, 0 to 1, that are too far from their paint to be silent.
    """
    total = int(histogram.flat.sum())
    notes = []
    for paint in paints:
        shades = oklab_from_rgb(histogram.colors[paint.members])
        own = oklab_from_rgb(np.array(paint.rgb, dtype=np.uint8))
        far = np.linalg.norm(shades - own, axis=1) > WIDE
        share = float(histogram.flat[paint.members] @ far) / total
        if share > 0 and share >= least:
            notes.append(
                f"{hex_of(paint.rgb)}: stands for very different shades ({100 * share:.0f} % of "
                "the flat pixels look unlike it), as in a drawing shaded throughout; name the "
                "colours with --colors"
            )
    return tuple(notes)
