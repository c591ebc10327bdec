"""Write what every export shares: drawings, exact cameras, and the pinholes that replace them.

Programs without orthographic cameras get a far pinhole, as the bundle's transforms.json has it. The
exact cameras always stand beside an export in toonset.json:

    schema, format       "toonset-export/1" and the name of the format
    pinhole_error_px     the largest of the views' bounds
    views                per view: name, picture, the exact camera, and for an orthographic one the
                         distance of its far pinhole and the radius that the bound covers
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from toonset.camera import Camera
from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.dataset.bundle.read_scene import MANNEQUIN, read_scene
from toonset.dataset.bundle.scene import Frame
from toonset.dataset.bundle.transforms_camera import far_pinhole_of
from toonset.dataset.bundle.transforms_read import transforms_file
from toonset.dataset.bundle.transforms_schema import FrameRecord, read_records
from toonset.dataset.images.picture import encode_png
from toonset.dataset.mesh.load import save_obj
from toonset.errors import BundleError
from toonset.mesh import Mesh
from toonset.write import write_bytes, write_json

SCHEMA = "toonset-export/1"
NATIVE = "toonset.json"


@dataclass(frozen=True, eq=False)
class ExportView:
    """One drawing, ready to be written.

    Attributes:
        name: file name of its picture, unique: "000.png".
        rgba: (height, width, 4) sRGB with straight alpha.
        camera: the exact camera of that picture.
        distance: world units from the target to the far pinhole; unused where `camera` is one.
        radius: world units around the target within which `error_px` holds.
    """

    name: str
    rgba: UInt8[np.ndarray, "height width 4"]
    camera: Camera
    distance: float
    radius: float

    @property
    def pinhole(self) -> Camera:
        """Return the camera as programs without orthographic cameras see it."""
        return self.camera.as_pinhole(self.distance)

    @property
    def error_px(self) -> float:
        """Return the bound in px of the pinhole's error; 0 for a true pinhole."""
        return self.camera.pinhole_error_px(self.distance, self.radius)

    @property
    def frame(self) -> Frame:
        """Return picture and exact camera."""
        return Frame(self.name, self.camera, self.rgba)


def read_views(bundle: Path) -> tuple[ExportView, ...]:
    """Return the drawings of a bundle, a transforms.json or the folder of one.

    Raises:
        BundleError: a file is missing or broken, or two pictures would get the same name.
        PictureError: a picture cannot be read.
    """
    scene = read_scene(bundle)
    records = read_records(transforms_file(bundle)).frames
    pairs = zip(scene.frames, records, strict=True)
    views = tuple(_view(frame, record) for frame, record in pairs)
    names = [view.name for view in views]
    double = next((name for name in names if names.count(name) > 1), None)
    if double:
        raise BundleError(f"{bundle}: two pictures would be written as {double}; rename one")
    return views


def largest_error_px(views: Sequence[ExportView]) -> float:
    """Return the bound that holds for every view's pinhole."""
    return max(view.error_px for view in views)


def write_views(
    folder: Path, kind: str, views: Sequence[ExportView], pictures: Sequence[str], mesh: Mesh | None
) -> None:
    """Write every view's RGBA picture, and what stands beside all exports (see `write_beside`)."""
    for view, picture in zip(views, pictures, strict=True):
        write_bytes(folder / picture, encode_png(view.rgba))
    write_beside(folder, kind, views, pictures, mesh)


def write_beside(
    folder: Path,
    kind: str,
    views: Sequence[ExportView],
    pictures: Sequence[str],
    mesh: Mesh | None,
    **more: Any,
) -> None:
    """Write toonset.json, and mannequin.obj where there is a mannequin.

    Args:
        folder: of the export.
        kind: name of the format.
        views: what was written.
        pictures: path of each view's picture in the folder.
        mesh: the mannequin.
        more: further entries of the file.
    """
    records = [
        {
            "name": view.name,
            "picture": picture,
            "camera": NativeCamera.of(view.camera, view.error_px).model_dump(mode="json"),
            "pinhole_distance": view.distance,
            "radius": view.radius,
        }
        for view, picture in zip(views, pictures, strict=True)
    ]
    error_px = largest_error_px(views)
    head = {"schema": SCHEMA, "format": kind, "pinhole_error_px": error_px, **more}
    write_json(folder / NATIVE, {**head, "views": records})
    if mesh is not None:
        write_bytes(folder / MANNEQUIN, save_obj(mesh))


def _view(frame: Frame, record: FrameRecord) -> ExportView:
    camera, name = frame.camera, f"{Path(frame.name).stem}.png"
    if not camera.is_orthographic:
        return ExportView(name, frame.rgba, camera, 1 / camera.k, 0.0)
    distance, error_px = far_pinhole_of(camera, record)
    return ExportView(
        name, frame.rgba, camera, distance, _covered_radius(camera, distance, error_px)
    )


def _covered_radius(camera: Camera, distance: float, error_px: float) -> float:
    """Return the radius whose `Camera.pinhole_error_px` is `error_px`: s r^2 + e r - e d = 0."""
    scale = max(1.0, camera.pixel_aspect) * camera.scale
    root = math.sqrt(error_px**2 + 4 * scale * error_px * distance)
    return (root - error_px) / (2 * scale)
