"""Say what views hold as records: numbers for JSON, and bytes for all else."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import UInt8

from toonset.camera import Camera
from toonset.nerf.layered_views.layered import LEVELS, Layered
from toonset.nerf.layered_views.light import BRIGHTEST, DARKEST, LIGHTEST, MIDDLE, TINT
from toonset.nerf.layered_views.lossy import webp
from toonset.nerf.layered_views.unmix import PARTS
from toonset.nerf.look.drawn_view import DRAWN, GUESSED, MIRRORED, SOLID, DrawnView

SMALL = {"quality": 60, "alpha_quality": 50}  # of further layers: 60 % of the bytes for 2 dB

ORIGIN_STEP = 2  # pixels of a view for one of its map of what is not drawn

Picture = UInt8[np.ndarray, "height width 4"]


def camera_record(camera: Camera) -> dict[str, Any]:
    """Return a camera's numbers: see `toonset.camera`."""
    return {
        "rotation": camera.rotation.reshape(-1).tolist(),
        "target": camera.target.tolist(),
        "scale": camera.scale,
        "center": camera.center.tolist(),
        "size": list(camera.size_wh),
        "k": camera.k,
        "aspect": camera.pixel_aspect,
    }


def coding() -> dict[str, Any]:
    """Return what is needed to read `layered_record`."""
    return {
        "levels": LEVELS,
        "parts": PARTS,
        "middle": MIDDLE,
        "darkest": DARKEST,
        "lightest": LIGHTEST,
        "brightest": BRIGHTEST,
        "tint": TINT,
    }


def layered_record(view: Layered | None, shrink: int = 1) -> dict[str, Any] | None:
    """Return a view's layers: see `page/compose.js`, which puts them together.

    `maps` holds, for every pixel row after row, first the paint and then what is to be read of it
    (alpha 1 whole, 2 soft; 4 ink, 8 soft ink; 16 a mixture; 32 stays as it is);
    then the soft alphas, soft inks, second paints and their parts of the pixels that have any.
    """
    if view is None:
        return None
    paints, there = view.paints, view.alpha > 0
    soft = there & (view.alpha < LEVELS)
    inked = there & (view.ink == LEVELS)
    lined = there & (view.ink > 0) & ~inked
    mixed = there & (paints.part > 0) & ~inked
    stays = there & paints.stays & ~inked
    flags = (there & ~soft) + 2 * soft + 4 * inked + 8 * lined + 16 * mixed + 32 * stays
    planes = [paints.first, flags.astype(np.uint8)]
    lists = [view.alpha[soft], view.ink[lined], paints.second[mixed], paints.part[mixed]]
    height, width = view.alpha.shape
    return {
        "box": [shrink * side for side in (*view.corner, width, height)],
        "size": [width, height],
        "maps": b"".join(part.tobytes() for part in (*planes, *lists)),
        "light": None if view.light is None else webp(view.light.picture()),
        **({} if view.color is None else {"color": view.color}),
    }


def origins_record(view: DrawnView, found: Layered) -> dict[str, Any] | None:
    """Return where no drawing shows a view; None where that is nowhere.

    A byte for ORIGIN_STEP by ORIGIN_STEP pixels of the layers' box: see `page/types.js`.
    """
    left, top = found.corner
    height, width = found.alpha.shape
    box = (slice(top, top + height, ORIGIN_STEP), slice(left, left + width, ORIGIN_STEP))
    source = np.where(view.alpha[box] >= SOLID, view.source[box], DRAWN).astype(np.uint8)
    if not source.any():
        return None
    return {
        "size": [source.shape[1], source.shape[0]],
        "mirrored": view.share(MIRRORED),
        "guessed": view.share(GUESSED),
        "map": source.tobytes(),
    }


def picture_record(picture: Picture, shrink: int = 1) -> dict[str, Any] | None:
    """Return a picture, cut to what it shows; None where that is nothing.

    Args:
        picture: with straight alpha.
        shrink: pixels of the view per pixel of the picture, along each axis.
    """
    rows, columns = (np.flatnonzero(picture[..., 3].any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return None
    top, left, bottom, right = (
        int(at) for at in (rows[0], columns[0], rows[-1] + 1, columns[-1] + 1)
    )
    box = [shrink * side for side in (left, top, right - left, bottom - top)]
    part = picture[top:bottom, left:right]
    return {"box": box, "picture": webp(part, **(SMALL if shrink > 1 else {}))}
