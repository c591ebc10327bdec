"""Learn which depth steps an artist draws as lines, and draw them in new views.

The rule is learned from the drawings: steps deeper than `least` have a line, smaller ones have
none, and lines reach so far onto the nearer and the farther side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Bool, Float
from pydantic import Field
from scipy.ndimage import map_coordinates

from toonset.nerf.look.outline import Width
from toonset.raster import quick_distance_to

STEPS = (0.01, 0.015, 0.02, 0.025, 0.03, 0.035, 0.04, 0.05, 0.06, 0.08)  # of the figure's height
USUAL, DOUBT = 0.035, 10.0  # a step from which lines are drawn; pixels that speak for the next one
FEWEST = 100  # pixels on steps that must be seen, to say anything
LINED = 0.6  # of the pixels on the steps above `least` must lie on a line
ON_LINE_PX = 2.0  # a step so near to a line lies on it: drawings and depth disagree a little
LINE = 0.5  # coverage from which a pixel is a line's
APART = (
    2.0  # times the line's width and a pixel, from outlines and deeper steps: lines of their own
)
WIDEST_PX, WIDEST = 12, 2.0  # from a step, in which its line is measured; times the outline's width
THINNEST_PX = 0.3  # thinner ones do not count
GAP_PX = 0.5  # between places at which a line is looked for
FAINT = 0.3  # coverage from which there is a line

Depth = Float[np.ndarray, "rows columns"]
Cover = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "rows columns"]


@dataclass(frozen=True)
class StepLines:
    """Learned rule of which depth steps have a line, and how wide.

    Attributes:
        least: the smallest step that has a line, of the figure's height.
        near_px: how far lines reach onto the side that hides the other, pixels of the drawings.
        far_px: how far onto the hidden side.
    """

    least: Annotated[float, Field(gt=0, le=1)]
    near_px: Width
    far_px: Width

    @property
    def width_px(self) -> float:
        """Return the width of a line."""
        return self.near_px + self.far_px

    @property
    def beyond_px(self) -> float:
        """Return how far behind a step, on its far side, the middle of its line lies."""
        return (self.far_px - self.near_px) / 2


def step_sides(depth: Depth, least: float) -> tuple[Mask, Mask]:
    """Return the pixels on the near and on the far side of steps, within the figure.

    A step is deeper than `least` beyond the slope on its flatter side.

    Args:
        depth: nan where nothing is.
        least: in units of depth.
    """
    near, far = np.zeros(depth.shape, dtype=bool), np.zeros(depth.shape, dtype=bool)
    for turned in (False, True):
        values = depth.T if turned else depth
        nears, fars = (near.T, far.T) if turned else (near, far)
        slope = np.diff(values, axis=1)
        step, before, after = slope[:, 1:-1], np.abs(slope[:, :-2]), np.abs(slope[:, 2:])
        flatter = np.fmin(np.nan_to_num(before, nan=np.inf), np.nan_to_num(after, nan=np.inf))
        flatter[np.isinf(flatter)] = 0
        with np.errstate(invalid="ignore"):
            down, up = step - flatter > least, -step - flatter > least
        nears[:, 1:-2] |= down
        fars[:, 2:-1] |= down
        fars[:, 1:-2] |= up
        nears[:, 2:-1] |= up
    return near, far


def step_places(
    depth: Depth, least: float, finer: int, gap_px: float
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2"]]:
    """Return places on steps, and unit vectors from the near side to the far one.

    Args:
        depth: `finer` samples per pixel and axis, nan where nothing is.
        least: in units of depth.
        finer: see there.
        gap_px: about the distance of places along a step, pixels.
    """
    near, far = step_sides(depth, least)
    soft = cv2.GaussianBlur(far.astype(np.float32) - near, (0, 0), float(finer))
    rows, columns = np.nonzero(near)
    across = np.stack(
        [cv2.Sobel(soft, cv2.CV_32F, *axis)[rows, columns] for axis in ((1, 0), (0, 1))], axis=-1
    ).astype(float)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    clear = np.flatnonzero(length[:, 0] > 1e-6)
    clear = clear[:: max(1, round(gap_px * finer))]
    places = (np.stack([columns, rows], axis=-1)[clear] + 0.5) / finer
    across = across[clear] / length[clear]
    return places + across * (0.5 / finer), across


def lines_across(
    cover: Cover,
    places: Float[np.ndarray, "n 2"],
    across: Float[np.ndarray, "n 2"],
    reach_px: float,
    farthest_px: float,
) -> Float[np.ndarray, " n"]:
    """Return how far across every place the line lies that is nearest and clearest; nan: none.

    Args:
        cover: how far lines cover every pixel, 0 to 1.
        places: pixels.
        across: unit vectors.
        reach_px: lines so far away count a third.
        farthest_px: and beyond nothing.
    """
    offs = np.arange(-farthest_px, farthest_px + GAP_PX, GAP_PX)
    at = places[:, None] + offs[:, None] * across[:, None]
    x, y = np.moveaxis(at - 0.5, -1, 0)
    found = map_coordinates(cover, [y, x], order=1)
    found = found * np.exp(-((offs / reach_px) ** 2))
    best = found.argmax(axis=1)
    return np.where(found.max(axis=1) > FAINT, offs[best], np.nan)


def learn_steps(
    covers: Sequence[Cover], depths: Sequence[Depth], height: float, width_px: float
) -> StepLines | None:
    """Learn which depth steps are drawn as lines; None if there are no such lines.

    Args:
        covers: how far lines cover every pixel of each drawing, 0 to 1.
        depths: of what each drawing shows, at its pixels; nan beside it.
        height: of the figure, in units of depth.
        width_px: of the outline, pixels of the drawings.
    """
    if width_px <= 0:
        return None
    room = APART * (width_px + 1)
    on, count = np.zeros(len(STEPS)), np.zeros(len(STEPS))
    for cover, depth in zip(covers, depths, strict=True):
        touched = _spread(cover, ON_LINE_PX) >= LINE
        clear = _distance(np.isnan(depth)) > room
        for i in reversed(range(len(STEPS))):
            near, _ = step_sides(depth, STEPS[i] * height)
            seen = near & clear
            on[i] += (touched & seen).sum()
            count[i] += seen.sum()
            clear &= _distance(near) > room
    level = _level(on, count)
    if level is None:
        return None
    widest = int(np.ceil(max(WIDEST_PX, WIDEST * width_px)))
    near_px, far_px = _reaches(covers, depths, STEPS[level] * height, room, widest)
    return StepLines(STEPS[level], near_px, far_px) if near_px + far_px > THINNEST_PX else None


def draw_steps(depth: Depth, style: StepLines, height: float, finer: int, scale: float) -> Cover:
    """Draw lines at depth steps: how far they cover every pixel of a view.

    Args:
        depth: `finer` samples per pixel and axis, nan where nothing is.
        style: of the lines.
        height: of the figure, in units of depth.
        finer: see there.
        scale: pixels of the view per pixel of the drawings.
    """
    rows, columns = depth.shape
    near, far = step_sides(depth, style.least * height)
    line = np.zeros(depth.shape, dtype=np.float32)
    if near.any():
        to_near, to_far = (_distance(side) for side in (near, far))
        reach = np.where(to_near < to_far, style.near_px, style.far_px) * finer * scale
        line = np.clip(reach - np.minimum(to_near, to_far), 0, 1) * np.isfinite(depth)
    size = (columns // finer, rows // finer)
    return cv2.resize(line.astype(np.float32), size, interpolation=cv2.INTER_AREA)


def _level(on: Float[np.ndarray, " n"], count: Float[np.ndarray, " n"]) -> int | None:
    """Return from which of STEPS on there are lines: what parts lined steps best from others."""
    usual = np.abs(np.arange(len(STEPS)) - STEPS.index(USUAL))
    right = [float(on[i:].sum() + (count - on)[:i].sum()) for i in range(len(STEPS))]
    best = int(np.argmax(right - DOUBT * usual))
    enough = count[best:].sum() >= FEWEST
    return best if enough and on[best:].sum() >= LINED * count[best:].sum() else None


def _reaches(
    covers: Sequence[Cover], depths: Sequence[Depth], least: float, room: float, widest: int
) -> tuple[float, float]:
    """Return how far a line reaches from its step onto the near and the far side, in the mean."""
    inked, seen = np.zeros((2, widest)), np.zeros((2, widest))
    lined = count = 0
    for cover, depth in zip(covers, depths, strict=True):
        sides = step_sides(depth, least)
        away = np.stack([_distance(side) for side in sides])
        nearer = away.argmin(axis=0)
        clear = (_distance(np.isnan(depth)) > room) & np.isfinite(depth)
        for side in range(2):
            at = clear & (nearer == side) & (away[side] < widest)
            index = away[side][at].astype(int)
            inked[side] += np.bincount(index, cover[at], widest)
            seen[side] += np.bincount(index, minlength=widest)
        there = sides[0] & clear
        lined += int((_spread(cover, widest / 2)[there] >= LINE).sum())
        count += int(there.sum())
    share = inked / np.maximum(seen, 1)
    beside = float(share[:, -widest // 4 :].mean(axis=1).min())  # ink that is not a step's
    near_px, far_px = np.maximum(share - beside, 0).sum(axis=1) * (count / max(lined, 1))
    return float(near_px), float(far_px)


def _distance(mask: Mask) -> Float[np.ndarray, "rows columns"]:
    """Return every pixel's distance to a mask, large without any."""
    if not mask.any():
        return np.full(mask.shape, 1e6, dtype=np.float32)
    return quick_distance_to(mask)


def _spread(cover: Cover, reach: float) -> Cover:
    side = 2 * round(reach) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    return cv2.dilate(cover.astype(np.float32), disc)


def step_edges(
    depth: Float[np.ndarray, "height width"], jump: float
) -> Bool[np.ndarray, "height width"]:
    """Return the pixels at which depth steps by more than `jump` beyond the slopes on both sides.

    A step may be spread over one mixed pixel. Where depth is not finite nothing is said.
    """
    return _row_steps(depth, jump) | _row_steps(depth.T, jump).T


def _row_steps(depth: np.ndarray, jump: float) -> np.ndarray:
    edges: np.ndarray = np.zeros(depth.shape, dtype=bool)
    wide = depth[3:-1] - depth[1:-3]
    before, after = depth[1:-3] - depth[:-4], depth[4:] - depth[3:-1]
    slope = 2 * np.maximum(np.abs(before), np.abs(after))
    with np.errstate(invalid="ignore"):
        edges[2:-2] = np.abs(wide) - slope > jump
    return edges
