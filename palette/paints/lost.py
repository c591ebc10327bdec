"""Find paints without flat pixels: areas of a figure that are unlike every known paint.

What is sketched has no flat pixel, shades that touch count as one paint, and cloth whose colour
lies between two others' counts as their blend. A blend is a border, though, and borders are thin:
an area with edges is a paint of its own, one that passes into what is beside it is a shade of that.
Drawings are looked at no taller than `TALL_PX`, without grain, where no line is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.palette.colors import JUST_NOTICEABLE, even_oklab_from_rgb
from toonset.palette.paints.clusters import UNLIKE, Paint, nearest_place
from toonset.palette.paints.features import LEAST_PX
from toonset.palette.paints.histogram import Histogram
from toonset.palette.paints.line_color import EXACT, rounded
from toonset.palette.pixels.antialias import OPAQUE
from toonset.palette.pixels.patches import shrunk, without_grain
from toonset.raster import dilate, erode, nearest, sized_parts, wider_than

FAR = 5 * JUST_NOTICEABLE  # in OKLab, from every paint: the middle of a lost one
GROUP = 3 * JUST_NOTICEABLE  # in OKLab, from its middle: a lost paint's pixels
BEYOND_PX, STEP = 3, 2 * JUST_NOTICEABLE  # from an area; in OKLab: less is no edge
PASSAGE = 0.4  # of an area's border to paint without an edge: more makes it a shade of that
OF_LINES = 0.25  # of a shrunk pixel that is drawn line: more is no paint
SAME_LEVELS = 4  # of 255, in every channel: no more apart two colours are alike
HALF_BLEND_PX = 1  # an area is wider than twice that
MOST = 40  # areas of one character that are looked at

Mask = Bool[np.ndarray, "height width"]
Places = Float[np.ndarray, "n 3"]
Colors = UInt8[np.ndarray, "paints 3"]


@dataclass(eq=False)
class _Shrunk:
    """A shrunk drawing in OKLab, where it is paint, and where no known paint is like it."""

    lab: Float[np.ndarray, "height width 3"]
    paint: Mask
    unlike: Mask


def add_lost_paints(
    histogram: Histogram,
    paints: Sequence[Paint],
    images: Sequence[UInt8[np.ndarray, "_ _ 4"]],
    contours: Sequence[Bool[np.ndarray, "_ _"]] | None = None,
) -> list[Paint]:
    """Return the paints, and those of areas that none of them is like, with what is like these.

    Args:
        histogram: of the character's pictures.
        paints: of this histogram.
        images: these pictures.
        contours: their drawn lines, if known.
    """
    colors = np.array([paint.rgb for paint in paints], dtype=np.uint8)
    lines = contours or [np.zeros(image.shape[:2], dtype=bool) for image in images]
    pairs = zip(images, lines, strict=True)
    looked_at = [_shrunk(image, line, colors) for image, line in pairs if image.size]
    seen = [one for one in looked_at if one is not None]
    if not seen:
        return list(paints)
    known = even_oklab_from_rgb(colors)
    middles = _middles(seen, known)
    if not len(middles):
        return list(paints)
    places = even_oklab_from_rgb(histogram.colors)
    owner, away = nearest_place(np.concatenate([known, middles]), places)
    found = list(paints)
    for number in range(len(known), len(known) + len(middles)):
        members = np.flatnonzero((owner == number) & (away <= GROUP))
        if not len(members):
            continue
        flat = histogram.flat[members]
        exact = flat.max() >= EXACT * max(int(flat.sum()), 1)
        middle = members[flat.argmax() if exact else away[members].argmin()]
        rgb = rounded(histogram.colors[middle])
        rest = (np.setdiff1d(one.members, members) for one in found)
        found = [replace(one, members=own) for one, own in zip(found, rest, strict=True)]
        found.append(Paint(rgb, members))
    return found


def _shrunk(
    picture: UInt8[np.ndarray, "_ _ 4"], line: Bool[np.ndarray, "_ _"], colors: Colors
) -> _Shrunk | None:
    """Return a drawing with areas that no colour is like; None of a drawing that has none."""
    small = shrunk(picture)
    rgb = np.ascontiguousarray(small[..., :3])
    paint = erode(small[..., 3] >= OPAQUE)
    if line.any():
        size = small.shape[1::-1]
        paint &= cv2.resize(line.astype(np.float32), size, interpolation=cv2.INTER_AREA) <= OF_LINES
    if not _unlike(rgb, paint, colors).any():  # as most are
        return None
    rgb = without_grain(rgb)
    return _Shrunk(even_oklab_from_rgb(rgb), paint, _unlike(rgb, paint, colors))


def _unlike(
    rgb: UInt8[np.ndarray, "height width 3"], paint: Mask, colors: Colors
) -> Bool[np.ndarray, "height width"]:
    """Return the areas of paint that are unlike every colour."""
    far = paint.copy()
    for color in colors.astype(int):  # quick, and no such pixel is unlike
        like = cv2.inRange(rgb, color - SAME_LEVELS, color + SAME_LEVELS)
        far &= like == 0
    far = wider_than(far, HALF_BLEND_PX)
    away = nearest_place(even_oklab_from_rgb(colors), even_oklab_from_rgb(rgb[far]))[1]
    far[far] = away > UNLIKE
    return wider_than(far, HALF_BLEND_PX)


def _middles(seen: Sequence[_Shrunk], known: Places) -> Places:
    """Return the colours of areas that are far from all paints, the largest area's first."""
    found = []
    for _ in range(MOST):
        largest = [_largest(one.unlike) for one in seen]
        number = int(np.argmax([area.sum() for area in largest]))
        if not largest[number].any():
            break
        middle = np.median(seen[number].lab[largest[number]], axis=0)
        pixels, borders = 0, []
        for one, area in zip(seen, largest, strict=True):
            own = one.unlike & (np.linalg.norm(one.lab - middle, axis=-1) <= GROUP)
            if one is seen[number]:
                own |= area
            one.unlike &= ~own
            pixels += int(wider_than(own, HALF_BLEND_PX).sum())
            borders.append(_lacks_edge(one, wider_than(own, HALF_BLEND_PX)))
        border = np.concatenate(borders)
        passage = border.sum() / max(len(border), 1)
        away = nearest_place(known, middle[None])[1][0]
        if pixels >= LEAST_PX and passage <= PASSAGE and away >= FAR:
            found.append(middle)
    return np.array(found).reshape(-1, 3)


def _lacks_edge(one: _Shrunk, area: Mask) -> Bool[np.ndarray, " border"]:
    """Return for each pixel of paint round an area whether no edge parts it from the area."""
    if not area.any():
        return np.zeros(0, dtype=bool)
    room = BEYOND_PX + 1
    own, paint = np.pad(area, room), np.pad(one.paint, room)
    lab = np.pad(one.lab, ((room, room), (room, room), (0, 0)))
    ring = dilate(own, BEYOND_PX) & ~dilate(own, BEYOND_PX - 1)
    step = np.linalg.norm(lab[ring] - lab[nearest(own)][ring], axis=-1)
    return step[paint[ring]] < STEP


def _largest(mask: Mask) -> Mask:
    """Return the largest connected part of a mask."""
    numbers, areas = sized_parts(mask)
    areas[0] = 0
    return np.asarray((numbers == areas.argmax()) & mask)
