"""A drawn figure, what can be done to one, and the sheet while it is painted.

All pictures are straight RGBA, cut to what they show; the sheet is premultiplied.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float, Shaped, UInt8

from toonset.view import premultiply, straight

Rgb = tuple[int, int, int]
Stamp = UInt8[np.ndarray, "height width 4"]  # straight RGBA


@dataclass(frozen=True, eq=False)
class Figure:
    """One drawing.

    Attributes:
        rgba: (height, width, 4) straight alpha; alpha is the figure's coverage.
        ink: (height, width) coverage of its lines, 0 to 255.
        paper: (height, width) share of each pixel that shows the paper instead of a colour, 0 to 1:
            the inside of line art.
    """

    rgba: UInt8[np.ndarray, "height width 4"]
    ink: UInt8[np.ndarray, "height width"]
    paper: Float[np.ndarray, "height width"]

    @property
    def height(self) -> int:
        """Return its height in pixels."""
        return self.rgba.shape[0]

    @property
    def width(self) -> int:
        """Return its width in pixels."""
        return self.rgba.shape[1]


@dataclass(frozen=True, eq=False)
class Cast:
    """One character as drawn for a sheet.

    Attributes:
        figures: its views, the front one first, all at one scale.
        heads: some of the same views, the head alone.
        colors: sRGB, as a swatch strip would show them.
        outline_px: width of the contour line; 0 = none.
    """

    figures: tuple[Figure, ...]
    heads: tuple[Figure, ...]
    colors: tuple[Rgb, ...]
    outline_px: float


def tight_window(covered: Shaped[np.ndarray, "h w"]) -> tuple[slice, slice]:
    """Return rows and columns just around what is not zero; something must be."""
    rows = np.flatnonzero(covered.any(axis=1))
    columns = np.flatnonzero(covered.any(axis=0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def cut_figure(rgba: UInt8[np.ndarray, "h w 4"], ink: UInt8[np.ndarray, "h w"]) -> Figure:
    """Return the figure of a larger picture that shows nothing else."""
    window = tight_window(rgba[..., 3])
    return Figure(rgba[window], ink[window], np.zeros(rgba[window].shape[:2], np.float32))


def resized(figure: Figure, factor: float) -> Figure:
    """Return the figure drawn smaller (lines become thinner with it); factors up to 1."""
    size = max(round(figure.width * factor), 1), max(round(figure.height * factor), 1)
    rgba = straight(cv2.resize(premultiply(figure.rgba), size, interpolation=cv2.INTER_AREA))
    ink, paper = (
        cv2.resize(layer, size, interpolation=cv2.INTER_AREA)
        for layer in (figure.ink, figure.paper)
    )
    return Figure(rgba, ink, paper)


def mirrored(figure: Figure) -> Figure:
    """Return the figure as in a mirror."""
    return Figure(figure.rgba[:, ::-1], figure.ink[:, ::-1], figure.paper[:, ::-1])


def bust_of(figure: Figure, share: float) -> Figure:
    """Return the upper share of the figure, cut off level."""
    rows = max(round(share * figure.height), 1)
    top = Figure(figure.rgba[:rows], figure.ink[:rows], figure.paper[:rows])
    window = tight_window(top.rgba[..., 3])
    return Figure(top.rgba[window], top.ink[window], top.paper[window])


def bent(figure: Figure, lean: float, crouch: float) -> Figure:
    """Return the figure in another pose: the body leans in a curve, the legs are shorter.

    Args:
        figure: standing.
        lean: how far the head goes to the side, share of the height.
        crouch: by how much the lower half is shortened, 0 to 1.
    """
    height, width = figure.height, figure.width
    half = height // 2
    lower = max(round((height - half) * (1 - crouch)), 1)
    source = np.concatenate([np.arange(half), np.linspace(half, height - 1, lower)])
    room = int(np.ceil(abs(lean) * height))
    up = 1 - np.arange(len(source)) / len(source)
    shift = lean * height * up**2
    x = np.arange(width + 2 * room, dtype=np.float32)[None] - room - shift[:, None]
    y = np.broadcast_to(source[:, None], x.shape)
    places = x.astype(np.float32), y.astype(np.float32)
    rgba = straight(cv2.remap(premultiply(figure.rgba), *places, cv2.INTER_LINEAR))
    ink, paper = (
        cv2.remap(layer, *places, cv2.INTER_LINEAR) for layer in (figure.ink, figure.paper)
    )
    window = tight_window(rgba[..., 3])
    return Figure(rgba[window], ink[window], paper[window])


def as_line_art(figure: Figure, ink_rgb: Rgb) -> Figure:
    """Return the figure's lines alone; what they enclose is paper, but still the figure."""
    alpha = figure.rgba[..., 3]
    covered = np.minimum(figure.ink / np.maximum(alpha, 1), 1.0)
    rgba = np.dstack([np.full((*alpha.shape, 3), ink_rgb, np.uint8), alpha])
    return replace(figure, rgba=rgba, paper=(1 - covered).astype(np.float32))


def with_colored_lines(figure: Figure, line_rgb: Rgb) -> Figure:
    """Return a painted figure with lines of a colour instead of black ones."""
    covered = np.minimum(figure.ink / np.maximum(figure.rgba[..., 3], 1), 1.0)[..., None]
    rgb = np.minimum(figure.rgba[..., :3] + covered * line_rgb, 255)
    return replace(figure, rgba=np.dstack([np.rint(rgb).astype(np.uint8), figure.rgba[..., 3]]))


def with_gaps(
    figure: Figure, gaps: int, gap_px: float, outline_px: float, rng: np.random.Generator
) -> Figure:
    """Return line art whose contour is interrupted: the pen was lifted.

    Args:
        figure: from `as_line_art`.
        gaps: how many.
        gap_px: free width of each between the two ends of the line.
        outline_px: width of the contour line.
        rng: chooses the places.
    """
    inside = np.pad((figure.rgba[..., 3] >= 128).astype(np.uint8), 1)
    depth = cv2.distanceTransform(inside, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
    on_line = np.argwhere((np.abs(depth - outline_px / 2) < 0.75) & (figure.paper < 0.5))
    if len(on_line) == 0:
        return figure
    radius = float(np.hypot(outline_px / 2, gap_px / 2))  # so wide is the gap at the line's rim
    y, x = np.mgrid[: figure.height, : figure.width].astype(np.float32)
    paper = figure.paper
    for row, column in on_line[rng.integers(len(on_line), size=gaps)]:
        erased = np.clip(radius + 0.5 - np.hypot(y - row, x - column), 0, 1)
        paper = np.maximum(paper, erased)
    return replace(figure, paper=paper)


def shaded(figure: Figure, strength: float) -> Figure:
    """Return the figure lit softly from above left: its colours darken by up to `strength`."""
    y, x = np.linspace(0, 1, figure.height), np.linspace(0, 1, figure.width)
    light = 1 - strength * (0.7 * y[:, None] + 0.3 * x)
    rgb = figure.rgba[..., :3] * light[..., None]
    return replace(figure, rgba=np.dstack([np.rint(rgb).astype(np.uint8), figure.rgba[..., 3]]))


WHITE = np.float32(255)


class Canvas:
    """A sheet in the making; everything painted on it is cut at its edges.

    Attributes:
        rgb: (height, width, 3) premultiplied, 0 to 255.
        alpha: (height, width) 0 to 1.
    """

    def __init__(
        self, paper: Float[np.ndarray, "height width 3"] | None, size_wh: tuple[int, int]
    ) -> None:
        """Start with a paper, or transparent: then line art is filled with white."""
        width, height = size_wh
        self._paper = paper
        self.rgb = np.zeros((height, width, 3), np.float32) if paper is None else paper.copy()
        self.alpha = np.full((height, width), 0.0 if paper is None else 1.0, np.float32)

    def over(self, stamp: UInt8[np.ndarray, "h w 4"], x: int, y: int) -> None:
        """Paint a stamp with its upper left corner at (x, y)."""
        ours, theirs = self._windows(x, y, stamp.shape[:2])
        alpha = stamp[theirs][..., 3] / WHITE
        self._blend(ours, stamp[theirs][..., :3].astype(np.float32), alpha)

    def figure(self, figure: Figure, x: int, y: int) -> None:
        """Paint a figure; where it is line art, the paper shows, not what was painted before."""
        ours, theirs = self._windows(x, y, figure.paper.shape)
        share = figure.paper[theirs][..., None]
        paper = WHITE if self._paper is None else self._paper[ours]
        color = figure.rgba[theirs][..., :3] * (1 - share) + paper * share
        self._blend(ours, color, figure.rgba[theirs][..., 3] / WHITE)

    def darken(self, share: Float[np.ndarray, "h w"], x: int, y: int) -> None:
        """Multiply by 1 - share, as a layer of shadow does; on nothing it is black."""
        ours, theirs = self._windows(x, y, share.shape)
        self._blend(ours, np.zeros((*share[theirs].shape, 3), np.float32), share[theirs])

    def rule(self, x: int, y: int, width: int, height: int, rgb: Rgb, share: float) -> None:
        """Paint an upright rectangle: lines of frames and guides."""
        ours, theirs = self._windows(x, y, (height, width))
        covered = np.full((height, width), share, np.float32)[theirs]
        self._blend(ours, np.array(rgb, np.float32), covered)

    def bytes(self) -> UInt8[np.ndarray, "height width 4"]:
        """Return the sheet with straight alpha."""
        alpha = self.alpha[..., None]
        straight = self.rgb / np.maximum(alpha, 1e-6)
        rgba = np.concatenate([straight, 255 * alpha], axis=-1)
        return np.rint(np.clip(rgba, 0, 255)).astype(np.uint8)

    def _blend(self, window: tuple[slice, slice], color: np.ndarray, alpha: np.ndarray) -> None:
        keep = 1 - alpha
        self.rgb[window] = self.rgb[window] * keep[..., None] + color * alpha[..., None]
        self.alpha[window] = self.alpha[window] * keep + alpha

    def _windows(
        self, x: int, y: int, shape: tuple[int, ...]
    ) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
        """Return the same rectangle in the canvas and in what is painted."""
        height, width = self.alpha.shape
        left, top = min(max(x, 0), width), min(max(y, 0), height)
        right, bottom = max(min(x + shape[1], width), left), max(min(y + shape[0], height), top)
        return (slice(top, bottom), slice(left, right)), (
            slice(top - y, bottom - y),
            slice(left - x, right - x),
        )
