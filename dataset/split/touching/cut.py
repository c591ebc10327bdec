"""Cut apart figures that touch or overlap a little, where the evidence says that two meet.

Cuts are cheap ways from the top to the bottom (`seams`) through what is seen of a patch (`costs`);
which one is right, and whether a person should look at it, is decided in `selection`.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Int, UInt8

from toonset.dataset.split.figures.blobs import Blobs, as_box
from toonset.dataset.split.figures.rows import SAME_OUTLINE, likeness, outline
from toonset.dataset.split.touching.costs import look_at
from toonset.dataset.split.touching.profiles import flanks, largest_piece
from toonset.dataset.split.touching.selection import Option, best_option, find_options
from toonset.view import Box

WORST = 25.0  # of a cut's badness: what is worse goes through a single figure
WORST_STUDY = 10.0  # the same of a cut between a figure and a study
WORTH_A_LOOK = 14.0  # the same of one that is not made, only reported
NARROW = 0.3  # times its own height: what is narrower is one figure
LEAST_HEIGHT = 24  # cells: in a lower patch no two figures can be told
THROUGH = 0.7  # of an enclosed patch's height that a cut runs through: a gap between two figures
MOST_ENCLOSED = 0.25  # of a patch in the background's colour: more is a line drawing
SURE = 0.9  # chance of being right: a cut that has less is worth a look


@dataclass(frozen=True)
class Cut:
    """Cut between two figures.

    Attributes:
        box: (x, y, width, height) of the two together, in the cells of the labels.
        crossed: paint that the cut goes through, as a share of the height.
        sure: chance that it is right, among the cuts that were found between the two.
        study: number of the patch that is no figure but a smaller drawing, or None.
        made: the patch was cut; if not, a study may touch it.
    """

    box: Box
    crossed: float
    sure: float
    study: int | None = None
    made: bool = True

    @property
    def in_doubt(self) -> bool:
        """Return whether a person should look at it."""
        return self.sure < SURE


@dataclass(frozen=True, eq=False)
class _Patches:
    """Numbered patches while they are cut: `labels`, `boxes` and `sides` change.

    Attributes:
        labels: number of every cell's patch, 0 = none.
        painted: cells that are not of the background's colour.
        rgb: their colours.
        boxes: of the patches that are figures, or several, by number.
        sides: of the same, right and left.
    """

    labels: Int[np.ndarray, "height width"]
    painted: Bool[np.ndarray, "height width"]
    rgb: UInt8[np.ndarray, "height width 3"]
    boxes: dict[int, Box]
    sides: dict[int, tuple[np.ndarray, np.ndarray]]

    def window(self, label: int) -> tuple[slice, slice]:
        """Return rows and columns of a patch."""
        x, y, width, height = self.boxes[label]
        return slice(y, y + height), slice(x, x + width)

    def measure(self, label: int, window: tuple[slice, slice]) -> None:
        """Take the box and the sides of a patch that lies in a window anew."""
        mask = self.labels[window] == label
        x, y, width, height = cv2.boundingRect(mask.view(np.uint8))
        self.boxes[label] = (window[1].start + x, window[0].start + y, width, height)
        self.sides[label] = flanks(largest_piece(mask))


def part_touching(
    blobs: Blobs,
    main_blobs: Int[np.ndarray, " main_blobs"],
    painted: Bool[np.ndarray, "height width"],
    rgb: UInt8[np.ndarray, "height width 3"],
) -> tuple[Blobs, list[Cut]]:
    """Return the patches of a sheet with touching figures apart, and cuts, made or suspected.

    Paper that two touching figures enclose between them becomes nobody's.

    Args:
        blobs: the patches.
        main_blobs: those that may be several figures.
        painted: pixels that are not of the background's colour.
        rgb: the sheet.
    """
    parted, cuts = _part_all(blobs, main_blobs, main_blobs, painted, rgb)
    in_two = {cut.box for cut in cuts if cut.made and cut.study is None}
    mistaken = _cut_by_mistake(blobs, main_blobs, in_two)
    if len(mistaken):
        others = np.setdiff1d(main_blobs, mistaken)
        parted, cuts = _part_all(blobs, main_blobs, others, painted, rgb)
    return parted, cuts


def _cut_by_mistake(
    blobs: Blobs, main_blobs: Int[np.ndarray, " main_blobs"], cut: set[Box]
) -> Int[np.ndarray, " mistaken"]:
    """Return the patches that were cut although one that was not cut has the same outline.

    Both are one figure, such as a broad one that is symmetric, from the front and from behind.
    """
    is_cut = np.array([as_box(blobs.boxes[number]) in cut for number in main_blobs], dtype=bool)
    if is_cut.all() or not is_cut.any():
        return main_blobs[:0]
    outlines = [outline(blobs.mask(int(number))) for number in main_blobs]
    single = [outlines[i] for i in np.flatnonzero(~is_cut)]
    alike = [
        bool(cut and max(likeness([own, other])[0] for other in single) >= SAME_OUTLINE)
        for own, cut in zip(outlines, is_cut, strict=True)
    ]
    return main_blobs[np.array(alike)]


def _part_all(
    blobs: Blobs,
    main_blobs: Int[np.ndarray, " main_blobs"],
    candidates: Int[np.ndarray, " candidates"],
    painted: Bool[np.ndarray, "height width"],
    rgb: UInt8[np.ndarray, "height width 3"],
) -> tuple[Blobs, list[Cut]]:
    """Return what `part_touching` does, of the candidates alone."""
    cuts = list[Cut]()
    patches = _Patches(blobs.labels.copy(), painted, rgb, {}, {})
    for number in main_blobs:
        patches.measure(int(number) + 1, blobs.window(int(number)))
    queue, top = [int(number) + 1 for number in candidates], len(blobs.areas)
    while queue:
        label = queue.pop()
        box = patches.boxes[label]
        if box[2] < NARROW * box[3] or box[3] < LEAST_HEIGHT:
            continue
        cut = _part(patches, label, top + 1)
        if cut is not None:
            cuts.append(cut)
        if cut is not None and cut.made:
            top += 1
            queue += [one for one in (label, top) if one - 1 != cut.study]
    return (_measured(patches.labels, top) if top > len(blobs.areas) else blobs), cuts


def _part(patches: _Patches, label: int, new: int) -> Cut | None:
    """Cut a patch in two, the right part with a new number; return the cut, None for none."""
    window = patches.window(label)
    mask = patches.labels[window] == label
    paint = mask & patches.painted[window]
    if paint.sum() < mask.sum() * (1 - MOST_ENCLOSED):
        paint = mask  # a line drawing: its inside is paper, too
    rgb = patches.rgb[window]
    cut_costs = look_at(mask, paint, rgb)
    small = cv2.resize(rgb, cut_costs.drawn.shape[::-1], interpolation=cv2.INTER_NEAREST)
    options = find_options(
        cut_costs, small, [side for two in patches.sides.values() for side in two]
    )
    likely = [one for one in options if one.badness <= (WORST_STUDY if one.study else WORST)]
    box = patches.boxes[label]
    if not likely:
        told = min((one.badness for one in options), default=np.inf) <= WORTH_A_LOOK
        return Cut(box, 0.0, 0.0, made=False) if told else None
    best, sure = best_option(likely, cut_costs.drawn > 0.5)
    columns = _enlarged(best, mask.shape)
    labels = patches.labels[window]
    labels[mask & (np.arange(mask.shape[1]) >= columns[:, None])] = new
    labels[_crossed(mask & ~paint, columns)] = 0
    patches.measure(label, window)
    patches.measure(new, window)
    study = {"left": label - 1, "right": new - 1}.get(best.study)
    return Cut(box, best.crossed, sure, study)


def _enlarged(option: Option, shape: tuple[int, ...]) -> Int[np.ndarray, " height"]:
    """Return the column right of a cut for every row of the sheet."""
    rows, columns = option.is_right.shape
    each = np.minimum(np.arange(shape[0]) * rows // shape[0], rows - 1)
    return np.rint(option.seam.columns[each] * shape[1] / columns).astype(int)


def _crossed(
    enclosed: Bool[np.ndarray, "height width"], cut: Int[np.ndarray, " height"]
) -> Bool[np.ndarray, "height width"]:
    """Return the enclosed patches that a cut runs through from top to bottom."""
    count, found, stats, _ = cv2.connectedComponentsWithStats(
        enclosed.view(np.uint8), connectivity=4
    )
    patches = np.asarray(found, dtype=np.int32)
    rows, columns = np.arange(len(cut)), np.clip(cut, 1, enclosed.shape[1] - 1)
    met = np.maximum(patches[rows, columns], patches[rows, columns - 1])
    between = np.bincount(met, minlength=count) >= THROUGH * stats[:, cv2.CC_STAT_HEIGHT]
    between[0] = False
    return between[patches]


def _measured(labels: Int[np.ndarray, "height width"], count: int) -> Blobs:
    """Return boxes, areas and centres of numbered patches."""
    rows, columns = np.nonzero(labels)
    number = labels[rows, columns] - 1
    areas = np.bincount(number, minlength=count)
    sums = [np.bincount(number, places, count) for places in (columns, rows)]
    return Blobs(labels, _boxes(labels), areas, np.stack(sums, axis=1) / areas[:, None])


def _boxes(labels: Int[np.ndarray, "height width"]) -> Int[np.ndarray, "blobs 4"]:
    """Return x, y, width, height of every number in use."""
    from scipy.ndimage import find_objects

    places = [(rows, columns) for rows, columns in find_objects(labels)]
    return np.array(
        [(c.start, r.start, c.stop - c.start, r.stop - r.start) for r, c in places]
    ).reshape(-1, 4)
