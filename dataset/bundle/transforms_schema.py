"""Define the schema of transforms.json: keys of nerfstudio, instant-ngp, Blender and toonset.

Unknown keys are other programs' business and are ignored, except lens distortion, which would bend
what is seen (`toonset.dataset.bundle.transforms_camera` refuses it).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.errors import BundleError
from toonset.json_file import read_json, validate
from toonset.read import schema_version

SCHEMA, VERSION = "toonset-transforms", 1
MAX_FRAMES = 10_000

Focal = Annotated[float, Field(gt=0)]
Row = tuple[float, float, float, float]


class Intrinsics(BaseModel):
    """Intrinsics of a frame, or of the file for all frames; pixels."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)
    w: int | None = None
    h: int | None = None
    fl_x: Focal | None = None
    fl_y: Focal | None = None
    cx: float | None = None
    cy: float | None = None
    camera_angle_x: Annotated[float, Field(gt=0, lt=math.pi)] | None = None
    camera_model: str | None = None


class FrameRecord(Intrinsics):
    """One picture and its camera."""

    file_path: str
    transform_matrix: tuple[Row, Row, Row, Row]
    toonset: NativeCamera | None = None


class TransformsFile(Intrinsics):
    """The whole file."""

    frames: list[FrameRecord] = Field(min_length=1, max_length=MAX_FRAMES)


def read_records(file: Path) -> TransformsFile:
    """Return the content of a transforms.json as its schema has it; cameras are not made yet.

    Raises:
        BundleError: the file cannot be read, is of a newer toonset, or does not fit its schema.
    """
    content = read_json(file)
    if isinstance(content, dict) and str(content.get("schema", "")).startswith("toonset-"):
        schema_version(content, SCHEMA, VERSION, str(file), BundleError)
    return validate(TransformsFile, content, file)
