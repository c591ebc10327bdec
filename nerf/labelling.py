"""Palette labels for a scene that comes without."""

from __future__ import annotations

from dataclasses import replace

from toonset.dataset.scene import Scene
from toonset.palette.extract import extract_palette
from toonset.palette.labels import label_image
from toonset.palette.palette import Palette


def labelled(scene: Scene) -> tuple[Scene, Palette]:
    """Return the scene with palette and labels extracted from its own pictures."""
    palette = extract_palette([frame.rgba for frame in scene.frames])
    frames = tuple(
        replace(frame, labels=label_image(frame.rgba, palette.rgb)) for frame in scene.frames
    )
    return replace(scene, palette=palette.rgb, frames=frames), palette


def without_palette(scene: Scene) -> Scene:
    """Return the scene without palette and labels."""
    return replace(
        scene, palette=None, frames=tuple(replace(frame, labels=None) for frame in scene.frames)
    )
