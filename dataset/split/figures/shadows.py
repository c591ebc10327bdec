"""Detect soft shadows that the figures cast on the ground.

A shadow is the paper, darker: every channel dimmed by one factor, without inner structure. Grey
shoes are that, too, so a shadow must also lie as a shadow lies: in the lower half of its figure,
with the figure standing in it (feet reach below its top) and whole without it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.dataset.split.figures.blobs import Blobs
from toonset.raster import dilate, parts_mostly_in

OFF_MEAN = 0.2  # of the noise: so far a whole patch may be off
LEAST_AREA = 0.01  # of the figure's area, with its edge
LEAST_CORE = 0.003  # of the figure's area: the smooth inside of a shadow
TOP = 0.4  # of the figure's height from its top: no shadow reaches higher
WHOLE = 0.9  # of the figure without the shadow that is still one piece
ENCLOSED = 0.5  # of the shadow that the figure surrounds: more is a patch of its clothes
FEET = 0.0  # of a soft shadow's height from its top: the figure reaches lower
FEET_OF_HARD = 0.7  # the same of one with a hard edge, which shoes have, too
EDGE = 0.02  # of the figure's height: a shadow's own edge is no wider
FADED = 0.93  # of the paper's light, at the shadow's border, besides noise
MOSTLY = 0.7  # of the border
TONE = 0.03  # of the paper's light: tones so near are one
BESIDE = 0.12  # of a shadow's border that is paper
OFTEN = 0.75  # of the views that show a shadow, if one does
DARKEST = 0.25  # of the paper's light
LIGHTEST = 0.998
OFF_PAPER = 2.0  # levels, beyond the noise: a channel dimmed otherwise is paint
STEEPEST = 0.06  # of the light per cell: a shadow's inside is smooth
BLACK = 40  # levels: a shadow on transparency is no lighter
OPAQUE = 230  # alpha: and less opaque


def find_shadows(
    blobs: Blobs,
    main_blobs: Int[np.ndarray, " main_blobs"],
    rgba: UInt8[np.ndarray, "height width 4"],
    ground: UInt8[np.ndarray, "height width 3"] | None,
    tolerance: int,
) -> Bool[np.ndarray, "height width"]:
    """Return the pixels of cast shadows; none unless most of the views have one.

    Args:
        blobs: patches of paint, shadows included.
        main_blobs: numbers of those that are bodies of views.
        rgba: the sheet.
        ground: its background's colours; None where it is transparent: there a shadow is
            see-through black.
        tolerance: noise of the sheet in levels.
    """
    looks = [(blobs.window(int(n)), blobs.mask(int(n))) for n in main_blobs]
    lights = [
        see_through(rgba[window])
        if ground is None
        else dimmed(rgba[window][..., :3], ground[window], tolerance)
        for window, _ in looks
    ]
    bodies = [body for _, body in looks]
    tone = _tone(bodies, lights)
    found = np.zeros(blobs.labels.shape, dtype=bool)
    shaded = 0
    for (window, body), dim in zip(looks, lights, strict=True):
        shadow = _shadow_of(body, dim, tone)
        found[window] |= shadow
        shaded += bool(shadow.any())
    return found if shaded >= max(1.0, OFTEN * len(main_blobs)) else np.zeros_like(found)


def _tone(bodies: list[np.ndarray], dims: list[Dim]) -> float | None:
    """Return the light of the darkest hard shadow; None if there is none."""
    deep = np.concatenate(
        [
            np.concatenate([[], *(dim.light[piece] for piece in _pieces(body, dim, body))])
            for body, dim in zip(bodies, dims, strict=True)
        ]
    )
    return float(np.percentile(deep, 10)) if len(deep) else None


def _is_soft(body: np.ndarray, dim: Dim, piece: np.ndarray) -> bool:
    """Return whether most of a patch's border with the paper fades into it, as no cloth does."""
    beside = dilate(np.pad(~body, 1, constant_values=True))[1:-1, 1:-1]
    rim = dim.light[_lit(piece, dim, body) & beside]
    return bool(len(rim) and np.mean(rim >= FADED - dim.noise / 255) >= MOSTLY)


def _pieces(
    body: Bool[np.ndarray, "height width"], dim: Dim, room: Bool[np.ndarray, "height width"]
) -> list[Bool[np.ndarray, "height width"]]:
    """Return the smooth patches in the room that are large, low and open enough for shadows."""
    _, found, stats, _ = cv2.connectedComponentsWithStats(
        (dim.smooth & room).view(np.uint8), connectivity=8
    )
    labels = np.asarray(found, dtype=np.int32)
    large = stats[:, cv2.CC_STAT_AREA] >= max(8, LEAST_CORE * body.sum())
    able = np.flatnonzero(large & (stats[:, cv2.CC_STAT_TOP] >= TOP * body.shape[0]))
    pieces = [labels == number for number in able[able > 0]]
    return [piece for piece in pieces if _is_open_shade(piece, dim, body, room)]


def _is_open_shade(piece: np.ndarray, dim: Dim, body: np.ndarray, room: np.ndarray) -> bool:
    """Return whether a patch is of the paper's tint and nothing darker divides it from the paper.

    An outline does: it shows a shoe.
    """
    if np.abs(dim.tint[piece].mean(axis=0)).max() > OFF_PAPER + OFF_MEAN * dim.noise:
        return False
    grown = _lit(piece, dim, body & room)
    return bool(grown.sum() >= LEAST_AREA * body.sum()) and _borders_paper(grown, body)


def _lit(piece: np.ndarray, dim: Dim, room: np.ndarray) -> Bool[np.ndarray, "height width"]:
    """Return a patch, with what is as light or lighter around it, without its darker parts."""
    lighter = dim.light >= float(np.median(dim.light[piece])) - TONE - dim.noise / 255
    return _grown(piece & lighter, EDGE * room.shape[0], dim.mask & room & lighter)


def _shadow_of(
    body: Bool[np.ndarray, "height width"], dim: Dim, tone: float | None
) -> Bool[np.ndarray, "height width"]:
    """Return the smooth patches that lie as a shadow lies, with their own edges.

    Args:
        body: a patch of paint.
        dim: where it is the paper with less light.
        tone: light of the darkest shadow with a hard edge; None if there are none.
    """
    pieces = [piece for piece in _pieces(body, dim, body) if _is_soft(body, dim, piece)]
    shadow, soft = np.any([np.zeros_like(body), *pieces], axis=0), bool(pieces)
    room = body
    if not soft and tone is not None:
        room = body & (dim.light >= tone - TONE)
        shadow = np.any([shadow, *_pieces(body, dim, room)], axis=0)
        if shadow.any():  # its one tone shows between the legs, too
            middle = float(np.median(dim.light[shadow]))
            shadow |= _toned(dim.smooth & room, dim.light, middle, int(TOP * body.shape[0]))
    if not shadow.any():
        return shadow
    reach = EDGE * body.shape[0]
    shadow |= parts_mostly_in(dim.smooth & body, _grown(shadow, reach, dim.mask & room))
    darkest = float(np.percentile(dim.light[shadow], 2))
    shadow = _grown(shadow, reach, dim.mask & body & (dim.light >= darkest - TONE))
    fits = _stands_in(body & ~shadow, shadow, FEET if soft else FEET_OF_HARD)
    return shadow if fits else np.zeros_like(body)


def _toned(
    smooth: np.ndarray, light: np.ndarray, tone: float, top: int
) -> Bool[np.ndarray, "height width"]:
    """Return the low smooth patches of the shadow's tone: those between the legs."""
    same = smooth & (np.abs(light - tone) <= TONE)
    same[:top] = False
    return opened(same)


def _grown(
    shadow: Bool[np.ndarray, "height width"], reach: float, room: Bool[np.ndarray, "height width"]
) -> Bool[np.ndarray, "height width"]:
    """Return the shadow with the dim pixels that are connected to it within a few steps."""
    for _ in range(max(2, round(reach))):
        shadow = shadow | (dilate(shadow) & room)
    return shadow


def _borders_paper(shadow: np.ndarray, body: np.ndarray) -> bool:
    """Return whether enough of the shadow's border is paper: it lies beside the figure."""
    padded = np.pad(shadow, 1)
    rim = dilate(padded) & ~padded
    return bool((rim & ~np.pad(body, 1)).sum() >= BESIDE * rim.sum())


def _stands_in(rest: Bool[np.ndarray, "height width"], shadow: np.ndarray, depth: float) -> bool:
    """Return whether what is left is whole and reaches so deep into the shadow."""
    _, _, stats, _ = cv2.connectedComponentsWithStats(rest.view(np.uint8), connectivity=8)
    if len(stats) < 2:
        return False
    largest = stats[1:][stats[1:, cv2.CC_STAT_AREA].argmax()]
    bottom = largest[cv2.CC_STAT_TOP] + largest[cv2.CC_STAT_HEIGHT]
    below = stats[1:, cv2.CC_STAT_TOP] >= bottom  # a caption that the shadow reaches
    own = stats[1:][~below, cv2.CC_STAT_AREA].sum()
    rows = np.flatnonzero(shadow.any(axis=1))
    level = rows[0] + depth * (rows[-1] - rows[0])
    outlines, _ = cv2.findContours(
        np.ascontiguousarray(rest).view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
    )
    filled = cv2.drawContours(np.zeros(rest.shape, np.uint8), outlines, -1, 1, cv2.FILLED) > 0
    return bool(
        bottom >= level
        and largest[cv2.CC_STAT_AREA] >= WHOLE * own
        and (shadow & filled).sum() <= ENCLOSED * shadow.sum()
    )


@dataclass(frozen=True, eq=False)
class Dim:
    """Pixels that are the paper with less light.

    Attributes:
        mask: there.
        smooth: there, away from edges.
        light: share of the paper's light, 0 to 1.
        tint: levels by which every channel is off the paper's, dimmed.
        noise: of the sheet, in levels.
    """

    mask: Bool[np.ndarray, "height width"]
    smooth: Bool[np.ndarray, "height width"]
    light: Float[np.ndarray, "height width"]
    tint: Float[np.ndarray, "height width 3"]
    noise: float


def see_through(rgba: UInt8[np.ndarray, "height width 4"]) -> Dim:
    """Return where a transparent picture is see-through black."""
    dim = (rgba[..., :3].max(axis=2) <= BLACK) & (rgba[..., 3] < OPAQUE)
    light = 1 - rgba[..., 3].astype(np.float32) / 255
    return Dim(dim, opened(dim), light, np.zeros((*light.shape, 3), np.float32), 0.0)


def dimmed(
    rgb: UInt8[np.ndarray, "height width 3"],
    ground: UInt8[np.ndarray, "height width 3"],
    tolerance: int,
) -> Dim:
    """Return where a picture is a darker background.

    Args:
        rgb: the picture.
        ground: its background's colours.
        tolerance: noise in levels.
    """
    paper = np.maximum(ground.astype(np.float32), 1)
    seen = rgb.astype(np.float32)
    light = (seen * paper).sum(axis=2) / (paper * paper).sum(axis=2)
    tint = seen - light[..., None] * paper
    off = np.abs(tint).max(axis=2)
    dim = (light > DARKEST) & (light < LIGHTEST) & (off <= OFF_PAPER + tolerance)
    slopes = [cv2.Sobel(light, cv2.CV_32F, *axis, scale=0.125) for axis in ((1, 0), (0, 1))]
    slope = np.abs(slopes).max(axis=0)
    smooth = opened(dim & (slope <= max(STEEPEST, 1.5 * tolerance / 255)))
    return Dim(dim, smooth, light, tint, float(tolerance))


def opened(mask: Bool[np.ndarray, "height width"]) -> Bool[np.ndarray, "height width"]:
    """Return the mask without what is as thin as a soft edge."""
    return cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0
