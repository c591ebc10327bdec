"""Take the lines round figures off few drawings that a field is fitted to.

A line along a figure's outline is seen by one drawing alone: others show the paint of the body
there. Of few drawings a figure without its rim explains that best. The drawn look draws the line
anew; under it goes the nearest paint.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toonset.dataset.bundle.scene import Scene
from toonset.nerf.look.flat_paint import flat_paint
from toonset.nerf.look.outline import outline_of
from toonset.palette.pixels.labels import UNLABELLED


def without_outlines(scene: Scene) -> Scene:
    """Return the scene with paint instead of lines round its figures, unlabelled there."""
    pictures = [frame.rgba for frame in scene.frames]
    line = outline_of(pictures)
    if line is None:
        return scene
    frames = []
    for frame, paint in zip(
        scene.frames, flat_paint(pictures, line, None, 0.0).paints, strict=True
    ):
        inked, labels = (paint != frame.rgba[..., :3]).any(axis=-1), frame.labels
        if labels is not None:
            labels = np.where(inked, UNLABELLED, labels).astype(np.uint8)
        frames.append(replace(frame, rgba=np.dstack([paint, frame.rgba[..., 3]]), labels=labels))
    return replace(scene, frames=tuple(frames))
