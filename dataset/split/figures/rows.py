"""Find groups of equal figures: rows of one height on one ground line, and rank them.

A turnaround is a group: a row of whole drawings, or several rows as high. Beside it a page shows
busts, expressions, poses and props, often more of them. Three things tell the turnaround: it is
drawn largest, it is several, and its outlines come again, mirrored from behind or from the other
side, as those of poses do not.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.dataset.split.figures.blobs import LEAST_AREA, LEAST_SPECK, RECTANGLE, Blobs, rows_of
from toonset.dataset.split.figures.text_and_swatches import find_letters

LOWEST = 0.75  # of the group's median height: lower drawings are studies or props
HIGHEST = 1.45  # of the same: higher ones, too
THIN = 0.006  # of its longer side, a patch's mean thickness: less is a line
LARGE = 0.02  # of the largest patch's area: smaller things make no group
OFF_ROW = 0.05  # of their height: the figures of a row stand on one line
LEAST_ROW = 3  # figures on one line: they make a row
AS_HIGH = 0.88  # of a row's height: another row that is lower is no part of its group
MOST_COUNTED = 4  # figures of a group: more speak no more for a turnaround
ALONE = 0.5  # likeness of a figure alone, to set beside that of figures in a row
SAME_OUTLINE = 0.75  # IoU of two drawings of one figure from one direction
CLEARLY_SAME = 0.06  # IoU, mean of a row: so much more alike as they are than mirrored
ROWS = 64  # at which outlines are compared
MOST_COMPARED = 64  # figures of one group or row


@dataclass(frozen=True, eq=False)
class Group:
    """Equal figures of a sheet.

    Attributes:
        rows: from the top, numbers of the patches of each row from left to right.
        height: median of the figures' heights, in cells.
        likeness: mean square of how well each figure's outline covers that of the most like other
            one, mirrored or not: IoU, 0 to 1; `ALONE` squared where there is nothing to compare.
        outfits: its rows show the same directions, so in other clothes.
    """

    rows: tuple[Int[np.ndarray, " row"], ...]
    height: float
    likeness: float
    outfits: bool

    @property
    def members(self) -> Int[np.ndarray, " figures"]:
        """Return the numbers of all its patches, in reading order."""
        return np.concatenate(self.rows)

    @property
    def merit(self) -> float:
        """Return how much speaks for a turnaround: size, number, and outlines that come again."""
        counted = min(len(self.members), MOST_COUNTED)
        return counted * self.height**3 * self.likeness


@dataclass(frozen=True)
class Taken:
    """Which figures of a sheet are wanted.

    Attributes:
        group: number of the group, from 0, the likeliest turnaround.
        outfit: number of its row, from 0; None: all of them.
    """

    group: int = 0
    outfit: int | None = None

    def of(self, groups: tuple[Group, ...]) -> Int[np.ndarray, " bodies"]:
        """Return the figures' numbers; none where there is no such group or row."""
        if self.group >= len(groups):
            return np.zeros(0, dtype=int)
        group = groups[self.group]
        if self.outfit is None:
            return group.members
        return group.rows[self.outfit] if self.outfit < len(group.rows) else np.zeros(0, dtype=int)


LIKELIEST = Taken()


def find_groups(blobs: Blobs) -> tuple[Group, ...]:
    """Return the groups of figures, the likeliest turnaround first; () where nothing is drawn.

    After the first, single drawings come last.
    """
    candidates = _candidates(blobs)
    if not len(candidates):
        return ()
    rows = [
        (number, part)
        for number, row in enumerate(rows_of(blobs.boxes[candidates], blobs.centers[candidates]))
        for part in _of_one_height(blobs, candidates[row])
    ]
    joined = list[dict[int, np.ndarray]]()  # parts of one row are apart for a reason
    for number, row in sorted(rows, key=lambda row: -_weight(blobs, row[1])):
        height = float(np.median(blobs.boxes[row, 3]))
        for others in joined:
            first = float(np.median(blobs.boxes[next(iter(others.values())), 3]))
            if number not in others and AS_HIGH <= height / first <= 1 / AS_HIGH:
                others[number] = row
                break
        else:
            joined.append({number: row})
    groups = [_group(blobs, [*rows.values()], alone=len(joined) == 1) for rows in joined]
    likeliest, *rest = sorted(groups, key=lambda group: -group.merit)
    return (likeliest, *sorted(rest, key=lambda group: len(group.members) == 1))


def _candidates(blobs: Blobs) -> Int[np.ndarray, " candidates"]:
    """Return the patches that may be figures."""
    large = np.flatnonzero(blobs.areas >= LEAST_SPECK)
    letters = np.zeros(len(blobs.areas), dtype=bool)
    lines = _are_lines(blobs)
    if not lines[large].all():
        large = large[~lines[large]]
    tallest = int(blobs.boxes[large, 3].max(initial=0))
    letters[large] = find_letters(blobs.boxes[large], tallest)
    fill = blobs.areas / (blobs.boxes[:, 2] * blobs.boxes[:, 3])
    drawn = large[~letters[large]]
    figurative = drawn[fill[drawn] < RECTANGLE]
    for candidates in (figurative, drawn, large):  # a sheet of boxes still has views
        if len(candidates):
            areas = blobs.areas[candidates]
            return candidates[areas >= LARGE * areas.max()]
    return large


def _are_lines(blobs: Blobs) -> Bool[np.ndarray, " blobs"]:
    """Find patches that are long lines, such as a frame drawn by hand; a spear is thicker."""
    sides = blobs.boxes[:, 2:]
    return np.asarray(blobs.areas < THIN * sides.max(axis=1) * sides.sum(axis=1))


def _of_one_height(blobs: Blobs, row: Int[np.ndarray, " row"]) -> list[Int[np.ndarray, " figures"]]:
    """Return the parts of a row whose patches are about equally high, the weightiest first."""
    parts, rest = [], row
    while len(rest):
        heights, areas = blobs.boxes[rest, 3], blobs.areas[rest]
        best, most = np.zeros(len(rest), dtype=bool), -1.0
        for height in np.unique(heights):
            alike = (heights >= LOWEST * height) & (heights <= height / LOWEST)
            alike &= areas >= LEAST_AREA * np.median(areas[alike])
            middle = float(np.median(heights[alike]))
            alike &= (heights >= LOWEST * middle) & (heights <= HIGHEST * middle)
            weight = _weight(blobs, rest[alike])
            if weight > most:
                best, most = alike, weight
        best[best] = ~_strays(blobs, rest[best])
        parts.append(rest[best])
        rest = rest[~best]
    return parts


def _strays(blobs: Blobs, row: Int[np.ndarray, " row"]) -> Bool[np.ndarray, " row"]:
    """Return which patches of a row neither stand in line with most of it nor look like it."""
    none = np.zeros(len(row), dtype=bool)
    if not LEAST_ROW < len(row) <= MOST_COMPARED:
        return none
    height = np.median(blobs.boxes[row, 3])
    ends = np.stack([blobs.boxes[row, 1], blobs.boxes[row, 1] + blobs.boxes[row, 3]], axis=1)
    away = np.abs(ends[:, None] - ends) / height
    level = (away.max(axis=2) <= OFF_ROW).sum(axis=1).argmax()
    standing = away[level].max(axis=1) <= OFF_ROW
    off = away[level].min(axis=1) > OFF_ROW
    if standing.sum() < LEAST_ROW or not off.any():
        return none
    outlines = [outline(blobs.mask(int(number))) for number in row]
    usual = likeness([outlines[i] for i in np.flatnonzero(standing)]).min()
    for i in np.flatnonzero(off):
        none[i] = max(_alike(outlines[i], outlines[j]) for j in np.flatnonzero(standing)) < usual
    return none


def _weight(blobs: Blobs, row: Int[np.ndarray, " row"]) -> float:
    """Return how much a row explains: area, number, and height."""
    if not len(row):
        return 0.0
    return float(blobs.areas[row].sum() * len(row) * np.median(blobs.boxes[row, 3]) ** 2)


def _group(blobs: Blobs, parts: list[np.ndarray], *, alone: bool) -> Group:
    """Return rows as a group; the only one of a sheet need not be compared with others."""
    members = np.concatenate(parts)
    order = rows_of(blobs.boxes[members], blobs.centers[members])
    rows = tuple(members[row] for row in order)
    alike = ALONE**2
    if not alone and len(members) > 1:
        outlines = [outline(blobs.mask(int(n))) for n in members[:MOST_COMPARED]]
        alike = float(np.mean(likeness(outlines) ** 2))
    height = float(np.median(blobs.boxes[members, 3]))
    return Group(rows, height, alike, _are_outfits(blobs, rows))


def _are_outfits(blobs: Blobs, rows: tuple[np.ndarray, ...]) -> bool:
    """Return whether the rows show the same directions one below the other.

    A second row of a turnaround goes on turning: its outlines are mirror images of the first's.
    """
    columns = {len(row) for row in rows}
    if not 2 <= len(rows) <= 26 or len(columns) > 1:  # a letter each
        return False
    if not 2 <= max(columns) <= MOST_COMPARED:
        return False
    first, *others = [[outline(blobs.mask(int(number))) for number in row] for row in rows]
    for row in others:
        pairs = [*zip(first, row, strict=True)]
        same = np.array([_overlap(a, b) for a, b in pairs])
        turned = np.array([_overlap(a, b[:, ::-1]) for a, b in pairs])
        if same.min() < SAME_OUTLINE or (same - turned).mean() < CLEARLY_SAME:
            return False
    return True


def outline(figure: Bool[np.ndarray, "height width"]) -> Bool[np.ndarray, "rows width"]:
    """Return a figure that fills its window, `ROWS` high."""
    mask = np.ascontiguousarray(figure).view(np.uint8)
    width = max(1, round(mask.shape[1] * ROWS / mask.shape[0]))
    covered = cv2.resize(255 * mask, (width, ROWS), interpolation=cv2.INTER_AREA)
    return covered > covered.max() // 2  # of what is thin, too, something is left


def likeness(outlines: list[np.ndarray]) -> Float[np.ndarray, " figures"]:
    """Return per outline its best overlap with another one, mirrored or not."""
    found = np.zeros(len(outlines))
    for i, j in combinations(range(len(outlines)), 2):
        both = _alike(outlines[i], outlines[j])
        found[i], found[j] = max(found[i], both), max(found[j], both)
    return found


def _alike(a: Bool[np.ndarray, "rows _"], b: Bool[np.ndarray, "rows _"]) -> float:
    """Return how well two outlines cover each other, mirrored or not."""
    return max(_overlap(a, b), _overlap(a, b[:, ::-1]))


def _overlap(a: Bool[np.ndarray, "rows _"], b: Bool[np.ndarray, "rows _"]) -> float:
    """Return the largest IoU of two outlines that are shifted sideways."""
    length = a.shape[1] + b.shape[1]
    spectra = [np.fft.rfft(mask.astype(np.float32), length, axis=1) for mask in (a, b)]
    shared = np.fft.irfft((spectra[0] * spectra[1].conj()).sum(axis=0), length).max()
    return float(shared / (a.sum() + b.sum() - shared))
