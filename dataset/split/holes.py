"""Tell holes from white eyes, shirts and paper among patches in the background's colour.

A picture alone cannot always tell; these rules say what is assumed. A patch is a hole (the gap
between arm and body) if all of this holds:

- it is larger than a small share of the figure,
- it is as high as wide or higher, as gaps beside arms and legs are, or as large as one between the
  legs of something broad: ribbons, cuffs, labels and eyes are wider than high,
- it does not lie in the figure's top: a white patch there is hair, a face or a hat,
- nothing lies inside it (an eye has a pupil),
- a limb divides it from the outside: neither only a line (white clothes reach up to the outline)
  nor half of the body (a white bag, a button),
- a line or another colour runs all round it: it does not fade into a shade of its own colour; but
  between the feet a shadow on the ground may close it,
- its border looks like the figure's outline: as inked as that, and without soft shades beside it
  on this side of the line (a white shirt has folds and borders on skin without the contour line);
  but beside light paint of another tint (cream trousers on cream paper) it is enough that the patch
  has the paper's tint,
- most of the figure is in other colours (else it is a line drawing, whose paper is its body).

On even tinted paper a patch in exactly the paper's colour is a hole whatever is round it, unless
something lies inside it: nobody mixes that paint by chance.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.dataset.split.background import difference
from toonset.dataset.split.figures.open_outlines import LEAST_POCKET, LINE, line_walls
from toonset.raster import depth_inside, dilate, distance_to, erode, sized_parts, wider_than
from toonset.view import over_white

LEAST_HOLE_PX = 9
LEAST_ISLAND = 0.008  # of the figure's height, its side: smaller is the paper's grain
LINE_ART = 0.5  # of the figure without its lines: more in the background's colour is a line drawing
EDGE_PX = 2.0  # of a figure on transparency: its soft edge
INK_LUMA = 64  # of 255: darker is ink
HEAD = 0.25  # of the figure's height from its top: no holes there
UPRIGHT = 0.9  # times its width: a hole's height
LYING = 0.05  # of the figure's area: unless it is as large as this
SOFT_SHADE = 48  # levels from the background: nearer is a shade of it
LEAST_WALL_PX = 4.0
THIN_WALL = 0.025  # of the figure's height: no limb but a line
MOST_THIN = 0.15  # of the border behind so thin a wall
THICK_WALL = 0.2  # of the figure's height: no limb but the body
CLEAR = 40  # levels from the background: a line or another colour
MOST_FADING = 0.1  # of the border
AT_THE_FEET = 0.1  # of the figure's height from its bottom: where a gap ends on the ground
SHADED = 0.15  # of such a gap's height, its lowest: a shadow may lie there
AS_INKED = 0.65  # of the outline's share of ink
SLACK = 0.05  # of the border: the shares of a short border are rough
PAPER_TINT = 3.0  # levels, of a patch's mean: nearer to the background is paper beside light paint
PAINT_TINT = 6.0  # levels: farther is light paint
TINTED = 250  # levels, of the background's darkest band: paper below is tinted
EVEN_PAPER = 2  # levels, over a figure's crop: paper with parts of its own may be in their paint
EXACT = 0.3  # levels, of a patch's mean: nearer to tinted paper it is that paper
LEAST_PAINT = 0.5  # of a patch's area: so much light paint tells what paper is


@dataclass(frozen=True)
class BorderLook:
    """Counts of pixels along a border.

    Attributes:
        ink: dark pixels within 3 px.
        near: pixels within 3 px.
        shades: those of `far` that are nearly background, with no ink between; nearer, the edge
            itself is soft.
        far: pixels 3 to 4 px away.
    """

    ink: int
    near: int
    shades: int
    far: int

    def __add__(self, other: BorderLook) -> BorderLook:
        """Return the look of both borders together."""
        return BorderLook(
            self.ink + other.ink,
            self.near + other.near,
            self.shades + other.shades,
            self.far + other.far,
        )

    def could_belong_to(self, outline: BorderLook) -> bool:
        """Return whether this border is as inked as the outline, and as free of soft shades."""
        ink, shades = self.ink / max(self.near, 1), self.shades / max(self.far, 1)
        least_ink = AS_INKED * outline.ink / max(outline.near, 1) - SLACK
        return ink >= least_ink and shades <= outline.shades / max(outline.far, 1) + SLACK


def outline_look(
    rgb: UInt8[np.ndarray, "height width 3"],
    mask: Bool[np.ndarray, "height width"],
    enclosed: Bool[np.ndarray, "height width"],
    background: UInt8[np.ndarray, "height width 3"],
) -> BorderLook:
    """Return what a figure's outline looks like; see `open_holes` for the arguments."""
    return _look(
        ~mask,
        mask & ~enclosed,
        difference(rgb, background),
        cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2GRAY),
    )


def open_holes(
    rgb: UInt8[np.ndarray, "height width 3"],
    mask: Bool[np.ndarray, "height width"],
    enclosed: Bool[np.ndarray, "height width"],
    background: UInt8[np.ndarray, "height width 3"],
    outline: BorderLook,
    least_share: float,
    filled: Bool[np.ndarray, "height width"] | None = None,
) -> tuple[Bool[np.ndarray, "height width"], int]:
    """Return the figure without its holes, and how many there were.

    Args:
        rgb: the crop of the sheet.
        mask: the figure with everything that it encloses.
        enclosed: its patches in the background's colour.
        background: that colour behind the crop.
        outline: what the outlines of all figures of the sheet look like.
        least_share: of the figure's area; a smaller patch is not a hole.
        filled: what an open outline encloses; no hole.
    """
    area = int(mask.sum())
    if not enclosed.any() or is_line_art(mask, enclosed):
        return mask, 0
    bare, opened = _bare_paper(rgb, mask, enclosed, background, least_share * area)
    enclosed, result = enclosed & ~bare, mask & ~bare
    if filled is not None:
        enclosed = enclosed & ~filled
    contrast, luma = (
        difference(rgb, background),
        cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2GRAY),
    )
    depth = depth_inside(mask) + 0.5
    _, labels, stats, _ = cv2.connectedComponentsWithStats(
        enclosed.astype(np.uint8), connectivity=4
    )
    tints = _tints(labels, len(stats), rgb, background)
    light_paint = int(stats[1:, cv2.CC_STAT_AREA][tints[1:] > PAINT_TINT].sum())
    rows = np.flatnonzero(mask.any(axis=1))
    top, height = int(rows[0]), int(rows[-1] - rows[0]) + 1
    for number in range(1, len(stats)):
        if stats[number, cv2.CC_STAT_AREA] < max(least_share * area, LEAST_HOLE_PX):
            continue
        if stats[number, cv2.CC_STAT_TOP] < top + HEAD * height:
            continue
        if not _is_upright(stats[number]) and stats[number, cv2.CC_STAT_AREA] < LYING * area:
            continue
        window = _window(stats[number], labels.shape)
        patch = labels[window] == number
        shown = _above_the_ground(stats[number], window, top + height, height)
        look = _look(patch, (mask & ~enclosed)[window] & shown, contrast[window], luma[window])
        if not _is_behind_a_limb(patch, shown, depth[window], height):
            continue
        fades = _fading(patch, shown, contrast[window]) > MOST_FADING
        told_apart = light_paint >= LEAST_PAINT * stats[number, cv2.CC_STAT_AREA]
        is_paper = told_apart and tints[number] <= PAPER_TINT
        looks_empty = is_paper or look.could_belong_to(outline)
        if looks_empty and not fades and not _has_islands(patch, LEAST_ISLAND * height):
            result[window] &= ~patch
            opened += 1
    return result, opened


def is_line_art(
    mask: Bool[np.ndarray, "height width"], enclosed: Bool[np.ndarray, "height width"]
) -> bool:
    """Return whether a figure is lines around paper, with few painted patches."""
    tall = int(mask.any(axis=1).sum())
    reach = max(1, round(LINE * tall))
    painted = wider_than(mask & ~enclosed, reach)
    paper = int(enclosed.sum())
    return paper > LINE_ART * (paper + int(painted.sum()))


def unpainted_patches(
    mask: Bool[np.ndarray, "height width"],
    enclosed: Bool[np.ndarray, "height width"],
    filled: Bool[np.ndarray, "height width"] | None,
) -> Bool[np.ndarray, "height width"]:
    """Return what is left unpainted of a figure on transparency.

    All that lines enclose if it is a line drawing; else large patches that lines alone close off
    from the outside, as they do clothes and not the gap between arm and body.

    Args:
        mask: the figure with everything that it encloses.
        enclosed: its transparent patches.
        filled: those that an open outline encloses; None: none.
    """
    if not enclosed.any() or is_line_art(mask, enclosed):
        return enclosed
    tall = float(mask.any(axis=1).sum())
    found = np.zeros_like(mask) if filled is None else filled.copy()
    numbers, areas = sized_parts(enclosed & ~found, connectivity=4)
    drawn, large = mask & ~enclosed, areas >= LEAST_POCKET * tall**2
    large[0] = False
    return found | (large & line_walls(numbers, len(areas), drawn, ~mask, tall))[numbers]


def with_paper(
    rgba: UInt8[np.ndarray, "height width 4"],
    mask: Bool[np.ndarray, "height width"],
    enclosed: Bool[np.ndarray, "height width"],
    filled: Bool[np.ndarray, "height width"] | None,
) -> tuple[UInt8[np.ndarray, "height width 4"], bool]:
    """Return a figure with white paper under its unpainted patches, and whether it has any.

    There the soft edges of lines become opaque, too; in a line drawing all but its outermost edge.

    Args:
        rgba: the figure on transparency.
        mask: where it is, with everything that it encloses.
        enclosed: its transparent patches.
        filled: those that an open outline encloses; None: none.
    """
    patches = unpainted_patches(mask, enclosed, filled)
    if not patches.any():
        return rgba, False
    away = distance_to(~mask)
    inner = away > EDGE_PX if is_line_art(mask, enclosed) else distance_to(patches) < away
    under = patches | (mask & inner & (rgba[..., 3] < 255))
    result = rgba.copy()
    rgb = np.rint(255 * over_white(rgba[under][None])[0])
    result[under] = np.column_stack([rgb, np.full(len(rgb), 255)]).astype(np.uint8)
    return result, True


def _above_the_ground(
    stat: np.ndarray, window: tuple[slice, slice], bottom: int, tall: int
) -> Bool[np.ndarray, "height 1"]:
    """Return the rows of a patch's window whose border tells what it is: not a shadow between feet.

    Args:
        stat: the patch, as OpenCV measures it.
        window: around it.
        bottom: row below the figure.
        tall: the figure's height.
    """
    high, ends = stat[cv2.CC_STAT_HEIGHT], stat[cv2.CC_STAT_TOP] + stat[cv2.CC_STAT_HEIGHT]
    last = ends - SHADED * high if ends >= bottom - AT_THE_FEET * tall else np.inf
    return (np.arange(window[0].start, window[0].stop) < last)[:, None]


def _is_behind_a_limb(
    patch: Bool[np.ndarray, "height width"],
    shown: Bool[np.ndarray, "height 1"],
    depth: Float[np.ndarray, "height width"],
    tall: int,
) -> bool:
    """Return whether a patch is as far from the outside as a limb is thick, in the shown rows."""
    rim = patch & ~erode(patch) & shown
    walls = depth[rim]
    thin = float((walls <= max(LEAST_WALL_PX, THIN_WALL * tall)).mean())
    return thin <= MOST_THIN and float(walls.min()) <= THICK_WALL * tall


def _bare_paper(
    rgb: UInt8[np.ndarray, "height width 3"],
    mask: Bool[np.ndarray, "height width"],
    enclosed: Bool[np.ndarray, "height width"],
    background: UInt8[np.ndarray, "height width 3"],
    least_px: float,
) -> tuple[Bool[np.ndarray, "height width"], int]:
    """Return the patches that show tinted paper, and how many; see `open_holes`."""
    found, count = np.zeros_like(mask), 0
    low, high = background.min(axis=(0, 1)), background.max(axis=(0, 1))
    tinted = low.min() < TINTED and high.max() > INK_LUMA  # black and white are common paints
    if not (enclosed.any() and tinted and (high - low).max() <= EVEN_PAPER):
        return found, count
    least_island = LEAST_ISLAND * np.count_nonzero(mask.any(axis=1))
    labels, areas = sized_parts(enclosed, connectivity=4)
    # pixels of edges and of lines across a gap are another colour
    own = np.where(erode(enclosed) & (difference(rgb, background) < CLEAR), labels, 0)
    tints = _tints(own, len(areas), rgb, background)
    large = (areas >= max(least_px, LEAST_HOLE_PX)) & (
        np.bincount(own.ravel(), minlength=len(areas)) > 0
    )
    for number in np.flatnonzero(large & (tints <= EXACT)):
        if number and not _has_islands(labels == number, least_island):
            found |= labels == number
            count += 1
    return found, count


def _fading(
    patch: Bool[np.ndarray, "height width"],
    shown: Bool[np.ndarray, "height 1"],
    contrast: UInt8[np.ndarray, "height width"],
) -> float:
    """Return the share of a patch's border beside which nothing differs from the background."""
    rim = dilate(patch) & ~patch & shown
    around = cv2.dilate(contrast, np.ones((7, 7), np.uint8))
    return float((around[rim] < CLEAR).mean()) if rim.any() else 0.0


def _look(
    empty: np.ndarray, solid: np.ndarray, contrast: np.ndarray, luma: np.ndarray
) -> BorderLook:
    reach = [dilate(empty, steps) for steps in (2, 3, 4)]
    near, far = reach[1] & solid, reach[2] & ~reach[0] & solid
    on_this_side = empty
    for _ in range(4):
        on_this_side = dilate(on_this_side) & (empty | (luma >= INK_LUMA))
    return BorderLook(
        int((luma[near] < INK_LUMA).sum()),
        int(near.sum()),
        int((contrast[far & on_this_side] < SOFT_SHADE).sum()),
        int(far.sum()),
    )


def _tints(
    labels: np.ndarray, count: int, rgb: np.ndarray, background: np.ndarray
) -> Float[np.ndarray, " labels"]:
    """Return how far each patch's mean colour is from the background's, levels of its worst band.

    A patch's edge pixels are left out where it has others.
    """
    own = np.where(erode(labels > 0), labels, 0)
    numbers = np.where(np.isin(np.arange(count), own)[labels], own, labels).ravel()
    counts = np.maximum(np.bincount(numbers, minlength=count), 1)
    away = rgb.astype(np.float64) - background
    bands = [np.bincount(numbers, away[..., c].ravel(), count) / counts for c in range(3)]
    return np.abs(bands).max(axis=0)


def _is_upright(stat: np.ndarray) -> bool:
    """Return whether a patch is as high as wide or higher, as gaps beside limbs are."""
    return bool(stat[cv2.CC_STAT_HEIGHT] >= UPRIGHT * stat[cv2.CC_STAT_WIDTH])


def _window(stat: np.ndarray, shape: tuple[int, int]) -> tuple[slice, slice]:
    x, y, width, height = (int(value) for value in stat[:4])
    return (
        slice(max(y - 5, 0), min(y + height + 5, shape[0])),
        slice(max(x - 5, 0), min(x + width + 5, shape[1])),
    )


def _has_islands(patch: Bool[np.ndarray, "height width"], least_px: float) -> bool:
    """Return whether something at least so many pixels wide lies inside the patch."""
    outside = np.pad(~patch, 1, constant_values=True).astype(np.uint8)
    _, _, stats, _ = cv2.connectedComponentsWithStats(outside, connectivity=8)
    sizes = np.sort(stats[1:, cv2.CC_STAT_AREA])[::-1]  # the largest is the surroundings
    return bool((sizes[1:] >= max(4, least_px**2)).any())
