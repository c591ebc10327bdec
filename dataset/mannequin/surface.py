"""Mesh a solid as a closed, exactly mirror-symmetric surface of even triangles.

Only the half at x >= 0 is meshed, by marching cubes on a grid with a layer at x = 0, so that the
border of the half lies in that plane exactly; the other half is its mirror image. Marching cubes
leaves slivers: vertices then slide to the middle of their neighbours and back onto the solid.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.dataset.mannequin.solids import Distances, Points, Solid, both_sides

SLIDES = 6  # rounds of relaxation; more no longer change the triangles' angles
STEP = 0.5  # of the way to the neighbours' middle: a full step lets neighbours swap places
DIFFERENCE = 1e-5  # world units, of the numeric slope: far below a cell, far above rounding

Vertices = Float[np.ndarray, "vertices 3"]
Faces = Int[np.ndarray, "faces 3"]


def half_surface(
    solid: Solid, low: Float[np.ndarray, " 3"], high: Float[np.ndarray, " 3"], cell: float
) -> tuple[Vertices, Faces, Bool[np.ndarray, " vertices"]]:
    """Return vertices, faces (outside to the viewer) and which vertices lie at x = 0, for x >= 0.

    Args:
        solid: what to mesh; only its half at x >= 0 counts.
        low: lowest corner of a box around the half, its x is taken as 0.
        high: highest corner.
        cell: side of a grid cell, world units.
    """
    from skimage.measure import marching_cubes

    whole = both_sides(solid)
    origin = np.array([0.0, low[1], low[2]])
    axes = [np.arange(a, b + 2 * cell, cell) for a, b in zip(origin, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    field = whole(grid.reshape(-1, 3)).reshape(grid.shape[:3])
    vertices, faces, _, _ = marching_cubes(field, 0.0, spacing=(cell,) * 3)
    at_plane = vertices[:, 0] == 0
    return _relaxed(whole, vertices + origin, faces, at_plane), faces, at_plane


def with_mirror_image(
    vertices: Vertices, faces: Faces, at_plane: Bool[np.ndarray, " vertices"]
) -> tuple[Vertices, Faces]:
    """Return a half surface and, after its faces, their mirror images; the border is shared."""
    mirrored = vertices[~at_plane] * [-1, 1, 1]
    image_of = np.arange(len(vertices))
    image_of[~at_plane] = len(vertices) + np.arange(len(mirrored))
    return (
        np.concatenate([vertices, mirrored]),
        np.concatenate([faces, image_of[faces][:, ::-1]]),  # a mirror turns faces inside out
    )


def _relaxed(
    solid: Solid, vertices: Vertices, faces: Faces, at_plane: Bool[np.ndarray, " vertices"]
) -> Vertices:
    """Return the vertices spread evenly over the solid; those at x = 0 stay there."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    ends, others = np.concatenate([edges, edges[:, ::-1]]).T
    counts = np.bincount(ends, minlength=len(vertices))[:, None]
    for _ in range(SLIDES):
        sums = [np.bincount(ends, vertices[others, axis], len(vertices)) for axis in range(3)]
        moved = vertices + STEP * (np.stack(sums, axis=1) / counts - vertices)
        vertices = _onto(solid, moved)
        vertices[at_plane, 0] = 0
    return vertices


def _onto(solid: Solid, points: Points) -> Points:
    """Return the points moved to the surface along its slope, by one Newton step."""
    slope = _slope(solid, points)
    steepness = np.maximum((slope**2).sum(axis=1), 0.25)  # a crease between solids has little slope
    return points - slope * (solid(points) / steepness)[:, None]


def _slope(solid: Solid, points: Points) -> Points:
    def along(axis: int) -> Distances:
        shift = DIFFERENCE * np.eye(3)[axis]
        return (solid(points + shift) - solid(points - shift)) / (2 * DIFFERENCE)

    return np.stack([along(axis) for axis in range(3)], axis=1)
