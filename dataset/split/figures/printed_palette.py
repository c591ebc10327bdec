"""Find the palette that a sheet prints: patches of plain colour, alike, side by side.

A swatch is a connected patch of one colour, flat up to the file's noise, that fills its outline: a
rectangle, rounded or not, or a disc. Swatches of a palette are equally large, or equally high in
one strip; they stand at even steps in a row, in a column or in rows of a grid, three or more of
them, in different colours. What a figure's body holds is paint, so nothing is looked for there;
and what touches much else that is painted (the pixels of a small drawing) is part of that.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.dataset.split.figures.blobs import Blobs
from toonset.dataset.split.figures.text_and_swatches import connected
from toonset.palette.colors import JUST_NOTICEABLE, oklab_from_rgb

FEWEST = 3  # swatches make a palette, in so many colours
LEAST_SIDE = 8  # cells
LEAST_OF_HEIGHT = 0.015  # of a figure's height: its side
MOST_OF_HEIGHT = 0.6  # of the same
STEP = 14  # levels between neighbours: more is an edge
PLAIN = 6  # levels: the median pixel's distance from the colour; JPEG's noise is less
FILLED = 0.6  # of its box that a swatch's own colour fills: its code may be written on it
OUTLINE = 0.85  # of its box that a rectangle's outline fills
DISC = (0.7, 0.86)  # of its box that a disc's or a well rounded square's outline fills
ROUND = 1.15  # times as long as wide, at most, is a disc
EQUAL = 0.15  # of its size: others differ by no more
SOFT = 3  # cells: soft edges take so much more of one than of another
TOUCHING = 0.12  # of its size: a line between the swatches of a strip is no thicker
FARTHEST = 3.0  # times its size, from middle to middle
ON_GROUND = 0.4  # of what lies round a swatch of a strip that is ground
MOST_MISSED = 2  # swatches beyond either end of a line
EVEN = 0.25  # of the median step that others may differ by
ALONE = 0.6  # of the paint that touches them that swatches, with their outlines, are
LINE = 4  # cells: an outline with its soft edge is no thicker
APART = 2 * JUST_NOTICEABLE  # in OKLab: two colours


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of plain colour.

    Attributes:
        boxes: x, y, width, height in cells.
        rgb: their colours.
    """

    boxes: Int[np.ndarray, "n 4"]
    rgb: UInt8[np.ndarray, "n 3"]

    def of(self, chosen: np.ndarray) -> Patches:
        """Return some of them."""
        return Patches(self.boxes[chosen], self.rgb[chosen])


def find_printed_palette(
    rgb: UInt8[np.ndarray, "height width 3"], blobs: Blobs, main_blobs: Int[np.ndarray, " bodies"]
) -> Patches:
    """Return the swatches of the palettes that a sheet prints, each palette in reading order.

    Args:
        rgb: the sheet, in cells.
        blobs: what is painted on it.
        main_blobs: the bodies of the views.
    """
    if min(rgb.shape[:2]) < LEAST_SIDE or not len(main_blobs):
        return Patches(np.zeros((0, 4), dtype=np.int64), np.zeros((0, 3), dtype=np.uint8))
    height = float(np.median(blobs.boxes[main_blobs, 3]))
    beside = _beside_bodies(blobs, main_blobs)
    found = _patches(
        rgb, beside, max(LEAST_SIDE, LEAST_OF_HEIGHT * height), MOST_OF_HEIGHT * height
    )
    boxes, colors = [np.zeros((0, 4), dtype=np.int64)], [np.zeros((0, 3), dtype=np.uint8)]
    for group in _groups(found):
        own = _with_missed(found.of(group), rgb)
        if len(_distinct(own.rgb)) >= FEWEST and _stands_alone(own.boxes, rgb, blobs, main_blobs):
            own = own.of(_reading_order(own.boxes))
            known = np.concatenate(boxes)
            own = own.of(np.array([not _overlap(box, known).any() for box in own.boxes], bool))
            boxes.append(own.boxes)
            colors.append(own.rgb)
    return Patches(np.concatenate(boxes), np.concatenate(colors))


def are_swatches(
    printed: Patches, blobs: Blobs, numbers: Int[np.ndarray, " n"]
) -> Bool[np.ndarray, " n"]:
    """Return which patches of paint mostly lie in swatches of a printed palette."""
    if not len(printed.boxes):
        return np.zeros(len(numbers), dtype=bool)
    within = np.zeros(blobs.labels.shape, dtype=bool)
    for box in printed.boxes:
        within[_round(box, LINE)] = True
    own = np.bincount(blobs.labels[within], minlength=len(blobs.areas) + 1)[1:]
    share: Bool[np.ndarray, " n"] = own[numbers] >= ALONE * blobs.areas[numbers]
    return share


def _beside_bodies(blobs: Blobs, main_blobs: np.ndarray) -> Bool[np.ndarray, "height width"]:
    """Return the boxes of all that is no body, without the bodies."""
    beside = np.zeros(blobs.labels.shape, dtype=bool)
    for number in np.setdiff1d(np.flatnonzero(blobs.areas >= LEAST_SIDE), main_blobs):
        beside[blobs.window(int(number))] = True
    is_main = np.zeros(len(blobs.areas) + 1, dtype=bool)
    is_main[main_blobs + 1] = True
    return beside & ~is_main[blobs.labels]


def _patches(
    rgb: UInt8[np.ndarray, "height width 3"],
    where: Bool[np.ndarray, "height width"],
    least: float,
    most: float,
) -> Patches:
    """Return the patches of plain colour, of a swatch's size and outline."""
    rgb = cv2.medianBlur(np.ascontiguousarray(rgb), 3)  # JPEG's ringing goes, edges stay
    flat = where.copy()
    flat[:, 1:] &= _step(rgb[:, 1:], rgb[:, :-1]) <= STEP
    flat[1:] &= _step(rgb[1:], rgb[:-1]) <= STEP
    _, labels, stats, _ = cv2.connectedComponentsWithStats(flat.view(np.uint8), connectivity=4)
    wide, high, area = stats[:, 2], stats[:, 3], stats[:, 4]
    able = (np.minimum(wide, high) >= least - 1) & (np.maximum(wide, high) <= most)
    able &= area >= FILLED * wide * high
    able[0] = False
    boxes, colors = [], []
    for number in np.flatnonzero(able):
        x, y, width, height = stats[number, :4].tolist()
        window = slice(y, y + height), slice(x, x + width)
        own = labels[window] == number
        pixels = rgb[window][own]
        color = np.median(pixels, axis=0)
        fill = _outlined(own)
        is_disc = DISC[0] <= fill <= DISC[1] and max(width, height) <= ROUND * min(width, height)
        plain = np.median(np.abs(pixels - color).max(axis=1)) <= PLAIN
        if plain and (fill >= OUTLINE or is_disc):
            boxes.append([x, y, width, height])
            colors.append(np.rint(color))
    return Patches(
        np.array(boxes, dtype=np.int64).reshape(-1, 4),
        np.array(colors, dtype=np.uint8).reshape(-1, 3),
    )


def _step(a: np.ndarray, b: np.ndarray) -> UInt8[np.ndarray, "height width"]:
    more: np.ndarray = cv2.absdiff(np.ascontiguousarray(a), np.ascontiguousarray(b)).max(axis=2)
    return more


def _outlined(own: Bool[np.ndarray, "height width"]) -> float:
    """Return the share of its box that a patch fills with all that it encloses."""
    paths, _ = cv2.findContours(own.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = np.zeros(own.shape, dtype=np.uint8)
    cv2.drawContours(filled, paths, -1, 1, cv2.FILLED)
    return float(filled.mean())


def _groups(found: Patches) -> list[Int[np.ndarray, " own"]]:
    """Return the palettes: patches of one shape that stand at even steps, as numbers."""
    number = len(found.boxes)
    if number < FEWEST:
        return []
    size = found.boxes[:, 2:].astype(float)
    middle = found.boxes[:, :2] + size / 2
    bound = EQUAL * np.maximum(size[:, None], size)
    equal = np.abs(size[:, None] - size) <= np.maximum(bound, SOFT)
    apart = np.abs(middle[:, None] - middle)
    between = apart - (size[:, None] + size) / 2
    near = np.zeros((number, number), dtype=bool)
    for along, across in ((0, 1), (1, 0)):
        level = (apart[..., across] <= EQUAL * size[:, across]) & equal[..., across]
        beside = equal[..., along] & (apart[..., along] <= FARTHEST * size[:, None, along])
        strip = between[..., along] <= np.maximum(TOUCHING * size[:, None, across], 3)
        near |= level & (beside | strip)
    groups = connected(near & near.T)
    every = [np.flatnonzero(groups == group) for group in range(int(groups.max()) + 1)]
    return [own for own in every if len(own) >= FEWEST and _is_even(found.boxes[own])]


def _is_even(boxes: Int[np.ndarray, "n 4"]) -> bool:
    """Return whether the gaps between neighbours of most rows or columns are alike."""
    gaps, sizes = [], []
    for along, across in ((0, 1), (1, 0)):
        ends = boxes[:, along] + boxes[:, along + 2]
        for i, box in enumerate(boxes):
            level = np.abs(boxes[:, across] - box[across]) <= EQUAL * box[across + 2]
            after = level & (boxes[:, along] >= ends[i] - 1) & (np.arange(len(boxes)) != i)
            if after.any():
                gaps.append(float((boxes[after, along] - ends[i]).min()))
                sizes.append(float(box[along + 2]))
        if len(gaps) >= FEWEST - 1:
            break
    if len(gaps) < FEWEST - 1:
        return False
    off = np.abs(np.array(gaps) - np.median(gaps))
    return bool((off <= np.maximum(EVEN * (np.median(gaps) + np.median(sizes)), 2)).mean() >= 0.6)


def _with_missed(found: Patches, rgb: UInt8[np.ndarray, "height width 3"]) -> Patches:
    """Return swatches with those of their rows or columns that noise has hidden.

    One is missed where the even steps between the others lead, and something plain lies there that
    is not the ground beside them.
    """
    ground = _ground(found.boxes, rgb)
    size = np.rint(np.median(found.boxes[:, 2:], axis=0)).astype(np.int64)
    middle = found.boxes[:, :2] + found.boxes[:, 2:] / 2
    along = int(np.ptp(middle[:, 1]) > np.ptp(middle[:, 0]))
    line = _lines(middle[:, 1 - along], float(size[1 - along]))
    boxes, colors = [*found.boxes], [*found.rgb]
    for number in range(int(line.max()) + 1):
        for at in _expected(np.sort(middle[line == number, along])):
            place = np.full(2, float(np.median(middle[line == number, 1 - along])))
            place[along] = at
            box = np.array([*np.rint(place - size / 2).astype(np.int64), *size])
            color = _plain(rgb, box, ground)
            if color is not None and not _overlap(box, np.array(boxes)).any():
                boxes.append(box)
                colors.append(color)
    return Patches(np.array(boxes), np.array(colors))


def _lines(across: Float[np.ndarray, " n"], size: float) -> Int[np.ndarray, " n"]:
    """Return the number of the line that each swatch stands in."""
    order = np.argsort(across, kind="stable")
    line = np.zeros(len(across), dtype=np.int64)
    line[order] = np.concatenate([[0], np.cumsum(np.diff(across[order]) > size / 2)])
    return line


def _expected(places: Float[np.ndarray, " n"]) -> list[float]:
    """Return where more swatches of a line would stand: between those seen, and beyond its ends."""
    steps = np.diff(places)
    if len(steps) < FEWEST - 2 or not len(steps):
        return []
    step = float(steps.min())
    times = steps / max(step, 1.0)
    if np.abs(times - np.rint(times)).max() > EQUAL:
        return []
    number = int(np.rint(times).sum())
    step = float((places[-1] - places[0]) / max(number, 1))
    return [float(places[0] + k * step) for k in range(-MOST_MISSED, number + 1 + MOST_MISSED)]


def _plain(
    rgb: UInt8[np.ndarray, "height width 3"], box: np.ndarray, ground: np.ndarray
) -> UInt8[np.ndarray, " 3"] | None:
    """Return the plain colour within a box; None if it is not plain, or the ground."""
    x, y, width, height = box.tolist()
    if x < 0 or y < 0 or x + width > rgb.shape[1] or y + height > rgb.shape[0]:
        return None
    inner = rgb[y + height // 4 : y + height - height // 4]
    inner = inner[:, x + width // 4 : x + width - width // 4].reshape(-1, 3)
    color = np.rint(np.median(inner, axis=0))
    is_ground = np.abs(color - ground).max() <= STEP
    on_ground = (np.abs(_ring(box, rgb) - ground).max(axis=1) <= STEP).mean()
    if (
        is_ground
        or on_ground < ON_GROUND
        or (np.abs(inner - color).max(axis=1) <= STEP).mean() < OUTLINE
    ):
        return None
    return color.astype(np.uint8)


def _ground(boxes: np.ndarray, rgb: UInt8[np.ndarray, "height width 3"]) -> np.ndarray:
    """Return the median colour beyond the swatches' outlines."""
    ground: np.ndarray = np.median(np.concatenate([_ring(box, rgb) for box in boxes]), axis=0)
    return ground


def _ring(box: np.ndarray, rgb: UInt8[np.ndarray, "height width 3"]) -> Int[np.ndarray, "n 3"]:
    """Return the pixels beyond a swatch's outline."""
    window = rgb[_round(box, LINE + 2)].astype(np.int64)
    inner = np.zeros(window.shape[:2], dtype=bool)
    inner[2:-2, 2:-2] = True
    return window[~inner]


def _overlap(box: np.ndarray, boxes: np.ndarray) -> Bool[np.ndarray, " n"]:
    low = np.maximum(box[:2], boxes[:, :2])
    high = np.minimum(box[:2] + box[2:], boxes[:, :2] + boxes[:, 2:])
    own: Bool[np.ndarray, " n"] = (np.maximum(high - low, 0).prod(axis=1)) > 0.3 * box[2:].prod()
    return own


def _distinct(rgb: UInt8[np.ndarray, "n 3"]) -> list[int]:
    """Return the first patch of every colour."""
    lab = oklab_from_rgb(rgb)
    kept: list[int] = []
    for number, place in enumerate(lab):
        if all(np.linalg.norm(lab[other] - place) > APART for other in kept):
            kept.append(number)
    return kept


def _stands_alone(
    boxes: np.ndarray,
    rgb: UInt8[np.ndarray, "height width 3"],
    blobs: Blobs,
    main_blobs: Int[np.ndarray, " bodies"],
) -> bool:
    """Return whether what touches the swatches is hardly more than they, or a panel round them."""
    touched = {int(label) for box in boxes for label in np.unique(blobs.labels[_round(box, LINE)])}
    touched -= {0}
    if not touched or touched & set((main_blobs + 1).tolist()):
        return False
    within = np.zeros(blobs.labels.shape, dtype=bool)
    for box in boxes:
        within[_round(box, LINE)] = True
    painted = np.isin(blobs.labels, list(touched))
    return bool(painted[within].sum() >= ALONE * painted.sum()) or _on_one_ground(boxes, rgb)


def _on_one_ground(boxes: np.ndarray, rgb: UInt8[np.ndarray, "height width 3"]) -> bool:
    """Return whether one plain colour lies round every swatch, beyond its outline."""
    ground = _ground(boxes, rgb)
    on_it = [(np.abs(_ring(box, rgb) - ground).max(axis=1) <= STEP).mean() for box in boxes]
    return min(on_it) >= ALONE


def _round(box: np.ndarray, margin: int) -> tuple[slice, slice]:
    x, y, width, height = (int(value) for value in box)
    rows = slice(max(y - margin, 0), y + height + margin)
    return rows, slice(max(x - margin, 0), x + width + margin)


def _reading_order(boxes: Int[np.ndarray, "n 4"]) -> Int[np.ndarray, " n"]:
    """Return rows from the top, each from left to right."""
    middle = boxes[:, 1] + boxes[:, 3] / 2
    order = np.argsort(middle, kind="stable")
    row = np.zeros(len(boxes), dtype=np.int64)
    new = np.diff(middle[order]) > boxes[order[:-1], 3] / 2
    row[order] = np.concatenate([[0], np.cumsum(new)])
    return np.lexsort((boxes[:, 0], row))
