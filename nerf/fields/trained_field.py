"""Hold a trained field with all that rendering it needs."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import UInt8

from toonset.nerf.fields.base import Field
from toonset.nerf.fields.classifier import PaletteClassifier
from toonset.nerf.hull.hull import Hull
from toonset.nerf.look.drawings import Drawings
from toonset.notebook import MOST_PICTURES, Cell, table
from toonset.palette.color_names import name_of
from toonset.palette.names import hex_of
from toonset.view import small_png

STRIP_PX = 960  # of all drawings, in a notebook

NO_PALETTE = "run: was trained without palette; train again without --no-palette"
NO_LINES = "run: its drawings have no contour lines; leave --layer ink out"
NO_DRAWINGS = "run: holds no drawings, so it has no drawn look; train again, or render --layer rgb"


@dataclass(frozen=True, eq=False)
class TrainedField:
    """A field that can be rendered.

    Attributes:
        field: density and colour.
        hull: where the field is evaluated.
        step: distance of samples along rays, world units.
        samples: most samples per ray.
        classifier: colour to palette label; None without palette.
        palette: (colors, 3) sRGB; None without palette.
        k: 1 / distance of a typical training camera, 0 = orthographic; for turntables.
        size_px: longest side of the training pictures, for turntables.
        drawings: what the drawn look is made of; None: the run holds none.
        kept: what renderings prepare for the next one; not part of the field.
    """

    field: Field
    hull: Hull
    step: float
    samples: int
    classifier: PaletteClassifier | None
    palette: UInt8[np.ndarray, "colors 3"] | None
    k: float
    size_px: int
    drawings: Drawings | None = None
    kept: dict[str, Any] = dataclasses.field(default_factory=dict, init=False, repr=False)

    def _repr_html_(self) -> str:
        """Return drawings and colours for a notebook; `toonset.render` shows the field itself."""
        colors = [] if self.palette is None else self.palette.tolist()
        rows: list[list[Cell]] = [
            [(r, g, b), hex_of((r, g, b)), name_of((r, g, b))] for r, g, b in colors
        ]
        views = self.drawings.views if self.drawings is not None else ()
        caption = (
            f"field of {len(views)} drawings, {self.size_px} px, {len(colors) or 'no'} colours"
        )
        strip = _strip([view.rgba for view in views]) if views else None
        return table(caption, ("", "code", "colour"), rows, strip)


def _strip(pictures: Sequence[UInt8[np.ndarray, "height width 4"]]) -> bytes:
    """Return pictures side by side as a small PNG file."""
    height = max(len(picture) for picture in pictures)
    room = [((0, height - len(picture)), (0, 0), (0, 0)) for picture in pictures]
    padded = [np.pad(picture, wide) for picture, wide in zip(pictures, room, strict=True)]
    return small_png(np.concatenate(padded, axis=1), STRIP_PX, MOST_PICTURES)
