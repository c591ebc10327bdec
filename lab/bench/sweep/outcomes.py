"""What a case comes to, and how two outcomes differ."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import UInt8

from lab.bench.split.cases import Drawn
from lab.bench.split.score import same_box
from toonset.dataset.split.sheet import Segmentation, split_picture
from toonset.errors import ToonsetError
from toonset.palette.choice import choose_palette
from toonset.palette.colors import JUST_NOTICEABLE, oklab_from_rgb
from toonset.palette.extract import paint_maps
from toonset.palette.palette import Palette
from toonset.palette.pixels.ink_lines import find_contours
from toonset.view import Box

LARGE = 0.05  # of the character: a paint of the rule
MANY = 0.05  # of the labelled pixels: a drawing labelled otherwise
Difference = dict[str, int | str]


@dataclass(frozen=True, eq=False)
class Outcome:
    """Results of a case.

    Attributes:
        pictures: of every view, or labels, tones and lines of every drawing.
        boxes: of the views; none of palettes.
        paints: colours and shares; none of sheets.
        words: by what they are about; "error" alone where the case ends with one.
    """

    pictures: tuple[UInt8[np.ndarray, ...], ...] = ()
    boxes: tuple[Box, ...] = ()
    paints: tuple[tuple[tuple[int, int, int], float], ...] = ()
    words: dict[str, str] = field(default_factory=dict)


def split_outcome(rgba: UInt8[np.ndarray, "height width 4"]) -> Outcome:
    """Return what splitting a sheet comes to."""
    try:
        found: Segmentation = split_picture(rgba)
    except ToonsetError as error:
        return Outcome(words={"error": str(error)})
    return Outcome(
        tuple(view.rgba for view in found.views),
        tuple(view.box for view in found.views),
        words={
            "warnings": "\n".join(found.warnings),
            "remarks": "\n".join(found.remarks),
            "left out": str(found.left_out),
            "swatches": str(found.swatches),
            "groups": str(found.groups),
            "background": f"{found.background} {found.sure:.6f}",
            "lines": str([view.line_width_px for view in found.views]),
        },
    )


def palette_outcome(
    pictures: tuple[UInt8[np.ndarray, "_ _ 4"], ...], printed: tuple[tuple[int, int, int], ...]
) -> Outcome:
    """Return what the palette of drawings comes to."""
    try:
        contours = find_contours(pictures)
        palette: Palette = choose_palette(pictures, contours, swatches=printed)
        maps = paint_maps(pictures, contours, palette)
    except ToonsetError as error:
        return Outcome(words={"error": str(error)})
    tones = [one.tones for one in maps if one.tones is not None]
    return Outcome(
        (*[one.labels for one in maps], *tones, *contours),
        paints=tuple((one.rgb, one.share) for one in palette.colors),
        words={
            "warnings": "\n".join(palette.warnings),
            "features": str([one for one in palette.colors if one.share < LARGE]),
            "tones": str([one.tones for one in palette.colors] + [palette.shadow]),
            "palette": repr(palette),
        },
    )


def difference(before: Outcome, after: Outcome) -> Difference:
    """Return what differs: empty where nothing does.

    "lost" speaks of sheets whose views are others, and of drawings that lack a large paint or are
    labelled otherwise.
    """
    found: Difference = {}
    for name in before.words.keys() | after.words.keys():
        if before.words.get(name) != after.words.get(name):
            found[name] = 1
    if before.boxes != after.boxes:
        found["boxes"] = 1
    if before.paints != after.paints:
        found["paints"] = 1
    pixels, of = _pixels(before, after)
    if pixels:
        found["pixels"] = pixels
    lost = _lost(before, after) or (
        "labels" if before.paints and pixels > MANY * max(of, 1) else ""
    )
    if lost:
        found["lost"] = lost
    return found


def _lost(before: Outcome, after: Outcome) -> str:
    if "error" in after.words and "error" not in before.words:
        return "error"
    if len(before.boxes) != len(after.boxes):
        return "number"
    if not all(map(_same, zip(before.boxes, before.pictures, strict=False), _views(after))):
        return "boxes"
    large = [rgb for rgb, share in before.paints if share >= LARGE]
    others = [rgb for rgb, _ in after.paints]
    if large and (not others or _farthest(large, others) > JUST_NOTICEABLE):
        return "paint"
    return ""


def _views(of: Outcome) -> zip[tuple[Box, UInt8[np.ndarray, ...]]]:
    return zip(of.boxes, of.pictures, strict=False)


def _same(
    before: tuple[Box, UInt8[np.ndarray, ...]], after: tuple[Box, UInt8[np.ndarray, ...]]
) -> bool:
    one, other = (Drawn(box, picture[..., 3]) for box, picture in (before, after))
    return same_box(one, other)


def _farthest(colors: list[tuple[int, int, int]], others: list[tuple[int, int, int]]) -> float:
    """Return how far from the nearest of others the one is that is farthest from them."""
    first, second = (oklab_from_rgb(np.array(rgb, dtype=np.uint8)) for rgb in (colors, others))
    return float(np.linalg.norm(first[:, None] - second, axis=-1).min(axis=1).max())


def _pixels(before: Outcome, after: Outcome) -> tuple[int, int]:
    """Return the number of pixels that differ, and of how many."""
    differ = of = 0
    for number in range(max(len(before.pictures), len(after.pictures))):
        pair = [own.pictures[number : number + 1] for own in (before, after)]
        sizes = [own[0].shape[0] * own[0].shape[1] if own else 0 for own in pair]
        of += max(sizes)
        if not all(pair) or pair[0][0].shape != pair[1][0].shape:
            differ += max(sizes)
            continue
        other = pair[0][0] != pair[1][0]
        differ += int((other.any(axis=-1) if other.ndim == 3 else other).sum())
    return differ, of
