"""Tell of sheets that have no paints to tell apart: line art, and figures in one colour."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import UInt8

from toonset.palette.colors import JUST_NOTICEABLE, oklab_from_rgb
from toonset.palette.names import hex_of
from toonset.palette.palette import Palette
from toonset.palette.pixels.antialias import OPAQUE

Picture = UInt8[np.ndarray, "height width 4"]

CLOTH = 0.03  # of the figure in the lines' colour without being a line: crossings, full stops
PAPER = (0.9, 2.5 * JUST_NOTICEABLE)  # lightness from which, and chroma to which, a colour is paper
LIKE = 5 * JUST_NOTICEABLE  # in OKLab: one colour with grain
SAMPLED = 7  # every so manieth pixel is looked at
STRAY = 0.02  # of the figure in any other colour


def plain_notes(found: Palette, pictures: Sequence[Picture]) -> tuple[str, ...]:
    """Return what a person should know of a sheet without paints, or with one.

    Args:
        found: its palette.
        pictures: its drawings, sRGB with straight alpha.
    """
    ink = found.contour
    others = [one for one in found.colors if ink is None or one.rgb != ink.rgb]
    left_out = sum(one.share for one in found.dropped)
    if ink is None:
        only = len(found.colors) == 1 and left_out <= STRAY and _is_plain(found, pictures)
        code = hex_of(found.colors[0].rgb)
        return (f"one colour only, {code}: there is nothing to tell apart",) if only else ()
    lines = ink.cloth <= CLOTH and len(others) <= 1 and all(_is_paper(one.rgb) for one in others)
    if not lines or left_out > STRAY:
        return ()
    within = f"; between them is paper, {hex_of(others[0].rgb)}" if others else ""
    return (f"lines only; no palette to find{within}",)


def _is_plain(found: Palette, pictures: Sequence[Picture]) -> bool:
    """Return whether nearly all that is opaque looks like the palette's one colour."""
    pixels = np.concatenate([one[one[..., 3] >= OPAQUE][::SAMPLED, :3] for one in pictures])
    off = oklab_from_rgb(pixels) - oklab_from_rgb(np.array(found.colors[0].rgb, dtype=np.uint8))
    return bool((np.linalg.norm(off, axis=1) <= LIKE).mean() >= 1 - STRAY)


def _is_paper(rgb: tuple[int, int, int]) -> bool:
    lightness, *ab = oklab_from_rgb(np.array(rgb, dtype=np.uint8))
    return bool(lightness >= PAPER[0] and np.hypot(*ab) <= PAPER[1])
