"""Named sets of training options."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from toonset.nerf.options import TrainOptions

PRESETS = ("fast", "paper")
PAPER_STEPS = 2000


def preset(name: str) -> dict[str, Any]:
    """Return the options of a preset that differ from the defaults; "fast" is the defaults."""
    if name == "fast":
        return {}
    defaults = asdict(TrainOptions())
    return {key: value for key, value in asdict(paper()).items() if value != defaults[key]}


def paper(steps: int = PAPER_STEPS) -> TrainOptions:
    """Return the plain method: triplane, small decoder, classic volume rendering, classifier.

    Three planes with summed bilinear features; a decoder to density and colour; stratified samples
    along the whole rays through the figure's box, drawn anew in every step; pictures over backdrops
    of all colours; a classifier of one hidden layer on the rendered colour, whose labels are the
    nearest palette colours. No silhouette is used but to place the box, nothing is smoothed, and
    drawings are taken as they are. A step takes 1,024 rays of 96 samples.
    """
    return TrainOptions(
        steps=steps,
        palette_weight=0.01,
        field="triplane",
        carve=False,
        smoothness=0.0,
        register=False,
        turn=False,
        unbend=False,
        symmetric=False,
    )
