"""The bundle on disk: what calibration hands to palette, training and other programs.

    transforms.json    cameras (see `toonset.dataset.transforms`)
    images/000.png     RGBA crops, straight alpha
    calibration.json   native cameras, uncertainty, verdicts
    overlay.png        every drawing with the mannequin's outline over it
    mannequin.obj      the mannequin as it was fitted, in the cameras' world

The folder appears whole or not at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from toonset.camera import Camera
from toonset.dataset.mesh_file import save_obj
from toonset.dataset.picture import encode_png
from toonset.dataset.transforms import transforms_dict
from toonset.errors import BundleError
from toonset.files import new_folder, write_bytes, write_json
from toonset.mesh import Mesh
from toonset.view import View

MANNEQUIN = "mannequin.obj"


def write_bundle(
    folder: Path,
    views: Sequence[View],
    cameras: Sequence[Camera],
    mesh: Mesh,
    calibration: dict[str, Any],
    overlay: UInt8[np.ndarray, "height width channels"],
    *,
    force: bool = False,
) -> None:
    """Write a bundle.

    Args:
        folder: where; replaced as a whole with `force`.
        views: the drawings in sheet order.
        cameras: one per view, in pixels of its crop.
        mesh: the mannequin as it was fitted; its height and radius set the far pinholes and their
            error bound.
        calibration: content of calibration.json.
        overlay: the picture for people.
        force: replace an existing bundle.

    Raises:
        OutputError: the folder exists, or cannot be written.
    """
    if len(views) != len(cameras):
        raise BundleError(f"{len(views)} views but {len(cameras)} cameras; one each is needed")
    named = [(f"images/{v.name}", camera) for v, camera in zip(views, cameras, strict=True)]
    with new_folder(folder, force=force) as temporary:
        for view in views:
            write_bytes(temporary / "images" / view.name, encode_png(view.rgba))
        write_json(temporary / "transforms.json", transforms_dict(named, mesh.height, mesh.radius))
        write_json(temporary / "calibration.json", calibration)
        write_bytes(temporary / "overlay.png", encode_png(overlay))
        write_bytes(temporary / MANNEQUIN, save_obj(mesh))
