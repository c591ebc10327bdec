"""Read toonset.json beside an export: exact cameras, preferred to the format's pinholes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.dataset.bundle.transforms_camera import shows_same_view
from toonset.dataset.bundle.transforms_read import place_in
from toonset.dataset.bundle.transforms_schema import MAX_FRAMES
from toonset.dataset.exporters.common import NATIVE
from toonset.dataset.importers.paths import ImportView, find_picture
from toonset.errors import BundleError, CameraError
from toonset.json_file import read_json, validate
from toonset.read import schema_version

NAME, VERSION = "toonset-export", 1


class _ViewRecord(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    name: str
    picture: str
    camera: NativeCamera
    pinhole_distance: float = Field(ge=1e-9, le=1e9)
    radius: float = Field(ge=0, le=1e9)


class _ExportRecord(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    views: list[_ViewRecord] = Field(min_length=1, max_length=MAX_FRAMES)


@dataclass(frozen=True, eq=False)
class NativeExport:
    """An export's own record.

    Attributes:
        views: with the exact cameras.
        error_px: per name, by how much a pinhole may differ from them.
        far_distance: world units from a target to the nearest far pinhole.
        radius: world units around a target that `error_px` covers.
    """

    views: tuple[ImportView, ...]
    error_px: dict[str, float]
    far_distance: float
    radius: float

    def exact(self, view: ImportView, path: Path) -> ImportView:
        """Return an imported view with its exact camera, if there is one of its name.

        Raises:
            BundleError: the two cameras look at different things.
        """
        own = next((own for own in self.views if own.name == view.name), None)
        if own is None:
            return view
        same_size = own.camera.size_wh == view.camera.size_wh
        error_px = self.error_px[own.name]
        if not (same_size and shows_same_view(own.camera, view.camera, error_px)):
            raise BundleError(
                f"{path}: {view.name}: its camera and that of {NATIVE} beside it disagree; remove "
                f"{NATIVE} if the cameras were changed"
            )
        return replace(view, camera=own.camera)


def read_native(root: Path) -> NativeExport:
    """Return the record of an export.

    Raises:
        BundleError: it is damaged, of a newer toonset, or names a picture that is not there.
    """
    file = place_in(root, NATIVE)
    content = read_json(file)
    schema_version(content, NAME, VERSION, str(file), BundleError)
    records = validate(_ExportRecord, content, file).views
    views = tuple(_view(root, record, file) for record in records)
    distance = min(record.pinhole_distance for record in records)
    radius = max(record.radius for record in records)
    if radius >= distance and any(view.camera.is_orthographic for view in views):
        raise BundleError(
            f"{file}: radius {radius:g} reaches the pinholes, {distance:g} away; export it again"
        )
    errors = {record.name: record.camera.pinhole_error_px for record in records}
    return NativeExport(views, errors, distance, radius)


def _view(root: Path, record: _ViewRecord, file: Path) -> ImportView:
    where = f"{file}: view {record.name[:80]!r}"
    try:
        camera = record.camera.camera()
    except (CameraError, BundleError) as error:
        raise BundleError(f"{where}: {error}; export it again") from error
    return ImportView(record.name, camera, find_picture([root], record.picture, where), None)
