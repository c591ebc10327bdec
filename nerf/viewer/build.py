"""A run, and the bundle beside it, to a page."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from toonset.dataset.bundle.calibration_file import read_calibration
from toonset.errors import ToonsetError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.kernels.threads import side_by_side
from toonset.nerf.render.layers import color_picture, default_layer
from toonset.nerf.render.turntable import FILL, turntable
from toonset.nerf.render.views import render
from toonset.nerf.viewer.scene import Blob, camera_record, drawings_record, field_record

FRAMES, FRAME_PX, QUALITY = 16, 280, 80
LAYERS = ("drawn", "rgb", "palette", "normal", "depth", "labels")


def run_scene(trained: TrainedField, title: str, about: dict[str, Any]) -> tuple[dict[str, Any], bytes]:
    """Return a run's numbers, and its arrays deflated.

    Args:
        trained: the run's field.
        title: of the page.
        about: further entries: verdict, palette, views.

    Raises:
        BundleError: its field has no planes.
    """
    blob = Blob()
    camera = turntable(trained, 36)[0]
    side = camera.size_wh[0]
    drawings = trained.drawings
    has = {"drawn": drawings is not None, "palette": trained.palette is not None}
    has["labels"] = has["palette"]
    layers = [layer for layer in LAYERS if has.get(layer, True)]
    layers.sort(key=lambda layer: layer != default_layer(trained))
    scene = {
        "schema": "toonset-view/1",
        "title": title,
        "layers": layers,
        "figure": {
            "target": camera.target.tolist(),
            "reach": FILL * side / 2 / camera.scale,
            "fill": FILL,
            "k": camera.k,
        },
        "pen": drawings and drawings.pen and {"rgb": list(drawings.pen.rgb), "width_px": drawings.pen.width_px},
        **about,
        "field": field_record(trained, blob),
        "drawings": None if drawings is None else drawings_record(drawings, blob),
    }
    return scene, blob.deflated()


def turn_pictures(trained: TrainedField) -> list[bytes]:
    """Return WebP pictures of a whole turn in the run's own look."""
    layer = default_layer(trained)
    found = []
    for camera in turntable(trained, FRAMES, size=FRAME_PX):
        file = io.BytesIO()
        Image.fromarray(render(trained, camera).picture(layer)).save(file, "WEBP", quality=QUALITY, method=6)
        found.append(file.getvalue())
    return found
