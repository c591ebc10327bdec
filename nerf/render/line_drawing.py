"""Contour lines for a rendering: along its silhouette, its steps in depth and its colour borders.

Lines are placed on a grid finer than the picture and averaged, so that they are anti-aliased and
begin between pixels. The silhouette's line lies inside the figure, as the drawings' alpha has it;
a step's line lies on the nearer side, for it is that part's outline.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from toonset.camera import Camera
from toonset.nerf.lines.explain import step_edges
from toonset.nerf.lines.nearest import depth_inside, distance_to, nearest, parts
from toonset.nerf.lines.remove import InkStyle

SAMPLES_PER_LINE = 4.0  # across a line, at least
FINEST = 4  # samples per pixel and axis, at most
SHORTEST = 4.0  # times its width: a shorter step is noise of the surface
SQUARE = np.ones((3, 3), dtype=np.uint8)


def ink_scale(camera: Camera, style: InkStyle) -> float:
    """Return how many pixels of a camera's picture one pixel of the drawings is."""
    return camera.scale / style.px_per_unit


def draw_ink(
    alpha: Float[np.ndarray, "height width"],
    depth: Float[np.ndarray, "height width"],
    shares: Float[np.ndarray, "height width colors"] | None,
    style: InkStyle,
    scale: float,
) -> Float[np.ndarray, "height width"]:
    """Return the share of every pixel that contour lines cover, at most its alpha.

    Args:
        alpha: of a rendering of a field trained without contour lines.
        depth: of the rendering.
        shares: of the rendering, None without palette.
        style: of the sheet's lines.
        scale: pixels of the rendering per pixel of the drawings, see `ink_scale`.
    """
    outline, inner = scale * style.outline_px, scale * style.inner_px
    factor = int(np.clip(math.ceil(SAMPLES_PER_LINE / max(outline, 1e-6)), 1, FINEST))
    figure = _enlarged(alpha, factor) >= 0.5
    ink = _line(depth_inside(figure) - factor * outline / 2, factor * outline)
    if style.jump is not None:
        signed = _to_steps(depth, style.jump, factor, SHORTEST * inner)
        ink = np.maximum(ink, _line(signed - factor * inner / 2, factor * inner))
    if shares is not None and style.borders:
        border = _border(shares, style, figure, factor)
        ink = np.maximum(ink, _line(distance_to(border) + 0.5, factor * inner))
    height, width = alpha.shape
    covered = np.where(figure, ink, 0).astype(np.float32)
    mean = cv2.resize(covered, (width, height), interpolation=cv2.INTER_AREA)
    return np.minimum(mean, alpha)


def inked(
    premultiplied: Float[np.ndarray, "height width 3"],
    alpha: Float[np.ndarray, "height width"],
    ink: Float[np.ndarray, "height width"],
    rgb: tuple[int, int, int],
) -> Float[np.ndarray, "height width 3"]:
    """Return premultiplied colour with lines over it; alpha stays as it is.

    Args:
        premultiplied: in [0, 1].
        alpha: in [0, 1].
        ink: of `draw_ink`.
        rgb: the ink's colour.
    """
    left = 1 - ink / np.maximum(alpha, 1e-6)
    return premultiplied * left[..., None] + ink[..., None] * (np.array(rgb) / 255.0)


def _line(distance: np.ndarray, width: float) -> np.ndarray:
    """Return the coverage of a line from the distance to its middle, in samples."""
    return np.clip(width / 2 + 0.5 - np.abs(distance), 0, 1)


def _enlarged(picture: np.ndarray, factor: int) -> np.ndarray:
    height, width = picture.shape[:2]
    size = (factor * width, factor * height)
    return cv2.resize(picture.astype(np.float32), size, interpolation=cv2.INTER_LINEAR)


def _to_steps(
    depth: Float[np.ndarray, "height width"], jump: float, factor: int, shortest_px: float
) -> Float[np.ndarray, "fine_height fine_width"]:
    """Return the distance in samples to the nearest step, negative on its farther side."""
    seen = np.isfinite(depth)
    if not seen.any():
        return np.full(tuple(factor * n for n in seen.shape), np.inf)
    edges = _long(step_edges(depth, jump), shortest_px)
    rows, columns = nearest(seen)
    filled = depth[rows, columns].astype(np.float32)
    middle = (cv2.erode(filled, SQUARE) + cv2.dilate(filled, SQUARE)) / 2
    nearer = _enlarged(filled, factor) < _enlarged(middle, factor)
    zone = _enlarged(edges, factor) >= 0.5
    near_side, far_side = _sides(nearer, zone)
    to_near, to_far = distance_to(near_side) + 0.5, distance_to(far_side) + 0.5
    return np.where(to_near <= to_far, to_near, -to_far)


def _long(edges: Bool[np.ndarray, "h w"], shortest_px: float) -> Bool[np.ndarray, "h w"]:
    """Return the edges that reach over `shortest_px` from one end to the other."""
    part = parts(edges)
    long = np.zeros(int(part.max()) + 1, dtype=bool)
    for number, box in enumerate(ndimage.find_objects(part), start=1):
        long[number] = np.hypot(*(side.stop - side.start for side in box)) >= shortest_px
    return long[part]


def _sides(
    nearer: Bool[np.ndarray, "h w"], zone: Bool[np.ndarray, "h w"]
) -> tuple[Bool[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
    """Return the samples on the nearer and on the farther side of every step within the zone."""
    near_side, far_side = np.zeros_like(nearer), np.zeros_like(nearer)
    for near, far, where, at in (
        (near_side, far_side, zone, nearer),
        (near_side.T, far_side.T, zone.T, nearer.T),
    ):
        step = (at[1:] != at[:-1]) & where[1:] & where[:-1]
        near[1:] |= step & at[1:]
        near[:-1] |= step & at[:-1]
        far[1:] |= step & ~at[1:]
        far[:-1] |= step & ~at[:-1]
    return near_side, far_side


def _border(
    shares: Float[np.ndarray, "height width colors"],
    style: InkStyle,
    figure: Bool[np.ndarray, "fine_height fine_width"],
    factor: int,
) -> Bool[np.ndarray, "fine_height fine_width"]:
    """Return the samples beside a border between two colours that have a line there."""
    lined = np.zeros((shares.shape[2], shares.shape[2]), dtype=bool)
    for pair in style.borders:
        lined[pair] = lined[pair[::-1]] = True
    layers = [_enlarged(shares[..., i], factor) for i in range(shares.shape[2])]
    labels = np.argmax(np.stack(layers), axis=0)
    border = np.zeros(labels.shape, dtype=bool)
    for marked, at, within in ((border, labels, figure), (border.T, labels.T, figure.T)):
        step = lined[at[1:], at[:-1]] & within[1:] & within[:-1]
        marked[1:] |= step
        marked[:-1] |= step
    return border
