"""What explains a line within the figure: a step in depth, or a border between two colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Int, UInt8

from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.hull.hull import carve
from toonset.nerf.hull.march import surface_depth
from toonset.nerf.lines.nearest import distance_to
from toonset.nerf.lines.strokes import Lines, Strokes
from toonset.palette.pixels.labels import UNLABELLED

VOXELS = 96  # along the hull's longest side: a hint needs no more
JUMP = 0.04  # of the figure's height: smaller steps of the hull are the voxels' own
SLIP = 0.02  # of the figure's height: drawings and hull disagree by as much
LEAST_BORDER = 8  # pixels of a border over all views, for it to be judged by itself
LINED = 0.85  # of a border must be under ink: who draws borders draws nearly all of them

Pairs = tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False)
class Hints:
    """Where one view's depth jumps are.

    Attributes:
        edges: (height, width) pixels on a jump.
        to_jump: (height, width) distance to the nearest of them, pixels.
        reach_px: as far from a jump its line may lie.
    """

    edges: Bool[np.ndarray, "height width"]
    to_jump: Float[np.ndarray, "height width"]
    reach_px: float


def depth_hints(scene: Scene, width_px: float) -> tuple[list[Hints], float]:
    """Return every view's hints from the hull of all silhouettes, and the smallest jump used.

    Raises:
        BundleError: the views share no volume.
    """
    cameras = [frame.camera for frame in scene.frames]
    alphas = [torch.as_tensor(frame.rgba[..., 3] / np.float32(255)) for frame in scene.frames]
    hull = carve(cameras, alphas, VOXELS, 0)
    height = float(hull.inside.any(dim=2).any(dim=0).sum()) * hull.voxel
    hints = []
    for frame in scene.frames:
        edges = step_edges(surface_depth(hull, frame.camera), JUMP * height)
        reach = SLIP * height * frame.camera.scale + width_px / 2
        hints.append(Hints(edges, distance_to(edges), reach))
    return hints, JUMP * height


def step_edges(
    depth: Float[np.ndarray, "height width"], jump: float
) -> Bool[np.ndarray, "height width"]:
    """Return the pixels at which depth steps by more than `jump` beyond the slopes on both sides.

    A step may be spread over one mixed pixel. Where depth is not finite nothing is said.
    """
    return _row_steps(depth, jump) | _row_steps(depth.T, jump).T


def _row_steps(depth: np.ndarray, jump: float) -> np.ndarray:
    edges: np.ndarray = np.zeros(depth.shape, dtype=bool)
    wide = depth[3:-1] - depth[1:-3]
    before, after = depth[1:-3] - depth[:-4], depth[4:] - depth[3:-1]
    slope = 2 * np.maximum(np.abs(before), np.abs(after))
    with np.errstate(invalid="ignore"):
        edges[2:-2] = np.abs(wide) - slope > jump
    return edges


def lined_pairs(
    frames: Sequence[Frame], pens: Sequence[Strokes], lines: Sequence[Lines], hints: Sequence[Hints]
) -> Pairs:
    """Return the pairs of labels whose borders, away from depth jumps, are mostly under ink.

    Args:
        frames: with labels under all ink.
        pens: strokes of the same frames that are ink.
        lines: of the same frames.
        hints: of the same frames.
    """
    total, inked = np.zeros((256, 256), int), np.zeros((256, 256), int)
    for frame, pen, line, hint in zip(frames, pens, lines, hints, strict=True):
        if frame.labels is None:
            return ()
        counted = (hint.to_jump > hint.reach_px) & ~line.outline
        near_ink = distance_to(pen.number > 0) <= 1
        for low, high, at in _borders(frame.labels):
            use = counted[at]
            np.add.at(total, (low[use], high[use]), 1)
            np.add.at(inked, (low[use], high[use]), near_ink[at][use])
    lined = (inked >= LINED * total) & (total >= LEAST_BORDER)
    return tuple((int(a), int(b)) for a, b in np.argwhere(lined))


def on_borders(
    labels: UInt8[np.ndarray, "height width"], pairs: Pairs
) -> Bool[np.ndarray, "height width"]:
    """Return the pixels beside a border between the labels of one of the pairs."""
    lined = np.zeros((256, 256), dtype=bool)
    for first, second in pairs:
        lined[first, second] = True
    marked = np.zeros(labels.shape, dtype=bool)
    for low, high, at in _borders(labels):
        marked[at] |= lined[low, high]
    return marked


def _borders(
    labels: UInt8[np.ndarray, "height width"],
) -> list[tuple[np.ndarray, np.ndarray, tuple[Int[np.ndarray, " n"], Int[np.ndarray, " n"]]]]:
    """Return smaller label, larger label and place of the pixels on both sides of all borders."""
    found = []
    for down, right in ((1, 0), (0, 1)):
        one, other = labels[down:, right:], labels[: -down or None, : -right or None]
        border = (one != other) & (one != UNLABELLED) & (other != UNLABELLED)
        low, high = np.minimum(one, other)[border], np.maximum(one, other)[border]
        rows, columns = np.nonzero(border)
        found.append((low, high, (rows, columns)))
        found.append((low, high, (rows + down, columns + right)))
    return found
