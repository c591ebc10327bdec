"""The bends of a run's key views, as config.json holds them."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.nerf.warp import Warp
from toonset.nerf.warp_back import KeyWarps

VALUES = len(Warp.none().numbers)
MOST_VIEWS = 4096

Number = Annotated[float, Field(ge=-1e9, le=1e9)]


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
