"""Giving the bends back: a rendering that looks drawn again.

A sheet's drawings were unbent to train on; a key view comes out as it was drawn when the inverse
of its bend is applied to the rendering. In between, the two nearest key views' inverses are
blended by angle, so a cheat (ears that always face the viewer) goes over from one drawing's to
the next one's.

Source: Rademacher, "View-dependent geometry", 1999, with 2D bends for 3D ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from jaxtyping import Float, Shaped

from toonset.camera import Camera
from toonset.nerf.prepare.unwarp import Warp, resampled, resampled_labels

SAME = 1e-6  # radians: closer cameras look from one side
NEIGHBOURS = 2.1  # radians: views farther apart (front and back) show nothing in common
Key = TypeVar("Key")


@dataclass(frozen=True, eq=False)
class KeyWarps:
    """The bends of a sheet's key views.

    Attributes:
        cameras: of the key views, in pixels of their drawings.
        warps: what was taken out of each drawing.
        middle: (3,) world point about which the figure stands.
    """

    cameras: tuple[Camera, ...]
    warps: tuple[Warp, ...]
    middle: Float[np.ndarray, " 3"]

    @property
    def is_none(self) -> bool:
        """Return whether nothing is given back anywhere."""
        return all(warp.is_none for warp in self.warps)


def give_back(
    layers: Mapping[Key, Shaped[np.ndarray, "height width *channels"]],
    camera: Camera,
    keys: KeyWarps,
) -> dict[Key, Shaped[np.ndarray, "height width *channels"]]:
    """Return a rendering's pictures, bent as the nearest key views were drawn.

    Args:
        layers: RGBA pictures (height, width, 4) or label maps (height, width), rendered by
            `camera`.
        camera: any.
        keys: of the sheet.
    """
    if keys.is_none:
        return dict(layers)
    grid = camera.pixel_grid()
    moves = bends_back(grid.reshape(-1, 2), camera, keys).reshape(grid.shape)
    return {name: _taken(layer, grid + moves) for name, layer in layers.items()}


def bends_back(
    pixels: Float[np.ndarray, "n 2"], camera: Camera, keys: KeyWarps
) -> Float[np.ndarray, "n 2"]:
    """Return the displacement at pixels of a new view, in its pixels."""
    moves = np.zeros_like(pixels)
    here, scale = _middle_in(camera, keys.middle)
    for share, key, warp in zip(view_shares(camera, keys), keys.cameras, keys.warps, strict=True):
        if share > 0 and not warp.is_none:
            there, key_scale = _middle_in(key, keys.middle)
            ratio = key_scale / scale
            moves += share / ratio * warp.back(there + ratio * (pixels - here))
    return moves


def view_shares(camera: Camera, keys: KeyWarps) -> Float[np.ndarray, " views"]:
    """Return how much of each key view's bend a camera gets: 1 at the view, 0 at the next one.

    Between two neighbours the shares are linear in the angle and sum to 1; off the arc between
    them (from above, past the last drawing) their sum falls, as nothing was drawn there.
    """
    forward = camera.rotation[2]
    keyward = np.stack([key.rotation[2] for key in keys.cameras])
    angles = _angle(keyward @ forward)
    shares = np.zeros(len(angles))
    first = int(angles.argmin())
    if angles[first] < SAME:
        shares[first] = 1
        return shares
    sideways = keyward - (keyward @ forward)[:, None] * forward
    apart = _angle(keyward @ keyward[first])
    across = (sideways @ sideways[first] < 0) & (apart < NEIGHBOURS)
    if not across.any():
        shares[first] = max(0.0, float(np.cos(angles[first])))
        return shares
    second = int(np.where(across, angles, np.inf).argmin())
    total = angles[first] + angles[second]
    shares[first], shares[second] = angles[second] / total, angles[first] / total
    return shares * min(1.0, apart[second] / total)


def _angle(cosine: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    return np.arccos(np.clip(cosine, -1, 1))


def _middle_in(camera: Camera, middle: Float[np.ndarray, " 3"]) -> tuple[np.ndarray, float]:
    """Return the middle's pixel and the pixels per world unit there."""
    pixels, depth, _ = camera.project(middle[None])
    return pixels[0], camera.scale / (1 + camera.k * float(depth[0]))


def _taken(
    layer: Shaped[np.ndarray, "height width *channels"], places: Float[np.ndarray, "height width 2"]
) -> Shaped[np.ndarray, "height width *channels"]:
    return resampled_labels(layer, places) if layer.ndim == 2 else resampled(layer, places)
