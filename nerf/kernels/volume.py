"""Apply linear operations to volumes, and their transposes."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from jaxtyping import Float, Int
from torch import Tensor

Volume = Float[Tensor, "x y z"]


def trilinear(
    at: Float[Tensor, "n 3"], shape: torch.Size
) -> tuple[Int[Tensor, "n 8"], Float[Tensor, "n 8"]]:
    """Return the voxels round points and their weights; beyond the centres the border goes on."""
    most = torch.tensor(shape) - 1
    at = at.clamp_min(0).minimum(most)
    corner = at.floor().minimum((most - 1).clamp_min(0))
    x, y, z = (torch.stack([1 - part, part]) for part in (at - corner).unbind(1))
    weights = torch.einsum("an,bn,cn->nabc", x, y, z).reshape(-1, 8).contiguous()
    bits = torch.cartesian_prod(*[torch.arange(2)] * 3)
    i, j, k = (corner.long()[:, None] + bits).minimum(most).unbind(2)
    return (i * shape[1] + j) * shape[2] + k, weights


def along_axes(volume: Tensor, matrices: Sequence[Tensor]) -> Tensor:
    """Return the volume with each axis multiplied by a matrix."""
    x, y, z = matrices
    if len(x) == len(x.T) and len(y) == len(y.T) and len(z) == len(z.T):
        return volume  # the finest level: all three are the identity
    volume = y @ (volume @ z.T)
    return (x @ volume.reshape(len(volume), -1)).view(len(x), *volume.shape[1:])


def inner(volume: Volume) -> Volume:
    """Return a view of the voxels that have all six neighbours."""
    return volume[1:-1, 1:-1, 1:-1]


def around(volume: Volume) -> list[Tensor]:
    """Return views of the six neighbours of the inner voxels."""
    beside, same = (slice(2, None), slice(None, -2)), slice(1, -1)
    places = [(part, same, same) for part in beside]
    places += [(same, part, same) for part in beside] + [(same, same, part) for part in beside]
    return [volume[place] for place in places]


def laplacian(f: Volume) -> Volume:
    """Return the sum of the six neighbours less six times the voxel, without the border."""
    total = inner(f) * -6
    for neighbour in around(f):
        total += neighbour
    return total


def add_bending(gradient: Volume, f: Volume, weights: Tensor) -> None:
    """Add half the gradient of the sum of weights times the squared Laplacian of f."""
    bent = laplacian(f).mul_(weights)
    inner(gradient).sub_(bent, alpha=6)
    for neighbour in around(gradient):
        neighbour += bent
