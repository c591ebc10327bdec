"""Merge opposite drawings half way: front and back show one outline, drawn twice.

The back drawing, seen through, is bent onto the front one by a smooth flow u with
back(x + u(x)) ~ front(x); both move half of the way. Drawings that would have to bend far show
different poses and are not merged.

Source: Thirion, "Image matching as a diffusion process: an analogy with Maxwell's demons", 1998, on
signed distances.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float

from toonset.nerf.sections.drawing import Drawing, Picture, sample, signed_distance

ROUNDS, COARSE_ROUNDS = 60, 30
SMOOTH_PX, COARSER = 14.0, 1.6  # width of the flow's kernel, and how much wider it is at first
MOST_PX = 22.0
MOST_BEND_PX = 12.0  # root mean square over the figure: beyond, the poses differ
CLIP_PX, NEAR_PX = 20.0, 6.0  # of distances, and of what counts beside the outline
SLOPE_FLOOR, WEIGHT_FLOOR = 0.1, 0.02
FIXED_POINT_STEPS = 8

Flow = Float[np.ndarray, "2 height width"]


@dataclass(frozen=True, eq=False)
class Merged:
    """Two opposite drawings as one.

    Attributes:
        first: the first drawing, bent half way.
        second: the other, bent half way to meet it; as it was if there was no merging.
        bend_px: by how much they differ, root mean square.
    """

    first: Drawing
    second: Drawing
    bend_px: float


def merged(first: Drawing, second: Drawing, depth_px: float = 0.0) -> Merged:
    """Return two drawings of one outline with the outline they agree on half way.

    Args:
        first: a drawing.
        second: one from the opposite side, or the same one.
        depth_px: of the body's middle past the first camera's target.
    """
    depth = depth_px / first.camera.scale
    grid = _grid(first.mask.shape)
    through = _pixels_in(first, second, grid, depth)
    flow = _demons(signed_distance(sample(second.rgba[..., 3], through)), first.distance)
    bend = float(np.sqrt(np.square(flow).sum(axis=0)[first.mask].mean()))
    if bend > MOST_BEND_PX:
        return Merged(first, second, bend)
    mean = _resampled(first, grid + np.moveaxis(_inverse(flow), 0, -1) / 2)
    back = _pixels_in(second, first, _grid(second.mask.shape), depth)
    move = np.stack([sample(part, back) for part in flow], axis=-1) / 2
    bent = _resampled(second, _pixels_in(first, second, back + move, depth))
    return Merged(mean, bent, bend)


def _grid(shape: tuple[int, ...]) -> Float[np.ndarray, "height width 2"]:
    """Return the centre of every pixel."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float32) + np.float32(0.5)
    return np.stack([x, y], axis=-1)


def _pixels_in(
    first: Drawing, second: Drawing, pixels: Float[np.ndarray, "height width 2"], depth: float
) -> Float[np.ndarray, "height width 2"]:
    """Return where another drawing shows what one shows at pixels, at the body's middle."""
    points = first.camera.unproject(pixels, np.full(pixels.shape[:-1], depth))
    return second.pixels(points.astype(np.float32))


def _resampled(drawing: Drawing, pixels: Float[np.ndarray, "height width 2"]) -> Drawing:
    """Return the drawing with its colours from other pixels, transparent beyond its edges."""
    premultiplied = drawing.rgba.copy()
    premultiplied[..., :3] *= premultiplied[..., 3:]
    places = (pixels - 0.5).astype(np.float32)
    maps = np.ascontiguousarray(places[..., 0]), np.ascontiguousarray(places[..., 1])
    found = cv2.remap(premultiplied, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    alpha = found[..., 3:]
    found[..., :3] = np.where(alpha > 1e-3, found[..., :3] / np.maximum(alpha, 1e-3), 1)
    return replace(drawing, rgba=found)


def _demons(moving: Picture, fixed: Picture) -> Flow:
    """Return the smooth flow u with moving(x + u(x)) ~ fixed(x); found at half size."""
    source, target = (_halved(picture) for picture in (moving, fixed))
    height, width = target.shape
    places = _grid((height, width))
    flow = np.zeros((2, height, width), np.float32)
    slopes = _slopes(target)
    near = np.exp(-np.square(target / (NEAR_PX / 2)))
    weights: dict[float, Picture] = {}
    for step in range(ROUNDS):
        width_px = SMOOTH_PX / 2 * (COARSER if step < COARSE_ROUNDS else 1)
        if width_px not in weights:
            weights[width_px] = _smooth(near, width_px) + WEIGHT_FLOOR
        now = sample(source, places + np.moveaxis(flow, 0, -1))
        mean = (slopes + _slopes(now)) / 2
        pull = (now - target) * near * mean / (np.square(mean).sum(axis=0) + SLOPE_FLOOR)
        flow -= np.stack([_smooth(part, width_px) for part in pull]) / weights[width_px]
        flow = flow.clip(-MOST_PX / 2, MOST_PX / 2)
    size = fixed.shape[::-1]
    return np.stack([cv2.resize(part, size) * 2 for part in flow])


def _slopes(picture: Picture) -> Flow:
    """Return a picture's slopes along x and y."""
    return np.stack([np.gradient(picture, axis=axis) for axis in (1, 0)])


def _halved(distance: Picture) -> Picture:
    clipped = distance.clip(-CLIP_PX, CLIP_PX)
    return cv2.resize(clipped, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) / 2


def _smooth(picture: Picture, width_px: float) -> Picture:
    return cv2.GaussianBlur(picture, (0, 0), width_px)


def _inverse(flow: Flow) -> Flow:
    """Return the flow v with v(x) = -u(x + v(x))."""
    places, inverse = _grid(flow.shape[1:]), -flow
    for _ in range(FIXED_POINT_STEPS):
        there = places + np.moveaxis(inverse, 0, -1)
        inverse = -np.stack([sample(part, there) for part in flow])
    return inverse
