"""Drawings whose labels and lines are known: sizes, lines of three inks or none, PNG and JPEG.

The first colour of every second character is painted black: cloth that a contour must be told from.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from lab.bench.cases.jpeg import through_jpeg
from lab.bench.palette.cases import characters
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, flat_palette, make_turnaround
from toonset.mesh import Mesh
from toonset.palette.pixels.labels import UNLABELLED

SIZES_PX = (150, 300, 600)
OUTLINE = 0.01  # of the cell
INKS = ((0, 0, 0), (90, 50, 20), (20, 30, 90))  # black, brown, dark blue
QUALITIES = (0, 90, 80)  # of JPEG; 0 = PNG
BLACK = (12, 12, 14)
VIEWS = 3
FINER = 4  # samples per pixel and axis


@dataclass(frozen=True, eq=False)
class LabelCase:
    """One drawing.

    Attributes:
        group: the condition.
        rgba: as read from its file, straight alpha.
        palette: the colours, the ink's last where there are lines.
        truth: labels; 255 where mixed, soft or outside.
        ink: coverage of the lines.
        outline_px: width of the outline.
        coverage: how far every colour but the ink covers each pixel, 0 to 1.
    """

    group: str
    rgba: UInt8[np.ndarray, "cell cell 4"]
    palette: UInt8[np.ndarray, "colors 3"]
    truth: UInt8[np.ndarray, "cell cell"]
    ink: UInt8[np.ndarray, "cell cell"]
    outline_px: float
    coverage: Float[np.ndarray, "colors cell cell"]


def label_cases(folder: Path | None, seed: int, *, quick: bool) -> Iterator[LabelCase]:
    """Yield every character's views under every condition.

    Args:
        folder: character folders with info.json and a .glb; None for synthetic ones.
        seed: of the first synthetic character and of all drawing errors.
        quick: two characters, small only.

    Raises:
        BundleError: the folder holds no character with known colours.
    """
    sizes = SIZES_PX[:1] if quick else SIZES_PX
    for number, mesh in enumerate(characters(folder, seed, quick=quick)):
        body = _in_black(mesh) if number % 2 else mesh
        for size, lined in product(sizes, (False, True)):
            options = SynthOptions(
                views=VIEWS,
                cell_px=size,
                outline_px=OUTLINE * size if lined else 0.0,
                warp_percent=0.8,
                yaw_jitter_deg=20,
                supersample=FINER,
            )
            ink = INKS[number % len(INKS)]
            fine = replace(
                options, cell_px=FINER * size, outline_px=FINER * options.outline_px, supersample=1
            )
            large = make_turnaround(body, fine, seed + number)
            yield from _drawings(make_turnaround(body, options, seed + number), large, ink)


def _in_black(mesh: Mesh) -> Mesh:
    """Return the mesh with its most frequent colour painted black."""
    palette, labels = flat_palette(mesh)
    colors = palette[labels]
    colors[labels == 0] = BLACK
    return replace(mesh, face_colors=colors)


def _drawings(
    drawn: Turnaround, large: Turnaround, ink_rgb: tuple[int, int, int]
) -> Iterator[LabelCase]:
    """Yield the views of a turnaround; `large` is the same one, `FINER` times as large."""
    outline_px = drawn.options.outline_px
    lined = outline_px > 0
    palette = drawn.palette
    if lined:
        palette = np.concatenate([palette, np.array([ink_rgb])]).astype(np.uint8)
    whole = zip(drawn.views, drawn.labels, drawn.ink, large.labels, strict=True)
    for view, labels, ink, finer in whole:
        coverage = _coverage(finer, ink, len(drawn.palette))
        clean = _inked(view.rgba, ink, ink_rgb)
        wholly = (ink == 255) & (clean[..., 3] == 255)
        truth = np.where(lined & wholly, len(drawn.palette), labels).astype(np.uint8)
        own = palette[np.minimum(truth, len(palette) - 1)]
        truth[(clean[..., :3] != own).any(axis=-1)] = UNLABELLED  # a trace of a coloured line
        for quality in QUALITIES:
            kind = f"jpeg {quality}" if quality else "png"
            lines = "lines" if lined else "no lines"
            group = f"{drawn.options.cell_px} px, {lines}, {kind}"
            rgba = _as_jpeg(clean, quality) if quality else clean
            yield LabelCase(group, rgba, palette, truth, ink, outline_px, coverage)


def _coverage(
    labels: UInt8[np.ndarray, "large large"], ink: UInt8[np.ndarray, "cell cell"], colors: int
) -> Float[np.ndarray, "colors cell cell"]:
    """Return how far every colour covers each pixel: what lines leave, as in a larger picture."""
    side = len(ink)
    blocks = labels.reshape(side, FINER, side, FINER)
    seen = np.stack([(blocks == color).mean(axis=(1, 3)) for color in range(colors)])
    return seen / np.maximum(seen.sum(axis=0), 1 / FINER**2) * (1 - ink / 255)


def _inked(
    rgba: UInt8[np.ndarray, "cell cell 4"],
    ink: UInt8[np.ndarray, "cell cell"],
    rgb: tuple[int, int, int],
) -> UInt8[np.ndarray, "cell cell 4"]:
    """Return the drawing with its black lines in another colour: they add it by their coverage."""
    share = ink[..., None] / np.maximum(rgba[..., 3:], 1)
    colors = np.rint(rgba[..., :3] + share * np.array(rgb)).clip(0, 255).astype(np.uint8)
    return np.dstack([colors, rgba[..., 3]])


def _as_jpeg(rgba: UInt8[np.ndarray, "cell cell 4"], quality: int) -> np.ndarray:
    """Return the drawing after it was saved on white paper as JPEG, with its true alpha."""
    alpha = rgba[..., 3:] / 255
    paper = np.rint(rgba[..., :3] * alpha + 255 * (1 - alpha)).astype(np.uint8)
    return np.dstack([through_jpeg(paper, quality)[..., :3], rgba[..., 3]])
