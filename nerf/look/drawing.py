"""One drawing as the look carries it, the same at half the size, and its depth in levels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, UInt8

from toonset.camera import Camera
from toonset.nerf.hull.mannequin_shape import Shape


@dataclass(frozen=True, eq=False)
class Original:
    """A drawing as it is on the sheet.

    Attributes:
        camera: that calibration found.
        rgba: (height, width, 4) sRGB with straight alpha.
    """

    camera: Camera
    rgba: UInt8[np.ndarray, "height width 4"]


@dataclass(frozen=True, eq=False)
class Drawing:
    """One drawing, agreeing with the others, and the surface that it shows.

    Attributes:
        camera: that saw it.
        rgba: (height, width, 4) sRGB with straight alpha.
        paint: (height, width, 3) of `toonset.nerf.look.flat_paint`.
        levels: (height, width) depth of the field's surface, 1 to 255 over `Drawings.depths`; 0
            where there is none, or a mirrored drawing does not hold; None: the surface is the
            mannequin's.
        mirrored: it is the mirror image of another.
        original: how it was drawn; None: just so.
        limbs: what it shows and the field lacks, for views near it; None: nothing.
    """

    camera: Camera
    rgba: UInt8[np.ndarray, "height width 4"]
    paint: UInt8[np.ndarray, "height width 3"]
    levels: UInt8[np.ndarray, "height width"] | None
    mirrored: bool = False
    original: Original | None = None
    limbs: Shape | None = None

    @property
    def as_drawn(self) -> Original:
        """Return the drawing as it is on the sheet."""
        return self.original or Original(self.camera, self.rgba)


def halved(view: Drawing) -> Drawing:
    """Return a drawing averaged over blocks of 2 x 2 pixels."""
    even = [(0, size % 2) for size in view.rgba.shape[:2]]
    paint = np.pad(view.paint, [*even, (0, 0)], mode="edge").astype(np.float32)
    levels = None if view.levels is None else np.pad(view.levels, even)[::2, ::2].copy()
    own = _half_size(Original(view.camera, view.rgba))
    original = None if view.original is None else _half_size(view.original)
    flat = _rounded(_in_blocks(paint))
    return Drawing(own.camera, own.rgba, flat, levels, view.mirrored, original, view.limbs)


def _half_size(picture: Original) -> Original:
    even = [(0, size % 2) for size in picture.rgba.shape[:2]]
    rgba = np.pad(picture.rgba, [*even, (0, 0)]).astype(np.float32)
    rgba[..., :3] *= rgba[..., 3:] / 255
    mean = _in_blocks(rgba)
    mean[..., :3] *= 255 / np.maximum(mean[..., 3:], 1e-6)
    camera = replace(picture.camera, size_wh=(rgba.shape[1], rgba.shape[0])).resized(0.5)
    return Original(camera, _rounded(mean))


def _in_blocks(picture: Float[np.ndarray, "height width c"]) -> Float[np.ndarray, "rows columns c"]:
    height, width, channels = picture.shape
    return picture.reshape(height // 2, 2, width // 2, 2, channels).mean(axis=(1, 3))


def _rounded(picture: Float[np.ndarray, "rows columns c"]) -> UInt8[np.ndarray, "rows columns c"]:
    return (picture + 0.5).clip(0, 255).astype(np.uint8)


def levels_of(
    depth: Float[np.ndarray, "height width"], depths: tuple[float, float]
) -> UInt8[np.ndarray, "height width"]:
    """Return depth (nan: none) in levels of `Drawing`."""
    low, high = depths
    part = (depth - low) / max(high - low, 1e-12)
    return np.where(np.isfinite(depth), np.rint(np.nan_to_num(part) * 254) + 1, 0).astype(np.uint8)


def depth_of(
    levels: UInt8[np.ndarray, "height width"], depths: tuple[float, float]
) -> Float[np.ndarray, "height width"]:
    """Return the depths of levels: the inverse of `levels_of`."""
    low, high = depths
    return np.where(levels > 0, low + (levels - 1.0) / 254 * (high - low), np.nan)
