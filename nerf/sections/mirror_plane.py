"""Estimate where a symmetric body's mirror plane x = const lies, from its front or back drawing."""

from __future__ import annotations

import cv2
import numpy as np

from toonset.nerf.sections.drawing import TALL, Drawing

REACH_PX = TALL / 8  # the plane from the middle of the figure's box
BLUR_PX = 2.0
ROWS = 3  # every so many rows are compared


def mirror_plane_of(drawing: Drawing) -> float:
    """Return the x of the plane about which a drawing is most its own mirror image."""
    alpha = drawing.rgba[..., 3:]
    picture = np.concatenate([drawing.rgba[..., :3] * alpha, alpha], axis=-1)
    picture = cv2.GaussianBlur(picture, (0, 0), BLUR_PX)[::ROWS]
    columns = np.flatnonzero(drawing.mask.any(axis=0))
    twice, reach = int(columns[0] + columns[-1]), round(2 * REACH_PX)
    width = picture.shape[1]
    best, least, total = twice, np.inf, picture.sum()
    for sums in range(twice - reach, twice + reach + 1):
        here = np.arange(max(0, sums - width + 1), min(width, sums + 1))
        apart = float(np.abs(picture[:, here] - picture[:, sums - here]).sum())
        apart += float(total - picture[:, here].sum())  # what lies beyond the edge has no like
        if apart < least:
            best, least = sums, apart
    camera = drawing.camera
    along = ((best + 1) / 2 - camera.center[0]) / camera.scale
    return float(camera.target[0] + along * camera.rotation[0, 0])
