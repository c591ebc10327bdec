"""Replace palette colours of a trained run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import UInt8

from toonset.errors import BundleError, PaletteError
from toonset.nerf.fields.trained_field import NO_LINES, NO_PALETTE, TrainedField
from toonset.nerf.look.outline import Outline
from toonset.nerf.options import ORIGINAL
from toonset.palette.formats.hex import rgb_of_typed
from toonset.palette.formats.registry import palette_names, parse_colors
from toonset.palette.pixels.labels import nearest_colors
from toonset.palette.recolor import change_colors


def recolor_run(trained: TrainedField, changes: Sequence[str]) -> TrainedField:
    """Return the run with palette colours replaced; all changes happen at once.

    Args:
        trained: the run.
        changes: "OLD=NEW", hex colours; OLD must be a colour of the run's palette, or the name
            that `toonset palette` gives one of them and no other.

    Raises:
        PaletteError: no palette, no such colour, or text that is no such pair.
    """
    if not changes:
        return trained
    if trained.palette is None:
        raise PaletteError(NO_PALETTE)
    return _in_colors(trained, change_colors(trained.palette, changes))


def change_pen(trained: TrainedField, width_px: float | None, color: str | None) -> TrainedField:
    """Return the run with the outline of its drawn look drawn by another pen.

    Args:
        trained: the run.
        width_px: of the line, pixels of the drawings; None: as it was drawn.
        color: of the line, hex; None: as it was drawn.

    Raises:
        BundleError: its drawings have no outline, or lines are switched off.
        PaletteError: `color` is not a colour.
    """
    if width_px is None and color is None:
        return trained
    if trained.drawings is None or trained.drawings.pen is None:
        raise BundleError(NO_LINES)
    pen = trained.drawings.pen
    rgb = pen.rgb if color is None else rgb_of_typed(color, "--ink-color")
    pen = Outline(rgb, pen.width_px if width_px is None else width_px)
    return replace(trained, drawings=replace(trained.drawings, pen=pen))


def repaint_run(
    trained: TrainedField, palette: str, *, nearest: bool = False, flag: str = "--palette"
) -> TrainedField:
    """Return the run in the colours of another palette, without training again.

    Args:
        trained: the run.
        palette: a palette file, or typed colours.
        nearest: give every colour of the run the nearest one (OKLab) of the palette; else the
            first takes the place of the first and so on.
        flag: that named the palette, for messages.

    Raises:
        PaletteError: no palette in the run, none in the file, or by order and other in number.
    """
    if trained.palette is None:
        raise PaletteError(NO_PALETTE)
    colors = np.asarray(parse_colors(palette))
    if nearest:
        place = nearest_colors(trained.palette, colors, space="oklab")
        return _in_colors(trained, colors[place])
    if len(colors) != len(trained.palette):
        raise PaletteError(
            f"{flag} {palette}: {len(colors)} colours, the run has {len(trained.palette)}; "
            "give as many in the same order, or pass --nearest"
        )
    return _in_colors(trained, colors)


def variants_of(
    trained: TrainedField, palettes: Sequence[str], *, nearest: bool = False
) -> list[tuple[str, TrainedField]]:
    """Return the run in the colours of other palettes, by their names (`palette_names`).

    Args:
        trained: the run.
        palettes: palette files, or typed colours.
        nearest: see `repaint_run`.

    Raises:
        PaletteError: see `repaint_run`.
    """
    fields = [repaint_run(trained, one, nearest=nearest, flag="--variants") for one in palettes]
    return list(zip(palette_names(palettes, ORIGINAL), fields, strict=True))


def _in_colors(trained: TrainedField, colors: UInt8[np.ndarray, "colors 3"]) -> TrainedField:
    """Return the run with as many other colours, its drawings in them, too."""
    drawings = trained.drawings
    if drawings is not None and len(colors) == len(drawings.palette):
        drawings = replace(drawings, repaint=colors)
    return replace(trained, palette=colors, drawings=drawings)
