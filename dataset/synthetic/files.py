"""Write a synthetic turnaround to disk.

sheet.png           the drawn sheet; sheet.jpg where it is a JPEG
views/000.png ..    its cells on transparent ground, with transforms.json (exact cameras)
labels/000.png ..   indexed PNG per cell, 255 = background, ink or mixed pixel
ink/000.png ..      grey PNG per cell: how far lines cover each pixel
shadows/000.png ..  where there is a shadow, grey PNG per cell: 255 = a labelled pixel in shadow
test/000.png ..     where asked for, exact pictures of the undistorted body, with transforms.json
mannequin.obj       the mesh that was drawn, with its colours
truth.json          cameras, yaws, boxes, palette, options, seed
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.dataset.bundle.transforms import transforms_dict
from toonset.dataset.images.picture import (
    encode_grey_png,
    encode_indexed_png,
    encode_jpeg,
    encode_png,
)
from toonset.dataset.mesh.load import save_obj
from toonset.dataset.synthetic.artist_options import ArtistOptions
from toonset.dataset.synthetic.shadow import TO_LIGHT, shadow_factor
from toonset.dataset.synthetic.turnaround import Turnaround
from toonset.palette.names import hex_of
from toonset.write import new_folder, write_bytes, write_json

TRUTH_VERSION = 1


def write_turnaround(
    turnaround: Turnaround, folder: Path, *, force: bool = False, test: Turnaround | None = None
) -> None:
    """Write the turnaround; the folder appears whole or not at all.

    Args:
        turnaround: what to write.
        folder: where.
        force: replace an existing folder.
        test: of the same mesh, whose views are written for comparison.

    Raises:
        OutputError: the folder exists, or cannot be written.
    """
    quality = turnaround.options.artist.jpeg_quality
    with new_folder(folder, force=force) as temporary:
        if quality:
            write_bytes(temporary / "sheet.jpg", encode_jpeg(turnaround.sheet, quality))
        else:
            write_bytes(temporary / "sheet.png", encode_png(turnaround.sheet))
        write_bytes(temporary / "mannequin.obj", save_obj(turnaround.mesh))
        write_json(temporary / "truth.json", truth_dict(turnaround))
        for view, labels, ink in zip(
            turnaround.views, turnaround.labels, turnaround.ink, strict=True
        ):
            picture = encode_indexed_png(labels, turnaround.palette)
            write_bytes(temporary / "labels" / view.name, picture)
            write_bytes(temporary / "ink" / view.name, encode_grey_png(ink))
        if turnaround.options.artist.shadow_strength:
            for view, shadow in zip(turnaround.views, turnaround.shadows, strict=True):
                tones = encode_grey_png(np.where(shadow, 255, 0).astype(np.uint8))
                write_bytes(temporary / "shadows" / view.name, tones)
        _write_views(turnaround, temporary / "views")
        if test is not None:
            _write_views(test, temporary / "test")


def _write_views(turnaround: Turnaround, folder: Path) -> None:
    for view in turnaround.views:
        write_bytes(folder / view.name, encode_png(view.rgba))
    named = [(v.name, c) for v, c in zip(turnaround.views, turnaround.cameras, strict=True)]
    mesh = turnaround.mesh
    write_json(folder / "transforms.json", transforms_dict(named, mesh.height, mesh.radius))


def truth_dict(turnaround: Turnaround) -> dict[str, Any]:
    """Return a turnaround's ground truth, as truth.json holds it.

    Per view: `name`, `cell_box` and `figure_box` (x, y, width, height in the sheet, px),
    `yaw_deg`, and `camera` (exact, OpenCV axes, in pixels of the cell). Where artists do what
    `ArtistOptions` has, also `color_factor` per view, its colours over the palette's, and `shadow`:
    `factor`, colours in shadow over those in light, and `to_light`, in camera axes of every view.
    """
    artist = turnaround.options.artist
    views: list[dict[str, Any]] = [
        {
            "name": view.name,
            "cell_box": list(view.box),
            "figure_box": list(box),
            "yaw_deg": float(np.degrees(yaw)),
            "camera": NativeCamera.of(camera).model_dump(mode="json"),
        }
        for view, box, yaw, camera in zip(
            turnaround.views,
            turnaround.figure_boxes,
            turnaround.yaws,
            turnaround.cameras,
            strict=True,
        )
    ]
    options, shadow = asdict(turnaround.options), {}
    if artist == ArtistOptions():
        del options["artist"]
    else:
        for view, factor in zip(views, turnaround.color_factors, strict=True):
            view["color_factor"] = factor.tolist()
    if artist.shadow_strength:
        factor = shadow_factor(artist.shadow_strength).tolist()
        shadow = {"shadow": {"factor": factor, "to_light": list(TO_LIGHT)}}
    return {
        "version": TRUTH_VERSION,
        "mesh": turnaround.mesh.name,
        "body_height": turnaround.mesh.height,
        "palette": [hex_of((r, g, b)) for r, g, b in turnaround.palette.tolist()],
        "seed": turnaround.seed,
        "options": options,
        **shadow,
        "views": views,
    }
