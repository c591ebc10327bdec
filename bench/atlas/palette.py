"""Trying a palette: are two near-equal colours told apart, and is a tiny feature's colour found?"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from bench.atlas.training import REFUSED, Tried
from bench.cases.bodies import HAIR, SKIN, random_body
from bench.stability.bodies import recolored, with_eyes
from bench.stability.page import Page
from bench.stability.sheet import Step
from toonset.dataset.images.picture import encode_png
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.errors import ToonsetError
from toonset.mesh import Mesh
from toonset.palette.colors import JUST_NOTICEABLE, oklab_from_rgb
from toonset.palette.names import hex_of
from toonset.palette.paints.extract import find_palette
from toonset.palette.palette import Palette
from toonset.palette.pixels.ink_lines import find_contour
from toonset.view import over_white

PICTURES = SynthOptions(views=8, cell_px=150, elevation_deg=8, outline_px=1.5)
LINE = 128  # of 255: covered by half, a pixel is a line, as in `toonset palette`
EYE = (20, 190, 180)  # unlike any other colour of the body
CLOSE_CALL = 1.0  # bits: `toonset palette` says of less that another number would nearly do
SKIN_AND_HAIR = (SKIN, HAIR)
SILENT, LISTED, CLOSE, WARNED = "silent", "left out, listed", "a close call", "warned"

Rgb = tuple[int, int, int]


@dataclass(frozen=True)
class PalettePage(Page):
    """A page about palettes.

    Attributes:
        draw: step and seed to a body and those of its colours that are to be found.
    """

    draw: Callable[[Step, int], tuple[Mesh, tuple[Rgb, ...]]]


def near_equal(step: Step, seed: int) -> tuple[Mesh, tuple[Rgb, ...]]:
    """Return a body whose hair is `step` hundredths of OKLab from its skin, and both colours."""
    hair = color_away(*SKIN_AND_HAIR, float(step) / 100)
    return recolored(random_body(seed), "hair", hair), (SKIN, hair)


def tiny_feature(step: Step, seed: int) -> tuple[Mesh, tuple[Rgb, ...]]:
    """Return a body with eyes of `step` percent of its height in radius, and their colour."""
    body = random_body(seed)
    return with_eyes(body, float(step) / 100 * body.height, EYE), (EYE,)


def color_away(start: Rgb, towards: Rgb, distance: float) -> Rgb:
    """Return the 8-bit colour between two that is nearest to `distance` in OKLab from the first."""
    shares = np.linspace(0, 1, 1024)[:, None]
    line = np.rint(np.array(start) + shares * (np.array(towards) - start)).astype(np.uint8)
    found = line[int(np.abs(_away(line, start) - distance).argmin())]
    return int(found[0]), int(found[1]), int(found[2])


def try_palette(page: PalettePage, step: Step, seed: int) -> tuple[Tried, bytes]:
    """Return the percentage of wanted colours that was found, and a PNG: drawing, both palettes."""
    began = time.perf_counter()
    body, wanted = page.draw(step, seed)
    made = make_turnaround(body, PICTURES, seed)
    pictures = [view.rgba for view in made.views]
    try:
        palette = find_palette(pictures, contours=[find_contour(p) >= LINE for p in pictures])
    except ToonsetError as error:
        return Tried(seed, 0.0, REFUSED, str(error)), b""
    missed = [color for color in wanted if not _has(palette.rgb, color, wanted)]
    voice, words = _said(palette, missed or wanted)
    found = 100 * (1 - len(missed) / len(wanted))
    evidence = {"colors": float(len(palette.colors))}
    if palette.evidence is not None:
        evidence |= {
            "one_more_bits": palette.evidence.one_more,
            "one_less_bits": palette.evidence.one_less,
        }
    picture = encode_png(_with_swatches(pictures[0], wanted, palette))
    return Tried(seed, found, voice, words, evidence, time.perf_counter() - began), picture


def _has(palette: UInt8[np.ndarray, "colors 3"], color: Rgb, wanted: Sequence[Rgb]) -> bool:
    """Return whether a palette's colour is this one, and none of the others."""
    others = [other for other in wanted if other != color]
    apart = min((float(_away(np.array([o], np.uint8), color)[0]) for o in others), default=np.inf)
    return bool(_away(palette, color).min() < min(JUST_NOTICEABLE, apart / 2))


def _said(palette: Palette, colors: Sequence[Rgb]) -> tuple[str, str]:
    """Return what `toonset palette` said about these colours, or about the number of all."""
    if palette.warnings:
        return WARNED, "; ".join(palette.warnings)
    for dropped in palette.dropped:
        if any(_away(np.array([dropped.rgb], np.uint8), c)[0] < JUST_NOTICEABLE for c in colors):
            return LISTED, f"left out: {hex_of(dropped.rgb)}, {100 * dropped.share:.1f} %"
    evidence = palette.evidence
    if evidence is not None and min(evidence.one_less, evidence.one_more) < CLOSE_CALL:
        return CLOSE, "another number of colours would do nearly as well, a close call"
    return SILENT, ""


def _away(colors: UInt8[np.ndarray, "colors 3"], color: Rgb) -> Float[np.ndarray, " colors"]:
    one = oklab_from_rgb(np.array([color], np.uint8))
    return np.linalg.norm(oklab_from_rgb(colors) - one, axis=1)


def _with_swatches(
    picture: UInt8[np.ndarray, "height width 4"], wanted: Sequence[Rgb], palette: Palette
) -> UInt8[np.ndarray, "height width 3"]:
    """Return a view over white; beside it what was to be found, and the palette that was."""
    height = picture.shape[0]
    columns = [np.repeat(_bars(colors, height), 24, axis=1) for colors in (wanted, palette.rgb)]
    gap = np.full((height, 8, 3), 255, np.uint8)
    shown = (over_white(picture) * 255 + 0.5).astype(np.uint8)
    return np.concatenate([shown, gap, columns[0], gap, columns[1]], axis=1)


def _bars(colors: Sequence[Rgb] | np.ndarray, height: int) -> UInt8[np.ndarray, "height 1 3"]:
    rows = np.arange(height) * len(colors) // height
    return np.asarray(colors, dtype=np.uint8)[rows][:, None]
