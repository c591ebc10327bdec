"""Find the page in pictures that show more: art boards, viewers, cards, paper on a desk.

A page is a smooth zone in another colour than the picture's own ground, whose outline is a
rectangle, upright or seen at an angle, and on which most of what is drawn stands. What lies around
it is not of the sheet and shows the page's nearest paper instead, so places stay as they are. A
page that lies at an angle is seen from straight above first (`straightened`).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.dataset.images.zones import find_zones, shrunk
from toonset.dataset.split.background import (
    Background,
    difference,
    find_background,
    of_paper,
    ring_of,
)
from toonset.dataset.split.background_field import fit_zone
from toonset.dataset.split.background_zones import LEAST_ZONE
from toonset.dataset.split.figures.frames import FRAMED
from toonset.errors import SheetError
from toonset.raster import connected_to, dilate, erode, from_nearest, sized_parts

LONGEST_PX = 800  # of the copy in which pages are looked for
LEAST_PAGE = 0.03  # of the picture
LEAST_PIECE = 0.005  # of the picture: ruled lines part a page into pieces
SAME_PAPER = 32  # levels between the pieces of a page
LINE = 4  # cells: ruled lines are no thicker
APART = 10  # levels between page and ground: a frame on the same paper is no page
FOUR_SIDED = 0.95  # of the four-sided figure round it: more is cut off the corners of no page
STEEPEST = 0.6  # of the smallest rectangle round it: paper seen at an angle fills less of it
PLAIN_RIM = 0.85  # of the page's outline that its own colour takes
PAPER = 0.35  # of the page that is not drawn on: less is a figure's outline
CELLS = 3  # that a zone ends before its edge
THING = 0.12  # of the page's height: a drawing is no lower
ALONE = 0.6  # of the page's height: one such drawing is enough
AS_TALL = 0.6  # of the tallest drawing on the pages: what stands beside them counts, too
STRIP = 0.12  # of the same: narrower things beside them are edges and shadows
STRAIGHT = 0.5  # of each side of a panel: things drawn over its edge hide the rest
FULL = 0.97  # of a panel: no ground from around it
LEAST_PANEL = 0.3  # of the picture
PLAIN_PANEL = 0.4  # of its inner edge that smooth zones take: no picture
SMOOTH = 0.95  # of these in the colours of one ground
UPRIGHT = 0.97  # of the smallest rectangle: less is a perspective
FOCAL = 0.75  # of a photograph's longer side: a phone's lens


@dataclass(frozen=True, eq=False)
class Pages:
    """The pages of a picture.

    Attributes:
        mask: (height, width) pixels inside of their edges, and what stands over an edge.
        around: the picture with paper alone, to be shown elsewhere.
        count: how many there are.
        upright: their edges are the picture's rows and columns.
        ground: the paper, where it is known already.
    """

    mask: Bool[np.ndarray, "height width"]
    around: UInt8[np.ndarray, "height width 4"]
    count: int
    upright: bool
    ground: Background | None = None

    def extended(
        self, rgba: UInt8[np.ndarray, "height width 4"]
    ) -> UInt8[np.ndarray, "height width 4"]:
        """Return the picture with paper in place of what lies around the pages."""
        return np.where(self.mask[..., None], rgba, self.around)

    def __str__(self) -> str:
        """Return where they are, for people."""
        x, y, width, height = cv2.boundingRect(self.mask.view(np.uint8))
        what = "one page" if self.count == 1 else f"{self.count} pages"
        return f"{what} within {width} x {height} px at {x}, {y}"


@dataclass(frozen=True, eq=False)
class _Page:
    """One page, in cells: what it covers, its corners, its paper, its tallest drawing."""

    mask: Bool[np.ndarray, "rows columns"]
    corners: Float[np.ndarray, "4 2"]
    paper: Bool[np.ndarray, "rows columns"]
    tallest: int
    upright: bool


@dataclass(frozen=True, eq=False)
class _Seen:
    """A picture in cells: colours, smooth zones, what is around all of them, and the pages."""

    rgb: UInt8[np.ndarray, "rows columns 3"]
    labels: Int[np.ndarray, "rows columns"]
    outer: Bool[np.ndarray, "rows columns"]
    clear: bool
    shrink: float
    pages: list[_Page]


def find_pages(rgba: UInt8[np.ndarray, "height width 4"]) -> Pages | None:
    """Return the pages on which a picture's figures are drawn; None if it is a page itself."""
    seen = _seen(rgba)
    if not seen.pages:
        return None if seen.clear else _panel(rgba, seen.rgb, seen.labels, seen.outer)
    mask, paper = (
        cv2.resize(np.any(cells, axis=0).view(np.uint8), rgba.shape[1::-1], interpolation=0) > 0
        for cells in ([page.mask for page in seen.pages], [page.paper for page in seen.pages])
    )
    around = from_nearest(rgba, paper)
    return Pages(mask, around, len(seen.pages), all(page.upright for page in seen.pages))


def straightened(
    rgba: UInt8[np.ndarray, "height width 4"],
) -> UInt8[np.ndarray, "height width 4"] | None:
    """Return a picture of one page at an angle as it is seen from straight above.

    The page's middle stays, and so does the picture's size; None where no page lies at an angle.
    The page's proportions follow from its four corners and a camera of usual focal length that
    looks at the picture's middle (Zhang and He, Whiteboard scanning and image enhancement, 2007).
    """
    seen = _seen(rgba)
    if len(seen.pages) != 1 or seen.pages[0].upright:
        return None
    size = np.array(rgba.shape[1::-1])
    corners = (seen.pages[0].corners + 0.5) / seen.shrink - 0.5
    flat = _rectangle(corners, size)
    matrix = cv2.getPerspectiveTransform(corners.astype(np.float32), flat.astype(np.float32))
    return np.asarray(
        cv2.warpPerspective(
            rgba, matrix, size.tolist(), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
        )
    )


def _corners(hull: Int[np.ndarray, "corners 1 2"]) -> Float[np.ndarray, "4 2"] | None:
    """Return the corners of an outline, clockwise from the upper left one."""
    found = cv2.approxPolyN(hull.astype(np.float32), 4, ensure_convex=True).reshape(-1, 2)
    if len(found) != 4:
        return None
    corners = np.asarray(found, dtype=np.float64)
    away = corners - corners.mean(axis=0)
    around = np.argsort(np.arctan2(away[:, 1], away[:, 0]))  # y points down: clockwise
    first = int((corners[around] @ (1, 1)).argmin())
    return corners[np.roll(around, -first)]


def _rectangle(
    corners: Float[np.ndarray, "4 2"], size_wh: Int[np.ndarray, " 2"]
) -> Float[np.ndarray, "4 2"]:
    """Return the upright rectangle of the same area and middle whose corners are seen there."""
    focal = FOCAL * size_wh.max()
    rays = np.column_stack([(corners - (size_wh - 1) / 2) / focal, np.ones(4)])
    left_top, right_top, right_bottom, left_bottom = rays
    diagonal = np.cross(left_top, right_bottom)
    right = diagonal @ left_bottom / (np.cross(right_top, right_bottom) @ left_bottom)
    down = diagonal @ right_top / (np.cross(left_bottom, right_bottom) @ right_top)
    aspect = np.linalg.norm(right * right_top - left_top) / np.linalg.norm(
        down * left_bottom - left_top
    )
    area = cv2.contourArea(corners.astype(np.float32))
    half = np.sqrt(area * np.array([aspect, 1 / aspect])) / 2
    half *= min(1.0, ((size_wh - 1) / 2 / half).min())
    middle = np.clip(corners.mean(axis=0), half, size_wh - 1 - half)
    return middle + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])


def _seen(rgba: UInt8[np.ndarray, "height width 4"]) -> _Seen:
    small, shrink = shrunk(rgba, LONGEST_PX)
    clear, ring = small[..., 3] < 128, ring_of(*small.shape[:2])
    rgb = _opaque(small, clear)
    labels = find_zones(rgb, shrink, LEAST_PIECE).labels
    areas = np.bincount(labels.ravel())
    at_border = np.bincount(labels[ring], minlength=len(areas)) >= LEAST_ZONE * ring.sum()
    see_through = np.bincount(labels[clear], minlength=len(areas)) > 0.5 * areas
    outer = see_through if clear.any() else at_border
    outer[0] = False
    large = np.flatnonzero((areas >= LEAST_PAGE * labels.size) & ~outer)
    found = [_page(_sheet(int(n), labels, outer, rgb)) for n in large[large > 0]]
    pages = [page for page in found if page is not None]
    pages = [page for page in pages if not any(_is_in(page, other) for other in pages)]
    if pages and not _hold_all(pages, outer[labels]):
        pages = []
    return _Seen(rgb, labels, outer[labels], bool(clear.any()), shrink, pages)


def _opaque(rgba: np.ndarray, clear: np.ndarray) -> UInt8[np.ndarray, "rows columns 3"]:
    """Return the picture with what is clear in a colour far from what is not."""
    if not clear.any():
        return np.ascontiguousarray(rgba[..., :3])
    usual = np.zeros(3) if clear.all() else np.median(rgba[~clear][:, :3], axis=0)
    far = np.where(usual < 128, 255, 0).astype(np.uint8)
    return np.where(clear[..., None], far, rgba[..., :3])


def _sheet(
    number: int, labels: np.ndarray, outer: np.ndarray, rgb: np.ndarray
) -> Bool[np.ndarray, "rows columns"]:
    """Return a zone with the pieces that ruled lines part from it; empty if it is as the ground."""
    own = labels == number
    color = np.median(rgb[own], axis=0)

    def away(other: int) -> float:
        return float(np.abs(color - np.median(rgb[labels == other], axis=0)).max())

    if any(away(int(ground)) < APART for ground in np.flatnonzero(outer)):
        return np.zeros_like(own)
    beside = np.unique(labels[dilate(own, LINE)])
    pieces = beside[(beside > 0) & (beside != number) & ~outer[beside]]
    alike = [int(piece) for piece in pieces if away(int(piece)) <= SAME_PAPER]
    return np.isin(labels, [number, *alike])


def _page(own: Bool[np.ndarray, "rows columns"]) -> _Page | None:
    """Return what a zone's outline holds, if that is a page."""
    outlines, _ = cv2.findContours(own.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not outlines:
        return None
    hull = cv2.convexHull(np.concatenate(outlines))
    corners = _corners(hull)
    _, (width, height), angle = cv2.minAreaRect(hull)
    area = cv2.contourArea(hull)
    filled = area / max(width * height, 1)
    mask, rim = np.zeros(own.shape, np.uint8), np.zeros(own.shape, np.uint8)
    cv2.drawContours(mask, [hull], -1, 1, cv2.FILLED)
    cv2.drawContours(rim, [hull], -1, 1, 1)
    if corners is None or area < FOUR_SIDED * cv2.contourArea(corners.astype(np.float32)):
        return None
    if filled < STEEPEST or dilate(own, CELLS)[rim > 0].mean() < PLAIN_RIM:
        return None
    if own.sum() < PAPER * np.count_nonzero(mask):
        return None
    tall = int(cv2.boundingRect(mask)[3])
    heights = _heights((mask > 0) & ~own, rim > 0)
    tallest = int(heights.max(initial=0))
    if (heights >= THING * tall).sum() < 2 and tallest < ALONE * tall:
        return None
    tilt_deg = abs((angle + 45) % 90 - 45)
    return _Page(mask > 0, corners, own, tallest, tilt_deg <= 0.5 and filled >= UPRIGHT)


def _panel(
    rgba: UInt8[np.ndarray, "height width 4"],
    rgb: UInt8[np.ndarray, "rows columns 3"],
    labels: Int[np.ndarray, "rows columns"],
    ground: Bool[np.ndarray, "rows columns"],
) -> Pages | None:
    """Return the panel that the ground around it shows, whatever stands over its edge.

    Most of what is not ground fills an upright rectangle, and most of each of its sides is an edge
    of that ground.
    """
    ground = connected_to(ring_of(*ground.shape), dilate(ground, CELLS))
    size_wh = rgba.shape[1::-1]
    numbers, areas = sized_parts(~ground)
    if len(areas) < 2:
        return None
    own = numbers == 1 + int(areas[1:].argmax())
    sides = [_side(turned) for turned in (own, own[:, ::-1], own.T, own.T[:, ::-1])]
    (left, _), (right, _), (top, _), (bottom, _) = sides
    edge = 2 * CELLS
    inside = np.zeros_like(own)
    inside[top + edge : len(own) - bottom - edge, left + edge : own.shape[1] - right - edge] = True
    straight = min(share for _, share in sides) >= STRAIGHT
    if not straight or inside.sum() < LEAST_PANEL * own.size or own[inside].mean() < FULL:
        return None
    paper = _paper_of(rgba, rgb, labels, inside)
    if paper is None:
        return None
    if np.abs(np.median(rgb[ground], axis=0) - paper.rgb).max() < APART:
        return None
    shown = paper.colors((0, 0, *size_wh))
    drawn = inside & (difference(rgb, cv2.resize(shown, rgb.shape[1::-1])) > SAME_PAPER)
    heights = _heights(drawn, np.zeros_like(drawn))
    if heights.max(initial=0) < FRAMED * np.count_nonzero(inside.any(axis=1)):
        return None
    if _is_flat(rgba):
        return None
    beyond = dilate(own, CELLS) & ~dilate(inside, edge + CELLS)
    cells = inside | (dilate(beyond, edge + CELLS) & own)
    mask = cv2.resize(cells.view(np.uint8), size_wh, interpolation=cv2.INTER_NEAREST) > 0
    return Pages(mask, np.dstack([shown, np.full_like(shown[..., :1], 255)]), 1, True, paper)


def _is_flat(rgba: UInt8[np.ndarray, "height width 4"]) -> bool:
    """Return whether the page and its panels are flat, so all of the sheet can stay as it is."""
    try:
        return find_background(rgba).kind == "stepped"
    except SheetError:
        return False


def _paper_of(
    rgba: UInt8[np.ndarray, "height width 4"],
    small: UInt8[np.ndarray, "rows columns 3"],
    labels: Int[np.ndarray, "rows columns"],
    inside: Bool[np.ndarray, "rows columns"],
) -> Background | None:
    """Return the smooth ground that zones along a panel's edge show; None if it is a picture."""
    rim = inside & ~erode(inside, CELLS)
    counts = np.bincount(labels[rim], minlength=int(labels.max()) + 1)
    own = counts >= LEAST_ZONE * rim.sum()
    own[0] = False
    cells = own[labels] & inside
    if counts[own].sum() < PLAIN_PANEL * rim.sum():
        return None
    colors = fit_zone(small, cells).colors((0, 0, *small.shape[1::-1]))
    if (difference(small, colors)[cells] <= APART).mean() < SMOOTH:
        return None
    size_wh = rgba.shape[1::-1]
    plate = cv2.resize(colors, size_wh, interpolation=cv2.INTER_LINEAR)
    paper = cv2.resize(erode(cells).view(np.uint8), size_wh, interpolation=cv2.INTER_NEAREST) > 0
    return of_paper(rgba, plate, paper, float(counts[own].sum() / rim.sum()))


def _side(own: Bool[np.ndarray, "rows columns"]) -> tuple[int, float]:
    """Return the column where most rows of a patch begin, and the share of its rows that do."""
    rows = own[own.any(axis=1)]
    first = rows.argmax(axis=1)
    counts = np.bincount(first, minlength=3)
    near = np.convolve(counts, np.ones(3, int), "same")  # an edge is drawn by hand
    return int(near.argmax()), float(near.max() / len(rows))


def _heights(
    mask: Bool[np.ndarray, "rows columns"], rim: Bool[np.ndarray, "rows columns"]
) -> Int[np.ndarray, " things"]:
    """Return the heights of connected patches, but those that a rim runs through."""
    _, found, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8)
    labels = np.asarray(found, dtype=np.int32)
    whole = np.ones(len(stats), dtype=bool)
    whole[labels[rim]] = False
    whole[0] = False
    return np.asarray(stats[whole, cv2.CC_STAT_HEIGHT], dtype=np.int64)


def _is_in(page: _Page, other: _Page) -> bool:
    """Return whether a page lies on a larger one."""
    shared = np.count_nonzero(page.mask & other.mask)
    smaller = page.mask.sum() < other.mask.sum()
    return page is not other and bool(smaller and shared > 0.5 * page.mask.sum())


def _hold_all(pages: list[_Page], ground: Bool[np.ndarray, "rows columns"]) -> bool:
    """Return whether nothing as tall as the pages' drawings stands beside them."""
    tallest = max(page.tallest for page in pages)
    around = dilate(np.any([page.mask for page in pages], axis=0), 2 * CELLS)
    width = max(3, round(STRIP * tallest))
    beside = (~ground & ~around).view(np.uint8)
    thick = cv2.morphologyEx(beside, cv2.MORPH_OPEN, np.ones((width, width), np.uint8)) > 0
    border = np.ones(ground.shape, dtype=bool)
    border[1:-1, 1:-1] = False
    return int(_heights(thick, border).max(initial=0)) < AS_TALL * tallest
