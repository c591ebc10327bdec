"""Compute the optical flow between two drawings over a common surface.

The displacement F under which two drawings show the same at every pixel t of a view,

    first(p(t) - w2 F(t)) = second(q(t) + w1 F(t)),        w1 + w2 = 1,

p and q being where t's place lies in each. It is stiff: faces and buckles differ by a smooth error
of the hand and of the surface's depth, and a supple flow would drag one feature into another.

Source: Lucas and Kanade 1981 in a Gaussian window, coarse to fine; robust weights as in Black and
Anandan 1996; symmetric as in Alvarez et al. 2007.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import cv2
import numpy as np
from jaxtyping import Float

from toonset.camera import Camera
from toonset.nerf.kernels.threads import side_by_side
from toonset.nerf.look.crisp_depth import crisp_depth
from toonset.nerf.look.drawings import STEP, Drawings, PairFlow
from toonset.nerf.look.texture import CRUMB, Seen, Texture, look_up

GRID = 133.0  # height of the figure on the finest level, pixels
LEVELS = ((4, 4.2), (2, 6.0), (1, 8.5))  # times the finest pixel; the window's sigma
ROUNDS = 4
MOST = 0.023  # of the figure's height: the longest displacement
DAMPING, ROBUST = 1e-3, 0.25
KEPT = 4  # of the finest pixels a side: one of what is kept
NEIGHBOURS = 2.1  # radians: drawings farther apart show too little in common

Depths = Callable[[Camera], Float[np.ndarray, "height width"]]


def pair_flows(drawings: Drawings, depth_of: Depths) -> tuple[PairFlow, ...]:
    """Return the flows of drawings that stand beside each other.

    Args:
        drawings: their `flows` are not read.
        depth_of: the surface's depth as a camera sees it, nan where there is none.
    """
    assert drawings.textures  # made here: two threads must not make them twice
    tasks = [partial(_pair_flow, drawings, pair, depth_of) for pair in neighbours(drawings)]
    return tuple(side_by_side(tasks))


def neighbours(drawings: Drawings) -> list[tuple[int, int]]:
    """Return the pairs of drawings that follow each other round the figure."""
    cameras = [view.camera for view in drawings.views]
    ring = sorted(range(len(cameras)), key=lambda i: cameras[i].angles[0])
    pairs = zip(ring, ring[1:] + ring[:1], strict=True)
    forward = [camera.rotation[2] for camera in cameras]
    near = [(i, j) for i, j in pairs if i != j and forward[i] @ forward[j] > np.cos(NEIGHBOURS)]
    return list(dict.fromkeys((min(pair), max(pair)) for pair in near))


def between(first: Camera, second: Camera, figure_px: float, height: float) -> Camera:
    """Return the camera half way between two, on whose picture the figure is `figure_px` tall."""
    left, _, right = np.linalg.svd(first.rotation + second.rotation)
    camera = replace(
        first,
        rotation=left @ right,
        target=(first.target + second.target) / 2,
        center=(first.center + second.center) / 2,
        k=(first.k + second.k) / 2,
    )
    return camera.resized(figure_px / (height * first.scale))


def _pair_flow(drawings: Drawings, pair: tuple[int, int], depth_of: Depths) -> PairFlow:
    first, second = (drawings.textures[i] for i in pair)
    camera = between(first.camera, second.camera, GRID, drawings.height)
    depth = drawings.shape.seen(camera).depth if drawings.shape else depth_of(camera)
    points = camera.unproject_grid(crisp_depth(depth))
    slack, least = STEP * drawings.height, CRUMB * GRID**2
    there = np.isfinite(depth)
    seen = [look_up(texture, points, slack, least) for texture in (first, second)]
    seen = [replace(one, mask=one.mask & there) for one in seen]
    finest = drawings.height * first.camera.scale / GRID
    flow = paint_flow((first, second), (seen[0], seen[1]), finest)
    small = camera.resized(1 / KEPT)
    kept = cv2.resize(flow, small.size_wh, interpolation=cv2.INTER_AREA)
    return PairFlow(pair, small, kept.astype(np.float16))


def paint_flow(
    textures: tuple[Texture, Texture], seen: tuple[Seen, Seen], finest: float
) -> Float[np.ndarray, "h w 2"]:
    """Return F for w1 = w2 = 1/2, pixels of the drawings.

    Args:
        textures: the drawings.
        seen: where a view's pixels lie in them.
        finest: pixels of the drawings per pixel of the view.
    """
    rows, columns = seen[0].mask.shape
    flow = np.zeros((rows, columns, 2), np.float32)
    for level, sigma in LEVELS:
        size = (max(8, columns // level), max(8, rows // level))
        shrink = max(1.0, finest * level)
        pictures = [_shrunk(texture.paint, shrink) for texture in textures]
        places = [_places(*each, size) for each in zip(seen, textures, pictures, strict=True)]
        shares = [
            cv2.resize(one.mask.astype(np.float32), size, interpolation=cv2.INTER_AREA)
            for one in seen
        ]
        both = ((shares[0] > 0.9) & (shares[1] > 0.9)).astype(np.float32)
        f = cv2.resize(flow, size, interpolation=cv2.INTER_LINEAR) / np.float32(shrink)
        most = MOST * GRID * finest / shrink
        layers = [(picture, *_slopes(picture)) for picture in pictures]
        for _ in range(ROUNDS):
            f = _improved(f, layers, places, both, sigma, most)
        flow = cv2.resize(f, (columns, rows), interpolation=cv2.INTER_LINEAR) * np.float32(shrink)
    return flow


def _improved(
    flow: Float[np.ndarray, "h w 2"],
    layers: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]],
    places: Sequence[tuple[np.ndarray, np.ndarray]],
    both: Float[np.ndarray, "h w"],
    sigma: float,
    most: float,
) -> Float[np.ndarray, "h w 2"]:
    """Return the flow after a step of Gauss and Newton."""
    read = [
        [_read(layer, x + part * flow[..., 0], y + part * flow[..., 1]) for layer in layers_of]
        for layers_of, (x, y), part in zip(layers, places, (-0.5, 0.5), strict=True)
    ]
    apart = read[1][0] - read[0][0]
    across, down = (read[0][1] + read[1][1]) / 2, (read[0][2] + read[1][2]) / 2
    weight = both / (1 + (apart**2).sum(axis=-1) / ROBUST**2)
    products = ((across, across), (down, down), (across, down), (across, apart), (down, apart))
    xx, yy, xy, bx, by = (_blurred(weight * (p * q).sum(axis=-1), sigma) for p, q in products)
    damping = DAMPING * np.maximum(_blurred(both, sigma), 0.02)
    xx, yy = xx + damping, yy + damping
    step = np.stack([xy * by - yy * bx, xy * bx - xx * by], axis=-1)
    flow = flow + _at_most(step / (xx * yy - xy**2)[..., None], 1.0)
    return _at_most(_blurred(flow, sigma / 2), most)


def _at_most(move: Float[np.ndarray, "h w 2"], most: float) -> Float[np.ndarray, "h w 2"]:
    length = np.linalg.norm(move, axis=-1, keepdims=True)
    return (move / np.maximum(1, length / most)).astype(np.float32)


def _blurred(values: np.ndarray, sigma: float) -> np.ndarray:
    return cv2.GaussianBlur(values.astype(np.float32), (0, 0), sigma)


def _shrunk(picture: Float[np.ndarray, "height width 3"], shrink: float) -> np.ndarray:
    rows, columns = picture.shape[:2]
    size = (max(2, round(columns / shrink)), max(2, round(rows / shrink)))
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def _slopes(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    across, down = (cv2.Scharr(picture, cv2.CV_32F, *axis) / 32 for axis in ((1, 0), (0, 1)))
    return across, down


def _places(
    seen: Seen, texture: Texture, small: np.ndarray, size: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Return where a coarser grid's pixels lie in a smaller copy of a drawing."""
    x, y = (
        (cv2.resize(values, size, interpolation=cv2.INTER_AREA) + 0.5) * (new / old) - 0.5
        for values, new, old in zip(
            (seen.x, seen.y), small.shape[1::-1], texture.paint.shape[1::-1], strict=True
        )
    )
    return x.astype(np.float32), y.astype(np.float32)


def _read(picture: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    x, y = x.astype(np.float32), y.astype(np.float32)
    return cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
