"""Group connected components into views, and classify the rest.

A patch that is no body of a view is a part of one (a floating hat, a hand apart) if it lies within
or close to it and between the head and ground lines of its row, or if most views have the like at
the same level; else it is left out under a name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.dataset.split.figures.blobs import LEAST_SPECK, LEVEL, Blobs, reading_order, rows_of
from toonset.dataset.split.figures.printed_palette import (
    Patches,
    are_swatches,
    find_printed_palette,
)
from toonset.dataset.split.figures.text_and_swatches import find_letters, find_swatches

WITHIN = 0.5  # of a patch that lies in a figure's box: its part
NEAR = 0.02  # of the figure's height: a part this near to the figure is the figure's
BESIDE = 0.08  # of the figure's height: so near its part may be, above it or in its colours
FARTHEST = 0.3  # of the figure's height: a part that most views have is no farther
HAT = 0.5  # of the body's height: a part over the head line of the row is no higher
FEET = 0.95  # of the figure's height from its top: no part's middle lies lower
SAME_LEVEL = 0.08  # of the figure's height
SAME_SIZE = 2.5  # times, of shares of the figure's area
OFTEN = 0.45  # times the views: in some a hand lies before the body, in some there are two
HAND = 0.06  # of the figure's area: a larger thing beside it is a drawing of its own
TOUCHING = 0.01  # of the figure's height: unless it is as near as this
PART_AREA = 0.35  # of the figure's area: a larger thing apart is a drawing of its own
LEAST_PART = 0.004  # of the figure's area: smaller things beside a figure are marks
SPECK = 0.01  # of the figure's height: the side of a patch that is dust if nothing is near
LISTED_SPECK = 0.0005  # of the figure's area: smaller ones are counted, not listed
FAMILIAR = 0.8  # of a part's pixels in colours that its figure has
DARK = 170  # level: ink is no lighter
LETTER_HEIGHT = 0.1  # of the figure's height
OFF_INK = 24  # levels from the mixtures of ink and paper: noise
ONE_INK = 0.95  # of a patch's pixels in its ink
STROKE = 0.12  # of its box's squared diagonal: a thing that covers no more is a stroke
SWATCH = 0.9  # of its box that a patch of colour fills
DISC = (0.74, 0.83)  # of its box that a disc fills


@dataclass(frozen=True, eq=False)
class Grouping:
    """Figure of every patch.

    Attributes:
        figure_of_blob: (blobs,) number of the figure in reading order; -1 = none.
        count: number of figures.
        kinds: per patch what it is if it is no figure's, as
            `toonset.dataset.split.beside_views.LeftOut` has it; "" for noise that is too small to
            name.
        printed: the palette that the sheet prints.
    """

    figure_of_blob: Int[np.ndarray, " blobs"]
    count: int
    kinds: tuple[str, ...]
    printed: Patches


def group_blobs(
    blobs: Blobs,
    main_blobs: Int[np.ndarray, " main_blobs"],
    rgb: UInt8[np.ndarray, "height width 3"],
    studies: Sequence[int] = (),
) -> Grouping:
    """Return which figure every patch belongs to, and what the others are.

    Args:
        blobs: the patches.
        main_blobs: those that are the bodies of the views.
        rgb: the sheet.
        studies: patches that are known to be drawings of their own.
    """
    main_blobs = main_blobs[reading_order(blobs.boxes[main_blobs], blobs.centers[main_blobs])]
    figure = np.full(len(blobs.areas), -1)
    figure[main_blobs] = np.arange(len(main_blobs))
    kinds = np.full(len(blobs.areas), "", dtype=object)
    printed = find_printed_palette(rgb, blobs, main_blobs)
    small = np.flatnonzero((figure < 0) & (blobs.areas >= LEAST_SPECK))
    if len(small):
        nearest, gap = _nearest_main(blobs, main_blobs, small)
        letters = find_letters(blobs.boxes[small], int(np.median(blobs.boxes[main_blobs, 3])))
        in_palette = are_swatches(printed, blobs, small)
        swatches = in_palette | find_swatches(blobs.boxes[small], blobs.areas[small])
        typical = float(np.median(blobs.areas[main_blobs]))
        bodies = main_blobs[nearest]
        out = _off_level(blobs, small, bodies, _levels(blobs, main_blobs)[nearest])
        for i, number in enumerate(small):
            body, height = blobs.boxes[bodies[i]], blobs.boxes[bodies[i], 3]
            near = gap[i] <= NEAR * height
            within = near and _share_within(blobs.boxes[number], body) >= WITHIN
            in_row = (bool(letters[i] | swatches[i]) and not within) or bool(in_palette[i])
            dust = gap[i] > TOUCHING * height and blobs.areas[number] <= (SPECK * height) ** 2
            if in_row or dust or out[i] > LEVEL or number in studies:
                continue
            if _is_part(blobs, int(number), int(bodies[i]), float(gap[i]), rgb):
                figure[number] = nearest[i]
        hat = (out <= LEVEL) | (blobs.boxes[small, 3] <= HAT * blobs.boxes[bodies, 3])
        again = ~letters & ~swatches & hat & ~np.isin(small, studies)
        again &= _come_again(blobs, small, bodies, gap, len(main_blobs), rgb)
        figure[small[again]] = nearest[again]
        for i, number in enumerate(small):
            if figure[number] >= 0:
                continue
            if swatches[i]:
                kinds[number] = "swatch"
            elif letters[i]:
                kinds[number] = "text"
            elif blobs.areas[number] >= LISTED_SPECK * typical:
                kinds[number] = _kind(blobs, int(number), typical)
    return Grouping(figure, len(main_blobs), tuple(kinds), printed)


def _nearest_main(
    blobs: Blobs, main_blobs: np.ndarray, small: np.ndarray
) -> tuple[Int[np.ndarray, " small"], Float[np.ndarray, " small"]]:
    """Return the position in `main_blobs` of every small patch's nearest figure, and the gap."""
    is_main = np.zeros(len(blobs.areas) + 1, dtype=bool)
    is_main[main_blobs + 1] = True
    position = np.zeros(len(blobs.areas) + 1, dtype=np.int64)
    position[main_blobs + 1] = np.arange(len(main_blobs))
    zero_at_main = (~is_main[blobs.labels]).view(np.uint8)
    away, found = cv2.distanceTransformWithLabels(
        zero_at_main, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    zones = np.asarray(found, dtype=np.int32)
    main_of_zone = np.zeros(int(zones.max()) + 1, dtype=np.int64)
    at_main = zero_at_main == 0
    main_of_zone[zones[at_main]] = position[blobs.labels[at_main]]
    nearest, gaps = [], []
    for number in small:
        window = blobs.window(number)
        gap = np.where(blobs.mask(number), away[window], np.inf)
        place = gap.argmin()
        nearest.append(main_of_zone[zones[window].flat[place]])
        gaps.append(gap.flat[place])
    return np.array(nearest), np.array(gaps)


def _levels(
    blobs: Blobs, main_blobs: Int[np.ndarray, " main_blobs"]
) -> Float[np.ndarray, "main_blobs 2"]:
    """Return the head line and the ground line of every body's row: medians."""
    ends = blobs.boxes[main_blobs, 1:2] + np.outer(blobs.boxes[main_blobs, 3], [0, 1])
    levels = np.empty(ends.shape)
    for row in rows_of(blobs.boxes[main_blobs], blobs.centers[main_blobs]):
        alone = len(row) == 1  # nothing is known of its lines
        levels[row] = (-np.inf, np.inf) if alone else np.median(ends[row], axis=0)
    return levels


def _off_level(
    blobs: Blobs,
    numbers: Int[np.ndarray, " n"],
    bodies: Int[np.ndarray, " n"],
    levels: Float[np.ndarray, "n 2"],
) -> Float[np.ndarray, " n"]:
    """Return how far patches rise over the head line of their row or hang below its ground line.

    In heights of their figures, which may rise and hang themselves.
    """
    top, body_top = blobs.boxes[numbers, 1], blobs.boxes[bodies, 1]
    bottom, body_bottom = top + blobs.boxes[numbers, 3], body_top + blobs.boxes[bodies, 3]
    over = np.minimum(levels[:, 0], body_top) - top
    below = bottom - np.maximum(levels[:, 1], body_bottom)
    return np.maximum(over, below) / blobs.boxes[bodies, 3]


def _is_part(blobs: Blobs, number: int, body: int, gap: float, rgb: np.ndarray) -> bool:
    """Return whether a patch is a part of the figure whose body is nearest to it."""
    own, main = blobs.boxes[number], blobs.boxes[body]
    area = blobs.areas[number] / blobs.areas[body]
    if area > PART_AREA:
        return False
    square = blobs.areas[number] >= SWATCH * own[2] * own[3]
    if _share_within(own, main) >= WITHIN:
        near, large = gap <= NEAR * main[3], area >= LEAST_PART and not square
        return bool(near or (large and gap <= BESIDE * main[3]))
    if square:
        return False
    middle = own[0] + own[2] / 2
    above = main[0] <= middle <= main[0] + main[2]
    aside = own[0] >= main[0] + main[2] or own[0] + own[2] <= main[0]
    if aside and area > HAND and gap > TOUCHING * main[3]:
        return False
    lettering = _is_lettering(blobs, number, body, rgb)
    below = own[1] >= main[1] + main[3]
    if gap <= NEAR * main[3]:
        return not (lettering and below)
    if area < LEAST_PART or _is_stroke(blobs.mask(number)):
        return False
    if lettering:
        return False
    if above:
        return bool(gap <= BESIDE * main[3] and own[1] < main[1])
    return gap <= BESIDE * main[3] and _in_its_colors(blobs, number, body, rgb)


def _come_again(
    blobs: Blobs,
    numbers: Int[np.ndarray, " n"],
    bodies: Int[np.ndarray, " n"],
    gaps: Float[np.ndarray, " n"],
    views: int,
    rgb: np.ndarray,
) -> Bool[np.ndarray, " n"]:
    """Return which patches are parts: most views have the like at the level, or one has a pair.

    So hands without arms and hats in the air are found, farther away than a single thing may be.
    """
    result = np.zeros(len(numbers), dtype=bool)
    own, main = blobs.boxes[numbers], blobs.boxes[bodies]
    middle = own[:, :2] + own[:, 2:] / 2 - main[:, :2]
    level = middle[:, 1] / main[:, 3]
    size = blobs.areas[numbers] / blobs.areas[bodies]
    above = (middle[:, 0] >= 0) & (middle[:, 0] <= main[:, 2])
    able = (gaps <= FARTHEST * main[:, 3]) & (size >= LEAST_PART)
    able &= size <= np.where(above, PART_AREA, HAND)
    able &= level <= FEET  # captions stand below
    for i in np.flatnonzero(able):
        number, body = int(numbers[i]), int(bodies[i])
        drawn = not _is_lettering(blobs, number, body, rgb) and not _is_stroke(blobs.mask(number))
        able[i] = drawn and (above[i] or _in_its_colors(blobs, number, body, rgb))
    for i in np.flatnonzero(able):
        alike = able & (np.abs(level - level[i]) <= SAME_LEVEL) & (above == above[i])
        alike &= (size <= SAME_SIZE * size[i]) & (size >= size[i] / SAME_SIZE)
        often = len(np.unique(bodies[alike])) >= 2 and alike.sum() >= OFTEN * views
        left = middle[:, 0] < main[:, 2] / 2
        pair = alike & (bodies == bodies[i]) & (left != left[i]) & ~above
        result[i] = often or pair.any()
    return result


def _share_within(own: np.ndarray, main: np.ndarray) -> float:
    start = np.maximum(own[:2], main[:2])
    stop = np.minimum(own[:2] + own[2:], main[:2] + main[2:])
    width, height = np.maximum(stop - start, 0)
    return float(width * height / (own[2] * own[3]))


def _is_stroke(mask: Bool[np.ndarray, "height width"]) -> bool:
    """Return whether a patch is thin for its length: an arrow, a flourish."""
    height, width = mask.shape
    return bool(mask.sum() <= STROKE * (height**2 + width**2))


def _is_lettering(blobs: Blobs, number: int, body: int, rgb: np.ndarray) -> bool:
    """Return whether a patch is of one ink, and low or thin: a word, a figure, an arrow."""
    mask = blobs.mask(number)
    low = mask.shape[0] <= LETTER_HEIGHT * blobs.boxes[body, 3]
    round_ = mask.mean() >= DISC[0] and max(mask.shape) <= 1.5 * min(mask.shape)  # a hand is
    thin = (low and not round_) or _is_stroke(mask)
    return thin and _is_ink(rgb[blobs.window(number)][mask])


def _is_ink(colors: UInt8[np.ndarray, "n 3"]) -> bool:
    """Return whether pixels are one dark ink and its soft edges: lettering, an arrow."""
    luma = colors.mean(axis=1)
    ink = np.median(colors[luma <= np.percentile(luma, 25)], axis=0)
    if ink.mean() > DARK:
        return False
    spread = colors - ink  # soft edges lie between the ink and one paper
    paper = np.median(spread[luma >= np.percentile(luma, 95)], axis=0)
    along = np.clip(spread @ paper / max(float(paper @ paper), 1.0), 0, 1)
    off = np.abs(spread - along[:, None] * paper).max(axis=1)
    return bool((off <= OFF_INK).mean() >= ONE_INK)


def _in_its_colors(blobs: Blobs, number: int, body: int, rgb: np.ndarray) -> bool:
    """Return whether a patch has hardly a colour that the figure does not have."""
    known = np.zeros((8, 8, 8), dtype=np.uint8)
    known[tuple((rgb[blobs.window(body)][blobs.mask(body)] // 32).T)] = 1
    own = tuple((rgb[blobs.window(number)][blobs.mask(number)] // 32).T)
    return float(known[own].mean()) >= FAMILIAR


def _kind(blobs: Blobs, number: int, typical: float) -> str:
    mask, (_, _, width, height) = blobs.mask(number), blobs.boxes[number]
    fill = blobs.areas[number] / (width * height)
    if fill >= SWATCH or (DISC[0] <= fill <= DISC[1] and 0.8 <= width / height <= 1.25):
        return "swatch"
    if _is_stroke(mask):
        return "mark"
    return "study" if blobs.areas[number] >= LEAST_PART * typical else "speck"
