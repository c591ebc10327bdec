"""Unwarp drawings by smooth displacements under which the outlines are one body's.

corrected(x) = drawn(x + d(x)). The rays of the cameras stay; the drawing is resampled once, with
its alpha and its labels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.silhouettes.alignment import Alignment, alignment_of
from toonset.dataset.silhouettes.displacement import CONTROLS, Bends
from toonset.dataset.silhouettes.outlines import Square
from toonset.palette.pixels.labels import UNLABELLED

ROUNDS = 8  # of Gauss-Newton
MOST = 0.05  # of the figure's square: the longest displacement; more is another pose
_BENDS = Bends.expected()


@dataclass(frozen=True, eq=False)
class Warp:
    """One drawing's displacement.

    Attributes:
        square: where the figure is, in pixels of the drawing.
        numbers: (k,) of `Bends`, in units of the square.
    """

    square: Square
    numbers: Float[np.ndarray, " k"]

    @classmethod
    def none(cls) -> Warp:
        """Return the identity."""
        return cls(Square(np.zeros(2), 1.0), np.zeros(2 * CONTROLS**2))

    def at(self, pixels: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
        """Return the displacement at pixels, in pixels; never longer than MOST."""
        return self.square.size * _limited(_BENDS.at(self.square.unit(pixels), self.numbers))

    def on_grid(self, size_wh: tuple[int, int]) -> Float[np.ndarray, "height width 2"]:
        """Return the displacement at all pixels of a picture, as `at` does."""
        axes = self.square.axes(size_wh)
        return self.square.size * _limited(_BENDS.on_grid(*axes, self.numbers))

    @property
    def is_none(self) -> bool:
        """Return whether the warp is the identity."""
        return not np.any(self.numbers)


@dataclass(frozen=True, eq=False)
class Unwarping(Alignment):
    """Bends that were taken out of the drawings.

    Attributes:
        warps: per frame of the scene, what was applied.
    """

    warps: tuple[Warp, ...]


def unwarp_drawings(scene: Scene) -> tuple[Scene, Unwarping]:
    """Unwarp a scene's drawings; return the scene and the fit.

    Drawings that agree within an outline's own error are returned as they are, to the bit; so are
    pictures without a figure, and scenes with fewer than FEWEST_VIEWS.

    Raises:
        BundleError: the cameras do not belong together (see `box_of_masks`).
    """
    found, numbers = alignment_of(scene, _BENDS, ROUNDS)
    changed = list(scene.frames)
    warps = [Warp.none() for _ in changed]
    if found.applied:
        for i, (square, own) in numbers.items():
            warps[i] = Warp(square, own)
            changed[i] = warped(changed[i], warps[i])
    unwarping = Unwarping(**vars(found), warps=tuple(warps))
    return (replace(scene, frames=tuple(changed)) if found.applied else scene), unwarping


def warped(frame: Frame, warp: Warp) -> Frame:
    """Return the frame with its drawing resampled: corrected(x) = drawn(x + d(x))."""
    places = frame.camera.pixel_grid() + warp.on_grid(frame.camera.size_wh)
    labels = None if frame.labels is None else resampled_labels(frame.labels, places)
    return replace(frame, rgba=resampled(frame.rgba, places), labels=labels)


def resampled(
    rgba: UInt8[np.ndarray, "height width 4"], places: Float[np.ndarray, "height width 2"]
) -> UInt8[np.ndarray, "height width 4"]:
    """Return straight-alpha colours at `places` (pixels), transparent beyond the edges."""
    straight = rgba.astype(np.float32) / 255
    straight[..., :3] *= straight[..., 3:]  # what is transparent has no colour to mix in
    # cubic: linear interpolation would blur a line of one pixel to half its depth
    maps = _maps(places)
    found = cv2.remap(straight, *maps, cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
    alpha = found[..., 3:].clip(0, 1)
    seen = alpha > 0.5 / 255
    color = np.where(seen, found[..., :3] / np.where(seen, alpha, 1), 0)
    return (np.concatenate([color, alpha], axis=-1).clip(0, 1) * 255 + 0.5).astype(np.uint8)


def resampled_labels(
    labels: UInt8[np.ndarray, "height width"], places: Float[np.ndarray, "height width 2"]
) -> UInt8[np.ndarray, "height width"]:
    """Return the nearest labels at `places`, none beyond the edges."""
    outside = (UNLABELLED,) * 4
    mode = cv2.BORDER_CONSTANT
    return cv2.remap(
        labels, *_maps(places), cv2.INTER_NEAREST, borderMode=mode, borderValue=outside
    )


def _limited(move: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
    """Return displacements of a square, none longer than MOST."""
    length = np.linalg.norm(move, axis=-1, keepdims=True)
    # smooth, and exact for short ones: a hard limit would crease the drawing
    return move / (1 + (length / MOST) ** 4) ** 0.25


def _maps(places: Float[np.ndarray, "height width 2"]) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y as OpenCV wants them: the first pixel's centre is at 0."""
    across, down = np.moveaxis(places - 0.5, -1, 0).astype(np.float32, order="C")
    return across, down
