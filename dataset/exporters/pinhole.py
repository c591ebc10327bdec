"""Fit cameras to other programs' lenses: a centred principal point, one lens for all views.

An orthographic view is free to choose: any point of its target's plane may be the principal one,
and its far pinhole may stand at any distance. So its picture is only ever padded, never resampled.
A pinhole's principal point is where it is: its picture moves, by parts of a pixel too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from toonset.dataset.exporters.common import ExportView
from toonset.dataset.images.picture import MAX_PIXELS
from toonset.errors import BundleError

LARGEST_FACTOR = 4.0  # a picture that must be enlarged by more has no business with the others
SAME_PX = 1e-3  # a smaller shift or growth of a picture is left out
Pair = tuple[float, float]


def centre_view(view: ExportView) -> ExportView:
    """Return the view with its principal point in the middle of its picture.

    An orthographic view keeps its picture. A pinhole's is padded with nothing to the smallest
    picture that holds it, and resampled if the principal point is at no whole or half pixel.
    """
    if view.camera.is_orthographic:
        return middle_chosen(view)
    half = _half_extent(view)
    size = (math.ceil(2 * half[0] - SAME_PX), math.ceil(2 * half[1] - SAME_PX))
    return placed(view, size, (1.0, 1.0))


def common_lens(views: Sequence[ExportView]) -> tuple[ExportView, ...]:
    """Return the views with one focal length, square pixels and one size, all centred.

    Orthographic views with square pixels share a focal length by their distance alone; pinholes are
    enlarged to the longest one.

    Raises:
        BundleError: orthographic views and pinholes, or pinholes too different, share no lens.
    """
    focals = [_focal_uv(view) for view in views]
    longest = max(max(pair) for pair in focals)
    factors = [_factors(view, pair, longest) for view, pair in zip(views, focals, strict=True)]
    largest = max(max(pair) for pair in factors)
    if largest > LARGEST_FACTOR or len({view.camera.is_orthographic for view in views}) > 1:
        raise BundleError(
            f"{views[0].name} and others: focal lengths from {min(min(p) for p in focals):.4g} to "
            f"{longest:.4g} px, one for all is needed; export to a format with a lens per view"
        )
    halves = [_half_extent(v, pair) for v, pair in zip(views, factors, strict=True)]
    size = tuple(math.ceil(2 * max(half[axis] for half in halves) - SAME_PX) for axis in (0, 1))
    size_wh = (size[0], size[1])
    result = [placed(v, size_wh, pair) for v, pair in zip(views, factors, strict=True)]
    return tuple(
        replace(v, distance=longest / v.camera.scale) if v.camera.is_orthographic else v
        for v in result
    )


def square_pixels(view: ExportView) -> ExportView:
    """Return the view with fx = fy: the shorter one's direction is enlarged."""
    aspect = view.camera.pixel_aspect
    width, height = view.camera.size_wh
    if abs(aspect - 1) * max(width, height) < SAME_PX:
        return view
    factors = (max(1.0, aspect), max(1.0, 1 / aspect))
    size = (math.ceil(width * factors[0]), math.ceil(height * factors[1]))
    return _warped(view, size, factors, (0.0, 0.0))


def middle_chosen(view: ExportView) -> ExportView:
    """Return an orthographic view whose target is what it shows in the middle of its picture."""
    middle = np.array(view.camera.size_wh) / 2
    target = view.camera.unproject(middle[None], np.zeros(1))[0]
    moved = float(np.linalg.norm(target - view.camera.target))
    camera = replace(view.camera, target=target, center=middle)
    return replace(view, camera=camera, radius=view.radius + moved)


def placed(view: ExportView, size_wh: tuple[int, int], factors: Pair) -> ExportView:
    """Return the view enlarged, on a picture of `size_wh` with the principal point in its middle.

    Raises:
        BundleError: the principal point lies so far outside that the picture would be too large.
    """
    if size_wh[0] * size_wh[1] > MAX_PIXELS:
        raise BundleError(
            f"{view.name}: a picture with the principal point in its middle has {size_wh[0]} x "
            f"{size_wh[1]} px, at most {MAX_PIXELS / 1e6:g} megapixels are written; export to a "
            "format with a lens per view"
        )
    if view.camera.is_orthographic:
        width, height = view.camera.size_wh
        shift = ((size_wh[0] - width * factors[0]) // 2, (size_wh[1] - height * factors[1]) // 2)
        return middle_chosen(_warped(view, size_wh, factors, shift))
    u, v = view.camera.center
    return _warped(
        view, size_wh, factors, (size_wh[0] / 2 - u * factors[0], size_wh[1] / 2 - v * factors[1])
    )


def _focal_uv(view: ExportView) -> Pair:
    K = view.pinhole.K
    return float(K[0, 0]), float(K[1, 1])


def _factors(view: ExportView, focal: Pair, longest: float) -> Pair:
    if not view.camera.is_orthographic:
        return longest / focal[0], longest / focal[1]
    return max(focal) / focal[0], max(focal) / focal[1]  # the distance does the rest


def _half_extent(view: ExportView, factors: Pair = (1.0, 1.0)) -> Pair:
    """Return how far the picture reaches from its principal point (or its middle), enlarged."""
    size = view.camera.size_wh
    center = np.array(size) / 2 if view.camera.is_orthographic else view.camera.center
    reach = [f * max(float(c), n - float(c)) for f, c, n in zip(factors, center, size, strict=True)]
    return reach[0], reach[1]


def _warped(
    view: ExportView, size_wh: tuple[int, int], factors: Pair, shift_px: Pair
) -> ExportView:
    """Return the view with u' = factor u + shift, on a picture of `size_wh`."""
    camera = view.camera
    moved = replace(
        camera,
        scale=camera.scale * factors[0],
        pixel_aspect=camera.pixel_aspect * factors[1] / factors[0],
        center=camera.center * np.array(factors) + np.array(shift_px),
        size_wh=size_wh,
    )
    return replace(view, camera=moved, rgba=_moved_picture(view.rgba, size_wh, factors, shift_px))


def _moved_picture(
    rgba: UInt8[np.ndarray, "height width 4"],
    size_wh: tuple[int, int],
    factors: Pair,
    shift_px: Pair,
) -> UInt8[np.ndarray, "h w 4"]:
    height, width = rgba.shape[:2]
    x, y = (round(shift) for shift in shift_px)
    grows = max(abs(factors[0] - 1) * width, abs(factors[1] - 1) * height)
    if max(grows, abs(shift_px[0] - x), abs(shift_px[1] - y)) < SAME_PX:
        result = np.zeros((size_wh[1], size_wh[0], 4), dtype=np.uint8)
        result[y : y + height, x : x + width] = rgba
        return result
    return _resampled(rgba, size_wh, factors, shift_px)


def _resampled(
    rgba: UInt8[np.ndarray, "height width 4"],
    size_wh: tuple[int, int],
    factors: Pair,
    shift_px: Pair,
) -> UInt8[np.ndarray, "h w 4"]:
    """Return the picture resampled with premultiplied alpha (Catmull-Rom-like cubic)."""
    alpha = rgba[..., 3:].astype(np.float32) / 255
    layers = np.concatenate([rgba[..., :3] * alpha, alpha * 255], axis=2).astype(np.float32)
    matrix = _opencv_matrix(factors, shift_px)
    flags, border = cv2.INTER_CUBIC, cv2.BORDER_CONSTANT
    warped = cv2.warpAffine(layers, matrix, size_wh, flags=flags, borderMode=border).clip(0, 255)
    covered = warped[..., 3:] / 255
    rgb = np.divide(warped[..., :3], covered, out=np.zeros_like(warped[..., :3]), where=covered > 0)
    both = np.concatenate([rgb, warped[..., 3:]], axis=2)
    return np.rint(both.clip(0, 255)).astype(np.uint8)


def _opencv_matrix(factors: Pair, shift_px: Pair) -> Float[np.ndarray, "2 3"]:
    """Return the map between pixels with integer centres: f (u + 0.5) + shift - 0.5."""
    fx, fy = factors
    return np.array([[fx, 0, shift_px[0] + (fx - 1) / 2], [0, fy, shift_px[1] + (fy - 1) / 2]])
