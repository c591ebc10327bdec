"""The style of a run's contour lines, as config.json holds it."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from toonset.nerf.ink import InkStyle
from toonset.palette.pixels.labels import UNLABELLED

WIDEST_PX = 4096.0

Byte = Annotated[int, Field(ge=0, le=255)]
Label = Annotated[int, Field(ge=0, lt=UNLABELLED)]
Width = Annotated[float, Field(ge=0, le=WIDEST_PX)]


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
