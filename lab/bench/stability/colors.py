"""Trying palettes and labels: are colours found, and has every pixel that of its own paint?

Counted are pixels that are one paint's and nothing else's, in light or in shadow; paints under 5 %
of the character, which no palette need have, are left out. A label is right if its colour is nearer
to the pixel's own paint than to any other's; a pixel without a label is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from jaxtyping import Float, UInt8

from lab.bench.cases.bodies import HAIR, SKIN, random_body
from lab.bench.palette.cases import INK, PaletteCase
from lab.bench.palette.measure import f1, score
from lab.bench.palette.methods import LEAST_SHARE, LINE
from lab.bench.palette.painted import labelled, painted_case, score_painted
from lab.bench.stability.bodies import recolored, with_eyes
from lab.bench.stability.sheets import DrawnSheet, as_cut_out
from lab.bench.stability.trials import Drawer, Kind, Trial, Tried
from toonset.dataset.images.picture import encode_png
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.mesh import Mesh
from toonset.palette.colors import JUST_NOTICEABLE, oklab_from_rgb
from toonset.palette.extract import extract_palette, paint_maps
from toonset.palette.names import hex_of
from toonset.palette.paints.extract import find_palette
from toonset.palette.palette import Palette
from toonset.palette.pixels.ink_lines import find_contour, find_contours
from toonset.palette.pixels.labels import UNLABELLED
from toonset.view import over_white

PICTURES = SynthOptions(views=8, cell_px=150, elevation_deg=8, outline_px=1.5)
EYE = (20, 190, 180)  # unlike any other colour of the body
CLOSE_CALL = 1.0  # bits: `toonset palette` says of less that another number would nearly do
SILENT, LISTED, CLOSE, WARNED = "silent", "left out, listed", "a close call", "warned"
WRONG_RGB = (213, 94, 0)

Rgb = tuple[int, int, int]
Wanted = tuple[Mesh, tuple[Rgb, ...]]  # a body, and those of its colours that are to be found
Labels = UInt8[np.ndarray, "height width"]


def near_equal(distance: float, seed: int) -> Wanted:
    """Return a body whose hair is so far from its skin in OKLab, and both colours."""
    hair = color_away(SKIN, HAIR, distance)
    return recolored(random_body(seed), "hair", hair), (SKIN, hair)


def tiny_feature(share: float, seed: int) -> Wanted:
    """Return a body with eyes of a share of its height in radius, and their colour."""
    body = random_body(seed)
    return with_eyes(body, share * body.height, EYE), (EYE,)


def color_away(start: Rgb, towards: Rgb, distance: float) -> Rgb:
    """Return the 8-bit colour between two that is nearest to `distance` in OKLab from the first."""
    shares = np.linspace(0, 1, 1024)[:, None]
    line = np.rint(np.array(start) + shares * (np.array(towards) - start)).astype(np.uint8)
    found = line[int(np.abs(_away(line, start) - distance).argmin())]
    return int(found[0]), int(found[1]), int(found[2])


def try_palette(draw: Drawer, seed: int) -> Tried:
    """Return the percentage of wanted colours that was missed, and a drawing, both palettes."""
    body, wanted = draw()
    made = make_turnaround(body, PICTURES, seed)
    pictures = [view.rgba for view in made.views]
    palette = find_palette(pictures, contours=[find_contour(p) >= LINE for p in pictures])
    missed = [color for color in wanted if not _has(palette.rgb, color, wanted)]
    voice, words = _said(palette, missed or wanted)
    columns = [
        _shown(pictures[0]),
        *(_bars(colors, PICTURES.cell_px) for colors in (wanted, palette.rgb)),
    ]
    value = 100 * len(missed) / len(wanted)
    return (Trial(seed, value, voice, words),), encode_png(np.hstack(columns))


def try_labels(draw: Drawer, seed: int, *, paints: bool = False) -> Tried:
    """Return the percentage of wrong pixels, or of what the paints' F1 lacks."""
    made: Turnaround = draw()
    cut = as_cut_out(made)
    pictures = [view.rgba for view, _ in cut.drawings]
    palette = extract_palette(pictures)
    found = [one.labels for one in paint_maps(pictures, find_contours(pictures), palette)]
    truths, shares = _truths(made, cut), _shares(made)
    true_colors, wanted = oklab_from_rgb(made.palette), shares >= LEAST_SHARE
    nearest = np.full(256, UNLABELLED, np.uint8)
    for index, color in enumerate(oklab_from_rgb(palette.rgb)):
        nearest[index] = np.linalg.norm(true_colors - color, axis=1).argmin()
    counted = [(t != UNLABELLED) & wanted[np.minimum(t, len(wanted) - 1)] for t in truths]
    trios = zip(found, truths, counted, strict=True)
    right = [(nearest[labels] == truth) & own for labels, truth, own in trios]
    parts = [r.sum() / max(c.sum(), 1) for r, c in zip(right, counted, strict=True)]
    right_share = sum(int(r.sum()) for r in right) / max(sum(int(c.sum()) for c in counted), 1)
    case = PaletteCase("", "", (), *_with_ink(made, shares))
    colors = f1([score([color.rgb for color in palette.colors], case)])
    words = "; ".join([f"F1 {colors:.2f}, {100 * right_share:.1f} % right", *palette.warnings])
    worst = int(np.argmin(parts))
    marked = _shown(pictures[worst])
    marked[counted[worst] & ~right[worst]] = WRONG_RGB
    picture = encode_png(np.hstack([_shown(pictures[worst]), marked]))
    value = 100 * (1 - (colors if paints else right_share))
    return (Trial(seed, value, WARNED if palette.warnings else SILENT, words),), picture


def try_painted(draw: Drawer, seed: int) -> Tried:
    """Return what the index of a painted sheet's labels lacks of 1, in percent."""
    case = painted_case(draw())
    palette, labels = labelled(case)
    result = score_painted(case, [color.rgb for color in palette.colors], labels)
    words = "; ".join([f"{len(palette.colors)} colours", *palette.warnings])
    colors = np.concatenate([palette.rgb, np.full((256 - len(palette.rgb), 3), 255, np.uint8)])
    picture = encode_png(np.hstack([_shown(case.images[0]), colors[labels[0]]]))
    voice = WARNED if palette.warnings else SILENT
    return (Trial(seed, 100 * (1 - result.index), voice, words),), picture


def _has(palette: UInt8[np.ndarray, "colors 3"], color: Rgb, wanted: Sequence[Rgb]) -> bool:
    """Return whether a palette's colour is this one, and none of the others."""
    others = [other for other in wanted if other != color]
    apart = min((float(_away(np.array([o], np.uint8), color)[0]) for o in others), default=np.inf)
    return bool(_away(palette, color).min() < min(JUST_NOTICEABLE, apart / 2))


def _said(palette: Palette, colors: Sequence[Rgb]) -> tuple[str, str]:
    """Return what `toonset palette` said about these colours, or about the number of all."""
    if palette.warnings:
        return WARNED, "; ".join(palette.warnings)
    for dropped in palette.dropped:
        if any(_away(np.array([dropped.rgb], np.uint8), c)[0] < JUST_NOTICEABLE for c in colors):
            return LISTED, f"left out: {hex_of(dropped.rgb)}, {100 * dropped.share:.1f} %"
    evidence = palette.evidence
    if evidence is not None and min(evidence.one_less, evidence.one_more) < CLOSE_CALL:
        return CLOSE, "another number of colours would do nearly as well, a close call"
    return SILENT, ""


def _away(colors: UInt8[np.ndarray, "colors 3"], color: Rgb) -> Float[np.ndarray, " colors"]:
    one = oklab_from_rgb(np.array([color], np.uint8))
    return np.linalg.norm(oklab_from_rgb(colors) - one, axis=1)


def _shown(picture: UInt8[np.ndarray, "height width 4"]) -> UInt8[np.ndarray, "height width 3"]:
    return (over_white(picture) * 255 + 0.5).astype(np.uint8)


def _bars(colors: Sequence[Rgb] | np.ndarray, height: int) -> UInt8[np.ndarray, "height 24 3"]:
    rows = np.arange(height) * len(colors) // height
    return np.repeat(np.asarray(colors, dtype=np.uint8)[rows][:, None], 24, axis=1)


def _truths(made: Turnaround, cut: DrawnSheet) -> list[Labels]:
    """Return the true labels in the pixels of the drawings that were cut out."""
    found = []
    for labels, drawn, (view, _) in zip(made.labels, made.views, cut.drawings, strict=True):
        height, width = view.rgba.shape[:2]
        left, top = view.box[0] - drawn.box[0], view.box[1] - drawn.box[1]
        pad = max(height, width)
        room = np.pad(labels, pad, constant_values=UNLABELLED)
        found.append(room[pad + top :, pad + left :][:height, :width])
    return found


def _shares(made: Turnaround) -> Float[np.ndarray, " colors"]:
    """Return the share of every true colour."""
    labels = np.concatenate([labels[labels != UNLABELLED] for labels in made.labels])
    counts = np.bincount(labels, minlength=len(made.palette))
    return counts / counts.sum()


def _with_ink(
    made: Turnaround, shares: Float[np.ndarray, " colors"]
) -> tuple[UInt8[np.ndarray, "more 3"], Float[np.ndarray, " more"]]:
    """Return the true colours and their shares with the lines' black: it may be found, too."""
    drawn = sum(float((view.rgba[..., 3] / 255).sum()) for view in made.views)
    ink = sum(float(coverage.sum()) / 255 for coverage in made.ink) / drawn
    colors = np.concatenate([made.palette, np.array([INK], np.uint8)])
    return colors, np.append((1 - ink) * shares, ink)


PALETTE = Kind(
    *("palette", "palettes", "colours missed", "%", 0.1, 0.1, 100.0, (SILENT,), try_palette),
    rule="A palette has failed that lacks one of the colours; it is announced if that colour is "
    "listed as left out, the number of colours is called a close call, or there is a warning.",
    pictures="a drawing, the colours that were to be found, the palette that was.",
)
LABELS = Kind(
    *("labels", "sheets", "pixels labelled wrong", "%", 5.0, 10.0, 100.0, (SILENT,), try_labels),
    rule="Of the pixels that are one paint's alone, fewer than 5 % are wrong on a fine sheet and "
    "more than 10 % on one that has failed; it is announced by a warning of the palette's.",
    pictures="the worst drawing of a step, and what is labelled wrong in vermilion.",
)
PAINTS = Kind(
    *("paints", "sheets", "F1 short of 1", "%", 10.0, 25.0, 100.0, (SILENT,)),
    partial(try_labels, paints=True),
    rule="The palette of a fine sheet has an F1 of 0.9 or more, one below 0.75 has failed; it is "
    "announced by a warning of the palette's.",
    pictures=LABELS.pictures,
)
PAINTED = Kind(
    *("painted", "sheets", "index short of 1", "%", 10.0, 10.0, 100.0, (SILENT,), try_painted),
    rule="A painted sheet has failed whose labels agree with its paints to an adjusted Rand index "
    "below 0.9; it is announced by a warning of the palette's.",
    pictures="the first drawing of a step's worst sheet, and its labels in their paints' colours.",
)
