"""Find where a mirrored drawing does not hold: drawings of both halves show them differently."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Bool, Float

from toonset.dataset.bundle.scene import Frame


def denied_places(
    frames: Sequence[Frame],
    depths: Sequence[Float[np.ndarray, "height width"]],
    differences: Sequence[Bool[np.ndarray, "height width"] | None],
    slack: float,
) -> list[Bool[np.ndarray, "height width"]]:
    """Return per drawing the pixels that it must not show; none but of mirrored drawings.

    Args:
        frames: drawings, some of them mirrored.
        depths: of the surface that each shows, nan where there is none.
        differences: per drawing of both halves where they differ, None of the others.
        slack: world units that a place may lie behind the surface that a drawing shows.
    """
    judges = [
        (frame, np.nan_to_num(depth, nan=-np.inf).astype(np.float32), differs.astype(np.uint8))
        for frame, depth, differs in zip(frames, depths, differences, strict=True)
        if differs is not None and differs.any()
    ]
    found = []
    for frame, depth in zip(frames, depths, strict=True):
        denied = np.zeros(depth.shape, dtype=bool)
        for judge, surface, differs in judges if frame.mirrored else ():
            points = frame.camera.unproject(frame.camera.pixel_grid(), np.nan_to_num(depth))
            pixels, behind, front = judge.camera.project(points)
            x, y = (
                np.nan_to_num(pixels[..., k] - 0.5, nan=-1e4).astype(np.float32) for k in (0, 1)
            )
            there = cv2.remap(surface, x, y, cv2.INTER_NEAREST, borderValue=-np.inf)
            unlike = cv2.remap(differs, x, y, cv2.INTER_NEAREST, borderValue=0) > 0
            denied |= unlike & front & (behind <= there + slack) & np.isfinite(depth)
        found.append(denied)
    return found
