"""A drawing as a texture: what other views take of it, and which of their places it shows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.camera import Camera
from toonset.nerf.look.border_lines import Unlined
from toonset.nerf.look.crisp_depth import filled
from toonset.nerf.look.features import Features, features_of
from toonset.nerf.look.outline import without_crumbs
from toonset.nerf.look.places import Places, places_in
from toonset.nerf.look.silhouette import Rim
from toonset.raster import sized_parts

CRUMB = 3e-4  # of the squared height of the figure: smaller patches that are seen are noise
FACES = 2  # times as far behind: hair bulges over faces, which stay whole


@dataclass(frozen=True, eq=False)
class Texture:
    """One drawing, ready to be looked up from other views.

    Attributes:
        camera: that saw it.
        whole: (height, width, 4) premultiplied, in [0, 1].
        drawn_by: the camera that calibration found.
        drawn: (rows, columns, 4) how it is on the sheet, premultiplied.
        paint: (height, width, 3) straight colour in [0, 1]: see `Drawing`.
        labels: (height, width) of this paint.
        far: (height, width) depth of the surface, the farthest of 3 x 3 pixels; -inf beside it, and
            just behind the steps of a known shape.
        to_edge: (height, width) pixels to the outline or the nearest step in depth.
        rim: what its outline has beyond the surface's.
        beyond: (height, width) pixels to the drawing and its surface.
        pen: width in pixels and colour of its lines; None: there are none.
        figure_px: height of the figure.
        in_own: (height, width, 3) the paint in the artist's colours.
    """

    camera: Camera
    whole: Float[np.ndarray, "height width 4"]
    drawn_by: Camera
    drawn: Float[np.ndarray, "rows columns 4"]
    paint: Float[np.ndarray, "height width 3"]
    labels: UInt8[np.ndarray, "height width"]
    far: Float[np.ndarray, "height width"]
    to_edge: Float[np.ndarray, "height width"]
    rim: Rim
    beyond: Float[np.ndarray, "height width"]
    pen: tuple[float, tuple[int, int, int]] | None
    figure_px: float
    in_own: UInt8[np.ndarray, "height width 3"]

    @cached_property
    def features(self) -> Features:
        """Return what is carried whole."""
        inside = self.whole[..., 3] > 0.5
        drawn = self.in_own / np.float32(255)
        return features_of(self.paint, self.labels, inside, self.pen, self.figure_px, drawn)

    @cached_property
    def unlined(self) -> Unlined:
        """Return its paints without lines and features."""
        found = self.features
        inside = (self.whole[..., 3] > 0.5) & (found.numbers == 0)
        drawn = self.in_own / np.float32(255)
        return Unlined.of(drawn, found.labels, inside, self.pen, self.figure_px)

    @cached_property
    def afloat(self) -> Bool[np.ndarray, "height width"]:
        """Return the pixels that it shows apart from its largest part."""
        part, areas = sized_parts(self.whole[..., 3] > 0.5)
        return (part > 0) & (part != areas[1:].argmax() + 1)

    @cached_property
    def anchors(self) -> Float[np.ndarray, "features 3"]:
        """Return the world points of the surface at which the features' middles lie."""
        found = self.features.found
        middles = np.array([feature.middle for feature in found]).reshape(-1, 2)
        surface = filled(np.where(np.isfinite(self.far), self.far, np.nan))
        depths = [np.median(surface[one.rows, one.columns][one.matte > 0.5]) for one in found]
        return self.camera.unproject(middles + 0.5, np.array(depths))


@dataclass(frozen=True, eq=False)
class Seen:
    """Projection of surface points into one drawing.

    Attributes:
        x, y: (h, w) column and row, the first pixel's centre at 0.
        mask: (h, w) the drawing shows the place.
    """

    x: Float[np.ndarray, "h w"]
    y: Float[np.ndarray, "h w"]
    mask: Bool[np.ndarray, "h w"]

    def moved(self, flow: Float[np.ndarray, "h w 2"] | None, part: float) -> Places:
        """Return the places with `part` of a displacement added, pixels of the drawing."""
        if flow is None or part == 0:
            return self.x, self.y
        return self.x + np.float32(part) * flow[..., 0], self.y + np.float32(part) * flow[..., 1]


def look_up(
    texture: Texture,
    points: Float[np.ndarray, "h w 3"],
    slack: float,
    least_px: float,
    *,
    faces: bool = False,
) -> Seen:
    """Return where places of the surface lie in a drawing, and which of them it shows.

    Args:
        texture: the drawing.
        points: world.
        slack: world units that a place may lie behind the drawing's own surface.
        least_px: smaller patches and pinholes of what it shows are noise.
        faces: groups of features may lie FACES times as far behind it.
    """
    (x, y), depth, front = places_in(texture.camera, points)
    border = cv2.BORDER_CONSTANT
    far = cv2.remap(texture.far, x, y, cv2.INTER_NEAREST, borderMode=border, borderValue=-np.inf)
    covered = cv2.remap(texture.whole[..., 3], x, y, cv2.INTER_LINEAR, borderMode=border)
    if faces:
        grouped = cv2.remap(texture.features.groups, x, y, cv2.INTER_NEAREST) > 0
        far = far + np.float32((FACES - 1) * slack) * grouped
    mask = front & (covered > 0.5) & (depth <= far + slack)
    return Seen(x, y, without_crumbs(mask, least_px))
