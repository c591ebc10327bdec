"""Fit backgrounds that repeat: graph paper, dots, diamonds, checkerboards for transparency.

A pattern is the same in every cell of a lattice of two vectors. They are the nearest two peaks of
the autocorrelation of what has the border's colours, refined at distant multiples; the cell's
colours are medians over all its repetitions, so figures are outliers.
Source: the lattice of autocorrelation peaks, H.-C. Lin, L.-L. Wang, S.-N. Yang, "Extracting
periodicity of a regular texture based on autocorrelation functions" (1997).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.view import Box

MARGIN = 0.08  # of the shorter side: the border that holds at least a part of the pattern
LEAST_MARGIN_PX = 24
BINS = 16  # levels per bin, and bins per channel, of coarse histograms of colours
COMMON = 0.02  # of the border: a colour of the pattern
WINDOW_PX = 640  # side of the part whose autocorrelation shows the nearest peaks
NEAREST_PX = 3
LEAST_ODD = 0.005  # of the border: less in other colours is no pattern
LEAST_PEAK = 0.5  # of the autocorrelation at no lag
FEWEST = 6  # repetitions in the sheet's shorter side
LIKE_THE_BEST = (0.9, 0.75, 0.6)  # of the highest peak: which peaks are looked at
ACROSS = 0.4  # sine of the angle between the two vectors
MOST_SAMPLES = 2_000_000  # pixels that a cell's colours are medians of
EXPLAINED = 0.5  # of the border's pixels that one colour leaves unexplained
ODD = 5  # levels from the commonest colour: another one
STRONG = 90  # percentile of these differences: the pattern's own, of which the half is looked at
CLOSE = 12  # levels from the cell's colours, or half the pattern's contrast: explained


@dataclass(frozen=True, eq=False)
class Plate:
    """A colour for every pixel of a sheet: what it would show without its figures.

    Attributes:
        picture: sRGB.
        typical: the commonest colour.
        evidence: why it is so, for people.
    """

    picture: UInt8[np.ndarray, "height width 3"]
    typical: tuple[int, int, int]
    evidence: str

    def colors(self, box: Box) -> UInt8[np.ndarray, "height width 3"]:
        """Return the colours in a window (x, y, width, height) of the sheet."""
        x, y, width, height = box
        return self.picture[y : y + height, x : x + width]

    def sampled(self, places: tuple[np.ndarray, np.ndarray]) -> Float[np.ndarray, "n 3"]:
        """Return the colours at the pixels (rows, columns) of the sheet."""
        return self.picture[places].astype(np.float64)


@dataclass(frozen=True, eq=False)
class Lattice:
    """Two vectors (x, y) in pixels by which a pattern repeats, as rows."""

    vectors: Float[np.ndarray, "2 2"]

    def phases(self, columns: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the places in the cell, 0 to 1 along either vector, of broadcast pixels."""
        inverse = np.linalg.inv(self.vectors)  # place = phases @ vectors
        u = columns * inverse[0, 0] + rows * inverse[1, 0]
        v = columns * inverse[0, 1] + rows * inverse[1, 1]
        return u - np.floor(u), v - np.floor(v)

    def __str__(self) -> str:
        """Return its vectors, for people."""
        return " and ".join(f"({x:.1f}, {y:.1f}) px" for x, y in self.vectors)

    @property
    def bins(self) -> tuple[int, int]:
        """Return how many cells per vector tell its colours apart: one per pixel."""
        first, second = np.linalg.norm(self.vectors, axis=1)
        return max(round(float(first)), 2), max(round(float(second)), 2)


def fit_pattern(
    rgb: UInt8[np.ndarray, "height width 3"], dominant: tuple[int, int, int]
) -> Plate | None:
    """Return a sheet's repeating background; None if its border does not repeat.

    Args:
        rgb: the sheet.
        dominant: the commonest colour of the border.
    """
    places = np.nonzero(_margin(rgb.shape[:2]))
    step = max(1, len(places[0]) // MOST_SAMPLES)
    border = places[0][::step], places[1][::step]
    contrast = np.abs(rgb[border].astype(np.int16) - np.array(dominant, np.int16)).max(axis=1)
    odd = contrast > ODD
    if np.count_nonzero(odd) <= LEAST_ODD * odd.size:
        return None
    odd = contrast > max(ODD, np.percentile(contrast[odd], STRONG) / 2)  # JPEG's ripples are less
    close = min(CLOSE, float(np.median(contrast[odd])) / 2)
    common = _common_colors(rgb[border], odd, dominant)
    window = rgb[:WINDOW_PX, :WINDOW_PX]
    found = _lattices(_lags(window, common[_codes(window)]), min(rgb.shape[:2]))
    if not found:
        return None
    like = common[_codes(rgb)]
    lags = _lags(rgb, like)
    for coarse in found:
        lattice = Lattice(np.stack([_refined(lags, vector) for vector in coarse.vectors]))
        if not _are_across(lattice.vectors[0], lattice.vectors[1:])[0]:
            continue  # both came to the same peak
        low, high = _cell(rgb, like, lattice)
        plate = _laid(rgb, lattice, low, high)
        off = cv2.absdiff(rgb, plate).max(axis=2)
        explained = float(np.mean(off[border][odd] <= close))
        if explained >= EXPLAINED and _shows_figures(off > close, lattice):
            return Plate(plate, dominant, f"repeats every {lattice}")
    return None


def _margin(shape: tuple[int, int]) -> Bool[np.ndarray, "height width"]:
    width = min(max(LEAST_MARGIN_PX, round(MARGIN * min(shape))), min(shape) // 2)
    border = np.ones(shape, dtype=bool)
    border[width : shape[0] - width, width : shape[1] - width] = False
    return border


def _common_colors(
    colors: UInt8[np.ndarray, "n 3"], odd: Bool[np.ndarray, " n"], dominant: tuple[int, int, int]
) -> Bool[np.ndarray, " codes"]:
    """Return the border's common colours and the blends of the two commonest, by their codes."""
    counts = np.bincount(_codes(colors), minlength=BINS**3)
    second = np.bincount(_codes(colors[odd]), minlength=BINS**3).argmax()
    grid = np.stack(np.unravel_index(np.arange(BINS**3), (BINS,) * 3), axis=1)
    middles = (grid + 0.5) * BINS
    start = np.array(dominant, dtype=np.float64)
    along = middles[second] - start
    share = np.clip((middles - start) @ along / max(along @ along, 1e-9), 0, 1)
    off = np.abs(middles - start - share[:, None] * along).max(axis=1)
    return (counts >= COMMON * counts.sum()) | (off <= BINS)


def _codes(rgb: UInt8[np.ndarray, "*n 3"]) -> Int[np.ndarray, "*n"]:
    bins = (rgb // BINS).astype(np.uint16)
    return (bins[..., 0] * BINS + bins[..., 1]) * BINS + bins[..., 2]


def _lattices(lags: Float[np.ndarray, "lags_y lags_x"], shorter_side: int) -> list[Lattice]:
    """Return the lattices that the peaks of an autocorrelation allow, the finest of each height."""
    peaks, heights = _peaks(lags)
    found: list[Lattice] = []
    if heights.max(initial=0.0) < LEAST_PEAK:
        return found
    lengths = np.linalg.norm(peaks, axis=1)
    for share in LIKE_THE_BEST:
        high = heights >= share * heights.max()
        first = peaks[high][lengths[high].argmin()]
        beside = high & _are_across(first, peaks)
        if not beside.any():
            continue
        second = peaks[beside][lengths[beside].argmin()]
        vectors = np.stack([first, second])
        often = np.linalg.norm(vectors, axis=1).max() * FEWEST <= shorter_side
        if often and not any(np.array_equal(vectors, one.vectors) for one in found):
            found.append(Lattice(vectors))
    return found


def _are_across(
    first: Float[np.ndarray, " 2"], others: Float[np.ndarray, "n 2"]
) -> Bool[np.ndarray, " n"]:
    """Return which vectors lead far enough aside of the first to span a lattice with it."""
    areas = np.abs(first[0] * others[:, 1] - first[1] * others[:, 0])
    across: Bool[np.ndarray, " n"] = areas > ACROSS * np.linalg.norm(
        others, axis=1
    ) * np.linalg.norm(first)
    return across


def _lags(
    rgb: UInt8[np.ndarray, "height width 3"], like: Bool[np.ndarray, "height width"]
) -> Float[np.ndarray, "lags_y lags_x"]:
    """Return the autocorrelation of the channel that varies most among the border's colours."""
    tones = rgb[like][:: max(1, int(like.sum()) // MOST_SAMPLES)].astype(np.float32)
    channel = int(tones.std(axis=0).argmax())
    signal = np.where(like, rgb[..., channel] - tones[:, channel].mean(), 0)
    return _autocorrelation(signal.astype(np.float32), like)


def _autocorrelation(
    signal: Float[np.ndarray, "rows columns"], like: Bool[np.ndarray, "rows columns"]
) -> Float[np.ndarray, "lags_y lags_x"]:
    """Return the autocorrelation at lags from minus to plus half the size, 1 at the centre."""
    half = [side // 2 for side in signal.shape]
    size = [cv2.getOptimalDFTSize(side + h) for side, h in zip(signal.shape, half, strict=True)]
    both = []
    for picture in (signal, like.astype(np.float32)):
        padded = np.zeros(size, np.float32)
        padded[: picture.shape[0], : picture.shape[1]] = picture
        spectrum = cv2.dft(padded)
        power = cv2.mulSpectrums(spectrum, spectrum, 0, conjB=True)
        lags = cv2.idft(power, flags=cv2.DFT_SCALE)
        both.append(np.roll(lags, half, axis=(0, 1))[: 2 * half[0] + 1, : 2 * half[1] + 1])
    pairs = np.maximum(both[1], 0.05 * both[1][half[0], half[1]])
    result = both[0] / pairs
    return np.asarray(result / max(float(result[half[0], half[1]]), 1e-9), dtype=np.float32)


def _peaks(
    lags: Float[np.ndarray, "lags_y lags_x"],
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, " n"]]:
    """Return lags (x, y) of the positive local maxima but the central one, and their heights."""
    middle = lags.shape[0] // 2, lags.shape[1] // 2
    top = (lags >= cv2.dilate(lags, np.ones((5, 5), np.uint8))) & (lags > 0)
    top[: middle[0]] = False  # the other half mirrors this one
    rows, columns = np.nonzero(top)
    lag = np.stack([columns - middle[1], rows - middle[0]], axis=1).astype(np.float64)
    away = np.linalg.norm(lag, axis=1) >= NEAREST_PX
    return lag[away], lags[rows, columns][away]


def _refined(
    lags: Float[np.ndarray, "lags_y lags_x"], vector: Float[np.ndarray, " 2"]
) -> Float[np.ndarray, " 2"]:
    """Return a lattice vector from the peaks at its multiples, each twice as far as the last."""
    middle = np.array([lags.shape[1] // 2, lags.shape[0] // 2])
    times = 1
    while True:
        place = middle + times * vector
        peak = _peak_near(lags, place)
        if peak is None or np.linalg.norm(peak - middle) < NEAREST_PX:
            return vector
        vector = (peak - middle) / times
        times *= 2


def _peak_near(
    lags: Float[np.ndarray, "lags_y lags_x"], place: Float[np.ndarray, " 2"]
) -> Float[np.ndarray, " 2"] | None:
    """Return the sub-pixel maximum within 2 pixels of a place (x, y); None at the rim."""
    x, y = (round(float(value)) for value in place)
    if not (3 <= x < lags.shape[1] - 3 and 3 <= y < lags.shape[0] - 3):
        return None
    near = lags[y - 2 : y + 3, x - 2 : x + 3]
    row, column = divmod(int(near.argmax()), 5)
    x, y = x + column - 2, y + row - 2
    best = []
    for line in (lags[y, x - 1 : x + 2], lags[y - 1 : y + 2, x]):
        curve = float(line[0] - 2 * line[1] + line[2])
        best.append(0.5 * float(line[0] - line[2]) / curve if curve < -1e-9 else 0.0)
    return np.array([x, y]) + np.clip(best, -0.5, 0.5)


def _cell(
    rgb: np.ndarray, like: Bool[np.ndarray, "height width"], lattice: Lattice
) -> tuple[UInt8[np.ndarray, "bins_u bins_v 3"], UInt8[np.ndarray, "bins_u bins_v 3"]]:
    """Return the darkest and lightest colour of every place of the cell and those beside it."""
    rows, columns = np.nonzero(like)
    step = max(1, len(rows) // MOST_SAMPLES)
    rows, columns = rows[::step], columns[::step]
    u, v = lattice.phases(columns, rows)
    bins = lattice.bins
    number = _bin(u, bins[0]) * bins[1] + _bin(v, bins[1])
    cell = _medians(rgb[rows, columns], number, bins[0] * bins[1]).reshape(*bins, 3)
    shifts = [(down, right) for down in (-1, 0, 1) for right in (-1, 0, 1)]
    near = np.stack([np.roll(cell, shift, axis=(0, 1)) for shift in shifts])
    light = near.sum(axis=3, dtype=np.int32)
    low, high = (
        np.take_along_axis(near, chosen[None, ..., None], axis=0)[0]
        for chosen in (light.argmin(axis=0), light.argmax(axis=0))
    )
    return low, high


def _bin(phase: np.ndarray, bins: int) -> np.ndarray:
    return np.rint(phase * bins).astype(np.int64) % bins


def _medians(
    colors: UInt8[np.ndarray, "n 3"], number: Int[np.ndarray, " n"], count: int
) -> UInt8[np.ndarray, "count 3"]:
    """Return the median colour of every number; the colours' median where there is none."""
    result = np.repeat(np.median(colors, axis=0)[None], count, axis=0)
    order = np.argsort(number, kind="stable")
    ends = np.searchsorted(number[order], np.arange(count + 1))
    sorted_colors = colors[order]
    for k in np.flatnonzero(np.diff(ends)):
        result[k] = np.median(sorted_colors[ends[k] : ends[k + 1]], axis=0)
    return np.rint(result).astype(np.uint8)


def _laid(
    rgb: UInt8[np.ndarray, "height width 3"], lattice: Lattice, low: np.ndarray, high: np.ndarray
) -> UInt8[np.ndarray, "height width 3"]:
    """Return the blends of the pattern's colours at each place that are nearest to the sheet's."""
    result = np.empty_like(rgb)
    columns = np.arange(rgb.shape[1])[None]
    for top in range(0, len(rgb), 256):
        part = rgb[top : top + 256]
        u, v = lattice.phases(columns, np.arange(top, top + len(part))[:, None])
        place = _bin(u, low.shape[0]), _bin(v, low.shape[1])
        start = low[place].astype(np.float32)
        along = high[place] - start
        share = ((part - start) * along).sum(axis=2) / np.maximum((along**2).sum(axis=2), 1)
        blend = start + np.clip(share, 0, 1)[..., None] * along
        result[top : top + 256] = np.rint(blend)
    return result


def _shows_figures(paint: Bool[np.ndarray, "height width"], lattice: Lattice) -> bool:
    """Return whether something is left that is larger than the pattern's cells."""
    stats = cv2.connectedComponentsWithStats(paint.view(np.uint8), connectivity=8)[2]
    tallest = int(stats[1:, cv2.CC_STAT_HEIGHT].max(initial=0))
    return tallest >= 2 * float(np.linalg.norm(lattice.vectors, axis=1).max())
