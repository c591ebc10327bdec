"""Count what recolouring on the page leaves of an old hue where paint is shaded throughout.

No pixel there has its paint's very colour, so the page's pictures are judged by those of `render`:
left is a pixel that is nearer to its old hue than to the one that it should have (a and b of
OKLab); it shines if it has CHROMA more chroma or LIGHT more light than anything around it should.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import UInt8

from toonset.palette.colors import oklab_from_rgb

TURNED = 0.05  # in OKLab: a hue that changes by less is not judged
CHROMA, LIGHT = 0.05, 0.1  # in OKLab
AROUND = np.ones((7, 7), np.uint8)

Picture = UInt8[np.ndarray, "height width 4"]


@dataclass(frozen=True)
class LeftHues:
    """Pixels whose hue should change, those that keep the old one, and those that shine."""

    judged: int
    old: int
    shining: int


def left_hues(before: Picture, after: Picture, wanted: Picture) -> LeftHues:
    """Return what recolouring left.

    Args:
        before: the view as `render` has it.
        after: recoloured on the page.
        wanted: recoloured by `render`.
    """
    there = (after[..., 3] >= 128) & (wanted[..., 3] >= 128)
    was, found, right = (
        oklab_from_rgb(np.ascontiguousarray(one[..., :3])) for one in (before, after, wanted)
    )
    way = was[..., 1:] - right[..., 1:]
    long = np.square(way).sum(axis=-1)
    judged = there & (long > TURNED**2)
    part = ((found - right)[..., 1:] * way).sum(axis=-1) / np.maximum(long, 1e-9)
    chroma, most = (np.linalg.norm(one[..., 1:], axis=-1) for one in (found, right))
    bright = cv2.dilate(right[..., 0].astype(np.float32), AROUND)
    shining = (chroma > cv2.dilate(most.astype(np.float32), AROUND) + CHROMA) | (
        found[..., 0] > bright + LIGHT
    )
    old = judged & (part > 0.5)
    return LeftHues(int(judged.sum()), int(old.sum()), int((there & shining).sum()))
