"""Draw what a page shows from each of its views: a trained figure, or a plain body."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import cv2
import numpy as np
from jaxtyping import UInt8

from toonset.camera import Camera
from toonset.dataset.mesh.rasterize import depth_and_normals
from toonset.mesh import Mesh
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.kernels.threads import side_by_side
from toonset.nerf.layered_views.layered import layered, layered_shares
from toonset.nerf.layered_views.records import layered_record, origins_record, picture_record
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.look.outline import Outline
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.layers import Rendering, default_layer
from toonset.nerf.render.views import baked_of, render

LAYERS = ("drawn", "rgb", "palette", "normal", "depth")
SHRINK = 2  # pixels of the layer that is seen at first for one of the others
BODY, AMBIENT = (158, 178, 204), 0.55  # sRGB of a plain body, and its light from everywhere
LIGHT = np.array([-0.4, -0.6, -0.7]) / np.linalg.norm([-0.4, -0.6, -0.7])  # camera axes
FINER = 2  # samples of a body per pixel and axis

Record = dict[str, Any]


def layers_of(trained: TrainedField) -> list[str]:
    """Return the layers that a figure's page has, the first at the start."""
    missing = set() if trained.drawings is not None else {"drawn"}
    missing |= set() if trained.palette is not None else {"palette"}
    layers = [layer for layer in LAYERS if layer not in missing]
    return sorted(layers, key=lambda layer: layer != default_layer(trained))


def paints_and_pen(drawings: Drawings) -> tuple[UInt8[np.ndarray, "paints 3"], Outline | None]:
    """Return the paints that a page knows beside its lines', and the pen that draws these."""
    return (drawings.paints if drawings.pen is None else drawings.palette), drawings.pen


def figure_sights(
    trained: TrainedField, cameras: Sequence[Camera], layered: Sequence[bool], ready: Rendering
) -> list[Record]:
    """Return a record of each layer that each camera has: see `page/types.js`.

    Args:
        trained: the figure.
        cameras: of the views.
        layered: which of them have all layers; the others have the first.
        ready: the view of one of these cameras, which is not made again.
    """
    layers, baked = layers_of(trained), baked_of(trained)
    return side_by_side(
        [
            partial(
                _sight,
                baked,
                partial(render, baked, camera) if camera is not ready.camera else lambda: ready,
                layers if all_of_them else layers[:1],
            )
            for camera, all_of_them in zip(cameras, layered, strict=True)
        ]
    )


def body_sights(mesh: Mesh, cameras: Sequence[Camera]) -> list[Record]:
    """Return the record of a plain body that each camera has."""
    return side_by_side([partial(_body_sight, mesh, camera) for camera in cameras])


def body_picture(mesh: Mesh, camera: Camera) -> UInt8[np.ndarray, "height width 4"]:
    """Return a body in plain light."""
    _, normal = depth_and_normals(mesh.vertices, mesh.faces, camera.resized(FINER))
    hit = (normal != 0).any(axis=-1)
    light = np.where(hit, AMBIENT + (1 - AMBIENT) * (normal @ LIGHT).clip(0, 1), 0)
    fine = np.dstack([light, hit]).astype(np.float32)
    mean = cv2.resize(fine, camera.size_wh, interpolation=cv2.INTER_AREA)
    straight = mean[..., :1] / np.maximum(mean[..., 1:], 1e-6) * np.array(BODY)
    return np.rint(np.dstack([straight, 255 * mean[..., 1]])).clip(0, 255).astype(np.uint8)


def _sight(baked: Baked, made: Callable[[], Rendering], layers: Sequence[str]) -> Record:
    """Return the layers of a view, the first at its size and the others SHRINK times smaller."""
    view = made()
    small = render(baked, view.camera.resized(1 / SHRINK))
    return {
        layers[0]: _layer(view, layers[0]),
        **{layer: _small_layer(small, layer) for layer in layers[1:]},
    }


def _layer(view: Rendering, layer: str) -> Record | None:
    drawings = view.field.drawings
    if layer != "drawn" or drawings is None:
        return picture_record(view.picture(layer))
    paints, pen = paints_and_pen(drawings)
    if pen is not None:
        finer = view.camera.scale / min(one.camera.scale for one in drawings.views)
        pen = replace(pen, width_px=pen.width_px * finer)
    shaded = bool(drawings.ramps)
    found = layered(view.drawn, paints, pen, drawings.drawn_shadow, shaded=shaded)
    record = layered_record(found)
    if found is None or record is None:
        return None
    return {**record, "origins": origins_record(view.drawn, found)}


def _small_layer(small: Rendering, layer: str) -> Record | None:
    """Return a layer of a small view."""
    if layer == "palette" and small.shares is not None:
        return layered_record(layered_shares(small.shares, small.alpha), SHRINK)
    return picture_record(small.picture(layer), SHRINK)


def _body_sight(mesh: Mesh, camera: Camera) -> Record:
    return {"mannequin": picture_record(body_picture(mesh, camera))}
