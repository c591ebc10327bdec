"""Warn of views that may be cut wrongly."""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.split.background import SURE_ENOUGH, Background, ring_of
from toonset.dataset.split.figures.open_outlines import LINE, Gap
from toonset.dataset.split.figures.parts_in_doubt import parts_in_doubt
from toonset.dataset.split.figures.shadows import dimmed, see_through
from toonset.dataset.split.left_out_warnings import like_views, other_groups, scattered_strokes
from toonset.dataset.split.pages import Pages
from toonset.dataset.split.segment import SheetLayout, figure_cells
from toonset.dataset.split.view_warnings import (
    is_level,
    off_row,
    one_in_another,
    tops_of,
    two_heads,
    uneven_views,
    wide_views,
)
from toonset.dataset.split.watermark import Watermark
from toonset.raster import sized_parts, wider_than
from toonset.view import View

REACHING = 0.1  # of the sheet's border: so much may be figures that reach over its edge
LEAST_SHADOW = 0.02  # of the height: so much lower than its row
SHADED = 0.9  # of what is lower: it is shadow
SCRAP = 0.3  # of the sheet's height and of its width: an only view is less of both
HEADS = 0.75  # of a head's height: the width of tops that may be heads
WHOLE = 0.6  # of the sheet that one view's box covers though there is text beside it
WIDE_GAP = 0.05  # of the figure's height: a wider gap may be meant
LARGE_POCKET = 0.01  # of the figure's squared height: so much more or less changes it
FULL = 0.82  # of its box: no figure fills more
MOST_STROKES = 0.08  # of a view: with more it is hollow somewhere
NO_OUTLINE = ("text", "swatch")  # no gap is between a figure and these


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
        row = [view, *(other for other in views if is_level(top, height, other))]
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
        *wide_views(views),
        *two_heads(views),
        *off_row(views),
        *uneven_views(views),
        *one_in_another(views),
        *_only_view(found, views, rgba),
        *_panels(views, rgba),
        *parts_in_doubt(
            *(found.blobs, found.grouping, rgba[:: found.cell_px, :: found.cell_px, :3]),
            *(found.cell_px, [view.name for view in views]),
        ),
        *other_groups(found, views, rgba),
        *like_views(found, views, rgba, chosen=chosen),
        *scattered_strokes(found, views),
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


def _only_view(found: SheetLayout, views: list[View], rgba: np.ndarray) -> list[str]:
    """Return a line if the only view may be a scrap, a panel with all on it, or several figures."""
    if len(views) > 1:
        return []
    _, _, width, height = views[0].figure_box
    if max(height / rgba.shape[0], width / rgba.shape[1]) < SCRAP:
        return [
            f"view {views[0].name} is the only one, and small on its sheet: did the cut miss "
            "fainter or larger figures? crop the sheet to them, or give them with --boxes"
        ]
    if width * height < WHOLE * rgba.shape[0] * rgba.shape[1]:
        return []
    if "text" in found.grouping.kinds:
        beside = ", with text beside it"
    elif len(tops_of(views[0], HEADS)) > 1:
        beside = " and has two tops"
    else:
        return []
    return [
        f"view {views[0].name} is most of the sheet{beside}: does it hold more than "
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
