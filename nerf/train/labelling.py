"""Palette labels for a scene that comes without."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.bundle.scene import Scene
from toonset.palette.extract import choose_palette, paint_maps
from toonset.palette.palette import Palette
from toonset.palette.pixels.ink_lines import find_contour
from toonset.palette.pixels.labels import label_pixels


def labelled(scene: Scene) -> tuple[Scene, Palette]:
    """Return the scene with the palette and labels that `toonset palette` finds."""
    pictures = [frame.rgba for frame in scene.frames]
    contours = [find_contour(picture) for picture in pictures]
    palette = choose_palette(pictures, contours)
    maps = paint_maps(pictures, contours, palette)
    frames = tuple(
        replace(frame, labels=paint.labels) for frame, paint in zip(scene.frames, maps, strict=True)
    )
    return replace(scene, palette=palette.rgb, shadow=palette.shadow, frames=frames), palette


def relabelled(scene: Scene, palette: UInt8[np.ndarray, "colors 3"]) -> Scene:
    """Return the scene with a palette and every pixel's label by it."""
    frames = tuple(
        replace(frame, labels=label_pixels(frame.rgba, palette)) for frame in scene.frames
    )
    return replace(scene, palette=palette, shadow=None, frames=frames)


def without_palette(scene: Scene) -> Scene:
    """Return the scene without palette and labels."""
    frames = tuple(replace(frame, labels=None) for frame in scene.frames)
    return replace(scene, palette=None, shadow=None, frames=frames)
