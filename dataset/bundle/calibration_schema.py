"""Define the schema of calibration.json: cameras, uncertainties, inputs.

Angles are degrees, lengths world units or pixels of the view, as each name says. Unknown keys are
ignored on reading (within a major version keys may be added), except in a camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from toonset.camera import Camera
from toonset.dataset.bundle.camera_record import NativeCamera, Pair, Rotation, Row
from toonset.dataset.bundle.transforms_schema import MAX_FRAMES
from toonset.errors import BundleError
from toonset.palette.palette import Hex
from toonset.view import Box

SCHEMA, VERSION = "toonset-calibration", 2
SAME_ANGLE_DEG = 1e-3
ROUNDING = 1e-6  # of a covariance, relative to its largest number

Verdict = Literal["ok", "weak", "ambiguous", "failed"]
Side = Literal["left", "top", "right", "bottom"]
Probability = Annotated[float, Field(ge=0, le=1 + 1e-6)]  # sums of probabilities round
Spread = Annotated[float, Field(ge=0)]
Text = Annotated[str, Field(max_length=10_000)]
Six = Annotated[list[float], Field(min_length=6, max_length=6)]


class _Record(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)


class CalibratedCamera(_Record):
    """A camera; its angles are those of its rotation, for people."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    model: Literal["orthographic", "pinhole"]
    yaw_deg: float
    elevation_deg: float
    roll_deg: float
    camera_from_world_rotation: Rotation
    target: Row
    scale_px_per_unit: float
    pixel_aspect: float = 1.0
    center_px: Pair
    k: float
    size_wh: tuple[int, int]

    @classmethod
    def of(cls, camera: Camera) -> CalibratedCamera:
        """Return the record of a camera."""
        yaw, elevation, roll = (math.degrees(angle) for angle in camera.angles)
        return cls(
            model="orthographic" if camera.is_orthographic else "pinhole",
            yaw_deg=yaw,
            elevation_deg=elevation,
            roll_deg=roll,
            camera_from_world_rotation=camera.rotation.tolist(),
            target=camera.target.tolist(),
            scale_px_per_unit=camera.scale,
            pixel_aspect=camera.pixel_aspect,
            center_px=camera.center.tolist(),
            k=camera.k,
            size_wh=camera.size_wh,
        )

    def camera(self) -> Camera:
        """Return the camera.

        Raises:
            CameraError, BundleError: not a valid camera, out of range, or not as it is
                described.
        """
        camera = NativeCamera(
            model=self.model,
            rotation=self.camera_from_world_rotation,
            target=self.target,
            scale=self.scale_px_per_unit,
            center=self.center_px,
            k=self.k,
            pixel_aspect=self.pixel_aspect,
            size_wh=self.size_wh,
        ).camera()
        said = np.array([self.yaw_deg, self.elevation_deg, self.roll_deg])
        off = (np.degrees(camera.angles) - said + 180) % 360 - 180
        if np.abs(off).max() > SAME_ANGLE_DEG:
            raise BundleError("camera: yaw, elevation and roll are not those of its rotation")
        return camera


class Sigmas(_Record):
    """One standard deviation of each number of a camera."""

    yaw_deg: Spread
    elevation_deg: Spread
    roll_deg: Spread
    scale_relative: Spread
    shift_px: Spread


class Alternative(_Record):
    """Another camera that explains the drawing."""

    probability: Probability
    camera: CalibratedCamera


class SheetFile(_Record):
    """The picture that a drawing was cut from."""

    name: Annotated[str, Field(min_length=1, max_length=255)]
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


class ViewRecord(_Record):
    """One drawing's camera; what older bundles do not say is None.

    `box` is its picture's (x, y, width, height) in `sheet`, pixels; `swatches` are the palette that
    the sheet prints.
    """

    name: Annotated[str, Field(min_length=1, max_length=255)]
    verdict: Verdict
    reason: Text
    camera: CalibratedCamera
    sigma: Sigmas
    covariance: Annotated[list[Six], Field(min_length=6, max_length=6)]
    covariance_of: Text
    p_flip: Probability
    twin: CalibratedCamera
    alternatives: Annotated[list[Alternative], Field(max_length=1000)]
    outline_error_of_height: Spread
    outline_coverage: Probability
    line_width_px: Spread | None = None
    box: tuple[int, int, int, int] | None = None
    sheet: SheetFile | None = None
    swatches: Annotated[list[Hex], Field(max_length=255)] = []

    def check(self) -> None:
        """Refuse what no calibration writes.

        Raises:
            CameraError, BundleError: a camera or a covariance is invalid.
        """
        for camera in (self.camera, self.twin, *(other.camera for other in self.alternatives)):
            camera.camera()
        covariance = np.array(self.covariance)
        covariance = covariance / max(float(np.abs(covariance).max()), 1e-300)
        if np.abs(covariance - covariance.T).max() > ROUNDING:
            raise BundleError("covariance is not symmetric")
        if np.linalg.eigvalsh(covariance).min() < -ROUNDING:
            raise BundleError("covariance has a negative variance")


class TriedModel(_Record):
    """A richer camera model; proven where its gain exceeds the margin."""

    model: Text
    bic_gain: float
    margin: float
    unknowns: Spread


class CameraModel(_Record):
    """The camera model of the sheet, with its evidence; a distance of None is orthographic."""

    chosen: Text
    distance_heights: Annotated[list[Spread | None], Field(max_length=MAX_FRAMES)]
    tried: Annotated[list[TriedModel], Field(max_length=100)]
    effective_samples: Spread


class DrawingError(_Record):
    """Error of drawn outlines: a smooth field, and noise from point to point."""

    smooth: Spread
    white: Spread


class InputFile(_Record):
    """A file that the cameras depend on."""

    name: Annotated[str, Field(min_length=1, max_length=255)]
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    role: Text


class LandmarkFit(_Record):
    """Fit of a view's landmarks to one camera."""

    view: Annotated[str, Field(min_length=1, max_length=255)]
    rms_px: Spread
    misplaced: Annotated[list[Text], Field(max_length=10_000)]
    perspective_bic_gain: float


@dataclass(frozen=True)
class FilledHole:
    """A false hole: paint in the paper's colour.

    Attributes:
        view: the drawing that has it.
        box: (x, y, width, height) in that drawing, pixels.
        by: the drawing that contradicts it.
    """

    view: Annotated[str, Field(min_length=1, max_length=255)]
    box: Box
    by: Annotated[str, Field(min_length=1, max_length=255)]

    def __str__(self) -> str:
        """Return what was done, for people."""
        x, y, width, height = self.box
        return (
            f"{self.view}: the hole at {x}, {y} ({width} x {height} px) is paint: {self.by}, drawn "
            "from the other side, shows none; filled"
        )


class CutOff(_Record):
    """A part of a figure that its picture lacks: a frame, not in the picture, cut it off."""

    view: Annotated[str, Field(min_length=1, max_length=255)]
    side: Side
    lost_px: Spread


class CalibrationFile(_Record):
    """The whole file, except `schema`."""

    verdict: Verdict
    reason: Text
    camera_model: CameraModel
    outline_offset_of_height: float
    drawing_error_of_height: DrawingError
    drawings_contradiction_of_height: Spread | None = None
    views: Annotated[list[ViewRecord], Field(min_length=1, max_length=MAX_FRAMES)]
    landmarks: Annotated[list[LandmarkFit], Field(max_length=MAX_FRAMES)] = []
    filled_holes: Annotated[list[FilledHole], Field(max_length=100_000)] = []
    cut_off: Annotated[list[CutOff], Field(max_length=4 * MAX_FRAMES)] = []
    options: dict[str, Any] = {}
    seed: Annotated[int, Field(ge=0)] | None = None
    versions: dict[str, Text] = {}
    inputs: Annotated[list[InputFile], Field(max_length=100_000)] = []
