"""How the steps of the pages about an artist's habits draw their sheets, and what stands in for it.

All of them start from the condition `artist` of `toonset synth`, cut out of its JPEG file; one
habit grows while the others stay as they are.
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from bench.cases.bodies import random_body
from bench.cases.cases import STRANGER
from bench.stability.draws import cut_out, through_jpeg
from bench.stability.sheet import DrawnSheet, GivenBody, Step
from toonset.dataset.synthetic.artist_options import ArtistOptions
from toonset.dataset.synthetic.options import CONDITIONS, SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround

SHEET = replace(CONDITIONS["artist"], cell_px=200, outline_px=2)
OTHER = "other body"


def drifted(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet whose drawings show bodies `step` times as far apart as artists' do."""
    return _cut(with_drift(step), seed)


def shadowed(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet with a shadow that takes `step` percent of the light."""
    return _cut(with_shadow(step), seed)


def grainy(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet on paper with grain of `step` levels."""
    return _cut(with_grain(step), seed)


def of_mannequin(step: Step, seed: int) -> DrawnSheet:
    """Return the sheet with its own body as mannequin, another one, a plain one, or none."""
    if step == OTHER:
        other = random_body(seed + STRANGER, symmetric=True)
        return replace(_cut(SHEET, seed), mesh=other)
    return replace(_cut(SHEET, seed), given=cast(GivenBody, step))


def without_mannequin(step: Step, seed: int) -> DrawnSheet:
    """Return a sheet of `step` drawings, to be calibrated without a mannequin."""
    return replace(_cut(replace(SHEET, views=int(step)), seed), given="none")


def with_drift(step: Step) -> SynthOptions:
    """Return the sheet's options with errors of the body `step` times as large."""
    return _with(replace(SHEET.artist, body=SHEET.artist.body.scaled(float(step))))


def with_shadow(step: Step) -> SynthOptions:
    """Return the sheet's options with a shadow that takes `step` percent of the light."""
    return _with(replace(SHEET.artist, shadow_strength=float(step) / 100))


def with_grain(step: Step) -> SynthOptions:
    """Return the sheet's options with grain of `step` levels."""
    return _with(replace(SHEET.artist, grain_levels=float(step)))


def with_color_error(step: Step) -> SynthOptions:
    """Return the sheet's options with colours off by up to `step` percent in every view."""
    return _with(replace(SHEET.artist, color_error_fraction=float(step) / 100))


def with_quality(step: Step) -> SynthOptions:
    """Return the sheet's options with JPEG of quality `step`; "lossless" is a PNG."""
    quality = step if isinstance(step, int) else 0
    return _with(replace(SHEET.artist, jpeg_quality=quality))


def as_cut_out(made: Turnaround) -> DrawnSheet:
    """Return the drawings of a sheet as they are found in its file, with their true cameras."""
    quality = made.options.artist.jpeg_quality
    return cut_out(made, through_jpeg(made.sheet, quality) if quality else made.sheet)


def _with(artist: ArtistOptions) -> SynthOptions:
    return replace(SHEET, artist=artist)


def _cut(options: SynthOptions, seed: int) -> DrawnSheet:
    return as_cut_out(make_turnaround(random_body(seed), options, seed))
