"""Replacing palette colours of a trained run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toonset.errors import PaletteError
from toonset.nerf.trained import TrainedField
from toonset.palette.files import parse_colors
from toonset.palette.labels import nearest_colors
from toonset.palette.names import hex_of


def recolored(trained: TrainedField, changes: Sequence[str]) -> TrainedField:
    """Return the run with palette colours replaced; all changes happen at once.

    Args:
        trained: the run.
        changes: "OLD=NEW", each a hex colour; OLD must be a colour of the run's palette.

    Raises:
        PaletteError: no palette, no such colour, or text that is no such pair.
    """
    if not changes:
        return trained
    if trained.palette is None:
        raise PaletteError("run: was trained without palette; train again without --no-palette")
    old = [tuple(color) for color in trained.palette.tolist()]
    palette = trained.palette.copy()
    for change in changes:
        words = change.split("=")
        if len(words) != 2:
            raise PaletteError(f"--recolor {change!r}: OLD=NEW is needed, e.g. '#aa0000=#00aa00'")
        source, wanted = (_color(word, change) for word in words)
        if source not in old:
            known = ", ".join(hex_of((r, g, b)) for r, g, b in old)
            raise PaletteError(f"--recolor {change!r}: the palette has {known}; choose one of them")
        palette[old.index(source)] = wanted
    return replace(trained, palette=palette)


def repainted(trained: TrainedField, palette: str, *, nearest: bool = False) -> TrainedField:
    """Return the run in the colours of another palette, without training again.

    Args:
        trained: the run.
        palette: a palette file, or typed colours.
        nearest: give every colour of the run the nearest one (OKLab) of the palette; else the
            first takes the place of the first and so on.

    Raises:
        PaletteError: no palette in the run, none in the file, or by order and other in number.
    """
    if trained.palette is None:
        raise PaletteError("run: was trained without palette; train again without --no-palette")
    colors = np.asarray(parse_colors(palette))
    if nearest:
        place = nearest_colors(trained.palette, colors, space="oklab")
        return replace(trained, palette=colors[place])
    if len(colors) != len(trained.palette):
        raise PaletteError(
            f"--palette {palette}: {len(colors)} colours, the run has {len(trained.palette)}; "
            "give as many in the same order, or pass --nearest"
        )
    return replace(trained, palette=colors)


def _color(word: str, change: str) -> tuple[int, int, int]:
    colors = np.asarray(parse_colors(word.strip()))
    if len(colors) != 1:
        raise PaletteError(f"--recolor {change!r}: {word!r} is not one colour")
    return int(colors[0, 0]), int(colors[0, 1]), int(colors[0, 2])
