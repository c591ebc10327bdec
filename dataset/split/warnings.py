"""Warn of views that may be cut wrongly."""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.split.background import SURE_ENOUGH, Background
from toonset.dataset.split.figures.blobs import Blobs, find_blobs, shared_colors
from toonset.dataset.split.figures.grouping import LEAST_PART
from toonset.dataset.split.figures.open_outlines import LINE, Gap
from toonset.dataset.split.figures.rows import LOWEST
from toonset.dataset.split.pages import Pages
from toonset.dataset.split.segment import SheetLayout, figure_cells
from toonset.dataset.split.watermark import Watermark
from toonset.raster import dilate, sized_parts, wider_than
from toonset.view import View

NEARLY_A_VIEW = 0.5  # of the views' height: something left out that may be a small one
PROPORTIONS = 1.2  # times the widest view's, or less than its inverse of the narrowest's: no view
ALIKE = 0.6  # of the colours that the views share among each other: less is another thing
BROAD = 1.15  # times its own height: wider than arms reach
NEARER = 1.2  # times the gap between parts and their bodies: so near a part may be another's
AS_LIKELY = 0.6  # of the merit of the group that was taken: another may be the turnaround
WHOLE = 0.6  # of the sheet that one view's box covers though there is text beside it
WIDE_GAP = 0.05  # of the figure's height: a wider gap may be meant
LARGE_POCKET = 0.01  # of the figure's squared height: so much more or less changes it
FULL = 0.82  # of its box: no figure fills more
MOST_STROKES = 0.08  # of a view: with more it is hollow somewhere
STROKES = ("mark", "speck", "text")  # as which pieces of a pencil drawing are left out
BROKEN = 0.05  # of the views' height: gaps between its pieces
PIECES = 3  # no sword or ruler has more
LEVEL = 0.7  # of their height: beside a view they stand in its row
SLENDER = 0.12  # of its height: a drawing is no narrower
WIDE = 1.28  # times the next widest of four or more: two figures, or a study that touches


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
    """Return a line if the background is hardly one."""
    if ground.rgb is None or ground.sure >= SURE_ENOUGH or found.lines:  # a frame explains it
        return ()
    return (f"only {100 * ground.sure:.0f} % of the sheet's border is background",)


def figure_warnings(
    found: SheetLayout, views: list[View], rgba: UInt8[np.ndarray, "height width 4"]
) -> tuple[str, ...]:
    """Return a line for every cut in doubt, every wide view, all left out that may be views."""
    return (
        *_cuts(found),
        *_open_outlines(found, views),
        *_wide_views(views),
        *_whole_page(found, views, rgba),
        *_panels(views, rgba),
        *_near_parts(found, views),
        *_other_groups(found),
        *_like_views(found, views, rgba),
        *_scattered_strokes(found, views),
    )


def _cuts(found: SheetLayout) -> list[str]:
    said = []
    for cut in (cut for cut in found.cuts if cut.in_doubt):
        x, y, width, height = (value * found.cell_px for value in cut.box)
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
            gap for gap in found.gaps if _is_worth_a_word(gap) and _is_beside(number, gap, figure)
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


def _is_beside(number: np.ndarray, gap: Gap, figure: int) -> bool:
    reach = max(2, round(gap.width))
    rows = slice(max(gap.y - reach, 0), gap.y + reach + 1)
    columns = slice(max(gap.x - reach, 0), gap.x + reach + 1)
    return bool((number[rows, columns] == figure + 1).any())


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
    said = []
    widths = [view.figure_box[2] / view.figure_box[3] for view in views]
    most = WIDE * sorted(widths)[-2] if len(views) > 3 else BROAD
    for view, width in zip(views, widths, strict=True):
        if width > min(most, BROAD):
            said.append(f"view {view.name} is unusually wide: do two figures touch?")
    return said


def _whole_page(found: SheetLayout, views: list[View], rgba: np.ndarray) -> list[str]:
    """Return a line if the only view may be a panel with all that is on it."""
    _, _, width, height = views[0].figure_box
    covered = width * height >= WHOLE * rgba.shape[0] * rgba.shape[1]
    if len(views) > 1 or not covered or "text" not in found.grouping.kinds:
        return []
    return [
        f"view {views[0].name} is most of the sheet, with text beside it: does it hold more than "
        "one figure? crop the sheet to the figures, or give them with --boxes"
    ]


def _panels(views: list[View], rgba: np.ndarray) -> list[str]:
    """Return a line if views fill their boxes as panels do in which figures stand."""
    fill = [view.mask.sum() / (view.figure_box[2] * view.figure_box[3]) for view in views]
    if np.median(fill) <= FULL or (rgba[..., 3] < 255).any():  # cut out already
        return []
    return [
        "the views are nearly rectangles: if the figures stand on panels, take them off with "
        "--matting"
    ]


def _near_parts(found: SheetLayout, views: list[View]) -> list[str]:
    """Return a line for every part apart that stands as near to another view as parts do."""
    parts, bodies = _parts_apart(found)
    own = [_gap(found.blobs, n, bodies[k]) for n, k in parts]
    reach = NEARER * max((gap for gap in own if np.isfinite(gap)), default=0.0)
    said = []
    for (number, figure), gap in zip(parts, own, strict=True):
        for other, body in enumerate(bodies):
            if other != figure and np.isfinite(gap) and _gap(found.blobs, number, body) <= reach:
                x, y, _, _ = (int(value) * found.cell_px for value in found.blobs.boxes[number])
                said.append(
                    f"a part at {x}, {y} went to view {views[figure].name}: "
                    f"is it a part of {views[other].name}, which is near, too?"
                )
    return said


def _parts_apart(found: SheetLayout) -> tuple[list[tuple[int, int]], list[int]]:
    """Return patches that are parts, with the numbers of their views, and the views' bodies."""
    parts, bodies = list[tuple[int, int]](), list[int]()
    areas = found.blobs.areas
    for figure in range(found.grouping.count):
        own = np.flatnonzero(found.grouping.figure_of_blob == figure)
        bodies.append(int(own[areas[own].argmax()]))
        least = LEAST_PART * areas[bodies[-1]]
        parts += [(int(n), figure) for n in own if n != bodies[-1] and areas[n] >= least]
    return parts, bodies


def _gap(blobs: Blobs, part: int, body: int) -> float:
    """Return how far a part is beside a body, in the body's heights; infinite at no level of it."""
    x, y, width, height = blobs.boxes[part]
    left, top, _, tall = blobs.boxes[body]
    beside = blobs.mask(body)[max(0, y - top) : max(0, y + height - top)]
    columns = np.flatnonzero(beside.any(axis=0))
    if not len(columns):
        return np.inf
    return float(max(left + columns[0] - x - width, x - left - columns[-1] - 1, 0) / tall)


def _other_groups(found: SheetLayout) -> list[str]:
    """Return a line for every other group that may be the turnaround, too."""
    taken = found.groups[found.taken.group]
    said = []
    for number, group in enumerate(found.groups):
        if group is taken or group.merit < AS_LIKELY * taken.merit or found.taken.group:
            continue
        x, y = (int(v) * found.cell_px for v in found.blobs.boxes[group.members, :2].min(axis=0))
        said.append(
            f"{len(group.members)} drawings from {x}, {y} on may be the turnaround, too: take "
            f"them with --group {number + 1}"
        )
    return said


def _like_views(found: SheetLayout, views: list[View], rgba: np.ndarray) -> list[str]:
    """Return a line for every drawing left out that is as high as a view, or like a small one.

    Drawings of another row of equal figures are poses or busts, which the row says.
    """
    rows = [row for group in found.groups for row in group.rows if len(row) > 1]
    in_rows = set(np.concatenate([np.zeros(0, int), *rows]).tolist())
    usual = float(np.median([view.figure_box[3] for view in views]))
    shapes = [view.figure_box[2] / view.figure_box[3] for view in views]
    colors = [view.rgba[view.mask][:, :3] for view in views]
    said, cell = [], found.cell_px
    for number, kind in enumerate(found.grouping.kinds):
        if kind != "study" or number in in_rows:
            continue
        x, y, width, height = (int(value) * cell for value in found.blobs.boxes[number])
        if height < NEARLY_A_VIEW * usual:
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
        if len(np.unique(found.blobs.labels[together.labels == number + 1])) > PIECES:
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
