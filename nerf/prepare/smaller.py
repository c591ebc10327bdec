"""Make the pictures of a scene smaller: what is compared or fitted needs no more pixels."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.silhouettes.mask import figure_px

WORTH_IT = 0.9  # times smaller: less saves nothing


def at_most(scene: Scene, tall_px: float) -> Scene:
    """Return the scene with pictures whose tallest figure has about `tall_px` pixels at most."""
    factor = tall_px / max(1, *(figure_px(frame) for frame in scene.frames))
    if factor > WORTH_IT:
        return scene
    return replace(scene, frames=tuple(_resized(frame, factor) for frame in scene.frames))


def _resized(frame: Frame, factor: float) -> Frame:
    camera = frame.camera.resized(factor)
    whole = frame.rgba.astype(np.float32)
    whole[..., :3] *= whole[..., 3:] / 255
    small = cv2.resize(whole, camera.size_wh, interpolation=cv2.INTER_AREA)
    small[..., :3] *= 255 / np.maximum(small[..., 3:], 1e-6)
    labels = frame.labels
    if labels is not None:
        labels = cv2.resize(labels, camera.size_wh, interpolation=cv2.INTER_NEAREST)
        labels = labels.astype(np.uint8)
    rgba = (small + 0.5).clip(0, 255).astype(np.uint8)
    return replace(frame, camera=camera, rgba=rgba, labels=labels)
