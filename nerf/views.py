"""Rendering new views of a trained field.

One ray goes through every pixel that may show the figure, more through pixels on borders: outlines,
folds, where one colour meets the next. Outlines are soft through the hull's occupancy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from toonset.camera import Camera
from toonset.nerf.ink import InkStyle
from toonset.nerf.ink_redraw import draw_ink, ink_scale, inked
from toonset.nerf.losses import straight
from toonset.nerf.march import pixels_near, rays_of
from toonset.nerf.supersample import borders, places_within
from toonset.nerf.trained import TrainedField
from toonset.nerf.views_bake import Baked
from toonset.nerf.views_cast import cast
from toonset.palette.labels import UNLABELLED

RAYS_PER_CHUNK = 1 << 12  # that get labels together
SEEN_FROM = 0.5  # opacity from which a pixel has a depth and a label


@dataclass(frozen=True, eq=False)
class Rendering:
    """One rendered view.

    Attributes:
        rgb: (height, width, 3) premultiplied colour in [0, 1].
        alpha: (height, width) opacity in [0, 1].
        depth: (height, width) mean distance past the plane through the camera's target, world
            units; nan where nothing is seen.
        labels: (height, width) most frequent palette label, 255 where nothing is seen; None
            without palette.
        shares: (height, width, colors) share of a pixel that each palette colour covers
            (premultiplied by alpha); None without palette.
        ink: (height, width) share of a pixel that contour lines cover, already part of `rgb`; None
            where the drawings have no lines.
        ink_rgb: sRGB of the lines; None without.
    """

    rgb: Float[np.ndarray, "height width 3"]
    alpha: Float[np.ndarray, "height width"]
    depth: Float[np.ndarray, "height width"]
    labels: UInt8[np.ndarray, "height width"] | None
    shares: Float[np.ndarray, "height width colors"] | None
    ink: Float[np.ndarray, "height width"] | None = None
    ink_rgb: tuple[int, int, int] | None = None


@torch.no_grad()
def render(source: TrainedField | Baked, camera: Camera) -> Rendering:
    """Return the view of `camera`, orthographic or pinhole, of any size.

    Contour lines that were taken off the drawings are drawn again, as wide as there.

    Args:
        source: a trained field; several views are faster from one `Baked.of(field)`.
        camera: where it is seen from.
    """
    baked = source if isinstance(source, Baked) else Baked.of(source)
    width, height = camera.size_wh
    near = torch.as_tensor(pixels_near(camera, baked.trained.hull))
    first = _cast(baked, camera, camera.pixel_grid()[near.numpy()])
    table = torch.zeros(height, width, first.shape[1])
    table[near] = first
    border = borders(table[..., [0, 1, 2, 3, *range(5, first.shape[1])]])
    places = places_within(border.numpy())
    more = _cast(baked, camera, places.reshape(-1, 2))
    table[border] = more.view(*places.shape[:2], table.shape[2]).mean(dim=1)
    return _with_lines(_rendering(table.numpy()), baked.trained.ink, camera)


def _with_lines(view: Rendering, style: InkStyle | None, camera: Camera) -> Rendering:
    if style is None:
        return view
    ink = draw_ink(view, style, ink_scale(camera, style))
    return replace(
        view, rgb=inked(view.rgb, view.alpha, ink, style.rgb), ink=ink, ink_rgb=style.rgb
    )


def _cast(baked: Baked, camera: Camera, pixels: Float[np.ndarray, "n 2"]) -> Tensor:
    """Return rays' premultiplied colour, opacity, depth times opacity, and share of each label."""
    rays = rays_of(camera, pixels, baked.trained.hull)
    seen = cast(baked, rays)
    forward = torch.as_tensor(np.array(camera.rotation[2]), dtype=torch.float32)
    offset = float(np.array(camera.rotation[2]) @ camera.target)
    # distance is opacity-weighted, hence the opacity before the constant parts
    seen[:, 4] *= rays.directions @ forward
    seen[:, 4] += seen[:, 3] * (rays.origins @ forward - offset)
    return torch.cat([seen, _shares(baked.trained, seen[:, :3], seen[:, 3])], dim=1)


def _shares(
    trained: TrainedField, color: Float[Tensor, "rays 3"], opacity: Float[Tensor, " rays"]
) -> Float[Tensor, "rays colors"]:
    """Return each ray's opacity in the column of its label; no column without palette."""
    if trained.classifier is None or trained.palette is None:
        return torch.zeros(len(color), 0)
    shares = torch.zeros(len(color), len(trained.palette))
    for hit in (opacity > 0).nonzero()[:, 0].split(RAYS_PER_CHUNK):
        label = trained.classifier(straight(color[hit], opacity[hit])).argmax(dim=1)
        shares[hit, label] = opacity[hit]
    return shares


def _rendering(mean: Float[np.ndarray, "height width columns"]) -> Rendering:
    alpha = mean[..., 3].clip(0, 1)
    seen = alpha >= SEEN_FROM
    depth = np.where(seen, mean[..., 4] / np.where(seen, alpha, 1), np.nan)
    shares = mean[..., 5:]
    if not shares.shape[2]:
        return Rendering(mean[..., :3], alpha, depth, None, None)
    labels = np.where(seen, shares.argmax(axis=-1), UNLABELLED).astype(np.uint8)
    return Rendering(mean[..., :3], alpha, depth, labels, shares)
