"""Select the palette from the paints: the paper's rule, and what a person keeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.errors import PaletteError
from toonset.palette.colors import JUST_NOTICEABLE, oklab_from_rgb
from toonset.palette.names import hex_of
from toonset.palette.options import PaletteOptions
from toonset.palette.paints.areas import Areas
from toonset.palette.paints.clusters import Paint

KEEP_REACH = (
    4 * JUST_NOTICEABLE
)  # in OKLab: so far a colour typed to be kept may be from a found one
OPEN = 0.25  # of a colour's blends: the deviation of an even spread over 0 to 1, in its favour

RGB = tuple[int, int, int]
USUAL = PaletteOptions()


@dataclass(frozen=True)
class PaletteRule:
    """Which of the colours that were found stay.

    Attributes:
        min_share: as of `PaletteOptions`, as are `max_colors` and `features`.
        max_colors: also of these.
        keep: 8-bit sRGB: the found colours nearest to these stay, however small they are.
        contour: count the drawn lines to their colour, as the paper does; False leaves that colour
            to what else is painted with it. Matters only where the lines are given.
        features: keep small colours that recur at one place of the character; None: as True.
        shades: colours that are no features: tones of paints that are left out.
    """

    min_share: float = USUAL.min_share
    max_colors: int = USUAL.max_colors
    keep: tuple[RGB, ...] = ()
    contour: bool = USUAL.contour
    features: bool | None = USUAL.features
    shades: tuple[RGB, ...] = ()

    def __post_init__(self) -> None:
        """Refuse more colours to keep than are wanted.

        Raises:
            PaletteError: so many.
        """
        if len(self.keep) > self.max_colors:
            raise PaletteError(
                f"--keep: {len(self.keep)} colours, but at most {self.max_colors} are wanted; "
                "raise --max-colors"
            )


@dataclass(frozen=True, eq=False)
class Amount:
    """Amount of a paint.

    Attributes:
        paint: the paint.
        share: of all pixels; drawn lines count to their ink alone.
        cloth: of all pixels, without drawn lines.
        weight: what the rule looks at: the share of pixels that are no lines, as much as blends
            may hold of it; for the ink the share of all pixels.
    """

    paint: Paint
    share: float
    cloth: float
    weight: float


def with_wanted(
    paints: Sequence[Paint], hidden: Sequence[Paint], wanted: Sequence[RGB]
) -> tuple[list[Paint], list[Paint]]:
    """Return the paints and the hidden ones, those that are wanted taken out of their paints.

    Args:
        paints: of a character, each colour of its pixels a member of one.
        hidden: colours that are taken for one of these, though they are their own.
        wanted: hidden ones that are nearer to one of these than every paint become paints.
    """
    paints, hidden = list(paints), list(hidden)
    for rgb in wanted:
        every = [*paints, *hidden]
        number = int(_away(every, rgb).argmin())
        if number >= len(paints):
            chosen = hidden.pop(number - len(paints))
            paints = [
                replace(paint, members=np.setdiff1d(paint.members, chosen.members))
                for paint in paints
            ] + [chosen]
    return paints, hidden


def measure(
    paints: Sequence[Paint], areas: Areas, options: PaletteRule
) -> tuple[list[Amount], int | None]:
    """Return every paint's amount, and which paint is the lines' ink (None without lines).

    Args:
        paints: all of a character.
        areas: their pixels.
        options: whether lines count to their ink.
    """
    lines = int(areas.drawn.sum())
    total = int(areas.painted.sum()) + lines
    ink = int(areas.drawn.argmax()) if lines else None
    cloth = areas.painted / total
    weights = (areas.painted + OPEN * areas.soft) / max(total - lines, 1)
    shares = cloth.copy()
    if ink is not None:
        shares[ink] += lines / total
        weights[ink] = max(weights[ink], shares[ink] if options.contour else 0)
    parts = zip(paints, shares.tolist(), cloth.tolist(), weights.tolist(), strict=True)
    return [Amount(*part) for part in parts], ink


def choose(
    amounts: Sequence[Amount], options: PaletteRule
) -> tuple[list[Amount], list[Amount], tuple[str, ...]]:
    """Return the amounts that stay and those left out, largest share first, and warnings.

    Raises:
        PaletteError: nothing found near a colour to keep.
    """
    wanted = [_nearest(amounts, rgb) for rgb in options.keep]
    notes = _keep_notes(wanted, options)
    by_share = sorted(amounts, key=lambda amount: (-amount.share, amount.paint.rgb))
    rule = [a for a in by_share if a.weight >= options.min_share and a not in wanted]
    room = options.max_colors - len(set(map(id, wanted)))
    stay = {id(amount) for amount in [*wanted, *rule[:room]]} or {id(by_share[0])}
    kept = [amount for amount in by_share if id(amount) in stay]
    left = [amount for amount in by_share if id(amount) not in stay]
    if wanted or rule:
        return kept, left, notes
    warning = (
        f"no colour reaches {options.min_share:.1%} of the pixels; the largest, with "
        f"{kept[0].share:.1%}, was kept alone: lower --min-share"
    )
    return kept, left, (warning,)


def nearest_found(rgb: RGB, colors: Sequence[RGB]) -> RGB:
    """Return which of the colours that were found is meant by one to keep."""
    return colors[int(_away_from(colors, rgb).argmin())]


def _keep_notes(wanted: Sequence[Amount], options: PaletteRule) -> tuple[str, ...]:
    """Return what was kept for colours that are not in the pictures as typed."""
    return tuple(
        f"--keep: {hex_of(rgb)} itself was not found; kept the nearest, {hex_of(one.paint.rgb)}"
        f"{', which the rule keeps anyway' if one.weight >= options.min_share else ''}"
        for rgb, one in zip(options.keep, wanted, strict=True)
        if _away([one.paint], rgb)[0] > JUST_NOTICEABLE
    )


def _away(paints: Sequence[Paint], rgb: RGB) -> Float[np.ndarray, " paints"]:
    """Return how far the paints are from a colour in OKLab."""
    return _away_from([paint.rgb for paint in paints], rgb)


def _away_from(colors: Sequence[RGB], rgb: RGB) -> Float[np.ndarray, " colors"]:
    found = oklab_from_rgb(np.array(colors, dtype=np.uint8))
    return np.linalg.norm(found - oklab_from_rgb(np.array(rgb, dtype=np.uint8)), axis=1)


def _nearest(amounts: Sequence[Amount], rgb: RGB) -> Amount:
    away = _away([amount.paint for amount in amounts], rgb)
    nearest = amounts[int(away.argmin())]
    if away.min() > KEEP_REACH:
        raise PaletteError(
            f"--keep: {hex_of(rgb)}: no such colour was found; the nearest is "
            f"{hex_of(nearest.paint.rgb)}: name that one, or give the whole palette with --colors"
        )
    return nearest
