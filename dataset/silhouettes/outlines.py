"""Prepare a sheet's outlines for comparison: signed distances, gradients, outline points.

All of it is kept at one small size, whatever the pictures' size, so that comparing costs the same
for every sheet; the antialiased outline keeps its place to a tenth of a pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float
from skimage.measure import find_contours

from toonset import raster
from toonset.camera import Camera
from toonset.dataset.silhouettes.bounds import box_of_masks
from toonset.dataset.silhouettes.mask import FAINT, thin

FIGURE_PX = 128  # larger figures are made this small; smaller ones stay as they are
OUTLINE_POINTS = 50.0  # outline points along a length as long as the figure
ROOM = 1.12  # of the figure's longer side: the square on which it may move
SHORTEST = 12  # outline points of a contour below which it is a speck
SLOPE = 0.3  # below which a ridge's slope has no direction


@dataclass(frozen=True, eq=False)
class Square:
    """The square of a picture in which its figure lies; `low` and `size` in pixels."""

    low: Float[np.ndarray, " 2"]
    size: float

    def unit(self, pixels: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
        """Return pixels as places in the square, (0, 0) to (1, 1)."""
        return (pixels - self.low) / self.size

    def axes(
        self, size_wh: tuple[int, int]
    ) -> tuple[Float[np.ndarray, " width"], Float[np.ndarray, " height"]]:
        """Return the places of a picture's columns and rows, pixel centres."""
        across, down = (
            (np.arange(n) + 0.5 - low) / self.size for n, low in zip(size_wh, self.low, strict=True)
        )
        return across, down


@dataclass(frozen=True, eq=False)
class Outline:
    """One drawing's outline, in the pixels of `camera`.

    Attributes:
        camera: of the small picture.
        distance: (3, height, width) signed distance to the outline in pixels, > 0 inside, and its
            unit gradient (x, y).
        points: (n, 2) points on the outline, evenly spaced.
        square: where the figure is.
    """

    camera: Camera
    distance: Float[np.ndarray, "3 height width"]
    points: Float[np.ndarray, "n 2"]
    square: Square

    def at(self, pixels: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "3 n"]:
        """Return distance and gradient at pixels."""
        return sample(self.distance, pixels)


@dataclass(frozen=True, eq=False)
class Outlines:
    """The outlines of a sheet.

    Attributes:
        views: one per drawing.
        middle: (3,) world point about which the figure stands.
        radius: world units from there in which all of it lies, along any axis.
    """

    views: tuple[Outline, ...]
    middle: Float[np.ndarray, " 3"]
    radius: float

    @property
    def size_px(self) -> float:
        """Return the squares' side, the same in all views."""
        return self.views[0].square.size

    def ratio(self, first: Camera) -> float:
        """Return how many pixels of the outlines a pixel of the pictures is; `first` is theirs."""
        return self.views[0].camera.scale / first.scale


def outlines_of(
    cameras: Sequence[Camera], alphas: Sequence[Float[np.ndarray, "height width"]]
) -> Outlines:
    """Return the outlines of drawings that all show a figure (alpha in [0, 1]).

    Raises:
        BundleError: the cameras do not belong together (see `box_of_masks`).
    """
    figure = max(max(_box(alpha)[1]) for alpha in alphas)
    factor = min(1.0, FIGURE_PX / figure)
    small = [_resized(camera, factor) if factor < 1 else camera for camera in cameras]
    pictures = [
        cv2.resize(alpha, camera.size_wh, interpolation=cv2.INTER_AREA) if factor < 1 else alpha
        for alpha, camera in zip(alphas, small, strict=True)
    ]
    side = ROOM * figure * factor
    box = box_of_masks(cameras, [alpha >= 0.5 for alpha in alphas])
    views = [_outline(c, a, side) for c, a in zip(small, pictures, strict=True)]
    return Outlines(tuple(views), (box.low + box.high) / 2, float(box.size.max()) / 2)


def sample(
    picture: Float[np.ndarray, "channels height width"], pixels: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "channels n"]:
    """Return a picture's values at pixels, bilinear; beyond the edges the nearest.

    (OpenCV would round the places to 1/32 pixel, which a fit's differences would feel.)
    """
    channels, height, width = picture.shape
    x = np.clip(pixels[:, 0] - 0.5, 0, width - 1)
    y = np.clip(pixels[:, 1] - 0.5, 0, height - 1)
    left, top = x.astype(np.intp), y.astype(np.intp)
    across, down = (x - left).astype(np.float32), (y - top).astype(np.float32)
    upper = top * width
    lower = np.minimum(top + 1, height - 1) * width
    right = np.minimum(left + 1, width - 1)
    flat = picture.reshape(channels, -1)
    first, second = flat[:, upper + left], flat[:, lower + left]
    first = first + across * (flat[:, upper + right] - first)
    second = second + across * (flat[:, lower + right] - second)
    return first + down * (second - first)


def signed_distance(alpha: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """Return the distance to the outline (alpha 1/2) in pixels, > 0 inside.

    What is too thin to cover half a pixel, as a cape's corner seen from its edge, has no outline,
    but is there: around it, distances are to its middle.
    """
    distance = raster.signed_distance((alpha >= 0.5) | thin(alpha))
    known = (alpha > FAINT) & (alpha < 1 - FAINT) & (np.abs(distance) < 1)
    return np.where(known, alpha - 0.5, distance).astype(np.float32)


def _resized(camera: Camera, factor: float) -> Camera:
    """Return the camera of the picture stretched to a whole number of pixels."""
    width, height = camera.size_wh
    size = (max(1, round(factor * width)), max(1, round(factor * height)))
    across, down = size[0] / width, size[1] / height
    return replace(
        camera,
        scale=camera.scale * across,
        center=camera.center * np.array([across, down]),
        size_wh=size,
        pixel_aspect=camera.pixel_aspect * down / across,
    )


def _outline(camera: Camera, alpha: Float[np.ndarray, "height width"], side: float) -> Outline:
    distance = signed_distance(alpha)
    smooth = cv2.GaussianBlur(distance, (0, 0), 0.7)
    slope = np.stack(np.gradient(smooth)[::-1])
    slope /= np.maximum(np.linalg.norm(slope, axis=0), SLOPE)
    stack = np.concatenate([distance[None], slope]).astype(np.float32)
    middle, _ = _box(alpha)
    square = Square(np.array(middle) - side / 2, side)
    return Outline(camera, stack, _outline_points(alpha, side / ROOM / OUTLINE_POINTS), square)


def _outline_points(
    alpha: Float[np.ndarray, "height width"], step: float
) -> Float[np.ndarray, "n 2"]:
    """Return points `step` pixels apart on all outlines, but where the picture's edge cuts them."""
    points = [np.zeros((0, 2))]
    for contour in find_contours(alpha, 0.5):
        corners = contour[:, ::-1] + 0.5
        length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))]
        if length[-1] >= SHORTEST:
            at = np.arange(0, length[-1], step)
            points.append(np.stack([np.interp(at, length, corners[:, k]) for k in (0, 1)], -1))
    return np.concatenate(points)


def _box(
    alpha: Float[np.ndarray, "height width"],
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the middle and the sides of a figure's box."""
    mask = alpha >= 0.5
    ends = [np.flatnonzero(mask.any(axis=axis))[[0, -1]] for axis in (0, 1)]
    (x0, x1), (y0, y1) = ends
    return ((x0 + x1 + 1) / 2, (y0 + y1 + 1) / 2), (float(x1 - x0 + 1), float(y1 - y0 + 1))
