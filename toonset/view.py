"""Define a view: one drawing of the character, cut out of its sheet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.errors import SheetError, as_text

SHOWN_PX, SHOWN_BYTES = 480, 200_000  # of a picture in a notebook, at most
SHEET = "sheet"  # the role of a file that holds drawings, side by side or one
VISIBLE = 16  # alpha: fainter is a file's noise

Box = tuple[int, int, int, int]  # x, y, width, height
Ends = tuple[float, float, float, float]  # left, top, right, bottom
NO_ENDS: Ends = (-np.inf, -np.inf, np.inf, np.inf)


@dataclass(frozen=True, eq=False)
class View:
    """One drawing.

    Attributes:
        rgba: (height, width, 4) sRGB crop with straight alpha; alpha is the figure's coverage.
        box: (x, y, width, height) of the crop in the sheet, pixels.
        line_width_px: width of the drawn contour line; 0 where there is none.
        name: file name of the view in a bundle, e.g. "000.png".
        ends: lines in pixels of the crop where a frame cuts the figure, infinite where none does:
            beyond them the drawing says nothing.
        paper: sRGB of the sheet behind the drawing; None where it is transparent or unknown, or
            where a person has had the chance to correct what was cut out.
        label: what it shows, as a person has said ("front", "3q", "90"); empty where nobody has.
        caption: what it shows as the sheet says ("front", "3q"); empty where nothing was read.
        origin: what it was cut from; None where that is not recorded.
        sheet: the one file that it was cut from; None where that is not recorded.
        swatches: 8-bit sRGB colours of the palette that its sheet prints, in reading order; empty
            where it prints none, or nobody has looked.
    """

    rgba: UInt8[np.ndarray, "height width 4"]
    box: tuple[int, int, int, int]
    line_width_px: float
    name: str
    ends: Ends = NO_ENDS
    paper: tuple[int, int, int] | None = None
    label: str = ""
    caption: str = ""
    origin: Origin | None = None
    sheet: InputFile | None = None
    swatches: tuple[tuple[int, int, int], ...] = ()

    def __post_init__(self) -> None:
        """Refuse an empty drawing.

        Raises:
            SheetError: the crop has no opaque pixel.
        """
        if not self.mask.any():
            raise SheetError(f"view {self.name}: no opaque pixel; crop the sheet to the figures")

    @property
    def figure_box(self) -> tuple[int, int, int, int]:
        """Return (x, y, width, height) in the sheet of what the figure visibly covers."""
        return visible_box(self.rgba, self.box)

    @property
    def shows(self) -> str:
        """Return its label, else its caption; "" where it has neither."""
        return self.label or self.caption

    @property
    def mask(self) -> Bool[np.ndarray, "height width"]:
        """Return which pixels the figure covers by at least half."""
        return self.rgba[..., 3] >= 128

    def _repr_png_(self) -> bytes:
        """Return the drawing for a notebook."""
        return small_png(self.rgba)

    def resized(self, size_wh: tuple[int, int]) -> View:
        """Return the drawing resampled to so many pixels; transparent ones lend no colour."""
        height, width = self.rgba.shape[:2]
        by = np.array(size_wh) / (width, height)
        way = cv2.INTER_AREA if by.min() < 1 else cv2.INTER_LINEAR
        rgba = straight(cv2.resize(premultiply(self.rgba), size_wh, interpolation=way))
        left, top, right, bottom = np.array(self.ends) * np.tile(by, 2)
        return replace(
            self, rgba=rgba, box=(*self.box[:2], *size_wh), ends=(left, top, right, bottom)
        )


def visible_box(rgba: UInt8[np.ndarray, "height width 4"], box: Box) -> Box:
    """Return (x, y, width, height) in the sheet of what a picture with this box there shows."""
    covered = rgba[..., 3] >= VISIBLE
    rows, columns = (np.flatnonzero(covered.any(axis=axis)) for axis in (1, 0))
    x, y = box[0] + int(columns[0]), box[1] + int(rows[0])
    return x, y, int(columns[-1] - columns[0]) + 1, int(rows[-1] - rows[0]) + 1


def premultiply(rgba: UInt8[np.ndarray, "height width 4"]) -> Float[np.ndarray, "height width 4"]:
    """Return a picture with colours times alpha, 0 to 255 as they were."""
    values = rgba.astype(np.float32)
    values[..., :3] *= values[..., 3:] / 255
    return values


def straight(values: Float[np.ndarray, "height width 4"]) -> UInt8[np.ndarray, "height width 4"]:
    """Return bytes with straight alpha of premultiplied colours, 0 to 255 as alpha is."""
    rgba = values.copy()
    rgba[..., :3] *= 255 / np.maximum(rgba[..., 3:], 1e-3)
    return np.rint(np.clip(rgba, 0, 255)).astype(np.uint8)


def over_white(rgba: UInt8[np.ndarray, "height width 4"]) -> Float[np.ndarray, "height width 3"]:
    """Return a straight-alpha picture over white, in [0, 1]."""
    values = rgba.astype(np.float64) / 255
    return values[..., :3] * values[..., 3:] + 1 - values[..., 3:]


def small_png(
    rgba: UInt8[np.ndarray, "height width 4"], side_px: int = SHOWN_PX, most: int = SHOWN_BYTES
) -> bytes:
    """Return a picture as a PNG file of at most `most` bytes, made smaller where it has to be.

    Args:
        rgba: with straight alpha.
        side_px: of the longer side, at most.
        most: bytes.
    """
    height, width = rgba.shape[:2]
    by = min(1.0, side_px / max(height, width))
    while True:
        size = (max(1, round(by * width)), max(1, round(by * height)))
        small = rgba
        if size != (width, height):
            small = straight(cv2.resize(premultiply(rgba), size, interpolation=cv2.INTER_AREA))
        data = cv2.imencode(".png", cv2.cvtColor(small, cv2.COLOR_RGBA2BGRA))[1].tobytes()
        if len(data) <= most or size == (1, 1):
            return data
        by *= 0.7


@dataclass(frozen=True)
class InputFile:
    """A file that a result depends on.

    Attributes:
        role: "sheet", "view", "mesh", ...
        name: without its folder, so that results are the same wherever it lies.
        sha256: of its bytes.
    """

    role: str
    name: str
    sha256: str

    def __post_init__(self) -> None:
        """Keep a name that any file can hold."""
        object.__setattr__(self, "name", as_text(self.name))

    @classmethod
    def of(cls, role: str, path: Path) -> InputFile:
        """Return the record of a file on disk."""
        return cls(role, path.name, sha256(path.read_bytes()).hexdigest())


@dataclass(frozen=True, eq=False)
class Origin:
    """Origin of the views of one or more sheets.

    Attributes:
        files: in the order in which they were given.
        options: how the sheets were cut, as typed; only what was given.
    """

    files: tuple[InputFile, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
