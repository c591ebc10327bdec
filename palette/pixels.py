"""A character's pixels, counted by colour: all of them, and those that lie within flat paint.

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

from toonset.palette.mixed import OPAQUE

LEAST_NOISE = 2  # levels: a painted gradient's step from one pixel to the next
MOST_NOISE = 12  # levels: more is an edge, in whatever file
TYPICAL = 0.4  # of the steps between neighbours: less than half, for edges are steps, too
NOISE_SPREAD = 1.5  # noise's typical step times this holds most of them
BAND_PIXELS = 2**18  # worked on at a time: stays in the processor's cache
TABLE_RUNS = 2**20  # from so many on, counting in a table of all colours beats sorting
FLAT, THIN = np.uint32(1 << 24), np.uint32(1 << 25)  # marks in the byte that held alpha
NOTHING = np.uint32(0xFFFFFFFF)
OPAQUE_WORD = np.uint32(OPAQUE << 24)
RGB = np.uint32(0xFFFFFF)

Words = UInt32[np.ndarray, "rows columns"]


@dataclass(frozen=True, eq=False)
class Histogram:
    """How often every colour occurs.

    Attributes:
        colors: (n, 3) sRGB, each once, sorted by blue, then green, then red.
        counts: (n,) pixels.
        flat: (n,) pixels within flat paint; all, where a picture has none.
        thin: (n,) pixels in the middle of thin dark strokes.
        noise: levels by which neighbours of one paint may differ.
    """

    colors: UInt8[np.ndarray, "n 3"]
    counts: Int[np.ndarray, " n"]
    flat: Int[np.ndarray, " n"]
    thin: Int[np.ndarray, " n"]
    noise: int


def count_pixels(images: Sequence[UInt8[np.ndarray, "_ _ 4"]]) -> Histogram:
    """Return how often every colour occurs in the opaque pixels of several pictures."""
    pictures = [words_of(image)[box_of(image)] for image in images]
    noise = _noise(pictures)
    runs = [_runs(band, noise) for words in pictures for band in bands(words, noise)]
    marked = np.concatenate([np.zeros(0, dtype=np.uint32), *(codes for codes, _ in runs)])
    lengths = np.concatenate([np.zeros(0, dtype=np.int64), *(lengths for _, lengths in runs)])
    codes, place = _distinct(marked & RGB)

    def total(of: Int[np.ndarray, " runs"]) -> Int[np.ndarray, " n"]:
        return np.bincount(place, of, len(codes)).astype(np.int64)

    colors = np.stack([codes & 255, codes >> 8 & 255, codes >> 16], axis=1).astype(np.uint8)
    flat, thin = (total(lengths * ((marked & bit) > 0)) for bit in (FLAT, THIN))
    counts = total(lengths)
    return Histogram(colors, counts, flat if flat.any() else counts, thin, noise)


@dataclass(frozen=True, eq=False)
class Band:
    """Some rows of a picture, with a row of the bands before and after.

    Attributes:
        words: the pixels.
        flat: which of them are flat.
        inner: the band's own rows.
    """

    words: Words
    flat: Bool[np.ndarray, "rows columns"]
    inner: slice


def words_of(rgba: UInt8[np.ndarray, "height width 4"]) -> Words:
    """Return one word per pixel: alpha, blue, green, red; no copy where the picture allows."""
    return np.ascontiguousarray(rgba).view("<u4")[..., 0]


def box_of(rgba: UInt8[np.ndarray, "height width 4"]) -> tuple[slice, slice]:
    """Return rows and columns of the box round the opaque pixels."""
    opaque = words_of(rgba) >= OPAQUE_WORD
    rows, columns = np.flatnonzero(opaque.any(axis=1)), np.flatnonzero(opaque.any(axis=0))
    if not len(rows):
        return slice(0), slice(0)
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def bands(words: Words, noise: int) -> Iterator[Band]:
    """Yield a picture's rows in bands."""
    height = max(1, BAND_PIXELS // max(words.shape[1], 1))
    for top in range(0, len(words), height):
        above, end = max(top - 1, 0), min(top + height, len(words))
        window = words[above : end + 1]
        flat = _flat(window, noise) & (window >= OPAQUE_WORD)
        yield Band(window, flat, slice(top - above, end - above))


def _noise(pictures: Sequence[Words]) -> int:
    """Return the levels by which neighbours of one paint may differ in these pictures."""
    steps = np.zeros(256, dtype=np.int64)
    for words in [view for picture in pictures for view in (picture, picture.T)]:
        rows = np.ascontiguousarray(words[:: max(1, words.size // BAND_PIXELS)])
        both = (rows[:, 1:] >= OPAQUE_WORD) & (rows[:, :-1] >= OPAQUE_WORD)
        away = _difference(rows[:, 1:], rows[:, :-1])[both][:, :3].max(axis=-1, initial=0)
        steps += np.bincount(away, minlength=256)
    typical = int(np.searchsorted(np.cumsum(steps), TYPICAL * steps.sum()))
    return int(np.clip(round(NOISE_SPREAD * typical), LEAST_NOISE, MOST_NOISE))


def _runs(band: Band, noise: int) -> tuple[UInt32[np.ndarray, " runs"], Int[np.ndarray, " runs"]]:
    """Return runs of alike opaque pixels: colour with marks, and length."""
    marked = (band.words & RGB) | band.flat * FLAT | _thin(band.words, noise) * THIN
    marked[band.words < OPAQUE_WORD] = NOTHING
    codes = marked[band.inner].ravel()
    starts = np.flatnonzero(np.concatenate([[True], codes[1:] != codes[:-1]]))
    lengths = np.diff(starts, append=codes.size)
    seen = codes[starts] != NOTHING
    return codes[starts][seen], lengths[seen]


def _flat(words: Words, noise: int) -> Bool[np.ndarray, "rows columns"]:
    """Return where a pixel equals a neighbour at one side, and one above or below."""
    beside, over = np.zeros(words.shape, dtype=bool), np.zeros(words.shape, dtype=bool)
    same = _near(words[:, 1:], words[:, :-1], noise)
    beside[:, 1:] |= same
    beside[:, :-1] |= same
    same = _near(words[1:], words[:-1], noise)
    over[1:] |= same
    over[:-1] |= same
    return beside & over


def _thin(words: Words, noise: int) -> Bool[np.ndarray, "rows columns"]:
    """Return where a pixel is darker than both neighbours on two opposite sides."""
    channels = _channels(words).astype(np.uint16)
    light = channels[..., 0] + channels[..., 1] + channels[..., 2]
    light[words < OPAQUE_WORD] = 4 * 255  # what lies beside the figure is paper
    darker = light + np.uint16(3 * noise)
    thin = np.zeros(words.shape, dtype=bool)
    thin[:, 1:-1] = (darker[:, 1:-1] < light[:, :-2]) & (darker[:, 1:-1] < light[:, 2:])
    thin[1:-1] |= (darker[1:-1] < light[:-2]) & (darker[1:-1] < light[2:])
    return thin


def _near(a: Words, b: Words, noise: int) -> Bool[np.ndarray, "rows columns"]:
    """Return where two pictures' pixels are equal but for the noise."""
    far = _difference(a, b) > noise
    same: np.ndarray = far.view("<u4")[..., 0] == 0  # its four channels at once
    return same


def _difference(a: Words, b: Words) -> UInt8[np.ndarray, "rows columns 4"]:
    first, second = _channels(a), _channels(b)
    return np.maximum(first, second) - np.minimum(first, second)


def _channels(words: Words) -> UInt8[np.ndarray, "rows columns 4"]:
    return np.ascontiguousarray(words)[..., None].view(np.uint8)


def _distinct(
    codes: UInt32[np.ndarray, " runs"],
) -> tuple[UInt32[np.ndarray, " n"], Int[np.ndarray, " runs"]]:
    """Return every code once, sorted, and each code's place among them."""
    if len(codes) < TABLE_RUNS:
        return np.unique(codes, return_inverse=True)
    seen = np.zeros(1 << 24, dtype=bool)
    seen[codes] = True
    found = np.flatnonzero(seen)
    rank = np.zeros(1 << 24, dtype=np.int32)
    rank[found] = np.arange(len(found))
    return found.astype(np.uint32), rank[codes]
