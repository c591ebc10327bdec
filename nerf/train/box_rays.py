"""Sample rays through a box without a hull: classic stratified volume rendering.

Every step draws its samples anew, one per bin of equal length, so nothing can be computed before.
Source: Mildenhall et al., "NeRF", 2020, equations 2 and 3.
"""

from __future__ import annotations

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor

from toonset.dataset.bundle.scene import Scene
from toonset.dataset.silhouettes.bounds import Box, box_of_masks
from toonset.dataset.silhouettes.mask import OPAQUE, has_figure, mask_of
from toonset.nerf.fields.base import Field, Places
from toonset.nerf.hull.hull import Hull
from toonset.nerf.hull.march import Rays, clip, rays_of
from toonset.nerf.train.batches import Batch
from toonset.nerf.train.loss import Model, Weights
from toonset.palette.pixels.labels import UNLABELLED

VOXELS = 96  # of the box, in the map of empty space that rendering skips
BINS = 96  # along a ray through the box
RAYS_PER_STEP = 1024
EMPTY_BELOW = 0.01  # opacity of a voxel that rendering skips
POINTS_PER_CHUNK = 1 << 16
OPACITY_WEIGHT = 0.25  # 3 colours' variance of 1/12: see `any_backdrop`
# By which softplus's argument starts lower, for rays to see through the whole box at first: fields
# start as a mist which suits a thin hull; 0.002 per cell instead of 0.1
CLEARER = 4.0


def any_backdrop(palette: float, smoothness: float) -> Weights:
    """Return the loss's weights that stand for pictures over a random colour.

    The expected squared error over all backdrops is that over middle grey, plus the squared error
    of opacity times the backdrops' variance. Over white alone, mist as white as the paper serves as
    well as nothing, and hides the figure from other sides.
    """
    return Weights(palette, smoothness, backdrop=0.5, opacity=OPACITY_WEIGHT)


class BoxRays:
    """The rays of all pixels that meet the box, background too."""

    def __init__(
        self, scene: Scene, hull: Hull, seed: int, generator: torch.Generator, parts: int = 1
    ) -> None:
        """Lay out the rays in an order drawn by `generator`; `seed` draws the samples.

        Args:
            scene: the drawings.
            hull: the box.
            seed: of the samples.
            generator: shuffles the rays.
            parts: batches of a step, which may be rendered side by side.
        """
        rays, rgb, alpha, labels = _pixels(scene, hull)
        near, far = clip(rays, hull)
        meets = (far > near).nonzero()[:, 0]
        order = meets[torch.randperm(len(meets), generator=generator)]
        self._rays, self._near, self._far = rays.at(order), near[order], far[order]
        self._rgb, self._alpha, self._labels = rgb[order], alpha[order], labels[order]
        self._seed, self._parts = seed, parts
        self._device = torch.device("cpu")

    def __len__(self) -> int:
        """Return how many steps go through all rays once."""
        return max(1, len(self._near) // RAYS_PER_STEP)

    @property
    def rays(self) -> int:
        """Return how many rays there are."""
        return len(self._near)

    def to(self, device: torch.device) -> BoxRays:
        """Let batches come on a device."""
        self._device = device
        return self

    def batches(self, index: int, step: int) -> tuple[Batch, ...]:
        """Return a step's rays with samples of its own."""
        part = torch.arange(index, self.rays, len(self))
        generator = torch.Generator().manual_seed((self._seed << 32) + step)
        shift = torch.rand(len(part), BINS, generator=generator)
        pairs = zip(part.chunk(self._parts), shift.chunk(self._parts), strict=True)
        return tuple(self._batch(*pair) for pair in pairs)

    def _batch(self, part: Int[Tensor, " rays"], shift: Float[Tensor, "rays bins"]) -> Batch:
        near, far = self._near[part, None], self._far[part, None]
        distance = near + (far - near) / BINS * (torch.arange(BINS) + shift)
        rays = self._rays.at(part)
        origins, directions = (a.T.contiguous() for a in (rays.origins, rays.directions))
        points = origins[..., None] + directions[..., None] * distance  # axis by axis
        return Batch(
            Places(points.view(3, -1).T),
            torch.arange(len(part)).repeat_interleave(BINS),
            torch.cat([distance, far], dim=1).diff(dim=1).view(-1),
            self._rgb[part],
            self._alpha[part],
            self._labels[part],
            even=True,
        ).to(self._device)

    def after(self, step: int, model: Model) -> None:
        """Do nothing: samples are drawn anew for every step."""


def open_box(scene: Scene) -> Hull:
    """Return the box round the figure, full everywhere: no silhouette is carved."""
    frames = [frame for frame in scene.frames if has_figure(frame)]
    masks = [mask_of(frame.rgba) for frame in frames]
    return full_hull(box_of_masks([frame.camera for frame in frames], masks))


def full_hull(box: Box) -> Hull:
    """Return a hull that fills a cube."""
    return Hull(box.low, float(box.size.max()) / VOXELS, torch.ones(VOXELS, VOXELS, VOXELS))


@torch.no_grad()
def without_empty_space(hull: Hull, field: Field) -> Hull:
    """Empty the hull's voxels in and round which the field is empty."""
    counts = hull.support.shape
    centres = [(torch.arange(n) + 0.5) * hull.voxel for n in counts]
    points = torch.cartesian_prod(*centres) + torch.as_tensor(hull.low, dtype=torch.float32)
    density = torch.cat([field(part)[0] for part in points.split(POINTS_PER_CHUNK)])
    filled = (1 - torch.exp(-density * hull.voxel) >= EMPTY_BELOW).view(1, 1, *counts).float()
    grown = F.max_pool3d(filled, 3, stride=1, padding=1)[0, 0]
    return Hull(hull.low, hull.voxel, grown)


def _pixels(
    scene: Scene, hull: Hull
) -> tuple[Rays, Float[Tensor, "n 3"], Float[Tensor, " n"], Int[Tensor, " n"]]:
    rays, rgba, labels = [], [], []
    for frame in scene.frames:
        rays.append(rays_of(frame.camera, frame.camera.pixel_grid().reshape(-1, 2), hull))
        rgba.append(torch.as_tensor(frame.rgba.reshape(-1, 4) / np.float32(255)))
        labels.append(torch.as_tensor(nearest_labels(frame.rgba, scene.palette)))
    parts = ([getattr(r, name) for r in rays] for name in ("origins", "directions", "start"))
    colors = torch.cat(rgba)
    return Rays(*map(torch.cat, parts)), colors[:, :3], colors[:, 3], torch.cat(labels)


def nearest_labels(rgba: np.ndarray, palette: np.ndarray | None) -> Int[np.ndarray, " pixels"]:
    """Return the nearest palette colour by L2 in RGB of every pixel of the figure, row by row."""
    pixels = rgba.reshape(-1, 4).astype(np.int64)
    if palette is None:
        return np.full(len(pixels), UNLABELLED)
    distances = [np.square(pixels[:, :3] - color).sum(axis=1) for color in palette.astype(np.int64)]
    return np.where(pixels[:, 3] >= OPAQUE, np.argmin(distances, axis=0), UNLABELLED)
