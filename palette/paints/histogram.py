"""Count a character's pixels by colour: all of them, and those within flat paint.

Flat pixels tell which colours there are. A pixel is flat if it equals a neighbour at one side and
one above or below, but for the picture's noise; the soft pixels along edges do not, and count only
once the colours are known. A pixel is read as one 32-bit word. Time grows with the character's box;
memory beyond the picture with one band of rows and the number of runs of equal pixels.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int, UInt8, UInt32

from toonset.palette.pixels.antialias import OPAQUE
from toonset.palette.pixels.opacity import COVERED

LEAST_NOISE = 2  # levels: a painted gradient's step from one pixel to the next
MOST_NOISE = 12  # levels: more is an edge, in whatever file
TYPICAL = 0.4  # of the steps between neighbours: less than half, for edges are steps, too
NOISE_SPREAD = 1.5  # noise's typical step times this holds most of them
NOISE_PIXELS = 2**16  # of a picture are looked at for its noise, twice: rows, and columns
BAND_PIXELS = 2**18  # worked on at a time: stays in the processor's cache
TABLE_RUNS = 2**17  # from so many on, a table of all colours beats sorting
FLAT = np.uint32(1 << 24)  # a mark in the byte that held alpha
OPAQUE_WORD, COVERED_WORD = np.uint32(OPAQUE << 24), np.uint32(COVERED << 24)
RGB = np.uint32(0xFFFFFF)

Words = UInt32[np.ndarray, "rows columns"]
Places = Int[np.ndarray, " places"]
Runs = tuple[UInt32[np.ndarray, " runs"], Int[np.ndarray, " runs"]]


@dataclass(frozen=True, eq=False)
class Picture:
    """The rows of one picture that the character covers, and its pixels that are not flat.

    Attributes:
        words: one word per pixel: alpha, blue, green, red.
        top: the first of the rows in the picture.
        rough: places of covered pixels that are not flat, counted row by row.
        own: their words.
        beside: the words to their left and right, above and below; at the border their own.
    """

    words: Words
    top: int
    rough: Places
    own: UInt32[np.ndarray, " places"]
    beside: UInt32[np.ndarray, "4 places"]


@dataclass(frozen=True, eq=False)
class Histogram:
    """Histogram of the opaque pixels' colours.

    Attributes:
        colors: (n, 3) sRGB, each once, sorted by blue, then green, then red.
        counts: (n,) pixels.
        flat: (n,) pixels within flat paint; all, where a picture has none.
        thin: (n,) pixels in the middle of thin dark strokes.
        noise: levels by which neighbours of one paint may differ.
        pictures: that were counted.
    """

    colors: UInt8[np.ndarray, "n 3"]
    counts: Int[np.ndarray, " n"]
    flat: Int[np.ndarray, " n"]
    thin: Int[np.ndarray, " n"]
    noise: int
    pictures: tuple[Picture, ...]

    @property
    def codes(self) -> UInt32[np.ndarray, " n"]:
        """Return the colours as words without alpha, ascending."""
        return self.colors.astype(np.uint32) @ np.array([1, 1 << 8, 1 << 16], dtype=np.uint32)


def count_pixels(images: Sequence[UInt8[np.ndarray, "_ _ 4"]]) -> Histogram:
    """Return how often every colour occurs in the opaque pixels of several pictures."""
    covered = [_covered_rows(image) for image in images]
    noise = _noise([words for words, _ in covered])
    runs: list[Runs] = []
    pictures = []
    for words, top in covered:
        bands = list(_bands(words, noise))
        runs += [run for run, _ in bands]
        rough = np.concatenate([np.zeros(0, dtype=np.int64), *(places for _, places in bands)])
        pictures.append(_picture(words, top, rough))
    marked = np.concatenate([np.zeros(0, dtype=np.uint32), *(codes for codes, _ in runs)])
    lengths = np.concatenate([np.zeros(0, dtype=np.int64), *(lengths for _, lengths in runs)])
    codes, place = distinct(marked & RGB)
    counts = _total(place, lengths, len(codes))
    flat = _total(place, lengths * (marked >= FLAT), len(codes))
    strokes = np.concatenate(
        [np.zeros(0, dtype=np.uint32), *(_middles(picture, noise) for picture in pictures)]
    )
    thin = np.bincount(np.searchsorted(codes, strokes), minlength=len(codes))
    colors, flat = rgb_of_words(codes), flat if flat.any() else counts
    return Histogram(colors, counts, flat, thin, noise, tuple(pictures))


def distinct(
    codes: UInt32[np.ndarray, " codes"],
) -> tuple[UInt32[np.ndarray, " n"], Int[np.ndarray, " codes"]]:
    """Return every 24-bit code once, ascending, and each code's place among them."""
    if len(codes) < TABLE_RUNS:
        return np.unique(codes, return_inverse=True)
    seen = np.zeros(1 << 24, dtype=bool)
    seen[codes] = True
    found = np.flatnonzero(seen)
    rank = np.zeros(1 << 24, dtype=np.int32)
    rank[found] = np.arange(len(found))
    return found.astype(np.uint32), rank[codes]


def rgb_of_words(words: UInt32[np.ndarray, "*n"]) -> UInt8[np.ndarray, "*n 3"]:
    """Return the colours of words, whatever their alpha."""
    return np.stack([words & 255, words >> 8 & 255, words >> 16 & 255], axis=-1).astype(np.uint8)


def _total(place: Places, amounts: Places, n: int) -> Int[np.ndarray, " n"]:
    return np.bincount(place, amounts, n).astype(np.int64)


def _covered_rows(rgba: UInt8[np.ndarray, "height width 4"]) -> tuple[Words, int]:
    """Return the rows from first to last covered pixel as words, and the first one's number."""
    words = np.ascontiguousarray(rgba).view("<u4")[..., 0]
    rows = np.flatnonzero(words.max(axis=1, initial=0) >= COVERED_WORD)
    if not len(rows):
        return words[:0], 0
    return words[rows[0] : rows[-1] + 1], int(rows[0])


def _picture(words: Words, top: int, rough: Places) -> Picture:
    width = words.shape[1]
    line = words.ravel()
    column = rough % max(width, 1)
    own = line[rough]
    beside = np.stack(
        [
            line.take(rough + step, mode="clip") if len(line) else own
            for step in (-1, 1, -width, width)
        ]
    )
    beside[0, column == 0] = own[column == 0]
    beside[1, column == width - 1] = own[column == width - 1]
    return Picture(words, top, rough, own, beside)


def _noise(pictures: Sequence[Words]) -> int:
    """Return the levels by which neighbours of one paint may differ in these pictures."""
    steps = np.zeros(256, dtype=np.int64)
    for words in [view for picture in pictures for view in (picture, picture.T)]:
        rows = np.ascontiguousarray(words[:: max(1, words.size // NOISE_PIXELS)])
        both = (rows[:, 1:] >= OPAQUE_WORD) & (rows[:, :-1] >= OPAQUE_WORD)
        away = _difference(rows[:, 1:][both], rows[:, :-1][both])[:, :3].max(axis=1, initial=0)
        steps += np.bincount(away, minlength=256)
    typical = int(np.searchsorted(np.cumsum(steps), TYPICAL * steps.sum()))
    return int(np.clip(round(NOISE_SPREAD * typical), LEAST_NOISE, MOST_NOISE))


def _bands(words: Words, noise: int) -> Iterator[tuple[Runs, Places]]:
    """Yield, some rows at a time, runs of alike opaque pixels, and the places of rough ones.

    A run is a colour, marked where it is flat, and a length.
    """
    height = max(1, BAND_PIXELS // max(words.shape[1], 1))
    for top in range(0, len(words), height):
        above, end = max(top - 1, 0), min(top + height, len(words))
        window = np.ascontiguousarray(words[above : end + 1])  # with a row of the bands beside
        inner = slice(top - above, end - above)
        line, is_flat = window[inner].ravel(), _flat(window, noise)[inner].ravel()
        places = np.flatnonzero(line >= COVERED_WORD)
        own, flat = line[places], is_flat[places]
        opaque = own >= OPAQUE_WORD
        codes = (own & RGB | flat * FLAT)[opaque]
        starts = np.flatnonzero(np.concatenate([[True], codes[1:] != codes[:-1]])[: len(codes)])
        lengths = np.diff(starts, append=len(codes))
        yield (codes[starts], lengths), places[~(flat & opaque)] + top * window.shape[1]


def _flat(words: Words, noise: int) -> Bool[np.ndarray, "rows columns"]:
    """Return where a pixel equals a neighbour at one side, and one above or below."""
    like_left, like_above = np.zeros((2, *words.shape), dtype=bool)
    line = words.ravel()
    like_left.ravel()[1:] = _near(line[1:], line[:-1], noise)
    like_left[:, 0] = False
    like_above[1:] = _near(words[1:], words[:-1], noise)
    beside, over = like_left.copy(), like_above.copy()
    beside[:, :-1] |= like_left[:, 1:]
    over[:-1] |= like_above[1:]
    return beside & over


def _middles(picture: Picture, noise: int) -> UInt32[np.ndarray, " middles"]:
    """Return the colours of opaque pixels darker than both neighbours on two opposite sides."""
    light = _light(picture.own) + 3 * noise
    left, right, above, below = (light < _light(words) for words in picture.beside)
    middle = ((left & right) | (above & below)) & (picture.own >= OPAQUE_WORD)
    return picture.own[middle] & RGB


def _light(words: UInt32[np.ndarray, " words"]) -> Int[np.ndarray, " words"]:
    """Return the sum of the channels; what lies beside the figure is as light as paper."""
    light = (words & 255) + (words >> 8 & 255) + (words >> 16 & 255)
    return np.where(words >= OPAQUE_WORD, light, 4 * 255).astype(np.int32)


def _near(
    a: UInt32[np.ndarray, "*shape"], b: UInt32[np.ndarray, "*shape"], noise: int
) -> Bool[np.ndarray, "*shape"]:
    """Return where two pictures' pixels are equal but for the noise."""
    far = _difference(a, b) > noise
    same: np.ndarray = far.view("<u4")[..., 0] == 0  # its four channels at once
    return same


def _difference(
    a: UInt32[np.ndarray, "*shape"], b: UInt32[np.ndarray, "*shape"]
) -> UInt8[np.ndarray, "*shape 4"]:
    first, second = (np.ascontiguousarray(x)[..., None].view(np.uint8) for x in (a, b))
    return np.maximum(first, second) - np.minimum(first, second)
