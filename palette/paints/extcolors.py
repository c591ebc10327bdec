"""Extract a palette with the paper's own tool, for comparison: `extcolors` and a 5 % rule.

What it does, read from its source (version 1.0.0): every colour that is not wholly transparent is
counted, then, from the most frequent on, each takes over all later colours within a tolerance (32)
in CIE L*a*b* 1976, ten times what is just noticeable, and keeps its own exact value. So near paints
merge (two greens of one outfit), blends along edges are colours like any other, and of equally
frequent colours the order of the pixels decides. Its own pixel count, the denominator of the shares
that it prints, includes transparent pixels; here shares are of the pixels that it counted. Time
grows with pixels, in Python, and with the square of the distinct colours.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence

import numpy as np
from jaxtyping import UInt8

from toonset.errors import PaletteError
from toonset.palette.color_names import name_of
from toonset.palette.colors import oklab_from_rgb
from toonset.palette.paints.select import PaletteOptions
from toonset.palette.palette import DroppedColor, Palette, PaletteColor

TOLERANCE = 32  # extcolors' default
LEAST_LISTED = 0.002  # of the pixels, as for our own


def extcolors_palette(
    images: Sequence[UInt8[np.ndarray, "_ _ 4"]], options: PaletteOptions | None = None
) -> Palette:
    """Return the palette that the paper's tool gives for all pictures together.

    Args:
        images: the character on transparent ground.
        options: its `min_share` and `max_colors` count.

    Raises:
        PaletteError: no picture, or only transparent pixels.
    """
    from PIL import Image

    extcolors = importlib.import_module("extcolors")  # untyped
    options = options or PaletteOptions()
    seen = [image[image[..., 3] > 0] for image in images]
    pixels = np.concatenate([np.zeros((0, 4), dtype=np.uint8), *seen])
    if not len(pixels):
        raise PaletteError("palette: no pixel to count; give pictures with a figure in them")
    found, _ = extcolors.extract_from_image(Image.fromarray(pixels[None]), TOLERANCE)
    shares = [(rgb, count / len(pixels)) for rgb, count in found]
    kept = [one for one in shares if one[1] >= options.min_share][: options.max_colors]
    kept = kept or shares[:1]
    colors = tuple(PaletteColor(rgb, share, name_of(rgb)) for rgb, share in kept)
    dropped = tuple(
        DroppedColor(rgb, share, name_of(rgb), _nearest_away(rgb, kept))
        for rgb, share in shares[len(kept) :]
        if share >= LEAST_LISTED
    )
    rule = f"extcolors, tolerance {TOLERANCE}: at least {options.min_share:g} of the counted pixels"
    return Palette(colors, rule, dropped)


def _nearest_away(
    rgb: tuple[int, int, int], kept: list[tuple[tuple[int, int, int], float]]
) -> float:
    """Return the distance in OKLab to the nearest colour that was kept."""
    given = oklab_from_rgb(np.array([color for color, _ in kept], dtype=np.uint8))
    own = oklab_from_rgb(np.array(rgb, dtype=np.uint8))
    return float(np.linalg.norm(given - own, axis=1).min())
