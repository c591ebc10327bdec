"""Write a dataset as NeRF's synthetic scenes: transforms_train, _val and _test.json.

    transforms_train.json    camera_angle_x for all, and a pose per picture
    train/000.png            RGBA, straight alpha
    points3d.ply             coloured points of the mannequin: Gaussian splatting starts from them
    toonset.json             the exact cameras of these pictures

The format has one focal length, square pixels, one size and the principal point in the middle:
`toonset.dataset.exporters.pinhole.common_lens` makes the views so. val and test name the pictures
of train: their readers need at least one, and a turnaround has none to spare. Source: Mildenhall et
al., NeRF (2020), load_blender.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from toonset.dataset.exporters.common import ExportView, write_views
from toonset.dataset.exporters.nerfstudio import transform_matrix
from toonset.dataset.exporters.pinhole import common_lens
from toonset.dataset.exporters.points import TrackedPoints, encode_ply
from toonset.mesh import Mesh
from toonset.write import new_folder, write_bytes, write_json

SPLITS = ("train", "val", "test")


def write_blender_synthetic(
    folder: Path,
    views: Sequence[ExportView],
    points: TrackedPoints | None = None,
    mesh: Mesh | None = None,
    *,
    force: bool = False,
) -> tuple[ExportView, ...]:
    """Write a synthetic-scene dataset.

    Returns:
        The views as they were written: padded or enlarged to one lens and size.

    Raises:
        BundleError: the views cannot share a lens.
        OutputError: the folder exists, or cannot be written.
    """
    written = common_lens(views)
    pictures = [f"train/{view.name}" for view in written]
    pinhole = written[0].pinhole
    frames = [
        {"file_path": f"./train/{Path(v.name).stem}", "transform_matrix": transform_matrix(v)}
        for v in written
    ]
    angle = 2 * math.atan(pinhole.size_wh[0] / 2 / float(pinhole.K[0, 0]))
    with new_folder(folder, force=force) as temporary:
        for split in SPLITS:
            content = {"camera_angle_x": angle, "frames": frames}
            write_json(temporary / f"transforms_{split}.json", content)
        if points is not None:
            write_bytes(temporary / "points3d.ply", encode_ply(points))
        write_views(temporary, "blender-synthetic", written, pictures, mesh)
    return written
