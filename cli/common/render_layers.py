"""The pictures that `toonset render` writes of one view, by the names of layers."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import UInt8

    from toonset.camera import Camera
    from toonset.nerf.fields.trained_field import TrainedField
    from toonset.nerf.render.depth_levels import DepthLevels
    from toonset.nerf.render.views import Rendering

    Picture = UInt8[np.ndarray, "height width 4"]
    Layer = UInt8[np.ndarray, "height width *channels"]

LAYER_NAMES = ("rgb", "palette", "depth", "labels", "alpha", "ink", "normal", "normal-camera")
BENT = ("rgb", "palette", "labels")  # layers that --as-drawn bends


def encoded(
    trained: TrainedField, view: Rendering, camera: Camera, layer: str, levels: DepthLevels
) -> tuple[bytes, Picture]:
    """Return the PNG of a view's layer, and the picture that a GIF shows.

    Labels are an indexed PNG, depth is grey of 16 bits on the scale of `levels`; all else is RGBA.
    """
    from toonset.dataset.images.picture import encode_grey_png, encode_indexed_png, encode_png

    picture = _layer(trained, view, camera, layer)
    if layer == "depth":
        return encode_grey_png(levels.picture(view.depth)), picture
    if layer != "labels":
        return encode_png(picture), picture
    assert trained.palette is not None  # label_picture has refused a run without palette
    return encode_indexed_png(picture, trained.palette), _in_colors(picture, trained.palette)


def _layer(trained: TrainedField, view: Rendering, camera: Camera, layer: str) -> Layer:
    """Return one layer of a view as RGBA, or as a label map."""
    from toonset.nerf.prepare.warp_back import give_back
    from toonset.nerf.render import layers
    from toonset.nerf.render.normals import normal_picture

    made: dict[str, Callable[[], Layer]] = {
        "rgb": lambda: layers.color_picture(view.rgb, view.alpha),
        "palette": lambda: layers.palette_picture(view, trained.palette),
        "labels": lambda: layers.label_picture(view),
        "depth": lambda: layers.depth_picture(view),
        "alpha": lambda: layers.alpha_picture(view),
        "ink": lambda: layers.ink_picture(view),
        "normal": lambda: normal_picture(view, camera, in_camera=False),
        "normal-camera": lambda: normal_picture(view, camera, in_camera=True),
    }
    picture = made[layer]()
    if trained.keys is None or layer not in BENT:
        return picture
    return give_back({layer: picture}, camera, trained.keys)[layer]


def _in_colors(
    labels: UInt8[np.ndarray, "height width"], palette: UInt8[np.ndarray, "colors 3"]
) -> Picture:
    import numpy as np

    from toonset.palette.pixels.labels import UNLABELLED

    colors = np.concatenate([palette, np.zeros((256 - len(palette), 3), np.uint8)])[labels]
    return np.dstack([colors, np.where(labels == UNLABELLED, 0, 255).astype(np.uint8)])
