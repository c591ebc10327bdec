"""Renderings against held-out pictures."""

from __future__ import annotations

from typing import Any

from toonset.dataset.scene import Scene
from toonset.nerf.layers import color_picture, palette_picture
from toonset.nerf.metrics import compare
from toonset.nerf.report import means
from toonset.nerf.trained import TrainedField
from toonset.nerf.views import render


def evaluate(trained: TrainedField, test: Scene) -> dict[str, Any]:
    """Return psnr, psnr_mask and ssim of every view and their means.

    `rgb` is the field's own colour, `palette` the rendering in palette colours (None without).
    """
    views: list[dict[str, Any]] = []
    for frame in test.frames:
        view = render(trained, frame.camera)
        row: dict[str, Any] = {"name": frame.name}
        row["rgb"] = compare(color_picture(view.rgb, view.alpha), frame.rgba)
        row["palette"] = None
        if trained.palette is not None:
            row["palette"] = compare(palette_picture(view, trained.palette), frame.rgba)
        views.append(row)
    palette = None if trained.palette is None else means([row["palette"] for row in views])
    return {"rgb": means([row["rgb"] for row in views]), "palette": palette, "views": views}
