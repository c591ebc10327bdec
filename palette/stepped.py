"""The palette of drawings whose paints are shaded in steps: a colour and its darker tones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toonset.palette.names import RGB
from toonset.palette.options import MAX_COLORS
from toonset.palette.paints.extract import rule_in_words
from toonset.palette.paints.grainy_colors import read_drawn_colors
from toonset.palette.paints.select import PaletteRule, nearest_found
from toonset.palette.palette import Palette
from toonset.palette.pixels.cel_tones import find_steps, with_steps
from toonset.palette.pixels.grain import LEAST_LEVELS, noise_levels
from toonset.palette.pixels.labels import nearest_labels
from toonset.palette.printed import Printed, in_printed_order
from toonset.palette.sheet_palette import Map, Mask, Picture, sheet_palette
from toonset.raster import dilate, is_uniform

LEAST_STEP = 0.008  # of the character: smaller tones are not told from blends
SMOOTHED_PX = 2  # from a tone's border: there smoothing has moved it


@dataclass(frozen=True, eq=False)
class Steps:
    """Plan of a palette whose paints are shaded in steps.

    Attributes:
        paints: the tones of paints that have several, from light to dark.
        stay: found colours that the user keeps.
        options: of the choice.
        rule: keeps all these tones, as colours of their own.
    """

    paints: list[list[RGB]]
    stay: tuple[RGB, ...]
    options: PaletteRule
    rule: PaletteRule


def steps_of(
    found: Palette,
    pictures: Sequence[Picture],
    contours: Sequence[Map],
    options: PaletteRule,
    least: int,
) -> Steps | None:
    """Return the steps that drawings are shaded in; None where they are not.

    Paints are tones that together reach the rule's share, the largest of them and of the other
    colours if there are too many. A colour to keep is no paint's darker tone.

    Args:
        found: their palette as they are drawn, each tone a colour.
        pictures: the drawings.
        contours: how far lines cover their pixels.
        options: of the choice.
        least: tones that some paint must have.
    """
    known = {one.rgb: one.share for one in found.dropped}
    known |= {one.rgb: one.share for one in found.colors}
    colors = [rgb for rgb, share in known.items() if share >= LEAST_STEP]
    steps = find_steps(pictures, contours, np.array(colors, np.uint8).reshape(-1, 3))
    if max(map(len, steps), default=0) < least:
        return None
    stay = tuple(dict.fromkeys(nearest_found(rgb, list(known)) for rgb in options.keep))
    chains = [[colors[n] for n in tones] for tones in steps]
    chains = [[tones[0], *(one for one in tones[1:] if one not in stay)] for tones in chains]
    chains = [tones for tones in chains if len(tones) > 1]
    shares = {tones[0]: sum(map(known.__getitem__, tones)) for tones in chains}
    others = known.keys() - {rgb for tones in chains for rgb in tones} - {*stay}
    room = options.max_colors - len(options.keep)
    rivals = sorted((*(shares.keys() - {*stay}), *others), key=lambda n: -shares.get(n, known[n]))
    first = {*stay, *rivals[:room]}
    paints = [
        tones
        for tones in chains
        if tones[0] in first and (tones[0] in stay or shares[tones[0]] >= options.min_share)
    ]
    tones = [rgb for own in paints for rgb in own if rgb not in stay]
    lights = sum(own[0] not in stay for own in paints)
    most = min(MAX_COLORS, options.max_colors + len(tones) - lights)
    if not paints or len(options.keep) + len(tones) > most:
        return None
    kept = {rgb for own in paints for rgb in own}
    shades = tuple(rgb for own in chains for rgb in own[1:] if rgb not in kept)
    rule = replace(options, keep=(*options.keep, *tones), max_colors=most, shades=shades)
    return Steps(paints, stay, options, rule)


def stepped_palette(
    steps: Steps,
    pictures: Sequence[Picture],
    smooth: Sequence[Picture],
    lines: Sequence[Mask],
    printed: Printed,
) -> Palette | None:
    """Return the palette of drawings that are shaded in steps.

    None where printed colours are the paints: which of them are tones of which is not known.

    Args:
        steps: of the drawings.
        pictures: with their grain.
        smooth: without it.
        lines: where lines are drawn.
        printed: the palette that the sheet prints.
    """
    palette = sheet_palette(smooth, steps.rule, lines, None, printed)
    if palette.evidence is None:
        return None
    meant = {one: one for own in steps.paints for one in own}
    if not meant.keys() <= {color.rgb for color in palette.colors}:
        return None
    stay = steps.stay
    if noise_levels(pictures) >= LEAST_LEVELS:
        labels = [nearest_labels(picture, palette.rgb) for picture in smooth]
        apart = [
            line | dilate(~is_uniform(own), SMOOTHED_PX)
            for line, own in zip(lines, labels, strict=True)
        ]
        read = read_drawn_colors(palette, pictures, smooth, apart)
        new = dict(zip((c.rgb for c in palette.colors), (c.rgb for c in read.colors), strict=True))
        if len(set(new.values())) == len(new):
            palette, meant = read, {rgb: new[rgb] for rgb in meant}
            stay = tuple(new.get(rgb, rgb) for rgb in stay)
    paints = [[meant[one] for one in own] for own in steps.paints]
    found = with_steps(palette, paints, steps.options.min_share, stay)
    found = replace(found, rule=rule_in_words(steps.options, palette.contour))
    return in_printed_order(found, palette.printed) if palette.printed else found
