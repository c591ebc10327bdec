"""Find a watermark that is laid over the whole sheet, and take it off paper and flat colours.

A mark is one colour m laid over everything with one opacity a: C' = (1 - a) C + a m. On the paper P
it has the one tone T = (1 - a) P + a m, so C' = T - (1 - a) (P - C), and a is what explains most
pixels of the figures by their own flat colours C. What is drawn behind the figures has a tone on
the paper, too, but explains none of their colours: it is taken off the paper alone.
Source: alpha compositing, T. Porter, T. Duff, "Compositing digital images" (1984).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.dataset.split.background import difference
from toonset.raster import dilate, erode

LEAST_SHARE = 0.01  # of the sheet that has the tone
FAINT = (8, 72)  # levels from the paper: the mark's contrast on it
LONGEST_PX = 2048  # of the copy in which a mark is looked for
NEARER = (0.3, 0.7)  # of the tone's contrast: levels that only edges of letters and grain have
PEAK = 0.5  # of the commonest of these
SAME = 5  # levels: one tone, or one flat colour
LEAST_SCRAPS = 8
LEAST_SCRAP = 24  # pixels
MOST_OF_HEIGHT = 0.25  # of the sheet: a scrap is no higher
ON_PAPER = 0.7  # of the scraps' borders that is paper or its blend with the tone
GRID = (6, 8)  # rows and columns of the sheet
SPREAD = 0.4  # of these that hold a scrap
FLAT_COLORS = 64  # of the figures, the commonest
LEAST_FLAT = 0.005  # of the figures: a rarer colour may be another under the mark
OPACITIES = np.linspace(0.04, 0.6, 57)
FLAT = 0.75  # of the figures in those colours: with less they say nothing against a mark
SOFTENED = 5  # pixels of the median filter before colours are looked for in pairs
UNDER = 0.3  # of the figures has a colour that is there under the mark, too
AS_OFTEN = 0.2  # of the mark's share of the paper: less of the figures in marked colours is chance
STANDING_OUT = 1.5  # times what other opacities explain: shades of one paint suit many
ELSEWHERE = 0.045  # from the opacity: another one
NEAR = 2  # levels: rounding, twice
SOFT = 2  # pixels: edges of letters


@dataclass(frozen=True, eq=False)
class Watermark:
    """A mark, known by its tone on the paper.

    Attributes:
        paper: 8-bit sRGB.
        tone: of the mark on it, 8-bit sRGB.
        over_figures: it may lie over the figures, too; otherwise it is drawn behind them.
    """

    paper: UInt8[np.ndarray, " 3"]
    tone: UInt8[np.ndarray, " 3"]
    over_figures: bool


def find_watermark(
    rgb: UInt8[np.ndarray, "height width 3"], paper: tuple[int, int, int] | None
) -> Watermark | None:
    """Return the mark that lies all over a sheet of plain paper; None if it has none."""
    if paper is None:
        return None
    step = -(-max(rgb.shape[:2]) // LONGEST_PX)
    rgb = np.ascontiguousarray(rgb[::step, ::step])
    tone = _faint_tone(rgb, paper)
    if tone is None:
        return None
    mask = difference(rgb, np.broadcast_to(tone, rgb.shape)) <= SAME
    bare = difference(rgb, np.broadcast_to(np.array(paper, np.uint8), rgb.shape)) <= SAME
    if not LEAST_SHARE * mask.size <= np.count_nonzero(mask) < np.count_nonzero(bare):
        return None  # where it covers more than the paper it is the paper: the rim is darker
    count, labels, stats, centers = cv2.connectedComponentsWithStats(
        mask.view(np.uint8), connectivity=8
    )
    thick = np.bincount(labels[erode(mask)], minlength=count) > 0  # JPEG's ripples are thinner
    scraps = thick & (stats[:, cv2.CC_STAT_AREA] >= LEAST_SCRAP)
    scraps &= stats[:, cv2.CC_STAT_HEIGHT] <= MOST_OF_HEIGHT * len(rgb)
    scraps[0] = False
    if not _is_all_over(centers[scraps], rgb.shape[:2]):
        return None
    blend = _is_between(rgb, np.array(paper), tone)
    rim = dilate(mask) & ~mask
    near = cv2.dilate(labels.astype(np.float32), np.ones((3, 3), np.uint8))[rim].astype(int)
    open_ = np.bincount(near, weights=blend[rim], minlength=count)
    scraps &= open_ >= ON_PAPER * np.bincount(near, minlength=count)
    if not _is_all_over(centers[scraps], rgb.shape[:2]):
        return None
    clean = np.array(paper, dtype=np.uint8)
    share = np.count_nonzero(mask) / np.count_nonzero(mask | bare)
    return Watermark(clean, tone, _is_over_figures(rgb, clean, tone, share))


def _faint_tone(
    rgb: UInt8[np.ndarray, "height width 3"], paper: tuple[int, int, int]
) -> UInt8[np.ndarray, " 3"] | None:
    """Return the commonest colour that is a little off the paper's, a peak apart from its grain."""
    away = difference(rgb, np.broadcast_to(np.array(paper, np.uint8), rgb.shape))
    faint = rgb[(away >= FAINT[0]) & (away <= FAINT[1])]
    if not len(faint):
        return None
    bins = (faint >> 2).astype(np.int32) @ np.array([4096, 64, 1], np.int32)
    tone = np.median(faint[bins == np.bincount(bins).argmax()], axis=0).astype(np.uint8)
    level = int(np.abs(tone.astype(int) - paper).max())
    often = np.convolve(np.bincount(away.ravel(), minlength=256), np.ones(3), "same")
    nearer = often[round(NEARER[0] * level) : round(NEARER[1] * level) + 1].max()
    return tone if often[level] >= PEAK * nearer else None


def _is_all_over(centers: Float[np.ndarray, "n 2"], shape: tuple[int, int]) -> bool:
    """Return whether enough scraps, by their centres (x, y), lie in enough parts of a sheet."""
    cells = (centers[:, ::-1] / shape * GRID).astype(int)
    spread = len(np.unique(cells, axis=0)) / (GRID[0] * GRID[1])
    return len(centers) >= LEAST_SCRAPS and spread >= SPREAD


def _is_over_figures(
    rgb: UInt8[np.ndarray, "height width 3"],
    paper: UInt8[np.ndarray, " 3"],
    tone: UInt8[np.ndarray, " 3"],
    share: float,
) -> bool:
    """Return whether the figures' flat colours are there under a mark, too, or tell nothing.

    Args:
        rgb: the sheet.
        paper: its colour.
        tone: the mark's on it.
        share: of the paper that has the tone.
    """
    inside = _paints(rgb, paper, tone)
    if not len(inside) or _commonest(inside)[1].sum() < FLAT * len(inside):
        return bool(len(inside))
    inside = _paints(np.asarray(cv2.medianBlur(rgb, SOFTENED), np.uint8), paper, tone)
    if not len(inside):
        return False
    colors, counts = _commonest(inside)
    explained, under = _explained(colors, counts / len(inside), paper.astype(np.float64), tone)
    best = int(explained.argmax())
    others = explained[np.abs(OPACITIES - OPACITIES[best]) > ELSEWHERE].max()
    often = explained[best] >= max(AS_OFTEN * share, STANDING_OUT * others)
    return bool(often and under[best] >= UNDER)


def _paints(
    rgb: UInt8[np.ndarray, "height width 3"],
    paper: UInt8[np.ndarray, " 3"],
    tone: UInt8[np.ndarray, " 3"],
) -> UInt8[np.ndarray, "n 3"]:
    """Return the colours of the pixels that are neither paper nor mark on it."""
    off = rgb[~_is_between(rgb, paper, tone)]
    return off[_is_drawn(off, paper)]


def remove_watermark(
    rgba: UInt8[np.ndarray, "height width 4"], mark: Watermark
) -> UInt8[np.ndarray, "height width 4"]:
    """Return the sheet without a mark on its paper and, where they are flat, on its figures."""
    rgb = np.ascontiguousarray(rgba[..., :3])
    result = rgb.copy()
    clean = mark.paper.astype(np.float64)
    result[_is_between(rgb, clean, mark.tone)] = mark.paper
    drawn = _is_drawn(result, mark.paper)
    inside = rgb[drawn]
    if not mark.over_figures or not len(inside):
        return np.dstack([result, rgba[..., 3]])
    colors, counts = _commonest(inside)
    explained, _ = _explained(colors, counts / len(inside), clean, mark.tone)
    opacity = float(OPACITIES[int(explained.argmax())])
    flat = colors[counts >= LEAST_FLAT * len(inside)]
    for color, under in zip(flat, _marked(flat, clean, mark.tone, opacity), strict=True):
        core = drawn & (np.abs(rgb - under).max(axis=2) <= NEAR)
        edge = dilate(core, SOFT) & drawn & _is_between(rgb, color, under)
        result[core | edge] = color
    return np.dstack([result, rgba[..., 3]])


def _is_drawn(
    rgb: UInt8[np.ndarray, "*n 3"], paper: UInt8[np.ndarray, " 3"]
) -> Bool[np.ndarray, "*n"]:
    away: Bool[np.ndarray, "*n"] = (
        np.abs(rgb.astype(np.int16) - paper.astype(np.int16)).max(axis=-1) > FAINT[1]
    )
    return away


def _commonest(
    colors: UInt8[np.ndarray, "n 3"],
) -> tuple[UInt8[np.ndarray, "k 3"], Int[np.ndarray, " k"]]:
    """Return the commonest colours and their counts, in that order."""
    codes = colors.astype(np.int32) @ np.array([65536, 256, 1], np.int32)
    values, counts = np.unique(codes, return_counts=True)
    common = np.argsort(-counts, kind="stable")[:FLAT_COLORS]
    flat = [values[common] >> 16, values[common] >> 8 & 255, values[common] & 255]
    return np.stack(flat, axis=1).astype(np.uint8), counts[common]


def _explained(
    colors: UInt8[np.ndarray, "k 3"],
    shares: Float[np.ndarray, " k"],
    paper: Float[np.ndarray, " 3"],
    tone: UInt8[np.ndarray, " 3"],
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"]]:
    """Return for every opacity the share of pixels in a commoner colour's marked one.

    And the share in those commoner ones. Colours that a mark hardly changes tell nothing.
    """
    commoner = np.triu(np.ones((len(colors), len(colors)), dtype=bool), 1)
    explained, under = np.zeros(len(OPACITIES)), np.zeros(len(OPACITIES))
    for number, opacity in enumerate(OPACITIES):
        marked = _marked(colors, paper, tone, float(opacity))
        changed = np.abs(marked - colors).max(axis=1) > 2 * NEAR
        near = np.abs(marked[:, None] - colors[None]).max(axis=2) <= NEAR
        pairs = near & commoner & changed[:, None]
        explained[number] = shares[pairs.any(axis=0)].sum()
        under[number] = shares[pairs.any(axis=1)].sum()
    return explained, under


def _marked(
    colors: np.ndarray, paper: np.ndarray, tone: np.ndarray, opacity: float
) -> Float[np.ndarray, "n 3"]:
    return np.asarray(tone - (1 - opacity) * (paper - colors), dtype=np.float64)


def _is_between(
    rgb: UInt8[np.ndarray, "height width 3"], start: np.ndarray, end: np.ndarray
) -> Bool[np.ndarray, "height width"]:
    """Return which pixels lie on the line between two colours."""
    along = (end.astype(np.float32) - start.astype(np.float32)).ravel()
    apart = rgb.astype(np.float32) - start.astype(np.float32)
    share = np.clip(apart @ along / max(float(along @ along), 1e-6), 0, 1)
    return np.abs(apart - share[..., None] * along).max(axis=2) <= SAME
