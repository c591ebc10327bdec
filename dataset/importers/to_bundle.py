"""Write imported views as a bundle: RGBA pictures, cameras, and the mannequin if there is one."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.bundle.read_scene import MANNEQUIN
from toonset.dataset.bundle.transforms import transforms_dict
from toonset.dataset.bundle.transforms_camera import FAR_HEIGHTS
from toonset.dataset.bundle.transforms_read import check_total
from toonset.dataset.exporters.common import NATIVE
from toonset.dataset.images.picture import encode_png, load_rgba
from toonset.dataset.importers.detect import Imported, turned
from toonset.dataset.importers.masks import REMARKS, read_mask
from toonset.dataset.importers.paths import ImportView
from toonset.dataset.mesh.load import save_obj
from toonset.errors import BundleError
from toonset.mesh import Z_UP, Mesh
from toonset.write import new_folder, write_bytes, write_json


@dataclass(frozen=True)
class ImportReport:
    """Report of an import.

    Attributes:
        views: names of the pictures.
        opaque: those that show no background: the whole picture counts as figure.
        masked: number of pictures whose alpha came from a mask.
        remarks: lines for people about what was read otherwise than it stands there.
    """

    views: tuple[str, ...]
    opaque: tuple[str, ...]
    masked: int
    remarks: tuple[str, ...] = ()


def write_imported(
    folder: Path, imported: Imported, mesh: Mesh | None, *, z_up: bool = False, force: bool = False
) -> ImportReport:
    """Write a bundle of imported views; the folder appears whole or not at all.

    Args:
        folder: where.
        imported: what was read.
        mesh: the mannequin in the world that was read.
        z_up: turn the world from +Z up, front -Y (Blender) to ours: +Y up, front +Z.
        force: replace an existing folder.

    Raises:
        BundleError: a picture or mask has another size than its camera, a mask shows no figure,
            or `z_up` is asked for an export of toonset's own.
        PictureError: a picture or mask cannot be read.
        OutputError: the folder exists, or cannot be written.
    """
    cameras = [view.camera for view in imported.views]
    if z_up:
        if imported.native is not None:
            raise BundleError(f"{NATIVE} says that +Y is up, as in every export; leave out --up z")
        cameras = [turned(camera) for camera in cameras]
        mesh = None if mesh is None else replace(mesh, vertices=mesh.vertices @ Z_UP.T)
    check_total(folder, cameras)
    opaque = []
    how = Counter[str]()
    with new_folder(folder, force=force) as temporary:
        for view in imported.views:
            rgba, read_as = _picture(view)
            how.update(read_as)
            if (rgba[..., 3] == 255).all():
                opaque.append(view.name)
            write_bytes(temporary / "images" / view.name, encode_png(rgba))
        named = [(f"images/{v.name}", c) for v, c in zip(imported.views, cameras, strict=True)]
        height, radius = _body(imported, mesh)
        write_json(temporary / "transforms.json", transforms_dict(named, height, radius))
        if mesh is not None:
            write_bytes(temporary / MANNEQUIN, save_obj(mesh))
    names = tuple(view.name for view in imported.views)
    masked = sum(view.mask is not None for view in imported.views)
    remarks = tuple(f"{count} of the masks {REMARKS[one]}" for one, count in how.items())
    return ImportReport(names, tuple(opaque), masked, (*imported.remarks, *remarks))


def _body(imported: Imported, mesh: Mesh | None) -> tuple[float, float]:
    """Return height and radius for the far pinholes of orthographic views."""
    if imported.native is not None:
        return imported.native.far_distance / FAR_HEIGHTS, imported.native.radius
    if mesh is not None:
        return mesh.height, mesh.radius
    cameras = [view.camera for view in imported.views if view.camera.is_orthographic]
    height = max((c.size_wh[1] / float(c.scale_uv[1]) for c in cameras), default=1.0)
    return height, height / 2


def _picture(view: ImportView) -> tuple[UInt8[np.ndarray, "height width 4"], tuple[str, ...]]:
    """Return a view's picture with its mask in its alpha, and how the mask had to be read."""
    rgba = load_rgba(view.picture)
    if rgba.shape[1::-1] != view.camera.size_wh:
        raise BundleError(
            f"{view.picture}: is {rgba.shape[1]} x {rgba.shape[0]} px, its camera says "
            f"{view.camera.size_wh[0]} x {view.camera.size_wh[1]}; give the pictures of that size"
        )
    if view.mask is None:
        return rgba, ()
    mask = read_mask(view.mask, rgba[..., 3])
    return np.dstack([rgba[..., :3], np.minimum(rgba[..., 3], mask.alpha)]), mask.how
