"""Writing COLMAP datasets with pycolmap: what 3D Gaussian splatting and many others read.

    images/000.png          RGB over white: COLMAP, GLOMAP and splatting trainers ignore alpha or
                            each treat it in another way
    masks/000.png.png       the figure white, the rest black (COLMAP's naming; black is ignored)
    sparse/0/               cameras, images, points3D, rigs, frames (.bin or .txt)
    toonset.json            the exact cameras, and by how much the pinholes miss them

COLMAP has no orthographic camera: such a view is the far PINHOLE that the bundle's transforms.json
holds too. Poses and pixels need no conversion (see `toonset.frames`). Read back by
`toonset.dataset.colmap_read`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from toonset import frames as conventions
from toonset.camera import Camera
from toonset.dataset.background import flattened
from toonset.dataset.colmap_points import TrackedPoints
from toonset.dataset.picture import encode_png
from toonset.dataset.scene import Frame
from toonset.dataset.transforms import NativeCamera, read_cameras, read_json
from toonset.errors import BundleError
from toonset.files import new_folder, write_bytes, write_json

SCHEMA = "toonset-colmap/1"


@dataclass(frozen=True, eq=False)
class FarPinhole:
    """A pinhole that stands for a view, and the bound in px of its error near the character."""

    camera: Camera
    error_px: float


def read_far_pinholes(bundle: Path) -> tuple[FarPinhole, ...]:
    """Return every frame of a transforms.json (or its folder) as the pinhole of its matrix.

    Args:
        bundle: an orthographic frame's distance is that of its `transform_matrix`.

    Raises:
        BundleError: the file is missing, broken or describes no usable camera.
    """
    cameras = [camera for _, camera in read_cameras(bundle)]
    names = ("transforms.json", "transforms_train.json")
    file = next(p for p in (bundle, *(bundle / name for name in names)) if p.is_file())
    records = read_json(file)["frames"]
    return tuple(_far_pinhole(c, r) for c, r in zip(cameras, records, strict=True))


def write_colmap(
    folder: Path,
    frames: Sequence[Frame],
    pinholes: Sequence[FarPinhole],
    points: TrackedPoints | None = None,
    *,
    text: bool = False,
    force: bool = False,
) -> None:
    """Write a COLMAP dataset; the folder appears whole or not at all.

    Args:
        folder: where.
        frames: posed pictures with their exact cameras.
        pinholes: one per frame.
        points: what points3D holds; None leaves it empty.
        text: write .txt instead of .bin.
        force: replace an existing folder.

    Raises:
        BundleError: two pictures would get the same name.
        OutputError: the folder exists, or cannot be written.
    """
    names = [f"{Path(frame.name).stem}.png" for frame in frames]
    double = next((name for name in names if names.count(name) > 1), None)
    if double:
        raise BundleError(f"{folder}: two pictures would be written as {double}; rename one")
    model = _reconstruction(names, pinholes, points)
    with new_folder(folder, force=force) as temporary:
        for name, frame in zip(names, frames, strict=True):
            picture, mask = _over_white(frame.rgba), _mask(frame.rgba)
            write_bytes(temporary / "images" / name, encode_png(picture))
            write_bytes(temporary / "masks" / f"{name}.png", encode_png(mask))
        sparse = temporary / "sparse" / "0"
        sparse.mkdir(parents=True)
        (model.write_text if text else model.write_binary)(sparse)
        write_json(temporary / "toonset.json", _native_dict(names, frames, pinholes, points))


def _far_pinhole(camera: Camera, record: dict[str, Any]) -> FarPinhole:
    if not camera.is_orthographic:
        return FarPinhole(camera, 0.0)
    matrix = np.array(record["transform_matrix"], dtype=np.float64)
    centre = conventions.opencv_pose_from_opengl(matrix)[:3, 3]
    distance = float(camera.rotation[2] @ (camera.target - centre))
    return FarPinhole(camera.as_pinhole(distance), float(record["toonset"]["pinhole_error_px"]))


def _over_white(
    rgba: UInt8[np.ndarray, "height width 4"],
) -> UInt8[np.ndarray, "height width 3"]:
    return flattened(rgba)[..., :3]


def _mask(rgba: UInt8[np.ndarray, "height width 4"]) -> UInt8[np.ndarray, "height width"]:
    return np.where(rgba[..., 3] >= 128, 255, 0).astype(np.uint8)


def _native_dict(
    names: Sequence[str],
    frames: Sequence[Frame],
    pinholes: Sequence[FarPinhole],
    points: TrackedPoints | None,
) -> dict[str, Any]:
    exact = [NativeCamera.of(f.camera, p.error_px) for f, p in zip(frames, pinholes, strict=True)]
    return {
        "schema": SCHEMA,
        "points": 0 if points is None else len(points.xyz),
        "points_are": "on the mannequin, projected (not measured), coloured from the drawings",
        "pinhole_error_px": max(pinhole.error_px for pinhole in pinholes),
        "views": [
            {"name": name, "camera": camera.model_dump(mode="json")}
            for name, camera in zip(names, exact, strict=True)
        ],
    }


def _reconstruction(
    names: Sequence[str], pinholes: Sequence[FarPinhole], points: TrackedPoints | None
) -> Any:
    import pycolmap

    model = pycolmap.Reconstruction()
    for number, (name, pinhole) in enumerate(zip(names, pinholes, strict=True)):
        camera = pinhole.camera
        seen = [] if points is None else points.pixels[number][points.seen[number]]
        image = pycolmap.Image(
            name=name,
            points2D=pycolmap.Point2DList([pycolmap.Point2D(uv) for uv in seen]),
            camera_id=number + 1,
            image_id=number + 1,
        )
        model.add_camera_with_trivial_rig(_lens(camera, number + 1))
        pose = camera.camera_from_world
        rigid = pycolmap.Rigid3d(pycolmap.Rotation3d(pose[:3, :3]), pose[:3, 3])
        model.add_image_with_trivial_frame(image, rigid)
    if points is not None:
        _add_points(model, points)
    return model


def _lens(camera: Camera, number: int) -> Any:
    import pycolmap

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
    import pycolmap

    index = np.cumsum(points.seen, axis=1) - 1  # of a point among those that a view sees
    for i, (xyz, rgb) in enumerate(zip(points.xyz, points.rgb, strict=True)):
        track = pycolmap.Track()
        for view in np.flatnonzero(points.seen[:, i]):
            track.add_element(int(view) + 1, int(index[view, i]))
        model.add_point3D(xyz, track, rgb)
