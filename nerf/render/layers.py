"""Layers of a rendering as 8-bit pictures."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8

from toonset.errors import PaletteError
from toonset.nerf.fields.trained_field import NO_PALETTE
from toonset.nerf.render.line_drawing import inked
from toonset.nerf.render.views import Rendering


def color_picture(
    premultiplied: Float[np.ndarray, "height width 3"], alpha: Float[np.ndarray, "height width"]
) -> UInt8[np.ndarray, "height width 4"]:
    """Return premultiplied colour as 8-bit RGBA with straight alpha."""
    visible = alpha > 0
    color = premultiplied / np.where(visible, alpha, 1)[..., None]
    return _bytes(np.concatenate([color * visible[..., None], alpha[..., None]], axis=-1))


def palette_picture(
    rendering: Rendering, palette: UInt8[np.ndarray, "colors 3"] | None
) -> UInt8[np.ndarray, "height width 4"]:
    """Return the view in palette colours only; pixels on borders mix the colours they cover.

    Raises:
        PaletteError: the run was trained without palette.
    """
    if rendering.shares is None or palette is None:
        raise PaletteError(NO_PALETTE)
    color = rendering.shares @ (palette / 255.0)
    if rendering.ink is not None and rendering.ink_rgb is not None:
        color = inked(color, rendering.alpha, rendering.ink, rendering.ink_rgb)
    return color_picture(color, rendering.alpha)


def depth_picture(rendering: Rendering) -> UInt8[np.ndarray, "height width 4"]:
    """Return depth as grey, the nearest point white and the farthest black, with alpha."""
    depth, seen = rendering.depth, np.isfinite(rendering.depth)
    near = float(depth[seen].min()) if seen.any() else 0.0
    extent = float(depth[seen].max()) - near if seen.any() else 0.0
    grey = 1 - (np.where(seen, depth, near) - near) / (extent or 1.0)
    return _bytes(np.dstack([grey, grey, grey, np.where(seen, rendering.alpha, 0)]))


def alpha_picture(rendering: Rendering) -> UInt8[np.ndarray, "height width 4"]:
    """Return opacity as opaque grey."""
    alpha = rendering.alpha
    return _bytes(np.dstack([alpha, alpha, alpha, np.ones_like(alpha)]))


def ink_picture(rendering: Rendering) -> UInt8[np.ndarray, "height width 4"]:
    """Return the contour lines alone, in their colour; nothing where there are none."""
    if rendering.ink is None or rendering.ink_rgb is None:
        return np.zeros((*rendering.alpha.shape, 4), dtype=np.uint8)
    color = np.array(rendering.ink_rgb) / 255.0
    return color_picture(rendering.ink[..., None] * color, rendering.ink)


def label_picture(rendering: Rendering) -> UInt8[np.ndarray, "height width"]:
    """Return the label map, 255 where nothing is seen.

    Raises:
        PaletteError: the run was trained without palette.
    """
    if rendering.labels is None:
        raise PaletteError(NO_PALETTE)
    return rendering.labels


def _bytes(values: Float[np.ndarray, "height width 4"]) -> UInt8[np.ndarray, "height width 4"]:
    return (values.clip(0, 1) * 255 + 0.5).astype(np.uint8)
