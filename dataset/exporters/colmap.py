"""Write a COLMAP dataset with pycolmap, for 3D Gaussian splatting and many others.

    images/000.png          RGB over white: COLMAP, GLOMAP and splatting trainers ignore alpha or
                            each treat it in another way
    masks/000.png.png       the figure white, the rest black (COLMAP's naming; black is ignored)
    sparse/0/               cameras, images, points3D, and in the new layout rigs, frames
                            (.bin or .txt)
    toonset.json            the exact cameras, and by how much the pinholes miss them

COLMAP has no orthographic camera: such a view is the far PINHOLE that the bundle's transforms.json
holds too. Poses and pixels need no conversion (see `toonset.frames`). The old layout, of COLMAP
before 3.12, is the new one without rigs and frames: every view is a rig of its own, so nothing is
lost. Read back by `toonset.dataset.importers.colmap`.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from toonset.camera import Camera
from toonset.dataset.exporters.common import ExportView, write_beside
from toonset.dataset.exporters.points import TrackedPoints
from toonset.dataset.images.picture import encode_png
from toonset.dataset.split.background import flatten
from toonset.mesh import Mesh
from toonset.write import new_folder, write_bytes

NEW_ONLY = ("rigs", "frames")  # files of COLMAP 3.12 and later


def write_colmap(
    folder: Path,
    views: Sequence[ExportView],
    points: TrackedPoints | None = None,
    mesh: Mesh | None = None,
    *,
    text: bool = False,
    old_layout: bool = False,
    force: bool = False,
) -> None:
    """Write a COLMAP dataset; the folder appears whole or not at all.

    Args:
        folder: where.
        views: drawings with their cameras.
        points: what points3D holds; None leaves it empty.
        mesh: the mannequin, written beside.
        text: write .txt instead of .bin.
        old_layout: without rigs and frames, as COLMAP before 3.12.
        force: replace an existing folder.

    Raises:
        OutputError: the folder exists, or cannot be written.
    """
    model = _reconstruction(views, points)
    with new_folder(folder, force=force) as temporary:
        for view in views:
            picture, mask = flatten(view.rgba)[..., :3], figure_mask(view.rgba)
            write_bytes(temporary / "images" / view.name, encode_png(picture))
            write_bytes(temporary / "masks" / f"{view.name}.png", encode_png(mask))
        _write_model(model, temporary / "sparse" / "0", text=text, old_layout=old_layout)
        pictures = [f"images/{view.name}" for view in views]
        write_beside(temporary, "colmap", views, pictures, mesh, **_about(points))


def figure_mask(rgba: UInt8[np.ndarray, "height width 4"]) -> UInt8[np.ndarray, "height width"]:
    """Return 255 where the figure covers a pixel by at least half, else 0."""
    return np.where(rgba[..., 3] >= 128, 255, 0).astype(np.uint8)


def _about(points: TrackedPoints | None) -> dict[str, Any]:
    if points is None:
        return {"points": 0}
    return {"points": len(points.xyz), "points_are": points.what}


def _write_model(model: Any, sparse: Path, *, text: bool, old_layout: bool) -> None:
    sparse.mkdir(parents=True)
    (model.write_text if text else model.write_binary)(sparse)
    if old_layout:
        for name in NEW_ONLY:
            (sparse / f"{name}.{'txt' if text else 'bin'}").unlink()


def load_pycolmap() -> Any:
    """Import pycolmap; SIGTERM does what it did before, not what its log library makes of it."""
    before = signal.getsignal(signal.SIGTERM)
    import pycolmap

    if before is not None and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, before)
    return pycolmap


def _reconstruction(views: Sequence[ExportView], points: TrackedPoints | None) -> Any:
    pycolmap = load_pycolmap()

    model = pycolmap.Reconstruction()
    for number, view in enumerate(views):
        seen = [] if points is None else points.pixels[number][points.seen[number]]
        image = pycolmap.Image(
            name=view.name,
            points2D=pycolmap.Point2DList([pycolmap.Point2D(uv) for uv in seen]),
            camera_id=number + 1,
            image_id=number + 1,
        )
        model.add_camera_with_trivial_rig(_lens(view.pinhole, number + 1))
        pose = view.pinhole.camera_from_world
        rigid = pycolmap.Rigid3d(pycolmap.Rotation3d(pose[:3, :3]), pose[:3, 3])
        model.add_image_with_trivial_frame(image, rigid)
    if points is not None:
        _add_points(model, points)
    return model


def _lens(camera: Camera, number: int) -> Any:
    pycolmap = load_pycolmap()

    K = camera.K
    width, height = camera.size_wh
    lens = pycolmap.Camera(
        model="PINHOLE",
        width=width,
        height=height,
        params=[K[0, 0], K[1, 1], K[0, 2], K[1, 2]],
        camera_id=number,
    )
    lens.has_prior_focal_length = True
    return lens


def _add_points(model: Any, points: TrackedPoints) -> None:
    pycolmap = load_pycolmap()

    index = np.cumsum(points.seen, axis=1) - 1  # of a point among those that a view sees
    for i, (xyz, rgb) in enumerate(zip(points.xyz, points.rgb, strict=True)):
        track = pycolmap.Track()
        for view in np.flatnonzero(points.seen[:, i]):
            track.add_element(int(view) + 1, int(index[view, i]))
        model.add_point3D(xyz, track, rgb)
