"""Measure labels and palettes of artists' sheets: right pixels, and F1 of the colours.

Counted are pixels that are one paint's and nothing else's, in light or in shadow; paints under 5 %
of the character, which no palette need have, are left out. A label is right if its colour is nearer
to the pixel's own paint than to any other's; a pixel without a label is wrong.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, UInt8

from bench.atlas.training import REFUSED, Tried
from bench.cases.bodies import random_body
from bench.palette.cases import INK, PaletteCase
from bench.palette.measure import f1, score
from bench.palette.methods import LEAST_SHARE
from bench.stability.artist import as_cut_out
from bench.stability.page import Page
from bench.stability.sheet import DrawnSheet, Step
from toonset.dataset.images.picture import encode_png
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.errors import ToonsetError
from toonset.palette.colors import oklab_from_rgb
from toonset.palette.extract import extract_palette, paint_maps
from toonset.palette.palette import Palette
from toonset.palette.pixels.ink_lines import find_contours
from toonset.palette.pixels.labels import UNLABELLED
from toonset.view import over_white

SILENT, WARNED = "silent", "warned"
WRONG_RGB, MIXED_RGB = (213, 94, 0), (200, 200, 200)

Labels = UInt8[np.ndarray, "height width"]


@dataclass(frozen=True)
class LabelPage(Page):
    """A page about labels, or about the palette that they are taken from.

    Attributes:
        options: step to a sheet's options.
        counted: "labels": right pixels; "paints": F1 of the palette's colours, the line's among
            them.
    """

    options: Callable[[Step], SynthOptions]
    counted: Literal["labels", "paints"] = "labels"


def try_labels(page: LabelPage, step: Step, seed: int) -> tuple[Tried, bytes]:
    """Return the percentage that the page counts, and a picture of the worst drawing.

    It shows the drawing, its labels in the palette's colours, and wrong pixels in vermilion.
    """
    began = time.perf_counter()
    made = make_turnaround(random_body(seed), page.options(step), seed)
    try:
        cut = as_cut_out(made)
        pictures = [view.rgba for view, _ in cut.drawings]
        palette = extract_palette(pictures)
        maps = paint_maps(pictures, find_contours(pictures), palette)
        found = [one.labels for one in maps]
    except ToonsetError as error:
        return Tried(seed, 0.0, REFUSED, str(error)), b""
    truths = _truths(made, cut)
    shares = _shares(made)
    true_colors, wanted = oklab_from_rgb(made.palette), shares >= LEAST_SHARE
    nearest = np.full(256, UNLABELLED, np.uint8)
    for index, color in enumerate(oklab_from_rgb(palette.rgb)):
        nearest[index] = np.linalg.norm(true_colors - color, axis=1).argmin()
    counted = [(t != UNLABELLED) & wanted[np.minimum(t, len(wanted) - 1)] for t in truths]
    right = [
        (nearest[labels] == t) & c for labels, t, c in zip(found, truths, counted, strict=True)
    ]
    accuracies = [100 * r.sum() / max(c.sum(), 1) for r, c in zip(right, counted, strict=True)]
    labelled = sum(int((c & (m != UNLABELLED)).sum()) for m, c in zip(found, counted, strict=True))
    all_right, all_counted = (sum(int(m.sum()) for m in maps) for maps in (right, counted))
    case = PaletteCase("", "", (), *_with_ink(made, shares))
    colors = score([color.rgb for color in palette.colors], case)
    evidence = {
        "right": 100 * all_right / max(all_counted, 1),
        "f1": f1([colors]),
        "spurious": float(colors.spurious),
        "right_of_labelled": 100 * all_right / max(labelled, 1),
    }
    voice = WARNED if palette.warnings else SILENT
    words = f"F1 {evidence['f1']:.2f}, {evidence['right']:.1f} % right"
    worst = int(np.argmin(accuracies))
    wrong = counted[worst] & ~right[worst]
    picture = _side_by_side(pictures[worst], found[worst], palette, wrong)
    taken = time.perf_counter() - began
    figure = evidence["right"] if page.counted == "labels" else 100 * evidence["f1"]
    return Tried(
        seed, figure, voice, "; ".join([words, *palette.warnings]), evidence, taken
    ), picture


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


def _side_by_side(
    picture: UInt8[np.ndarray, "height width 4"],
    labels: Labels,
    palette: Palette,
    wrong: Bool[np.ndarray, "height width"],
) -> bytes:
    table = np.full((256, 3), 255, np.uint8)
    table[: len(palette.rgb)] = palette.rgb
    shown = (over_white(picture) * 255 + 0.5).astype(np.uint8)
    painted = table[labels]
    painted[(labels == UNLABELLED) & (picture[..., 3] >= 128)] = MIXED_RGB
    marked = (255 - (255 - shown) * 0.3).astype(np.uint8)
    marked[wrong] = WRONG_RGB
    return encode_png(np.concatenate([shown, painted, marked], axis=1))
