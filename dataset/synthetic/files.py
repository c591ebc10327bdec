"""A synthetic turnaround on disk.

sheet.png           the drawn sheet
views/000.png ..    its cells on transparent ground, with transforms.json (exact cameras)
labels/000.png ..   indexed PNG per cell, 255 = background, ink or mixed pixel
ink/000.png ..      grey PNG per cell: how far lines cover each pixel
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
from toonset.dataset.images.picture import encode_grey_png, encode_indexed_png, encode_png
from toonset.dataset.mesh.load import save_obj
from toonset.dataset.synthetic.turnaround import Turnaround
from toonset.palette.names import hex_of
from toonset.write import new_folder, write_bytes, write_json

TRUTH_VERSION = 1


def write_turnaround(turnaround: Turnaround, folder: Path, *, force: bool = False) -> None:
    """Write the turnaround; the folder appears whole or not at all.

    Args:
        turnaround: what to write.
        folder: where.
        force: replace an existing folder.

    Raises:
        OutputError: the folder exists, or cannot be written.
    """
    mesh = turnaround.mesh
    with new_folder(folder, force=force) as temporary:
        write_bytes(temporary / "sheet.png", encode_png(turnaround.sheet))
        write_bytes(temporary / "mannequin.obj", save_obj(mesh))
        write_json(temporary / "truth.json", truth_dict(turnaround))
        named = []
        for view, camera, labels, ink in zip(
            turnaround.views, turnaround.cameras, turnaround.labels, turnaround.ink, strict=True
        ):
            write_bytes(temporary / "views" / view.name, encode_png(view.rgba))
            picture = encode_indexed_png(labels, turnaround.palette)
            write_bytes(temporary / "labels" / view.name, picture)
            write_bytes(temporary / "ink" / view.name, encode_grey_png(ink))
            named.append((view.name, camera))
        cameras = transforms_dict(named, mesh.height, mesh.radius)
        write_json(temporary / "views" / "transforms.json", cameras)


def truth_dict(turnaround: Turnaround) -> dict[str, Any]:
    """Return what is true of a turnaround, as truth.json holds it.

    Per view: `name`, `cell_box` and `figure_box` (x, y, width, height in the sheet, px),
    `yaw_deg`, and `camera` (exact, OpenCV axes, in pixels of the cell).
    """
    views = [
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
    return {
        "version": TRUTH_VERSION,
        "mesh": turnaround.mesh.name,
        "body_height": turnaround.mesh.height,
        "palette": [hex_of((r, g, b)) for r, g, b in turnaround.palette.tolist()],
        "seed": turnaround.seed,
        "options": asdict(turnaround.options),
        "views": views,
    }
