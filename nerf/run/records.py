"""Contour lines' style and key views' bends, as config.json of a run holds them."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.nerf.lines.remove import InkStyle
from toonset.nerf.prepare.unwarp import Warp
from toonset.nerf.prepare.warp_back import KeyWarps
from toonset.palette.pixels.labels import UNLABELLED

WIDEST_PX = 4096.0

Byte = Annotated[int, Field(ge=0, le=255)]
Label = Annotated[int, Field(ge=0, lt=UNLABELLED)]
Width = Annotated[float, Field(ge=0, le=WIDEST_PX)]
VALUES = len(Warp.none().numbers)
MOST_VIEWS = 4096
Number = Annotated[float, Field(ge=-1e9, le=1e9)]


class InkRecord(BaseModel):
    """What a reader of config.json needs to draw the lines; fields as in `InkStyle`."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    rgb: tuple[Byte, Byte, Byte]
    outline_px: Width
    inner_px: Width
    views_px: tuple[Width, ...]
    px_per_unit: float = Field(gt=0, le=1e9)
    jump: float | None = Field(gt=0, le=1e9)
    borders: tuple[tuple[Label, Label], ...]

    @classmethod
    def of(cls, style: InkStyle) -> InkRecord:
        """Return the record of a style."""
        return cls(**asdict(style))

    @property
    def style(self) -> InkStyle:
        """Return the style of the record."""
        return InkStyle(**self.model_dump())


class WarpRecord(BaseModel):
    """One drawing's bend and its camera; fields as in `Warp`."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    camera: NativeCamera
    low_px: tuple[Number, Number]
    size_px: float = Field(gt=0, le=1e9)
    numbers: list[Number] = Field(min_length=VALUES, max_length=VALUES)


class KeysRecord(BaseModel):
    """What a reader of config.json needs to give bends back; see `KeyWarps`."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    middle: tuple[Number, Number, Number]
    views: list[WarpRecord] = Field(max_length=MOST_VIEWS)

    @classmethod
    def of(cls, keys: KeyWarps) -> KeysRecord:
        """Return the record of key views' bends."""
        views = [
            {"camera": NativeCamera.of(camera), **warp.to_json()}
            for camera, warp in zip(keys.cameras, keys.warps, strict=True)
        ]
        return cls.model_validate({"middle": keys.middle.tolist(), "views": views})

    def keys(self) -> KeyWarps:
        """Return the bends of the record.

        Raises:
            CameraError: a camera's record is none.
        """
        warps = [Warp.from_json(view.model_dump(exclude={"camera"})) for view in self.views]
        cameras = [view.camera.camera() for view in self.views]
        return KeyWarps(tuple(cameras), tuple(warps), np.array(self.middle))
