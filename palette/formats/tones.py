"""Write shadow tones as swatches of their own in palette files, and read them back.

    brown
    brown, shadow

A person who paints wants both side by side; who reads the file back wants one paint. So a swatch
that follows "NAME" as "NAME, shadow" is its tone. Files without names hold colours in light alone.
"""

from __future__ import annotations

from collections.abc import Sequence

from toonset.palette.names import NamedColor, clean_name
from toonset.palette.palette import Palette

SUFFIX = ", shadow"


def swatches_of(palette: Palette) -> list[NamedColor]:
    """Return the colours with their names, each followed by its tone in shadow if it has another.

    Black is black in shadow, too. Of a ramp the darkest tone stands for shadow.
    """
    found = []
    for color in palette.colors:
        name = clean_name(color.name)
        found.append(NamedColor(color.rgb, name))
        darkest = color.tones[1:][-1:]
        dark = [tone.rgb for tone in darkest if name and tone.rgb != color.rgb]
        found += [NamedColor(rgb, name + SUFFIX) for rgb in dark]
    return found


def paints_of(swatches: Sequence[NamedColor]) -> list[NamedColor]:
    """Return swatches without those that are another one's tone in shadow."""
    return [
        one
        for one, before in zip(swatches, [None, *swatches], strict=False)
        if before is None or not before.name or one.name != before.name + SUFFIX
    ]
