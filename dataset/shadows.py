"""Soft shadows that the figures cast on the ground: no part of the character.

A shadow is the paper, darker: every channel dimmed by one factor, without inner structure. Grey
shoes are that, too, so a shadow must also lie as a shadow lies: in the lower half of its figure,
with the figure standing in it (feet reach below its top) and whole without it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.dataset.figures import Blobs

DARKEST = 0.25  # of the paper's light
LIGHTEST = 0.998
OFF_PAPER = 2.0  # levels, beyond the noise: a channel dimmed otherwise is paint
STEEPEST = 0.06  # of the light per cell: a shadow's inside is smooth
LEAST_AREA = 0.01  # of the figure's area
TOP = 0.4  # of the figure's height from its top: no shadow reaches higher
WHOLE = 0.9  # of the figure without the shadow that is still one piece
ENCLOSED = 0.5  # of the shadow that the figure surrounds: more is a patch of its clothes
FEET = 0.0  # of a soft shadow's height from its top: the figure reaches lower
FEET_OF_HARD = 0.7  # the same of one with a hard edge, which shoes have, too
EDGE = 0.02  # of the figure's height: a shadow's own edge is no wider
BLACK = 40  # levels: a shadow on transparency is no lighter
OPAQUE = 230  # alpha: and less opaque
FADED = 0.95  # of the paper's light, at the shadow's border, besides noise
MOSTLY = 0.7  # of the border
GREY = 0.05  # of the figures' upper parts in the shadows' tone: grey clothes, nothing is known
TONE = 0.03  # of the paper's light: tones so near are one
BESIDE = 0.12  # of a shadow's border that is paper
OFTEN = 0.75  # of the views that show a shadow, if one does


def find_shadows(
    blobs: Blobs,
    mains: Int[np.ndarray, " mains"],
    rgba: UInt8[np.ndarray, "height width 4"],
    ground: UInt8[np.ndarray, "height width 3"] | None,
    tolerance: int,
) -> Bool[np.ndarray, "height width"]:
    """Return the pixels of cast shadows; none unless most of the views have one.

    Args:
        blobs: patches of paint, shadows included.
        mains: numbers of those that are bodies of views.
        rgba: the sheet.
        ground: its background's colours; None where it is transparent: there a shadow is
            see-through black.
        tolerance: noise of the sheet in levels.
    """
    looks = [(blobs.window(int(n)), blobs.mask(int(n))) for n in mains]
    lights = [
        _see_through(rgba[window])
        if ground is None
        else _dimmed(rgba[window][..., :3], ground[window], tolerance)
        for window, _ in looks
    ]
    bodies = [body for _, body in looks]
    tone = _tone(bodies, lights, tolerance)
    found = np.zeros(blobs.labels.shape, dtype=bool)
    if tone is None:
        return found
    shaded = 0
    for (window, body), dim in zip(looks, lights, strict=True):
        shadow = _shadow_of(body, dim, tone, tolerance)
        found[window] |= shadow
        shaded += bool(shadow.any())
    return found if shaded >= max(1.0, OFTEN * len(mains)) else np.zeros_like(found)


@dataclass(frozen=True, eq=False)
class Dim:
    """Where a picture is the paper with less light.

    Attributes:
        mask: there.
        smooth: there, away from edges.
        light: share of the paper's light, 0 to 1.
    """

    mask: Bool[np.ndarray, "height width"]
    smooth: Bool[np.ndarray, "height width"]
    light: Float[np.ndarray, "height width"]


def _see_through(rgba: UInt8[np.ndarray, "height width 4"]) -> Dim:
    dim = (rgba[..., :3].max(axis=2) <= BLACK) & (rgba[..., 3] < OPAQUE)
    return Dim(dim, _opened(dim), 1 - rgba[..., 3].astype(np.float32) / 255)


def _dimmed(
    rgb: UInt8[np.ndarray, "height width 3"],
    ground: UInt8[np.ndarray, "height width 3"],
    tolerance: int,
) -> Dim:
    paper = np.maximum(ground.astype(np.float32), 1)
    seen = rgb.astype(np.float32)
    light = (seen * paper).sum(axis=2) / (paper * paper).sum(axis=2)
    off = np.abs(seen - light[..., None] * paper).max(axis=2)
    dim = (light > DARKEST) & (light < LIGHTEST) & (off <= OFF_PAPER + tolerance)
    slopes = [cv2.Sobel(light, cv2.CV_32F, *axis, scale=0.125) for axis in ((1, 0), (0, 1))]
    slope = np.abs(slopes).max(axis=0)
    return Dim(dim, _opened(dim & (slope <= max(STEEPEST, 1.5 * tolerance / 255))), light)


def _tone(bodies: list[np.ndarray], dims: list[Dim], tolerance: int) -> float | None:
    """Return the light of the darkest shadow; None if the figures' own upper parts have it."""
    pieces = [
        _pieces(body, dim.mask & body, dim.smooth & body)
        for body, dim in zip(bodies, dims, strict=True)
    ]
    deep = np.concatenate([dim.light[own] for dim, own in zip(dims, pieces, strict=True)])
    if not len(deep):
        return None
    darkest = float(np.percentile(deep, 10))
    if _are_soft(bodies, dims, pieces, tolerance):
        return darkest
    toned = area = 0
    for body, dim in zip(bodies, dims, strict=True):
        upper = body[: int(TOP * len(body))]
        light, smooth = dim.light[: len(upper)], dim.smooth[: len(upper)]
        toned += int((upper & smooth & (np.abs(light - np.median(deep)) <= TONE)).sum())
        area += int(upper.sum())
    return None if toned > GREY * area else darkest


def _are_soft(
    bodies: list[np.ndarray], dims: list[Dim], pieces: list[np.ndarray], tolerance: int
) -> bool:
    """Return whether most of the shadows' border with the paper fades into it, as no cloth does."""
    square = np.ones((3, 3), np.uint8)
    rims = []
    for body, dim, own in zip(bodies, dims, pieces, strict=True):
        paper = np.pad(~body, 1, constant_values=True).view(np.uint8)
        beside = cv2.dilate(paper, square)[1:-1, 1:-1] > 0
        shadow = _grown(own, EDGE * len(body), dim.mask & body)
        rims.append(dim.light[shadow & beside])
    rim = np.concatenate(rims)
    return bool(len(rim) and np.mean(rim >= FADED - tolerance / 255) >= MOSTLY)


def _pieces(
    body: Bool[np.ndarray, "height width"],
    dim: Bool[np.ndarray, "height width"],
    smooth: Bool[np.ndarray, "height width"],
) -> Bool[np.ndarray, "height width"]:
    """Return the smooth patches that are large, low and open enough for shadows."""
    _, found, stats, _ = cv2.connectedComponentsWithStats(smooth.view(np.uint8), connectivity=8)
    labels = np.asarray(found, dtype=np.int32)
    large = stats[:, cv2.CC_STAT_AREA] >= LEAST_AREA * body.sum()
    able = np.flatnonzero(large & (stats[:, cv2.CC_STAT_TOP] >= TOP * body.shape[0]))
    pieces = [labels == number for number in able[able > 0]]
    reach = EDGE * body.shape[0]
    return np.any(
        [np.zeros_like(body), *(p for p in pieces if _borders_paper(_grown(p, reach, dim), body))],
        axis=0,
    )


def _opened(mask: Bool[np.ndarray, "height width"]) -> Bool[np.ndarray, "height width"]:
    """Return the mask without what is as thin as a soft edge."""
    return cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0


def _shadow_of(
    body: Bool[np.ndarray, "height width"], dim: Dim, tone: float, tolerance: int
) -> Bool[np.ndarray, "height width"]:
    """Return the smooth patches that lie as a shadow lies, with their own edges."""
    room = body & (dim.light >= tone - TONE)
    shadow = _pieces(body, dim.mask & room, dim.smooth & room)
    if not shadow.any():
        return shadow
    soft = _are_soft([body], [dim], [shadow], tolerance)
    if not soft:  # its one tone shows between the legs, too
        middle = float(np.median(dim.light[shadow]))
        shadow |= _toned(dim.smooth & room, dim.light, middle, int(TOP * body.shape[0]))
    reach = EDGE * body.shape[0]
    shadow |= _mostly(dim.smooth & body, _grown(shadow, reach, dim.mask & room))
    darkest = float(np.percentile(dim.light[shadow], 2))
    shadow = _grown(shadow, reach, dim.mask & body & (dim.light >= darkest - TONE))
    fits = _stands_in(body & ~shadow, shadow, FEET if soft else FEET_OF_HARD)
    return shadow if fits else np.zeros_like(body)


def _mostly(
    smooth: Bool[np.ndarray, "height width"], shadow: Bool[np.ndarray, "height width"]
) -> Bool[np.ndarray, "height width"]:
    """Return the smooth patches of which most is shadow already: with its darker core."""
    count, found = cv2.connectedComponents(smooth.view(np.uint8), connectivity=8)
    labels = np.asarray(found, dtype=np.int32)
    sizes = np.bincount(labels.ravel(), minlength=count)
    inside = np.bincount(labels[shadow], minlength=count) > 0.5 * sizes
    inside[0] = False
    return inside[labels]


def _toned(
    smooth: np.ndarray, light: np.ndarray, tone: float, top: int
) -> Bool[np.ndarray, "height width"]:
    """Return the low smooth patches of the shadow's tone: those between the legs."""
    same = smooth & (np.abs(light - tone) <= TONE)
    same[:top] = False
    return _opened(same)


def _grown(
    shadow: Bool[np.ndarray, "height width"], reach: float, room: Bool[np.ndarray, "height width"]
) -> Bool[np.ndarray, "height width"]:
    """Return the shadow with the dim pixels that are connected to it within a few steps."""
    square = np.ones((3, 3), np.uint8)
    for _ in range(max(2, round(reach))):
        shadow = shadow | ((cv2.dilate(shadow.view(np.uint8), square) > 0) & room)
    return shadow


def _borders_paper(shadow: np.ndarray, body: np.ndarray) -> bool:
    """Return whether enough of the shadow's border is paper: it lies beside the figure."""
    padded = np.pad(shadow, 1).view(np.uint8)
    rim = (cv2.dilate(padded, np.ones((3, 3), np.uint8)) > 0) & (padded == 0)
    return bool((rim & ~np.pad(body, 1)).sum() >= BESIDE * rim.sum())


def _stands_in(rest: Bool[np.ndarray, "height width"], shadow: np.ndarray, depth: float) -> bool:
    """Return whether what is left is whole and reaches so deep into the shadow."""
    _, _, stats, _ = cv2.connectedComponentsWithStats(rest.view(np.uint8), connectivity=8)
    if len(stats) < 2:
        return False
    largest = stats[1:][stats[1:, cv2.CC_STAT_AREA].argmax()]
    bottom = largest[cv2.CC_STAT_TOP] + largest[cv2.CC_STAT_HEIGHT]
    rows = np.flatnonzero(shadow.any(axis=1))
    level = rows[0] + depth * (rows[-1] - rows[0])
    outlines, _ = cv2.findContours(
        np.ascontiguousarray(rest).view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
    )
    filled = cv2.drawContours(np.zeros(rest.shape, np.uint8), outlines, -1, 1, cv2.FILLED) > 0
    return bool(
        bottom >= level
        and largest[cv2.CC_STAT_AREA] >= WHOLE * rest.sum()
        and (shadow & filled).sum() <= ENCLOSED * shadow.sum()
    )
