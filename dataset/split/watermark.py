"""Find a watermark that is laid over the whole sheet, and take it off paper and flat colours.

A mark is one colour m laid over everything with one opacity a: C' = (1 - a) C + a m. On the paper P
it has the one tone T = (1 - a) P + a m, so C' = T - (1 - a) (P - C), and a is what explains most
pixels of the figures by their own flat colours C.
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
NEAR = 2  # levels: rounding, twice
SOFT = 2  # pixels: edges of letters


@dataclass(frozen=True, eq=False)
class Watermark:
    """A mark, known by its tone on the paper (both 8-bit sRGB)."""

    paper: UInt8[np.ndarray, " 3"]
    tone: UInt8[np.ndarray, " 3"]


def find_watermark(
    rgb: UInt8[np.ndarray, "height width 3"], paper: tuple[int, int, int] | None
) -> Watermark | None:
    """Return the mark that lies all over a sheet of plain paper; None if there is none."""
    if paper is None:
        return None
    step = -(-max(rgb.shape[:2]) // LONGEST_PX)
    rgb = np.ascontiguousarray(rgb[::step, ::step])
    tone = _faint_tone(rgb, paper)
    if tone is None:
        return None
    mask = difference(rgb, np.broadcast_to(tone, rgb.shape)) <= SAME
    if np.count_nonzero(mask) < LEAST_SHARE * mask.size:
        return None
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
    return Watermark(np.array(paper, dtype=np.uint8), tone)


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


def remove_watermark(
    rgba: UInt8[np.ndarray, "height width 4"], mark: Watermark
) -> UInt8[np.ndarray, "height width 4"]:
    """Return the sheet without a mark on its paper and, where they are flat, on its figures."""
    rgb = np.ascontiguousarray(rgba[..., :3])
    result = rgb.copy()
    clean = mark.paper.astype(np.float64)
    result[_is_between(rgb, clean, mark.tone)] = mark.paper
    drawn = np.abs(result.astype(np.int16) - clean.astype(np.int16)).max(axis=2) > FAINT[1]
    inside = rgb[drawn]
    if not len(inside):
        return np.dstack([result, rgba[..., 3]])
    colors, counts = _commonest(inside)
    opacity = _opacity(colors, counts, clean, mark.tone)
    flat = colors[counts >= LEAST_FLAT * len(inside)]
    for color, under in zip(flat, _marked(flat, clean, mark.tone, opacity), strict=True):
        core = drawn & (np.abs(rgb - under).max(axis=2) <= NEAR)
        edge = dilate(core, SOFT) & drawn & _is_between(rgb, color, under)
        result[core | edge] = color
    return np.dstack([result, rgba[..., 3]])


def _commonest(
    colors: UInt8[np.ndarray, "n 3"],
) -> tuple[UInt8[np.ndarray, "k 3"], Int[np.ndarray, " k"]]:
    """Return the commonest colours and their counts, in that order."""
    codes = colors.astype(np.int32) @ np.array([65536, 256, 1], np.int32)
    values, counts = np.unique(codes, return_counts=True)
    common = np.argsort(-counts, kind="stable")[:FLAT_COLORS]
    flat = [values[common] >> 16, values[common] >> 8 & 255, values[common] & 255]
    return np.stack(flat, axis=1).astype(np.uint8), counts[common]


def _opacity(
    colors: UInt8[np.ndarray, "k 3"],
    counts: Int[np.ndarray, " k"],
    paper: Float[np.ndarray, " 3"],
    tone: UInt8[np.ndarray, " 3"],
) -> float:
    """Return the opacity under which most pixels have a commoner colour's marked one."""
    commoner = np.triu(np.ones((len(colors), len(colors)), dtype=bool), 1)
    explained = []
    for opacity in OPACITIES:
        marked = _marked(colors, paper, tone, float(opacity))
        near = np.abs(marked[:, None] - colors[None]).max(axis=2) <= NEAR
        explained.append(int(counts[(near & commoner).any(axis=0)].sum()))
    return float(OPACITIES[int(np.argmax(explained))])


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
