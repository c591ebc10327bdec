"""What goes wrong with a drawing, as functions of a drawing and its exact camera.

Every function returns the changed view with the camera that is true of it, so that a sweep can
measure errors after any of them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import cast

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import distance_transform_edt

from toonset.camera import Camera
from toonset.view import View, premultiply, straight

Drawn = tuple[View, Camera]
Nearest = tuple[Float[np.ndarray, "height width"], Int[np.ndarray, "2 height width"]]

MIRROR = np.diag([-1.0, 1.0, 1.0])  # left and right swapped, in the world or in the image
HOLE_OF_HEIGHT = 0.04  # radius of a missing piece: about as wide as an arm


def padded(view: View, camera: Camera, margin_px: int) -> Drawn:
    """Return the drawing with `margin_px` transparent pixels more on every side."""
    rgba = np.pad(view.rgba, ((margin_px, margin_px), (margin_px, margin_px), (0, 0)))
    x, y, width, height = view.box
    box = (x - margin_px, y - margin_px, width + 2 * margin_px, height + 2 * margin_px)
    size_wh = (rgba.shape[1], rgba.shape[0])
    shown = camera.moved((-margin_px, -margin_px), size_wh)
    return replace(view, rgba=rgba, box=box), shown


def mirrored(view: View, camera: Camera) -> Drawn:
    """Return the drawing flipped left to right, with the camera that sees a mirrored body so."""
    flipped = replace(
        camera,
        rotation=MIRROR @ camera.rotation @ MIRROR,
        target=MIRROR @ camera.target,
        center=np.array([camera.size_wh[0] - camera.center[0], camera.center[1]]),
    )
    return replace(view, rgba=np.ascontiguousarray(view.rgba[:, ::-1])), flipped


def without_feet(view: View, camera: Camera, share: float) -> Drawn:
    """Return the picture cut so that the lowest `share` of the figure's height is missing."""
    top, bottom = _rows(view.mask)
    lost = round(share * (bottom - top))
    if not lost:
        return view, camera
    kept = view.rgba[: bottom - lost]
    return replace(view, rgba=kept), camera.moved((0, 0), (kept.shape[1], kept.shape[0]))


def without_pieces(
    view: View, camera: Camera, share: float, generator: np.random.Generator
) -> Drawn:
    """Return the drawing with round pieces missing, `share` of the figure's area in all.

    Pieces within the figure are holes, at its border bites; many of them leave fragments. A larger
    share with the same generator state removes the same pieces and more.
    """
    top, bottom = _rows(view.mask)
    height, width = view.mask.shape
    v, u = np.mgrid[:height, :width] + 0.5
    left = np.ones((height, width))
    wanted = (1 - share) * view.mask.sum()
    while (open_now := view.mask & (left >= 0.5)).sum() > wanted:
        rows, columns = np.nonzero(open_now)
        i = int(generator.integers(len(rows)))
        away = np.hypot(u - columns[i] - 0.5, v - rows[i] - 0.5)
        left = np.minimum(left, np.clip(away - HOLE_OF_HEIGHT * (bottom - top) + 0.5, 0, 1))
    rgba = view.rgba.copy()
    rgba[..., 3] = np.round(rgba[..., 3] * left)
    return replace(view, rgba=rgba), camera


def stretched(view: View, camera: Camera, growth: float) -> Drawn:
    """Return the drawing taller by the factor 1 + `growth` and narrower by it; < 0: squashed."""
    tall = 1 + growth
    height, width = view.rgba.shape[:2]
    size_wh = (max(1, round(width / tall)), max(1, round(height * tall)))
    across, down = size_wh[0] / width, size_wh[1] / height
    shown = replace(
        camera,
        scale=camera.scale * across,
        pixel_aspect=camera.pixel_aspect * down / across,
        center=camera.center * (across, down),
        size_wh=size_wh,
    )
    return view.resized(size_wh), shown


def with_gaps_closed(view: View, camera: Camera, share: float) -> Drawn:
    """Return the drawing with gaps between limbs painted shut that are narrower than `share`.

    Args:
        view: the drawing; what is closed gets the nearest pixel's colour.
        camera: true of it.
        share: width of a gap over the figure's height.
    """
    top, bottom = _rows(view.mask)
    reach = round(share * (bottom - top) / 2)
    if not reach:
        return view, camera
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    room = np.pad(view.rgba[..., 3], reach)  # a border of its own, or the rim counts as figure
    inner = (slice(reach, -reach), slice(reach, -reach))
    alpha = cv2.morphologyEx(room, cv2.MORPH_CLOSE, disc)[inner]
    _, nearest = cast(Nearest, distance_transform_edt(~view.mask, return_indices=True))
    closed = (alpha > view.rgba[..., 3])[..., None]
    painted = np.where(closed, view.rgba[nearest[0], nearest[1]], view.rgba)
    painted[..., 3] = alpha
    return replace(view, rgba=painted), camera


def with_ball(
    view: View,
    camera: Camera,
    middle: Float[np.ndarray, " 3"],
    radius: float,
    color: tuple[int, int, int],
) -> Drawn:
    """Return the drawing, grown where need be, with a ball in front that the mannequin lacks.

    Its middle and radius are in world units; a radius of 0 leaves the drawing as it is.
    """
    if radius <= 0:
        return view, camera
    radius_px = radius * camera.scale
    at = camera.project(middle[None])[0]
    beyond = np.maximum(-at, at - np.array(camera.size_wh)).max() + radius_px
    if beyond > 0:
        view, camera = padded(view, camera, math.ceil(beyond) + 1)
        at = camera.project(middle[None])[0]
    away = np.linalg.norm(camera.pixel_grid() - at[0], axis=-1)
    cover = np.clip(radius_px - away + 0.5, 0, 1)[..., None]
    ball = np.array([*color, 255], dtype=np.float64)
    below = premultiply(view.rgba)
    return replace(view, rgba=straight(cover * ball + (1 - cover) * below)), camera


def _rows(mask: Bool[np.ndarray, "height width"]) -> tuple[int, int]:
    rows = np.flatnonzero(mask.any(axis=1))
    return int(rows[0]), int(rows[-1]) + 1
