"""Draw one cell of a synthetic turnaround: one body, one camera, one hand."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.camera import Camera
from toonset.dataset.synthetic.artist_options import Brushwork
from toonset.dataset.synthetic.drawing import Drawing, draw, find_lines
from toonset.dataset.synthetic.gl_render import render_labels
from toonset.dataset.synthetic.hand_error import bend, pen_width
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.shadow import (
    Shade,
    color_factor,
    shadow_factor,
    shadow_mask,
    soft_shade,
    times,
)
from toonset.mesh import Mesh
from toonset.palette.pixels.labels import UNLABELLED

Paints = tuple[UInt8[np.ndarray, "colors 3"], Int[np.ndarray, " faces"]]


@dataclass(frozen=True, eq=False)
class Hand:
    """The random numbers of one drawing; each generator is for one kind of error.

    Attributes:
        bend_seed: of the bend.
        body, tilt, pen, paint, brush: of the body, the elevation, the lines' widths, the colours,
            the strokes.
    """

    bend_seed: int
    body: np.random.Generator
    tilt: np.random.Generator
    pen: np.random.Generator
    paint: np.random.Generator
    brush: np.random.Generator


@dataclass(frozen=True, eq=False)
class Cell:
    """One drawn cell.

    Attributes:
        drawing: its labels are those of the paints alone.
        shadow: (cell, cell) where a label is in shadow.
        color_factor: (3,) its colours over the palette's.
        line_px: mean width of its outline.
    """

    drawing: Drawing
    shadow: Bool[np.ndarray, "cell cell"]
    color_factor: Float[np.ndarray, " 3"]
    line_px: float


def draw_cell(
    mesh: Mesh, paints: Paints, camera: Camera, jump: float, options: SynthOptions, hand: Hand
) -> Cell:
    """Draw a body as one hand does.

    While it is drawn, colours in shadow are labels of their own, after those in light.

    Args:
        mesh: the body that the drawing shows.
        paints: the character's colours and the index of every face's.
        camera: of the cell.
        jump: world units; a larger step in depth is a line.
        options: of the sheet.
        hand: random numbers.
    """
    (palette, face_labels), large = paints, camera.resized(options.supersample)
    seen = render_labels(mesh, face_labels, large)
    lines = find_lines(seen, jump, label_lines=options.label_lines)
    strength, toned = options.artist.shadow_strength, seen.labels
    if strength:
        dark = shadow_mask(mesh, large) & (seen.labels != UNLABELLED)
        toned = np.where(dark, seen.labels + np.uint8(len(palette)), seen.labels)
    shade = _shade(mesh, camera, options, hand.brush)
    bent, lines, shade = bend(
        toned,
        lines,
        shade,
        rms_px=options.warp_percent / 100 * options.cell_px * options.supersample,
        generator=np.random.default_rng(hand.bend_seed),
    )
    factor = color_factor(options.artist.color_error_fraction, hand.paint)
    colors = [times(palette, factor), times(palette, factor * shadow_factor(strength))]
    width = pen_width(options.outline_px, options.artist.line_width_spread, bent.shape, hand.pen)
    drawing = draw(
        bent,
        lines,
        np.concatenate(colors),
        width,
        options.supersample,
        shade,
        options.artist.brush.line_tint,
    )
    labelled = drawing.labels != UNLABELLED
    shadow = labelled & (drawing.labels >= len(palette))
    labels = np.where(shadow, drawing.labels - np.uint8(len(palette)), drawing.labels)
    return Cell(replace(drawing, labels=labels), shadow, factor, float(np.mean(width)))


def _shade(
    mesh: Mesh, camera: Camera, options: SynthOptions, generator: np.random.Generator
) -> Shade | None:
    """Return the painter's shade of a large cell; None where nobody shades."""
    if options.artist.brush == Brushwork():
        return None
    shade = soft_shade(mesh, camera, options.artist.brush, generator)
    side = options.cell_px * options.supersample
    return np.asarray(cv2.resize(shade, (side, side), interpolation=cv2.INTER_LINEAR))
