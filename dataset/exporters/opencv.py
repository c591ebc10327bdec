"""Write cameras as OpenCV's YAML (`cv2.FileStorage`).

    cameras.yml        views: a list of maps with name, image (path), image_width, image_height,
                       camera_matrix, distortion_coefficients (0), rvec, R, tvec
    images/000.png     RGBA, straight alpha
    toonset.json       the exact cameras

rvec, R and tvec are camera_from_world, and the first pixel's centre is (0, 0), as OpenCV's
`projectPoints` has it: cx and cy are 0.5 less than elsewhere. Orthographic views are far pinholes.
Read back by `toonset.dataset.importers.opencv`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from toonset import frames as conventions
from toonset.dataset.exporters.common import ExportView, write_views
from toonset.mesh import Mesh
from toonset.write import new_folder, write_bytes

VERSION = 1  # of the layout of the file


def write_opencv(
    folder: Path, views: Sequence[ExportView], mesh: Mesh | None = None, *, force: bool = False
) -> None:
    """Write cameras.yml and pictures; the folder appears whole or not at all.

    Raises:
        OutputError: the folder exists, or cannot be written.
    """
    pictures = [f"images/{view.name}" for view in views]
    text = _text(list(zip(views, pictures, strict=True)))
    with new_folder(folder, force=force) as temporary:
        write_bytes(temporary / "cameras.yml", text.encode())
        write_views(temporary, "opencv", views, pictures, mesh)


def _text(views: Sequence[tuple[ExportView, str]]) -> str:
    storage = cv2.FileStorage(".yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("version", VERSION)
    storage.startWriteStruct("views", cv2.FileNode_SEQ)
    for view, picture in views:
        storage.startWriteStruct("", cv2.FileNode_MAP)
        _write_view(storage, view, picture)
        storage.endWriteStruct()
    storage.endWriteStruct()
    return storage.releaseAndGetString()


def _write_view(storage: cv2.FileStorage, view: ExportView, picture: str) -> None:
    camera = view.pinhole
    K = camera.K
    K[:2, 2] = conventions.opencv_from_pixels(K[:2, 2])
    pose = camera.camera_from_world
    rotation = np.ascontiguousarray(pose[:3, :3])
    storage.write("name", view.name)
    storage.write("image", picture)
    storage.write("image_width", camera.size_wh[0])
    storage.write("image_height", camera.size_wh[1])
    storage.write("camera_matrix", K)
    storage.write("distortion_coefficients", np.zeros((1, 5)))
    storage.write("rvec", cv2.Rodrigues(rotation)[0])
    storage.write("R", rotation)
    storage.write("tvec", np.ascontiguousarray(pose[:3, 3:]))
