"""Warn of views that may be cut wrongly."""

from __future__ import annotations

from itertools import combinations

import cv2
import numpy as np
from jaxtyping import Int, UInt8

from toonset.dataset.split.background import SURE_ENOUGH, Background, ring_of
from toonset.dataset.split.figures.blobs import find_blobs, shared_colors
from toonset.dataset.split.figures.open_outlines import LINE, Gap
from toonset.dataset.split.figures.parts_in_doubt import ALIKE, LEVEL, parts_in_doubt
from toonset.dataset.split.figures.rows import LOWEST, OFF_ROW
from toonset.dataset.split.figures.shadows import dimmed, see_through
from toonset.dataset.split.pages import Pages
from toonset.dataset.split.segment import SheetLayout, figure_cells
from toonset.dataset.split.touching.selection import HEAD
from toonset.dataset.split.watermark import Watermark
from toonset.raster import dilate, sized_parts, wider_than
from toonset.view import View

REACHING = 0.1  # of the sheet's border: so much may be figures that reach over its edge
NEARLY_A_VIEW = 0.5  # of the views' height: something left out that may be a small one
PROPORTIONS = 1.2  # times the widest view's, or less than its inverse of the narrowest's: no view
BROAD = 1.15  # times its own height: wider than arms reach
IN_EACH_OTHER = 0.45  # of the smaller one's box
LEAST_SHADOW = 0.02  # of the height: so much lower than its row
SHADED = 0.9  # of what is lower: it is shadow
AS_LIKELY = 0.6  # of the merit of the group that was taken: another may be the turnaround
EVEN = 0.85  # of the others' height: views of one figure differ by less
UPRIGHT = 1.4  # times its width: a standing figure is higher, a head is not
SMALL = 0.25  # of a single view's height: small whole figures beside it may be the turnaround
FEET, LEAST_FOOT = 0.05, 1e-4  # of a figure's height, its lowest; squared: feet
WHOLE = 0.6  # of the sheet that one view's box covers though there is text beside it
WIDE_GAP = 0.05  # of the figure's height: a wider gap may be meant
LARGE_POCKET = 0.01  # of the figure's squared height: so much more or less changes it
FULL = 0.82  # of its box: no figure fills more
MOST_STROKES = 0.08  # of a view: with more it is hollow somewhere
NO_OUTLINE = ("text", "swatch")  # no gap is between a figure and these
STROKES = ("mark", "speck", "text")  # as which pieces of a pencil drawing are left out
BROKEN = 0.05  # of the views' height: gaps between its pieces
PIECES = 2  # no sword or ruler has more
CRUMB = 0.01  # of the largest piece: a smaller one is dust beside it
SLENDER = 0.12  # of its height: a drawing is no narrower
WIDE = 1.28  # times the next widest of four or more: two figures, or a study that touches
TWO_HEADS = 0.68  # of a view's width: two tops that are broader are no ears
LIMB = 0.12  # of the figure's height: what is no wider is an arm, a scarf or a tail
BROADER = 1.05  # times the next broadest without those: spread arms alone are a pose
LOOKED_AT = 200  # pixels: height of the copy of which limbs are taken off


def page_warnings(pages: Pages | None) -> tuple[str, ...]:
    """Return a line if pages lie at an angle: their drawings are cut as they are seen."""
    if pages is None or pages.upright:
        return ()
    return (
        "paper lies at an angle and is cut as it is seen: straighten it and crop the picture to it "
        "for true proportions",
    )


def mark_warnings(mark: Watermark | None) -> tuple[str, ...]:
    """Return a line if a watermark lies over the figures: their colours may keep some of it."""
    if mark is None or not mark.over_figures:
        return ()
    return (
        "a watermark lies over the sheet; it was taken off the paper and flat colours: look at the "
        "figures, or use a picture without it",
    )


def border_warnings(ground: Background, found: SheetLayout) -> tuple[str, ...]:
    """Return a line if the background is hardly one.

    Frames explain a border that is not background, and so do figures that reach over the sheet's
    edge, but for a little of it: a backdrop that was taken for a figure reaches it, too.
    """
    if ground.rgb is None or ground.sure >= SURE_ENOUGH or found.lines:
        return ()
    figures = figure_cells(found) > 0
    rows, columns = figures.shape
    reaching = float(figures[ring_of(rows, columns, ground.inset)].mean())
    if found.grouping.count > 1 and ground.sure + min(reaching, REACHING) >= SURE_ENOUGH:
        return ()
    return (f"only {100 * ground.sure:.0f} % of the sheet's border is background",)


def shadow_warnings(
    ground: Background, views: list[View], rgba: UInt8[np.ndarray, "height width 4"]
) -> tuple[str, ...]:
    """Return a line for every view that reaches lower than its row with a shadow alone.

    Grey shoes do so, too, but the figure with the highest feet has them as well.
    """
    said = []
    for view in views:
        _, top, _, height = view.figure_box
        row = [view, *(other for other in views if _is_level(top, height, other))]
        highest = min(row, key=_feet)
        lower = _feet(view) - _feet(highest)
        if lower > LEAST_SHADOW * height and (
            _shaded(ground, view, rgba, lower) >= SHADED > _shaded(ground, highest, rgba, lower)
        ):
            said.append(
                f"view {view.name} stands lower than its row: does it still include its shadow?"
            )
    return tuple(said)


def _feet(view: View) -> int:
    return view.figure_box[1] + view.figure_box[3]


def _shaded(ground: Background, view: View, rgba: np.ndarray, rows: int) -> float:
    """Return which share of a figure's lowest rows is the paper with less light."""
    x, _, width, _ = view.box
    top = _feet(view) - rows
    seen = rgba[top : top + rows, x : x + width]
    if ground.rgb is None:
        dim = see_through(seen)
    else:
        paper = ground.colors((x, top, width, rows))
        dim = dimmed(seen[..., :3], paper, ground.tolerance)
    drawn = view.rgba[top - view.box[1] :, :, 3][:rows] > 0
    return float(dim.mask[drawn].mean())


def figure_warnings(
    found: SheetLayout,
    views: list[View],
    rgba: UInt8[np.ndarray, "height width 4"],
    *,
    chosen: bool = False,
) -> tuple[str, ...]:
    """Return a line for every cut in doubt, every wide view, all left out that may be views.

    Args:
        found: figures and what was left out.
        views: the figures.
        rgba: the sheet.
        chosen: whether a person said which group of figures is wanted: other rows are not.
    """
    return (
        *_cuts(found),
        *_open_outlines(found, views),
        *_wide_views(views),
        *_two_heads(views),
        *_off_row(views),
        *_uneven(views),
        *_one_in_another(views),
        *_whole_page(found, views, rgba),
        *_panels(views, rgba),
        *parts_in_doubt(
            *(found.blobs, found.grouping, rgba[:: found.cell_px, :: found.cell_px, :3]),
            *(found.cell_px, [view.name for view in views]),
        ),
        *_other_groups(found, views, rgba),
        *_like_views(found, views, rgba, chosen=chosen),
        *_scattered_strokes(found, views),
    )


def _cuts(found: SheetLayout) -> list[str]:
    said = []
    for cut in (cut for cut in found.cuts if cut.in_doubt):
        x, y, width, height = (value * found.cell_px for value in cut.box)
        if not cut.made:
            said.append(
                f"a study may touch the figure within {width} x {height} px at {x}, {y}; it was "
                "not cut off: look, or give all views with --boxes"
            )
            continue
        two = "two figures touch" if cut.study is None else "a figure and a study touch"
        said.append(
            f"{two} within {width} x {height} px at {x}, {y}; they were cut apart "
            f"through {100 * cut.crossed:.1f} % of their height: look whether the cut is right"
        )
    return said


def _open_outlines(found: SheetLayout, views: list[View]) -> list[str]:
    """Return a line for every view whose outline is open, or was closed over a wide gap."""
    said, number, cell = list[str](), figure_cells(found), found.cell_px
    for figure, view in enumerate(views):
        own = [
            gap
            for gap in found.gaps
            if _is_worth_a_word(gap) and _is_beside(found, number, gap, figure)
        ]
        where = f"the outline of {view.name} is open at"
        if own:
            gap = max(own, key=lambda gap: gap.area)
            wide = f" over {gap.width * cell:.0f} px; it was closed there" if gap.closed else ""
            said.append(f"{where} {gap.x * cell}, {gap.y * cell}{wide}")
        elif (place := _strokes(view)) is not None:
            said.append(f"{where} {place[0]}, {place[1]}; beside it the view is lines alone")
    return said


def _is_worth_a_word(gap: Gap) -> bool:
    far = gap.width > WIDE_GAP * gap.height and gap.area > LARGE_POCKET * gap.height**2
    return far or not gap.closed


def _is_beside(found: SheetLayout, number: np.ndarray, gap: Gap, figure: int) -> bool:
    """Return whether a gap is in a figure's outline, not between it and text or swatches."""
    reach = max(2, round(gap.width))
    top, left = max(gap.y - reach, 0), max(gap.x - reach, 0)
    window = slice(top, gap.y + reach + 1), slice(left, gap.x + reach + 1)
    rows, columns = np.nonzero(number[window] == figure + 1)
    if not len(rows):
        return False
    kinds = np.isin(np.array(["text", *found.grouping.kinds], dtype=object), NO_OUTLINE)
    drawn = np.argwhere(~kinds[found.blobs.labels[window]]) - (gap.y - top, gap.x - left)
    own = np.stack([rows, columns], axis=1) - (gap.y - top, gap.x - left)
    nearest = own[(own**2).sum(axis=1).argmin()]
    return bool((drawn @ nearest < 0).any())


def _strokes(view: View) -> tuple[int, int] | None:
    """Return where in the sheet the largest stroke of a view is that is lines for a good part."""
    strokes = view.mask & ~wider_than(view.mask, max(1, round(LINE * view.figure_box[3])))
    if np.count_nonzero(strokes) < MOST_STROKES * np.count_nonzero(view.mask):
        return None
    numbers, areas = sized_parts(strokes)
    rows, columns = np.nonzero(numbers == 1 + int(areas[1:].argmax()))
    middle = len(rows) // 2
    return view.box[0] + int(columns[middle]), view.box[1] + int(rows[middle])


def _wide_views(views: list[View]) -> list[str]:
    """Return a line for every view as wide as two figures, or as one and a study.

    Wider than the other views counts only without arms, scarves and tails, which may be spread.
    """
    said, bodies = [], list[float]()
    widths = [view.figure_box[2] / view.figure_box[3] for view in views]
    most = WIDE * sorted(widths)[-2] if len(views) > 3 else BROAD
    for number, width in enumerate(widths):
        if width <= min(most, BROAD):
            continue
        bodies = bodies or [_body_width(view) for view in views]
        others = bodies[:number] + bodies[number + 1 :]
        if width > BROAD or bodies[number] > BROADER * max(others):
            said.append(f"view {views[number].name} is unusually wide: do two figures touch?")
    return said


def _two_heads(views: list[View]) -> list[str]:
    """Return a line for every view with two heads: broad tops, apart, that are most of its width.

    Ears and raised claws leave more of it to the body.
    """
    said = []
    for view in views:
        left, top, width, height = view.figure_box
        x, y, depth = left - view.box[0], top - view.box[1], max(1, round(HEAD * height))
        tops = find_blobs(view.mask[y : y + depth, x : x + width])
        broad = np.bincount(tops.labels[-1], minlength=len(tops.areas) + 1)[1:]
        heads = broad[(broad >= depth) & (tops.boxes[:, 1] <= OFF_ROW * height)]
        if len(heads) > 1 and heads.sum() >= TWO_HEADS * width:
            said.append(f"view {view.name} has two heads: do two figures touch?")
    return said


def _body_width(view: View) -> float:
    """Return how wide a figure is without its limbs, in its heights."""
    left, top, width, height = view.figure_box
    x, y = left - view.box[0], top - view.box[1]
    size = max(1, round(width * LOOKED_AT / height)), LOOKED_AT
    figure = view.mask[y : y + height, x : x + width].view(np.uint8)
    small = cv2.resize(255 * figure, size, interpolation=cv2.INTER_AREA) >= 128
    columns = np.flatnonzero(wider_than(small, round(LIMB / 2 * LOOKED_AT)).any(axis=0))
    return float(columns[-1] - columns[0] + 1) / LOOKED_AT if len(columns) else 0.0


def _off_row(views: list[View]) -> list[str]:
    """Return a line for every view whose head and feet are both higher or lower than its row's."""
    said = []
    for view in views:
        _, top, _, height = view.figure_box
        heads, feet = _beside_row(top, height, [other for other in views if other is not view])
        if min(abs(heads), abs(feet)) > OFF_ROW and heads * feet > 0:
            said.append(
                f"view {view.name} stands {'lower' if heads < 0 else 'higher'} than the rest of "
                "its row: is it another drawing?"
            )
    return said


def _uneven(views: list[View]) -> list[str]:
    """Return a line if one view is much lower than all others: a part, a study, another figure."""
    if len(views) < 2:
        return []
    low, *others = sorted(views, key=lambda view: view.figure_box[3])
    least, usual = others[0].figure_box[3], np.median([view.figure_box[3] for view in others])
    share = low.figure_box[3] / usual
    if share >= EVEN or least < EVEN * usual:
        return []
    whom = others[0].name if len(others) == 1 else "the others"
    return [
        f"view {low.name} is {100 * share:.0f} % as high as {whom}: are all whole figures of one "
        "character?"
    ]


def _one_in_another(views: list[View]) -> list[str]:
    """Return a line for every two views whose boxes lie far in each other: one was cut in two."""
    said = []
    for one, other in combinations(views, 2):
        (x, y, width, height), (left, top, wide, tall) = one.figure_box, other.figure_box
        across = min(x + width, left + wide) - max(x, left)
        down = min(y + height, top + tall) - max(y, top)
        if min(across, down) > 0 and across * down > IN_EACH_OTHER * min(
            width * height, wide * tall
        ):
            said.append(f"views {one.name} and {other.name} lie in each other: are they two?")
    return said


def _beside_row(top: int, height: int, views: list[View]) -> tuple[float, float]:
    """Return how far something's row has its heads and its feet below its own, in its height."""
    row = [
        (view.figure_box[1] - top, view.figure_box[1] + view.figure_box[3] - top - height)
        for view in views
        if _is_level(top, height, view)
    ]
    if len(row) < 2:
        return 0.0, 0.0
    heads, feet = np.median(row, axis=0) / height
    return float(heads), float(feet)


def _whole_page(found: SheetLayout, views: list[View], rgba: np.ndarray) -> list[str]:
    """Return a line if the only view may be a panel with all that is on it, or several figures."""
    _, _, width, height = views[0].figure_box
    covered = width * height >= WHOLE * rgba.shape[0] * rgba.shape[1]
    if len(views) > 1 or not covered:
        return []
    if "text" in found.grouping.kinds:
        beside = ", with text beside it"
    elif height < UPRIGHT * width and _stands_on(views[0]) > 2:
        beside = " and stands on many feet"
    else:
        return []
    return [
        f"view {views[0].name} is most of the sheet{beside}: does it hold more than "
        "one figure? crop the sheet to the figures, or give them with --boxes"
    ]


def _stands_on(view: View) -> int:
    """Return in how many parts a figure stands."""
    left, top, width, height = view.figure_box
    x, y, low = left - view.box[0], top - view.box[1], max(1, round(FEET * height))
    _, areas = sized_parts(view.mask[y + height - low : y + height, x : x + width])
    return int((areas[1:] > LEAST_FOOT * height**2).sum())


def _panels(views: list[View], rgba: np.ndarray) -> list[str]:
    """Return a line if views fill their boxes as panels do in which figures stand."""
    fill = [view.mask.sum() / (view.figure_box[2] * view.figure_box[3]) for view in views]
    if np.median(fill) <= FULL or (rgba[..., 3] < 255).any():  # cut out already
        return []
    return [
        "the views are nearly rectangles: if the figures stand on panels, take them off with "
        "--matting"
    ]


def _other_groups(
    found: SheetLayout, views: list[View], rgba: UInt8[np.ndarray, "height width 4"]
) -> list[str]:
    """Return a line for every other group that may be the turnaround."""
    taken, cell = found.groups[found.taken.group], found.cell_px
    colors = [view.rgba[view.mask][:, :3] for view in views]
    said = []

    def colors_of(number: int) -> UInt8[np.ndarray, "n 3"]:
        small = rgba[::cell, ::cell, :3][found.blobs.window(number)]
        return np.asarray(small[found.blobs.mask(number)])

    for number, group in enumerate(found.groups):
        boxes = found.blobs.boxes[group.members]
        if group is taken or found.taken.group:
            continue
        small = len(taken.members) == 1 and _has_whole(boxes, taken.height)
        small = small and all(_shares(colors_of(int(n)), colors) for n in group.members)
        if not small and group.merit < AS_LIKELY * taken.merit:
            continue
        x, y = (int(v) * found.cell_px for v in boxes[:, :2].min(axis=0))
        said.append(
            f"{len(group.members)} drawings from {x}, {y} on may be the turnaround, too: take "
            f"them with --group {number + 1}"
        )
    return said


def _has_whole(boxes: Int[np.ndarray, "figures 4"], tall: float) -> bool:
    """Return whether several drawings beside a single, larger one are whole figures."""
    slender = boxes[:, 3] >= UPRIGHT * boxes[:, 2]
    return bool((slender & (boxes[:, 3] >= SMALL * tall)).sum() > 1)


def _like_views(
    found: SheetLayout, views: list[View], rgba: np.ndarray, *, chosen: bool
) -> list[str]:
    """Return a line for every drawing left out that is as high as a view, or like a small one.

    Lower drawings of another row of equal figures are poses or busts, which the row says, and so
    are those beside the views that do not stand in their row.
    """
    rows = [row for group in found.groups for row in group.rows if len(row) > 1]
    in_rows = set(np.concatenate([np.zeros(0, int), *rows]).tolist())
    usual = float(np.median([view.figure_box[3] for view in views]))
    shapes = [view.figure_box[2] / view.figure_box[3] for view in views]
    colors = [view.rgba[view.mask][:, :3] for view in views]
    said, cell = [], found.cell_px
    for number, kind in enumerate(found.grouping.kinds):
        x, y, width, height = (int(value) * cell for value in found.blobs.boxes[number])
        if kind != "study" or (number in in_rows and (chosen or height < usual)):
            continue
        strays = min(map(abs, _beside_row(y, height, views))) > OFF_ROW
        if height < NEARLY_A_VIEW * usual or strays:
            continue
        own = rgba[::cell, ::cell, :3][found.blobs.window(number)][found.blobs.mask(number)]
        slender = width / height >= min(shapes) / PROPORTIONS
        shaped = slender and width / height <= max(shapes) * PROPORTIONS
        if height >= LOWEST * usual or (shaped and _shares(own, colors)):
            said.append(
                f"a drawing at {x}, {y} of {100 * height / usual:.0f} % of the views' height "
                "was left out: if it is a view, give all views with --boxes"
            )
    return said


def _scattered_strokes(found: SheetLayout, views: list[View]) -> list[str]:
    """Return a line for strokes left out that lie together as high as a view: a pencil drawing."""
    kinds = np.array([*found.grouping.kinds, ""], dtype=object)
    cell = found.cell_px
    usual = float(np.median([view.figure_box[3] for view in views])) / cell
    reach = max(1, round(BROKEN / 2 * usual))
    strokes = np.isin(kinds, STROKES)[found.blobs.labels - 1]
    together = find_blobs(dilate(strokes, reach))
    said = []
    for number, (x, y, width, height) in enumerate(together.boxes.tolist()):
        tall, broad = height - 2 * reach, width - 2 * reach
        if tall < NEARLY_A_VIEW * usual or broad < SLENDER * tall:
            continue
        if not any(_is_level((y + reach) * cell, tall * cell, view) for view in views):
            continue
        inside = found.blobs.labels[(together.labels == number + 1) & strokes]
        pieces = np.bincount(inside)
        if np.count_nonzero(pieces > CRUMB * pieces.max()) > PIECES:
            x, y = (x + reach) * cell, (y + reach) * cell
            said.append(
                f"strokes at {x}, {y} lie together {100 * tall / usual:.0f} % as high as the "
                "views: if they are a drawing, close its outline"
            )
    return said


def _is_level(top: int, tall: int, view: View) -> bool:
    """Return whether something stands beside a view, not above or below it."""
    _, first, _, height = view.figure_box
    return min(top + tall, first + height) - max(top, first) >= LEVEL * tall


def _shares(own: UInt8[np.ndarray, "n 3"], views: list[np.ndarray]) -> bool:
    """Return whether a drawing has the views' colours about as much as they have each other's."""
    among = [shared_colors(a, b) for i, a in enumerate(views) for b in views[i + 1 : i + 2]]
    least = ALIKE * float(np.median(among)) if among else ALIKE
    return float(np.median([shared_colors(own, view) for view in views])) >= least
