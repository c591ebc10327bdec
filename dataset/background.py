"""What of a sheet is background: its colour, its noise, and which pixels belong to it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.errors import SheetError

BINS = 16  # levels per bin of the coarse histogram that finds the dominant colour
CLUSTER_RADIUS = 32  # levels: border pixels this near to the dominant colour are background + noise
LEAST_TOLERANCE = 2  # levels: a picture without noise still holds rounding
MOST_TOLERANCE = 48  # levels: beyond it figures would be eaten, whatever the noise
TRANSPARENT = 0.01  # of the sheet: less see-through area is an accident, not a background
HALO_WIDTH = 8  # levels: noise of the file falls off within about so many
CLEAR_HALO = 4.0  # times as many pixels as a little farther from the background: noise at all
HALO = 2.0  # times as many pixels as a little farther: still noise
LEAST_SURE = 0.3  # of the border: less in one colour is no background
LINE_SHARE = 0.8  # of a row or column in one colour: a ruled line or frame, not a figure


@dataclass(frozen=True, eq=False)
class Background:
    """The background of a sheet.

    Attributes:
        rgb: its colour; None where the sheet has an alpha channel of its own.
        sure: share of the border that has this colour (or is transparent), 0 to 1.
        tolerance: largest difference of a channel, in levels, that is still background.
        outside: (height, width) pixels reached from the border through background.
        enclosed: (height, width) background-coloured pixels that the border does not reach.
    """

    rgb: tuple[int, int, int] | None
    sure: float
    tolerance: int
    outside: Bool[np.ndarray, "height width"]
    enclosed: Bool[np.ndarray, "height width"]


def find_background(rgba: UInt8[np.ndarray, "height width 4"]) -> Background:
    """Return the background of a sheet: its transparency, else the border's dominant colour.

    The tolerance comes from the border's own noise, so that JPEG sheets work and white shirts on
    an almost white ground survive. Ruled lines and frames across the whole sheet count as
    background where no figure stands on both sides of them.

    Raises:
        SheetError: the border has no dominant colour.
    """
    ring = _ring(rgba.shape[0], rgba.shape[1])
    if is_transparent(rgba):
        nothing = np.zeros(rgba.shape[:2], dtype=bool)
        sure = float((rgba[ring][:, 3] < 128).mean())
        return Background(None, sure, 0, rgba[..., 3] == 0, nothing)
    rgb, sure, tolerance = _dominant(rgba[ring][:, :3])
    if sure < LEAST_SURE:
        raise SheetError(
            f"the background is not one colour (the commonest takes {sure:.0%} of the border); put "
            "the figures on a plain or a transparent background"
        )
    away = difference(rgba[..., :3], rgb)
    tolerance = max(tolerance, _halo(away))
    like = away <= tolerance
    like |= _ruled_lines(rgba[..., :3], like)
    return _flood(like, ring, rgb, sure, tolerance)


def is_transparent(rgba: UInt8[np.ndarray, "height width 4"]) -> bool:
    """Return whether the sheet's own alpha tells the figures from the background."""
    return bool((rgba[..., 3] < 128).mean() > TRANSPARENT)


def flattened(rgba: UInt8[np.ndarray, "height width 4"]) -> UInt8[np.ndarray, "height width 4"]:
    """Return an opaque picture: what is see-through shows white paper."""
    if (rgba[..., 3] == 255).all():
        return rgba
    alpha = rgba[..., 3:] / 255.0
    rgb = np.rint(rgba[..., :3] * alpha + 255 * (1 - alpha)).astype(np.uint8)
    return np.dstack([rgb, np.full(rgb.shape[:2], 255, dtype=np.uint8)])


def difference(
    rgb: UInt8[np.ndarray, "*n 3"], background: tuple[int, int, int]
) -> UInt8[np.ndarray, " *n"]:
    """Return the largest difference of any channel from the background, in levels."""
    apart = [
        np.maximum(rgb[..., i], level) - np.minimum(rgb[..., i], level)
        for i, level in enumerate(np.array(background, dtype=np.uint8))
    ]
    return np.maximum(np.maximum(apart[0], apart[1]), apart[2])


def _ring(height: int, width: int) -> Bool[np.ndarray, "height width"]:
    """Return the pixels near the border: 2 % of the shorter side, so a thin frame is outvoted."""
    thick = max(3, round(0.02 * min(height, width)))
    ring = np.ones((height, width), dtype=bool)
    ring[thick : height - thick, thick : width - thick] = False
    return ring


def _dominant(colors: UInt8[np.ndarray, "n 3"]) -> tuple[tuple[int, int, int], float, int]:
    """Return the dominant colour, its share, and the tolerance that its noise asks for."""
    best = np.median(colors, axis=0)
    share = -1.0
    for shift in (0, BINS // 2):  # two grids: a colour on the edge of a bin is whole in the other
        bins = (colors.astype(np.int64) + shift) // BINS
        codes = bins @ np.array([289, 17, 1])
        code, count = np.unique(codes, return_counts=True)
        if count.max() / len(colors) > share:
            share = float(count.max() / len(colors))
            best = np.median(colors[codes == code[count.argmax()]], axis=0)
    red, green, blue = (round(float(x)) for x in best)
    away = difference(colors, (red, green, blue))
    near = away <= CLUSTER_RADIUS
    center = np.median(colors[near], axis=0)
    # 99 % of the border's noise, doubled: noise near figures (JPEG) is stronger than far away
    noise = float(np.percentile(away[near], 99))
    tolerance = int(np.clip(np.ceil(2 * noise), LEAST_TOLERANCE, MOST_TOLERANCE))
    red, green, blue = (round(float(x)) for x in center)
    return (red, green, blue), float(near.mean()), tolerance


def _halo(away: UInt8[np.ndarray, "height width"]) -> int:
    """Return how far, in levels, compression has spread the background's colour near figures.

    A soft edge passes all differences from the background equally often; ringing around edges
    (JPEG) adds small ones, the smaller the more. The level is where that decay ends.
    """
    often = np.bincount(away.ravel(), minlength=256).astype(np.float64)
    for level in range(1, MOST_TOLERANCE):
        here = often[level : level + 3].mean()
        beyond = np.median(often[level + HALO_WIDTH : level + 3 * HALO_WIDTH])
        surplus = CLEAR_HALO if level == 1 else HALO  # chance makes small surpluses
        if here <= surplus * beyond + 3 * np.sqrt(beyond) + 1:
            return level
    return MOST_TOLERANCE


def _flood(
    like: Bool[np.ndarray, "height width"],
    ring: Bool[np.ndarray, "height width"],
    rgb: tuple[int, int, int],
    sure: float,
    tolerance: int,
) -> Background:
    """Divide background-coloured pixels into those that the border reaches and the others."""
    _, found = cv2.connectedComponents(like.astype(np.uint8), connectivity=4)
    labels = np.asarray(found, dtype=np.int32)
    reached = np.zeros(int(labels.max()) + 1, dtype=bool)
    reached[np.unique(labels[ring & like])] = True
    reached[0] = False
    outside = reached[labels]
    return Background(rgb, sure, tolerance, outside, like & ~outside)


def _ruled_lines(
    rgb: UInt8[np.ndarray, "height width 3"], like: Bool[np.ndarray, "height width"]
) -> Bool[np.ndarray, "height width"]:
    """Return pixels of lines in one colour that cross the sheet, except within figures."""
    found = np.zeros(like.shape, dtype=bool)
    for turned in (False, True):
        picture = rgb.swapaxes(0, 1) if turned else rgb
        ground = like.T if turned else like
        target = found.T if turned else found
        rows = np.flatnonzero((~ground).mean(axis=1) >= LINE_SHARE)
        rows = np.array([row for row in rows if _is_one_colour(picture[row])], dtype=int)
        for first, last in _runs(rows):
            above = ground[first - 1] if first > 0 else np.ones(ground.shape[1], dtype=bool)
            below = (
                ground[last + 1] if last + 1 < len(ground) else np.ones(ground.shape[1], dtype=bool)
            )
            if last - first < 0.02 * len(ground):  # thicker is a block, not a line
                target[first : last + 1] = above | below
    return found


def _is_one_colour(row: UInt8[np.ndarray, "width 3"]) -> bool:
    middle: Float[np.ndarray, " 3"] = np.median(row, axis=0)
    return bool((np.abs(row - middle).max(axis=1) < CLUSTER_RADIUS).mean() >= LINE_SHARE)


def _runs(rows: np.ndarray) -> list[tuple[int, int]]:
    """Return first and last of every run of neighbouring rows."""
    if not len(rows):
        return []
    breaks = np.flatnonzero(np.diff(rows) > 1)
    firsts = np.concatenate([[rows[0]], rows[breaks + 1]])
    lasts = np.concatenate([rows[breaks], [rows[-1]]])
    return [(int(a), int(b)) for a, b in zip(firsts, lasts, strict=True)]
