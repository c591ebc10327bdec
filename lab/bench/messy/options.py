"""What makes a sheet messy: the named difficulties, which go together, and random mixtures."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from toonset.errors import SheetError

GROUNDS = ("plain", "tinted", "gradient", "vignette", "paper", "transparent")
OTHERS = (
    "jpeg",
    "one",
    "rows",
    "sizes",
    "captions",
    "title",
    "arrows",
    "swatches",
    "frame",
    "cells",
    "ground line",
    "guides",
    "props",
    "heads",
    "touching",
    "overlap",
    "floating",
    "shadows",
    "line art",
    "open contour",
    "signature",
)
BESIDE = (
    "poses",
    "busts",
    "outfits",
    "glued study",
    "hand frame",
    "ground strokes",
)  # drawn alone; no part of a mixture
DIFFICULTIES = (*GROUNDS, *OTHERS, *BESIDE)
GROUND_SHARES = (0.25, 0.2, 0.15, 0.1, 0.15, 0.15)  # of a mixture
# the earlier one stays where both are drawn
EXCLUSIVE = (
    ("transparent", "jpeg"),
    ("rows", "one"),
    ("touching", "one"),
    ("overlap", "one"),
    ("arrows", "one"),
    ("touching", "cells"),
    ("overlap", "cells"),
    ("open contour", "line art"),  # open contours are line art already
    ("overlap", "touching"),
    ("rows", "outfits"),
    ("shadows", "ground strokes"),
)


@dataclass(frozen=True)
class MessyOptions:
    """Options of messy sheets.

    Attributes:
        figure_px: smallest and largest height of the figures; many are drawn smaller than few.
        mixed: fewest and most difficulties of a mixture, beside its ground.
        most_figures: on one sheet.
    """

    figure_px: tuple[int, int] = (150, 640)
    mixed: tuple[int, int] = (2, 6)
    most_figures: int = 16


def checked(difficulties: Iterable[str]) -> frozenset[str]:
    """Return the difficulties as a set with exactly one ground, plain where none is named.

    Raises:
        SheetError: a name is unknown, or two exclude each other.
    """
    chosen = frozenset(difficulties)
    for name in sorted(chosen - set(DIFFICULTIES)):
        raise SheetError(
            f"messy sheet: no difficulty {name!r}; one of {', '.join(DIFFICULTIES)} is needed"
        )
    if not chosen & set(GROUNDS):
        chosen |= {"plain"}
    kept = compatible(chosen)
    if kept != chosen or len(chosen & set(GROUNDS)) > 1:
        raise SheetError(
            f"messy sheet: {', '.join(sorted(chosen))} do not all go together; ask for fewer"
        )
    return chosen


def compatible(chosen: frozenset[str]) -> frozenset[str]:
    """Return the difficulties without those that an earlier one excludes."""
    kept = set(chosen)
    for stays, goes in EXCLUSIVE:
        if stays in kept:
            kept.discard(goes)
    return frozenset(kept)


def mixture(options: MessyOptions, rng: np.random.Generator) -> frozenset[str]:
    """Return a random ground and a random few of the other difficulties."""
    ground = str(rng.choice(GROUNDS, p=GROUND_SHARES))
    count = int(rng.integers(options.mixed[0], options.mixed[1] + 1))
    return compatible(frozenset({ground, *map(str, rng.permutation(OTHERS)[:count])}))


def in_order(chosen: Iterable[str]) -> tuple[str, ...]:
    """Return difficulties in the order of `DIFFICULTIES`."""
    return tuple(name for name in DIFFICULTIES if name in set(chosen))
