"""Split a sheet into its views: find background and figures, and cut each figure out.

The cost grows with the number of pixels, plus a little per figure.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, UInt8

from toonset.dataset.silhouettes.line_width import contour_width_px
from toonset.dataset.split.background import (
    Background,
    find_background,
    flatten,
    is_transparent,
    remove_residual_alpha,
)
from toonset.dataset.split.beside_views import (
    NAMES,
    FigureGroup,
    LeftOut,
    Swatch,
    groups_of,
    left_out_of,
    swatches_of,
)
from toonset.dataset.split.crop import Crop, boxed_crops, found_crops, grid_crops
from toonset.dataset.split.figures.rows import LIKELIEST, Taken
from toonset.dataset.split.holes import BorderLook, open_holes, outline_look, with_paper
from toonset.dataset.split.matting import cut_out, edge_softness_px
from toonset.dataset.split.pages import Pages, find_pages
from toonset.dataset.split.segment import SheetLayout, find_layout, find_paint
from toonset.dataset.split.warnings import (
    border_warnings,
    figure_warnings,
    mark_warnings,
    page_warnings,
    shadow_warnings,
)
from toonset.dataset.split.watermark import Watermark, find_watermark, remove_watermark
from toonset.errors import SheetError
from toonset.palette.pixels.enlarged import Grid, find_grid
from toonset.view import Box, View

LEAST_FIGURE_PX = 8  # pixels: a lower or narrower figure shows nothing


@dataclass(frozen=True)
class PictureOptions:
    """Options of splitting a sheet.

    Attributes:
        margin_px: empty pixels around every figure.
        least_hole: share of the figure's area from which an enclosed patch in the background's
            colour is a hole.
        most_figures: more are refused; a sheet of letters or a pattern is not a character sheet.
        background_rgb: the background's colour, where a person knows it.
        boxes: (x, y, width, height) of the figures where a person gives them; one view each, in
            this order.
        grid: columns and rows of equal cells, one view per cell that is not empty.
        taken: which group of figures, where a person knows better than its evidence.
        without: names of corrections that are left out, of
            `toonset.dataset.split.corrections.CORRECTIONS`.
    """

    margin_px: int = 4
    least_hole: float = 0.001
    most_figures: int = 64
    background_rgb: tuple[int, int, int] | None = None
    boxes: tuple[Box, ...] = ()
    grid: tuple[int, int] | None = None
    taken: Taken = LIKELIEST
    without: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Segmentation:
    """The drawings of a sheet.

    Attributes:
        views: in reading order, rows from the top, each from left to right.
        background: the sheet's colour; None where it is transparent.
        sure: share of the sheet's border that is background, 0 to 1.
        warnings: what a person should look at, for a view may be wrong.
        left_out: what was seen but is not a view.
        remarks: what was done besides, for people.
        swatches: of the palette that the sheet prints, in reading order.
        groups: of equal figures, the likeliest turnaround first.
    """

    views: tuple[View, ...]
    background: tuple[int, int, int] | None
    sure: float
    warnings: tuple[str, ...]
    left_out: tuple[LeftOut, ...] = ()
    remarks: tuple[str, ...] = ()
    swatches: tuple[Swatch, ...] = ()
    groups: tuple[FigureGroup, ...] = ()


def split_picture(
    rgba: UInt8[np.ndarray, "height width 4"], options: PictureOptions | None = None
) -> Segmentation:
    """Return the views of a sheet.

    Args:
        rgba: the picture; a single figure is fine.
        options: see `PictureOptions`.

    Raises:
        SheetError: blank, no plain background, nothing on it large enough, far too many figures, or
            no correction of that name to leave out.
    """
    options = options or PictureOptions()
    by_hand = bool(options.boxes) or options.grid is not None
    blocks = None if by_hand else find_grid(rgba)
    if blocks is not None:
        return _enlarged(split_picture(blocks.reduced(rgba), options), blocks)
    pages = find_pages(rgba) if options.background_rgb is None else None
    if pages is not None:
        rgba = pages.extended(rgba)
    residual = 0
    if options.background_rgb is not None or not is_transparent(rgba):
        rgba = flatten(rgba)
    else:
        rgba, residual = remove_residual_alpha(rgba)
    of_page = None if pages is None else pages.ground
    ground = of_page or find_background(rgba, options.background_rgb)
    plain = ground.kind == "plain" and of_page is None
    mark = find_watermark(rgba[..., :3], ground.rgb) if plain else None
    if mark is not None:
        rgba = remove_watermark(rgba, mark)
        ground = find_background(rgba, options.background_rgb)
    paint, ground = find_paint(rgba, ground)
    found = find_layout(rgba, paint, ground, options.without, options.taken)
    _check(found, ground, options)
    crops = _crops(found, paint, options)
    views, holes, papered = _views(rgba, ground, crops, options)
    swatches, chosen = swatches_of(found), options.taken != LIKELIEST
    return Segmentation(
        tuple(views),
        ground.rgb,
        ground.sure,
        (*page_warnings(pages), *mark_warnings(mark), *border_warnings(ground, found))
        + (() if by_hand else figure_warnings(found, views, rgba, chosen=chosen))
        + (() if by_hand else shadow_warnings(ground, views, rgba)),
        () if by_hand else left_out_of(found),
        (
            *_of_picture(pages, residual, mark),
            *_remarks(
                *(ground, found, holes, papered),
                0 if by_hand else sum(cut.made for cut in found.cuts),
            ),
        ),
        swatches,
        () if by_hand else groups_of(found),
    )


def _enlarged(found: Segmentation, blocks: Grid) -> Segmentation:
    """Return what was found in a sheet at its own size, as it is in the enlarged one."""

    def box_of(box: Box) -> Box:
        x, y, width, height = box
        left, right = np.searchsorted(blocks.columns, [x, x + width]).tolist()
        top, bottom = np.searchsorted(blocks.rows, [y, y + height]).tolist()
        return left, top, right - left, bottom - top

    views = []
    for view in found.views:
        x, y, width, height = box_of(view.box)
        rows = blocks.rows[y : y + height] - view.box[1]
        columns = blocks.columns[x : x + width] - view.box[0]
        rgba, line = view.rgba[rows[:, None], columns], view.line_width_px * blocks.times
        views.append(replace(view, rgba=rgba, box=(x, y, width, height), line_width_px=line))
    remark = f"enlarged {blocks.times} times without smoothing: cut at its own size"
    return replace(
        found,
        views=tuple(views),
        left_out=tuple(replace(one, box=box_of(one.box)) for one in found.left_out),
        remarks=(remark, *found.remarks),
        swatches=tuple(replace(one, box=box_of(one.box)) for one in found.swatches),
        groups=tuple(
            replace(one, rows=tuple(tuple(map(box_of, row)) for row in one.rows))
            for one in found.groups
        ),
    )


def _check(found: SheetLayout, ground: Background, options: PictureOptions) -> None:
    color = "transparent" if ground.rgb is None else "#{:02x}{:02x}{:02x}".format(*ground.rgb)
    blobs = found.blobs
    if not len(blobs.areas):
        raise SheetError(f"the sheet is blank (all {color}); draw a figure on it")
    width, height = (int(v) * found.cell_px for v in blobs.boxes[blobs.areas.argmax(), 2:])
    if min(width, height) < LEAST_FIGURE_PX:
        raise SheetError(
            f"no figure on the {color} background: the largest patch is {width} x {height} px, "
            f"{LEAST_FIGURE_PX} x {LEAST_FIGURE_PX} is needed; use a larger picture"
        )
    by_hand = bool(options.boxes) or options.grid is not None
    if found.grouping.count > options.most_figures and not by_hand:
        raise SheetError(
            f"found {found.grouping.count} figures, at most {options.most_figures} are read; crop "
            "the sheet to one character"
        )


def _crops(
    found: SheetLayout, paint: Bool[np.ndarray, "height width"], options: PictureOptions
) -> list[Crop]:
    if options.boxes:
        return boxed_crops(found, paint, options.boxes, options.margin_px)
    if options.grid is not None:
        return grid_crops(found, paint, options.grid, options.margin_px)
    return found_crops(found, paint, options.margin_px)


def _window(picture: np.ndarray, box: Box) -> np.ndarray:
    x, y, width, height = box
    return picture[y : y + height, x : x + width]


def _views(
    rgba: np.ndarray, ground: Background, crops: list[Crop], options: PictureOptions
) -> tuple[list[View], int, int]:
    """Return the views, the number of opened holes, and how many views were given paper."""
    holes, papered = 0, 0
    if ground.rgb is None:
        cuts = [np.where(c.solid[..., None], _window(rgba, c.box), np.uint8(0)) for c in crops]
        each = [
            with_paper(cut, crop.solid, crop.enclosed, crop.filled)
            for cut, crop in zip(cuts, crops, strict=True)
        ]
        cuts = [cut for cut, _ in each]
        papered = sum(changed for _, changed in each)
    else:
        papers = [ground.colors(crop.box) for crop in crops]
        softness = _softness(rgba, ground, crops)
        look = BorderLook(0, 0, 0, 0)
        for crop, paper in zip(crops, papers, strict=True):
            rgb = _window(rgba, crop.box)[..., :3]
            look += outline_look(rgb, crop.solid, crop.enclosed, paper)
        cuts = []
        for crop, paper in zip(crops, papers, strict=True):
            rgb = _window(rgba, crop.box)[..., :3]
            solid, opened = open_holes(
                *(rgb, crop.solid, crop.enclosed, paper), *(look, options.least_hole, crop.filled)
            )
            cuts.append(cut_out(rgb, solid, paper, ground.tolerance, softness))
            holes += opened
    return (
        [
            _view(cut, crop.box, f"{i:03d}.png")
            for i, (cut, crop) in enumerate(zip(cuts, crops, strict=True))
        ],
        holes,
        papered,
    )


def _softness(rgba: np.ndarray, ground: Background, crops: list[Crop]) -> int:
    """Return the edge softness of the sheet: the median of its figures'."""
    each = [
        edge_softness_px(
            _window(rgba, crop.box)[..., :3], crop.solid, ground.colors(crop.box), ground.tolerance
        )
        for crop in crops
    ]
    return int(np.median(each))


def _view(cut: UInt8[np.ndarray, "height width 4"], box: Box, name: str) -> View:
    if not (cut[..., 3] >= 128).any():
        raise SheetError(f"view {name}: its figure is nearly transparent; make it opaque")
    return View(cut, box, contour_width_px(cut), name)


def _of_picture(pages: Pages | None, residual: int, mark: Watermark | None) -> tuple[str, ...]:
    """Return what was changed before the figures were looked for."""
    said = [] if pages is None else [f"what lies around {pages} was left out"]
    if residual:
        said.append(f"alpha of up to {residual} of 255 was taken for transparent")
    if mark is not None and not mark.over_figures:
        said.append("a faint drawing behind the figures was taken off the paper")
    return tuple(said)


def _remarks(
    ground: Background, found: SheetLayout, holes: int, papered: int, cuts: int
) -> tuple[str, ...]:
    said = [] if ground.kind in ("plain", "transparent") else [str(ground)]
    kinds = found.grouping.kinds
    said += [f"{NAMES[kind]} left out ({kinds.count(kind)})" for kind in NAMES if kind in kinds]
    if found.groups and found.groups[found.taken.group].outfits and found.taken.outfit is None:
        last = chr(ord("A") + len(found.groups[found.taken.group].rows) - 1)
        said.append(
            f"the rows show the same directions: take one with --outfit A to {last}, or each with "
            "--outfit all"
        )
    if found.lines:
        said.append(f"ruled lines and frames were taken for paper ({len(found.lines)})")
    if found.shadow.any():
        said.append("shadows on the ground were left out")
    if cuts:
        said.append(f"touching figures were cut apart ({cuts})")
    closed = [gap for gap in found.gaps if gap.closed]
    if closed:
        widest = max(gap.width for gap in closed) * found.cell_px
        said.append(f"open outlines were closed ({len(closed)} gaps, up to {widest:.0f} px wide)")
    if papered:
        said.append(f"unpainted patches within figures became white paper ({papered} views)")
    if holes:
        said.append(f"enclosed patches in the background's colour became holes ({holes})")
    return tuple(said)
