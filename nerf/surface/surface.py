"""Extract the surface of a trained field as triangles in palette colours.

Marching cubes on what is solid; palette probabilities at the vertices; triangles cut where two
colours are equally likely. Neighbours share the cuts, so the surface stays closed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from jaxtyping import Float, Int
from scipy import ndimage
from skimage.measure import marching_cubes

from toonset.errors import UsageError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.options import FEWEST_FACES, MeshOptions
from toonset.nerf.surface.color import label_probabilities
from toonset.nerf.surface.cut import cut
from toonset.nerf.surface.decimate import decimate
from toonset.nerf.surface.files import Surface, Variant
from toonset.nerf.surface.solid import SOLID_FROM, Solid, solid_of

ROUNDS = 2  # of averaging colours over neighbours: specks go, borders come out smooth
FINER = 4  # times as many faces as wanted are enough to choose from


def surface_of(
    trained: TrainedField,
    faces: int | None = MeshOptions.faces,
    progress: Callable[[str, float], None] = lambda step, done: None,
    *,
    variants: Sequence[tuple[str, TrainedField]] = (),
) -> Surface:
    """Return the surface of a trained field.

    Args:
        trained: a field with palette.
        faces: at most so many triangles; None: all, a few per voxel of the hull's surface.
        progress: told what is done now, and which share of it.
        variants: the same field in other colours, by name; for GLB files only.

    Raises:
        BundleError: the field shows nothing.
        PaletteError: the run was trained without palette.
        UsageError: fewer than 100 triangles asked for.
    """
    if faces is not None and faces < FEWEST_FACES:
        raise UsageError(f"faces: {faces}; {FEWEST_FACES} or more are needed to close a figure")
    solid = solid_of(trained, partial(progress, "finding the surface"))
    vertices, corners = _triangles(solid)
    rounds = ROUNDS
    if faces is not None and len(corners) > 4 * FINER * faces:
        vertices, corners = _triangles(_halved(solid))
        rounds = 0  # edges are twice as long: one round would already take small features
    chances = label_probabilities(trained, vertices, corners, rounds)
    vertices, corners, labels = cut(vertices, corners, chances)
    if faces is not None and len(corners) > faces:
        fewer = partial(progress, "merging triangles")
        vertices, corners, labels = decimate(vertices, corners, labels, faces, fewer)
    assert trained.palette is not None  # label_probabilities has refused a run without palette
    others = [(name, field.palette) for name, field in variants]
    known = tuple(Variant(name, palette) for name, palette in others if palette is not None)
    return Surface(vertices, corners, labels, trained.palette, known)


def _triangles(solid: Solid) -> tuple[Float[np.ndarray, "vertices 3"], Int[np.ndarray, "faces 3"]]:
    """Return the level set; faces turn counter-clockwise as seen from where values are low."""
    # a value at the level itself would put several vertices at one place
    at_level = np.abs(solid.values - SOLID_FROM) < 1e-4
    values = np.where(at_level, np.float32(SOLID_FROM + 1e-4), solid.values)
    vertices, faces, _, _ = marching_cubes(values, SOLID_FROM, gradient_direction="ascent")
    return solid.low + solid.voxel * vertices.astype(np.float64), faces.astype(np.int64)


def _halved(solid: Solid) -> Solid:
    """Return every other value along each axis, of the volume smoothed for that."""
    smooth = np.pad(ndimage.uniform_filter(solid.values, 2, mode="constant"), 2)
    # uniform_filter of 2 puts the mean of values i - 1 and i at i
    low = solid.low - 2.5 * solid.voxel
    return Solid(low, 2 * solid.voxel, smooth[::2, ::2, ::2])
