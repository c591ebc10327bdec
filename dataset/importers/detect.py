"""Detect the format of other programs' cameras, and read them.

transforms.json, transforms_train.json ...    nerfstudio, instant-ngp, NeRF's synthetic scenes
sparse/0, sparse, or a model's own folder     COLMAP (.bin or .txt, old or new layout)
toonset.json                                  any export of toonset; its cameras are exact
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from toonset.camera import Camera
from toonset.dataset.bundle.camera_record import check_range
from toonset.dataset.bundle.transforms_read import spellings
from toonset.dataset.exporters.common import NATIVE
from toonset.dataset.images.folder import picture_files
from toonset.dataset.importers.colmap import read_colmap
from toonset.dataset.importers.native import NativeExport, read_native
from toonset.dataset.importers.nerfstudio import read_transforms, transforms_files
from toonset.dataset.importers.paths import ImportView, find_mask, find_picture
from toonset.errors import BundleError, CameraError
from toonset.mesh import Z_UP

IMAGES, SOME = "images", 3  # of a COLMAP dataset; names that a line says


@dataclass(frozen=True, eq=False)
class Imported:
    """Views read from another program's files.

    Attributes:
        views: pictures with cameras; names are unique.
        program: whose format it is.
        native: toonset's own record of an export, whose exact cameras `views` then have.
        remarks: lines for people about what was left out.
    """

    views: tuple[ImportView, ...]
    program: str
    native: NativeExport | None
    remarks: tuple[str, ...] = ()


def read_import(path: Path, images: Path | None = None, masks: Path | None = None) -> Imported:
    """Return the posed pictures of another program's folder (or camera file).

    Args:
        path: see the module's docstring.
        images: where a COLMAP model's pictures lie, if not beside it.
        masks: folder of masks, white where the figure is: NAME.png or STEM.png of a picture.

    Raises:
        BundleError: the folder is of no known kind, or its cameras cannot be read or honoured.
    """
    root = path.parent if path.is_file() else path
    native = read_native(root) if (root / NATIVE).is_file() else None
    program, read = _reader(path, images, native)
    views = _named(read(), path)
    if masks is not None:
        views = [replace(view, mask=find_mask([masks], view.name) or view.mask) for view in views]
    for view in views:
        try:
            check_range(view.camera)
        except (BundleError, CameraError) as error:
            raise BundleError(f"{path}: {view.name}: {error}; correct the file") from error
    exact = views if native is None else [native.exact(view, path) for view in views]
    remarks = _without_camera(views, path, images) if program == "COLMAP" else ()
    return Imported(tuple(exact), program, native, remarks)


def turned(camera: Camera, ours_from_theirs: Float[np.ndarray, "3 3"] = Z_UP) -> Camera:
    """Return the camera after its world was turned."""
    rotation = camera.rotation @ ours_from_theirs.T
    return replace(camera, rotation=rotation, target=ours_from_theirs @ camera.target)


def _reader(
    path: Path, images: Path | None, native: NativeExport | None
) -> tuple[str, Callable[[], Sequence[ImportView]]]:
    """Return whose format it is, and what reads it."""
    files = transforms_files(path)
    if files:
        return "transforms.json", lambda: read_transforms(files)
    if _holds_colmap(path):
        return "COLMAP", lambda: _colmap_views(path, images)
    if native is not None:
        return "toonset", lambda: native.views
    if not path.exists():
        raise BundleError(f"{path}: does not exist; give a folder of cameras and pictures")
    raise BundleError(
        f"{path}: holds no cameras that are known; transforms.json, transforms_train.json "
        "or a COLMAP model (sparse/0) is needed; name that folder"
    )


def _holds_colmap(path: Path) -> bool:
    places = (path, path / "sparse", path / "sparse" / "0")
    return any((place / f"cameras.{end}").is_file() for place in places for end in ("bin", "txt"))


def _colmap_views(path: Path, images: Path | None) -> list[ImportView]:
    """Return a model's views; pictures and masks lie in images/ and masks/ of the dataset."""
    root = _colmap_root(path)
    folders = [root / IMAGES, path] if images is None else [images]
    views = []
    for name, camera in read_colmap(path):
        where = f"{path}: image {name[:80]!r}"
        picture, mask = find_picture(folders, name, where), find_mask([root / "masks"], name)
        views.append(ImportView(spellings(name)[-1], camera, picture, mask))
    return views


def _colmap_root(path: Path) -> Path:
    root = path.parent if path.name == "0" else path
    return root.parent if root.name == "sparse" else root


def _without_camera(
    views: Sequence[ImportView], path: Path, images: Path | None
) -> tuple[str, ...]:
    """Return a line if pictures lie beside those of a COLMAP model that have no camera in it."""
    folder = images or _colmap_root(path) / IMAGES
    if not folder.is_dir():
        return ()
    posed = {view.picture.resolve() for view in views}
    others = [file.name for file in picture_files(folder)[0] if file.resolve() not in posed]
    if not others:
        return ()
    named = ", ".join(others[:SOME]) + ", ..." * (len(others) > SOME)
    return (f"left out, for they have no camera: {named} ({len(others)} of {folder})",)


def _named(views: Sequence[ImportView], path: Path) -> list[ImportView]:
    """Return the views named STEM.png, or FOLDER_STEM.png where two stems are equal."""
    if not all(Path(view.name).name for view in views):
        raise BundleError(f"{path}: a view has no name; name it as its picture")
    stems = Counter(Path(view.name).stem for view in views)
    named = []
    for view in views:
        parts = Path(view.name).with_suffix("").parts
        stem = parts[-1] if stems[parts[-1]] == 1 else "_".join(parts)
        named.append(replace(view, name=f"{stem}.png"))
    name, count = Counter(view.name for view in named).most_common(1)[0]
    if count > 1:
        raise BundleError(f"{path}: {count} pictures would be named {name}; rename all but one")
    return named
