"""Bake a trained field into volumes at the hull's voxels, from which views are rendered.

Values between voxels are trilinear. OpenCV's `remap` interpolates bilinearly at any list of places,
ten times faster than a field or `grid_sample` answers; so a volume's slices lie side by side in one
picture, and a point is interpolated in the two slices next to it and then between them.

Density rises steeply where a surface begins, so it is not density that is interpolated but what
softplus makes density from, and the hull's support goes beside it. Against the field itself that
costs 0.03 dB on new views.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int, Shaped, UInt8
from torch import Tensor

from toonset.nerf.fields.classifier import PaletteClassifier
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.hull.hull import EDGE, Hull, grow, occupancy
from toonset.nerf.kernels.threads import side_by_side
from toonset.nerf.render.labels import label_table

POINTS_PER_CHUNK = 1 << 13
FAINTEST, STEEPEST = 1e-6, 15.0  # optical depths between which softplus has an exact inverse
MOST_CLEAR = 24  # voxels: farther ones count as so far


@dataclass(frozen=True, eq=False)
class Baked:
    """A field at the voxels of its hull.

    Places are in voxels from half a voxel before the hull's lowest corner, axis by axis: lists of
    single numbers are what processors are fast at.

    Attributes:
        trained: where it comes from.
        matter: slices of constant x, one voxel round each: what softplus makes a step's optical
            depth from, and the hull's support, here and in the next slice.
        safe_steps: (x, y, z) steps, in any direction, from anywhere in this voxel over what
            certainly holds no sample.
        color: RGB in the same places as `matter`; a fourth channel is read faster than none.
        shell: (3, n) places of voxels that may hold a sample beside voxels that may not.
        labels: a palette label for every colour; None without palette.
        paints: (colors, 3) what the surface shows for each palette label, nan for one that it shows
            nowhere; no rows without palette.
    """

    trained: TrainedField
    matter: Slices
    safe_steps: UInt8[Tensor, "x y z"]
    color: Slices
    shell: Float[Tensor, "3 n"]
    labels: UInt8[Tensor, "red green blue"] | None
    paints: Float[Tensor, "colors 3"]

    @classmethod
    @torch.no_grad()
    def of(cls, trained: TrainedField) -> Baked:
        """Return the field, read at the voxels where the hull leaves anything."""
        hull = trained.hull
        read = grow(hull.near, 1)
        cells = read.reshape(-1).nonzero()[:, 0]

        def look(chunk: Int[Tensor, " n"]) -> tuple[Tensor, Tensor]:
            per_unit, color = trained.field(_middles(hull, chunk))
            return _unsoftened(per_unit * trained.step), color

        found = side_by_side([partial(look, chunk) for chunk in cells.split(POINTS_PER_CHUNK)])
        depth, color = (torch.cat(parts) for parts in zip(*found, strict=True))
        surface = (hull.inside & grow(~hull.inside, 1)).reshape(-1)
        paints = _paints(trained.classifier, color[surface[cells]])

        def matter() -> Slices:
            density = torch.zeros(read.numel()).index_copy_(0, cells, depth).view(read.shape)
            parts = (np.pad(density, 1, mode="edge"), np.pad(hull.support, 1))
            count = len(parts[0])
            return Slices.of(
                lambda x: cv2.merge([part[at % count] for at in (x, x + 1) for part in parts]),
                count,
            )

        def colors() -> Slices:
            levels = torch.full((read.numel(), 4), 255, dtype=torch.uint8)
            levels[cells, :3] = color.mul_(255).round_().byte()
            volume = np.pad(levels.view(*read.shape, 4), [(1, 1)] * 3 + [(0, 0)], mode="edge")
            return Slices.of(lambda x: volume[x], len(volume))

        def labels() -> UInt8[Tensor, "red green blue"] | None:
            return None if trained.classifier is None else label_table(trained.classifier)

        tasks: list[Callable[[], Any]] = [  # large ones first, in turn for either side
            *(matter, partial(_leaps, hull, trained.step), colors),
            *(partial(_shell, hull.near), labels),
        ]
        slices, safe_steps, shades, shell, table = side_by_side(tasks)
        return cls(trained, slices, safe_steps, shades, shell, table, paints)

    def leap(self, place: Float[Tensor, "3 n"]) -> Float[Tensor, " n"]:
        """Return `safe_steps` at places; outside of the hull's box, of the nearest voxel."""
        most = torch.tensor(self.safe_steps.shape)[:, None] - 1.0
        cell = torch.minimum((place - 0.5).clamp_min_(0), most).int()
        strides = torch.tensor(self.safe_steps.stride(), dtype=torch.int32)[:, None]
        index = (cell * strides).sum(dim=0, dtype=torch.int32)
        return self.safe_steps.view(-1).index_select(0, index).float()

    def optical_depth(self, place: Float[Tensor, "3 steps n"]) -> Float[Tensor, "steps n"]:
        """Return a step's optical depth at places, which are clamped to the hull in place."""
        number, part, y, z = self._split(place)
        found = self.matter.at(number, y, z)
        density = torch.lerp(found[..., 0], found[..., 2], part)
        support = torch.lerp(found[..., 1], found[..., 3], part)
        occupied = occupancy(F.threshold(support, EDGE, 0.0, inplace=True))
        return F.softplus(density).mul_(occupied)

    def rgb(self, place: Float[Tensor, "3 steps n"]) -> Float[Tensor, "3 steps n"]:
        """Return colour in [0, 1] at places, which are clamped to the hull in place."""
        number, part, y, z = self._split(place)
        here, there = (
            torch.empty_like(place).copy_(self.color.at(number + i, y, z).permute(2, 0, 1)[:3])
            for i in (0, 1)
        )
        return here.lerp_(there, part).mul_(1 / 255)

    def _split(self, place: Float[Tensor, "3 steps n"]) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return the slice before each place, how far it is towards the next, and y, z there."""
        most = torch.tensor(self.safe_steps.shape)[:, None, None] + (1 - 1e-3)
        x, y, z = torch.minimum(place, most, out=place.clamp_min_(0))
        number = x.floor()
        return number, x.sub_(number), y, z


@dataclass(frozen=True, eq=False)
class Slices:
    """A volume's slices of constant x in one picture, and how to read in it.

    Attributes:
        picture: the slices below and beside each other.
        rows: slices below each other.
        size: (height, width) of a slice.
    """

    picture: Shaped[np.ndarray, "height width 4"]
    rows: int
    size: tuple[int, int]

    @classmethod
    def of(
        cls, slice_at: Callable[[int], Shaped[np.ndarray, "height width 4"]], count: int
    ) -> Slices:
        """Return so many slices in about a square."""
        first = slice_at(0)
        y, z = first.shape[:2]
        rows = min(count, max(1, round(math.sqrt(count * z / y))))
        picture = np.zeros((rows, y, -(-count // rows), z, 4), dtype=first.dtype)
        for number in range(count):
            column, row = divmod(number, rows)
            picture[row, :, column] = slice_at(number)
        return cls(picture.reshape(rows * y, -1, 4), rows, (y, z))

    def at(
        self, number: Float[Tensor, "h w"], y: Float[Tensor, "h w"], z: Float[Tensor, "h w"]
    ) -> Shaped[Tensor, "h w 4"]:
        """Return what is at y, z in the slices of these whole numbers, bilinear."""
        column = ((number + 0.5) * (1 / self.rows)).floor_()
        row = torch.sub(number, column, alpha=self.rows)
        u = torch.add(z, column, alpha=self.size[1])
        v = torch.add(y, row, alpha=self.size[0])
        return torch.from_numpy(cv2.remap(self.picture, u.numpy(), v.numpy(), cv2.INTER_LINEAR))


def _leaps(hull: Hull, step: float) -> UInt8[Tensor, "x y z"]:
    """Return the steps from every voxel to where the next sample may be.

    A voxel whose nearest neighbour that may hold one is n voxels away, along the axis on which it
    is most, has n - 1 voxels without any round it.
    """
    away, cells = torch.zeros(hull.near.shape, dtype=torch.uint8), hull.near.byte()
    for _ in range(MOST_CLEAR):
        away += 1 - cells
        cells = grow(cells, 1)
    return ((away.float() - 1) * (hull.voxel / step)).floor_().add_(1).clamp_(0, 255).byte()


def _shell(near: Bool[Tensor, "x y z"]) -> Float[Tensor, "3 n"]:
    beyond = grow(F.pad(~near, (1,) * 6, value=True), 1)[1:-1, 1:-1, 1:-1]
    return (near & beyond).nonzero().T + 1.0


def _paints(
    classifier: PaletteClassifier | None, shown: Float[Tensor, "n 3"]
) -> Float[Tensor, "colors 3"]:
    """Return the median of all colours with each label, nan for unused labels."""
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
