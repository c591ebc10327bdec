"""Find the limbs that single drawings hold in a pose of their own, and give them bodies.

An arm that every drawing holds in another place is denied by all but one of them, and a field,
which agrees with most, leaves it out or shows it elsewhere. From about where it was drawn people
expect to see it as drawn. So each drawing gets what it shows and the field lacks as a body of its
own, put where the others object least (`completion`), and loses what the field has and it does not
show. Both are for views near that drawing.

Source: view-dependent geometry, Rademacher 1999.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage
from skimage.measure import marching_cubes

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame
from toonset.mesh import Mesh
from toonset.nerf.sections.completion import OVER_PX, inflated, missing_parts, rivals_of
from toonset.nerf.sections.drawing import Drawing, Mask, sample, signed_distance, working_drawings
from toonset.nerf.sections.grid import Grid, Volume, distance_again, grid_of
from toonset.raster import dilate

APART = 1.4  # of half a limb's width: so far off it is in another pose; less is the hand's error
LARGE = 0.012  # of the figure's pixels: smaller parts are shadows, hair tips and strokes
INTO_PX = 3  # into the body, that limbs hang on it

Shows = Callable[[Camera], Bool[np.ndarray, "height width"]]


@dataclass(frozen=True, eq=False)
class OwnLimbs:
    """What a drawing shows otherwise than a field.

    Attributes:
        mesh: what it shows and the field lacks; None: nothing.
        denied: (height, width) pixels of the drawing in which the field shows what it does not.
    """

    mesh: Mesh | None
    denied: Mask


def own_limbs(
    frames: Sequence[Frame],
    inside: Volume,
    low: Float[np.ndarray, " 3"],
    voxel: float,
    shows: Shows,
) -> list[OwnLimbs | None]:
    """Return what each drawing shows otherwise than a field; None of mirrored ones.

    Args:
        frames: posed drawings at eye level that show a figure.
        inside: (x, y, z) share of each voxel that may belong to the field.
        low: world position of the lowest corner.
        voxel: edge of a voxel, world units.
        shows: pixels in which a camera sees the field.

    Raises:
        BundleError: fewer than two drawings, or cameras do not belong together.
    """
    drawings, per_px = working_drawings(frames)
    drawings = tuple(
        replace(drawing, mirrored=frame.mirrored)
        for drawing, frame in zip(drawings, frames, strict=True)
    )
    grid = grid_of(drawings, per_px)
    places = (grid.centres - low) / voxel - 0.5
    solid = ndimage.map_coordinates(inside, places.T, order=1).reshape(grid.shape)
    f = distance_again(np.float32(0.5) - solid)
    found: list[OwnLimbs | None] = []
    for frame, drawing in zip(frames, drawings, strict=True):
        if drawing.mirrored:
            found.append(None)
            continue
        shown = shows(drawing.camera)
        mesh = _limbs(grid, f, drawing, shown, drawings)
        extra = missing_parts(shown, drawing.distance, APART, LARGE)
        found.append(OwnLimbs(mesh, _in_frame(extra, drawing, frame)))
    return found


def _limbs(
    grid: Grid, f: Volume, drawing: Drawing, shown: Mask, drawings: Sequence[Drawing]
) -> Mesh | None:
    """Return triangles round what a drawing shows and the field lacks."""
    beside = signed_distance(shown.astype(np.float32))
    lacking = missing_parts(drawing.mask, beside, APART, LARGE)
    lacking = dilate(lacking, INTO_PX) & drawing.mask
    if not lacking.any():
        return None
    balls = inflated(grid, f, drawing, lacking, rivals_of(drawing, drawings))
    outside = drawing.distance_at(grid.centres).reshape(grid.shape) - OVER_PX
    body = np.pad(np.maximum(balls.distance(grid), outside), 1, constant_values=1.0)
    if body.min() >= 0:
        return None
    vertices, faces, _, _ = marching_cubes(body, 0.0)
    places = grid.low + grid.voxel * (vertices.astype(np.float64) - 0.5)
    return Mesh(places, faces.astype(np.int64), name="limbs")


def _in_frame(mask: Mask, drawing: Drawing, frame: Frame) -> Mask:
    """Return a working drawing's mask at the size of its frame."""
    pixels = frame.camera.pixel_grid()
    points = frame.camera.unproject(pixels, np.zeros(pixels.shape[:2]))
    places = drawing.pixels(points.astype(np.float32))
    return np.asarray(sample(mask.astype(np.float32), places) > 0.5)
