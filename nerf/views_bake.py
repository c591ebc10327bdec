"""A trained field read once, at the hull's voxels: what views are rendered from.

Values between voxels are trilinear. OpenCV's `remap` interpolates bilinearly at any list of places,
ten times faster than a field or `grid_sample` answers; so a volume's slices lie side by side in one
picture, and a point is interpolated in the two slices next to it and then between them.

Density rises steeply where a surface begins, so it is not density that is interpolated but what
softplus makes density from, and the hull's support goes beside it. Against the field itself that
costs 0.03 dB on new views.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from toonset.nerf.classifier import PaletteClassifier
from toonset.nerf.hull import EDGE, Hull, grown, occupancy
from toonset.nerf.trained import TrainedField

POINTS_PER_CHUNK = 1 << 13
WIDTH = 512  # of the pictures that hold a list of places; OpenCV's sides end at 32,767
FAINTEST, STEEPEST = 1e-6, 15.0  # optical depths between which softplus has an exact inverse
MOST_CLEAR = 24  # voxels: farther ones count as so far


@dataclass(frozen=True, eq=False)
class Baked:
    """A field at the voxels of its hull.

    Places are in voxels from half a voxel before the hull's lowest corner, one list per axis:
    lists of single numbers are what processors are fast at.

    Attributes:
        trained: where it comes from.
        density: slices of constant x side by side, one voxel round each: what softplus makes a
            step's optical depth from.
        support: the hull's support, in the same places.
        color: RGB and a constant 1, in the same places.
        corners: (2, slices) column and row of each slice.
        clear: (x, y, z) voxels from here to the nearest that may hold a sample, along the axis on
            which they are most; 0: this one may.
        paints: (colors, 3) what the surface shows for each palette label, nan for one that it shows
            nowhere; no rows without palette.
    """

    trained: TrainedField
    density: Float[np.ndarray, "height width"]
    support: Float[np.ndarray, "height width"]
    color: Float[np.ndarray, "height width 4"]
    corners: Float[Tensor, "2 slices"]
    clear: UInt8[Tensor, "x y z"]
    paints: Float[Tensor, "colors 3"]

    @classmethod
    @torch.no_grad()
    def of(cls, trained: TrainedField) -> Baked:
        """Return the field, read at the voxels where the hull leaves anything."""
        hull = trained.hull
        read = grown(hull.near, 1)
        density, color = torch.zeros(read.numel()), torch.ones(read.numel(), 4)
        for chunk in read.reshape(-1).nonzero()[:, 0].split(POINTS_PER_CHUNK):
            per_unit, color[chunk, :3] = trained.field(_middles(hull, chunk))
            density[chunk] = _unsoftened(per_unit * trained.step)
        tiles, corners = _side_by_side(density.view(*read.shape, 1).numpy(), "edge")
        support, _ = _side_by_side(hull.support[..., None].numpy(), "constant")
        colors, _ = _side_by_side(color.view(*read.shape, 4).numpy(), "edge")
        clear = _away_from(hull.near)
        shown = color[(hull.inside & grown(~hull.inside, 1)).reshape(-1), :3]
        paints = _paints(trained.classifier, shown)
        return cls(trained, tiles[..., 0], support[..., 0], colors, corners, clear, paints)

    def place(self, points_world: Float[Tensor, "n 3"]) -> Float[Tensor, "3 n"]:
        """Return world points in voxels."""
        hull = self.trained.hull
        low = torch.as_tensor(hull.low - hull.voxel / 2, dtype=torch.float32)
        return ((points_world - low) * (1 / hull.voxel)).T.contiguous()

    def clearance(self, place: Sequence[Float[Tensor, "n steps"]]) -> UInt8[Tensor, "n steps"]:
        """Return `clear` at places inside the hull's box, given by axis."""
        sizes = self.clear.shape
        x, y, z = (
            (at - 0.5).clamp_(0, size - 1).int() for at, size in zip(place, sizes, strict=True)
        )
        index = x.mul_(sizes[1]).add_(y).mul_(sizes[2]).add_(z)
        return self.clear.view(-1)[index]

    def at(self, place: Sequence[Float[Tensor, "n steps"]]) -> Looked:
        """Return what is found at places, given by axis; they are clamped to the hull in place."""
        x, y, z = (
            at.clamp_(0, size + (1 - 1e-3))
            for at, size in zip(place, self.clear.shape, strict=True)
        )
        number = x.int()
        part = x - number
        here, there = self._maps(number, y, z), self._maps(number + 1, y, z)
        density, support = (
            _found(tiles, here, part.shape).lerp_(_found(tiles, there, part.shape), part)
            for tiles in (self.density, self.support)
        )
        occupied = occupancy(support).mul_(support >= EDGE)
        colors = [_found(self.color, at, (*part.shape, 4)) for at in (here, there)]
        return Looked(F.softplus(density).mul_(occupied), colors[0], colors[1], part)

    def _maps(
        self, number: Int[Tensor, "n steps"], y: Tensor, z: Tensor
    ) -> Float[np.ndarray, "2 rows width"]:
        """Return columns and rows of places in the slices of these numbers."""
        maps = torch.zeros(2, -(-number.numel() // WIDTH) * WIDTH)
        for corner, at, found in zip(self.corners, (z, y), maps, strict=True):
            first = corner.index_select(0, number.view(-1))
            torch.add(first, at.reshape(-1), out=found[: len(first)])
        return maps.view(2, -1, WIDTH).numpy()


@dataclass(frozen=True, eq=False)
class Looked:
    """What is found at some places along rays.

    Attributes:
        depth: optical depth of a step, the hull's part included.
        here, there: RGB and 1 in the slices before and behind each place.
        part: how far each place is towards the latter.
    """

    depth: Float[Tensor, "n steps"]
    here: Float[Tensor, "n steps 4"]
    there: Float[Tensor, "n steps 4"]
    part: Float[Tensor, "n steps"]

    def color(self, weights: Float[Tensor, "n steps"]) -> Float[Tensor, "n 4"]:
        """Return the weighted sums of RGB, and of the weights."""
        there = weights * self.part
        sums = torch.bmm((weights - there)[:, None], self.here)
        return sums.baddbmm_(there[:, None], self.there)[:, 0]


def _found(
    tiles: Float[np.ndarray, "height width *channels"],
    maps: Float[np.ndarray, "2 rows width"],
    shape: tuple[int, ...],
) -> Float[Tensor, "n steps *channels"]:
    values = torch.from_numpy(cv2.remap(tiles, maps[0], maps[1], cv2.INTER_LINEAR))
    return values.view(-1)[: math.prod(shape)].view(shape)


def _away_from(cells: Bool[Tensor, "x y z"]) -> UInt8[Tensor, "x y z"]:
    """Return every cell's distance to the nearest one that is set, the largest of the axes'."""
    away = torch.zeros(cells.shape, dtype=torch.uint8)
    for _ in range(MOST_CLEAR):
        away += ~cells
        cells = grown(cells, 1)
    return away


def _paints(
    classifier: PaletteClassifier | None, shown: Float[Tensor, "n 3"]
) -> Float[Tensor, "colors 3"]:
    """Return the median of all colours with each label, nan where there is none."""
    if classifier is None:
        return torch.zeros(0, 3)
    labels = classifier(shown).argmax(dim=1)
    paints = [shown[labels == label] for label in range(classifier.out.out_features)]
    none = torch.full((3,), torch.nan)
    return torch.stack([paint.median(dim=0).values if len(paint) else none for paint in paints])


def _unsoftened(optical_depth: Float[Tensor, " n"]) -> Float[Tensor, " n"]:
    """Return the inverse of softplus."""
    low = optical_depth.clamp(FAINTEST, STEEPEST)
    return torch.where(optical_depth > STEEPEST, optical_depth, torch.log(torch.expm1(low)))


def _middles(hull: Hull, cells: Int[Tensor, " n"]) -> Float[Tensor, "n 3"]:
    _, y, z = hull.support.shape
    number = torch.stack([cells // (y * z), cells // z % y, cells % z], dim=1)
    return torch.as_tensor(hull.low, dtype=torch.float32) + hull.voxel * (number + 0.5)


def _side_by_side(
    volume: Float[np.ndarray, "x y z channels"], beyond: Literal["edge", "constant"]
) -> tuple[Float[np.ndarray, "height width channels"], Float[Tensor, "2 slices"]]:
    """Return the slices of a volume in one picture, a voxel round each, and where each begins.

    Args:
        volume: values at voxels.
        beyond: the voxel round a slice repeats its edge, or is zero.
    """
    volume = np.pad(volume, [(1, 1)] * 3 + [(0, 0)], mode=beyond)
    x, y, z = volume.shape[:3]
    columns = max(1, round(np.sqrt(x * y / z)))
    rows = -(-x // columns)
    tiles = np.zeros((rows * columns, y, z, volume.shape[3]), dtype=np.float32)
    tiles[:x] = volume
    grid = tiles.reshape(rows, columns, y, z, -1).swapaxes(1, 2).reshape(rows * y, columns * z, -1)
    number = torch.arange(x)
    corners = torch.stack([number % columns * z, number // columns * y]).float()
    return np.ascontiguousarray(grid), corners
