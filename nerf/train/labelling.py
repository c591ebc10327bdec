"""Label a scene that comes without a palette."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.bundle.scene import Scene
from toonset.palette.paints.extract import find_palette
from toonset.palette.palette import Palette
from toonset.palette.pixels.grain import remove_grain
from toonset.palette.pixels.labels import label_pixels


def label_scene(scene: Scene) -> tuple[Scene, Palette]:
    """Return the scene with palette and labels extracted from its own pictures."""
    palette = find_palette([frame.rgba for frame in scene.frames])
    return relabel_scene(scene, palette.rgb), palette


def relabel_scene(scene: Scene, palette: UInt8[np.ndarray, "colors 3"]) -> Scene:
    """Return the scene with a palette and every pixel's label by it."""
    pictures = remove_grain([frame.rgba for frame in scene.frames])
    frames = tuple(
        replace(frame, labels=label_pixels(picture, palette))
        for frame, picture in zip(scene.frames, pictures, strict=True)
    )
    return replace(scene, palette=palette, frames=frames)


def drop_palette(scene: Scene) -> Scene:
    """Return the scene without palette and labels."""
    return replace(
        scene, palette=None, frames=tuple(replace(frame, labels=None) for frame in scene.frames)
    )
