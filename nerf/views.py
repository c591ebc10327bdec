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
from toonset.nerf.march import pixels_near, rays_of
from toonset.nerf.supersample import borders, places_within
from toonset.nerf.trained import TrainedField
from toonset.nerf.views_bake import Baked
from toonset.nerf.views_cast import cast
from toonset.nerf.views_labels import NONE, labels_of, palette_shares
from toonset.palette.labels import UNLABELLED

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
    trained = baked.trained
    width, height = camera.size_wh
    near = torch.as_tensor(pixels_near(camera, trained.hull))
    seen, labels = torch.zeros(height, width, 5), torch.full((height, width), NONE)
    seen[near] = _cast(baked, camera, camera.pixel_grid()[near.numpy()])
    if trained.classifier is not None:
        labels[near] = labels_of(trained.classifier, seen[near][:, :3], seen[near][:, 3])
    border = borders(seen[..., :4].numpy(), labels.numpy())
    places = places_within(border)
    more = _cast(baked, camera, places.reshape(-1, 2)).view(*places.shape[:2], 5)
    chosen, shares = torch.as_tensor(border), None
    if trained.classifier is not None:
        shares = palette_shares(trained.classifier, baked.paints, seen, labels, chosen, more)
    seen[chosen] = more.mean(dim=1)
    view = _rendering(seen.numpy(), None if shares is None else shares.numpy())
    return _with_lines(view, trained.ink, camera)


def _with_lines(view: Rendering, style: InkStyle | None, camera: Camera) -> Rendering:
    if style is None:
        return view
    ink = draw_ink(view, style, ink_scale(camera, style))
    return replace(
        view, rgb=inked(view.rgb, view.alpha, ink, style.rgb), ink=ink, ink_rgb=style.rgb
    )


def _cast(baked: Baked, camera: Camera, pixels: Float[np.ndarray, "n 2"]) -> Float[Tensor, "n 5"]:
    """Return rays' premultiplied colour, opacity, and depth times opacity."""
    rays = rays_of(camera, pixels, baked.trained.hull)
    seen = cast(baked, rays)
    forward = torch.as_tensor(np.array(camera.rotation[2]), dtype=torch.float32)
    offset = float(np.array(camera.rotation[2]) @ camera.target)
    # distance is opacity-weighted, hence the opacity before the constant parts
    seen[:, 4] *= rays.directions @ forward
    seen[:, 4] += seen[:, 3] * (rays.origins @ forward - offset)
    return seen


def _rendering(
    mean: Float[np.ndarray, "height width 5"],
    shares: Float[np.ndarray, "height width colors"] | None,
) -> Rendering:
    alpha = mean[..., 3].clip(0, 1)
    seen = alpha >= SEEN_FROM
    depth = np.where(seen, mean[..., 4] / np.where(seen, alpha, 1), np.nan)
    labels = None
    if shares is not None:
        labels = np.where(seen, shares.argmax(axis=-1), UNLABELLED).astype(np.uint8)
    return Rendering(mean[..., :3], alpha, depth, labels, shares)
