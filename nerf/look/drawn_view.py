"""A view of a field: its geometry, and what it looks like when it is drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from toonset.camera import Camera
from toonset.palette.pixels.labels import UNLABELLED

SOLID = 0.5  # opacity from which a pixel shows the surface
DRAWN, MIRRORED, GUESSED = 0, 1, 2  # where a pixel's paint comes from
SOURCES = ("drawn", "mirrored", "guessed")


@dataclass(frozen=True, eq=False)
class Geometry:
    """Geometry of the field as a view sees it.

    Attributes:
        camera: of the view.
        alpha: (height, width) opacity in [0, 1].
        depth: (height, width) past the camera's target, nan where nothing is seen.
    """

    camera: Camera
    alpha: Float[np.ndarray, "height width"]
    depth: Float[np.ndarray, "height width"]

    @classmethod
    def of(cls, camera: Camera) -> Geometry:
        """Return what is seen where only the mannequin's shape is known: nothing."""
        size = camera.size_wh[::-1]
        return cls(camera, np.zeros(size, np.float32), np.full(size, np.nan, np.float32))

    def crop(self, rows: slice, columns: slice) -> Geometry:
        """Return a part of the view."""
        at = (rows, columns)
        size = (columns.stop - columns.start, rows.stop - rows.start)
        corner = (columns.start, rows.start)
        return Geometry(self.camera.moved(corner, size), self.alpha[at], self.depth[at])


@dataclass(frozen=True, eq=False)
class DrawnView:
    """A view in the drawn look.

    Attributes:
        rgb: (height, width, 3) premultiplied colour in [0, 1], lines included.
        alpha: (height, width) coverage in [0, 1].
        ink: (height, width) share of every pixel that lines cover.
        labels: (height, width) of `Drawings.paints`.
        paint: (height, width, 3) straight colour under the lines, in [0, 1].
        source: (height, width) of a pixel's paint: DRAWN; MIRRORED, where only the mirror image of
            a drawing shows the place; GUESSED, which is the paint beside it; or, in a
            view of which no drawing shows anything, that of the nearest drawing behind it.
    """

    rgb: Float[np.ndarray, "height width 3"]
    alpha: Float[np.ndarray, "height width"]
    ink: Float[np.ndarray, "height width"]
    labels: UInt8[np.ndarray, "height width"]
    paint: Float[np.ndarray, "height width 3"]
    source: UInt8[np.ndarray, "height width"]

    @property
    def by_field(self) -> float:
        """Return the share of the figure's pixels that no drawing shows."""
        return self.share(GUESSED)

    def share(self, source: int) -> float:
        """Return the share of the figure's pixels whose paint comes from a source."""
        solid = self.alpha >= SOLID
        return float((solid & (self.source == source)).sum() / max(solid.sum(), 1))

    def palette_labels(self, colors: int) -> UInt8[np.ndarray, "height width"]:
        """Return the labels of a palette's colours; 255 beside the figure and on other ink."""
        shown = (self.alpha >= SOLID) & (self.labels < colors)
        return np.where(shown, self.labels, UNLABELLED).astype(np.uint8)
