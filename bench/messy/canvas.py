"""The sheet while it is painted: premultiplied colour and alpha, later things over earlier ones."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8

from bench.messy.figure import Figure, Rgb

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
