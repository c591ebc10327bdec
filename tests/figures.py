"""Bodies of boxes, and bodies as drawings: exact coverage, nothing painted inside."""

from collections.abc import Callable, Iterable

import numpy as np
import trimesh

from toonset.dataset.mesh.rasterize import silhouette_mask
from toonset.mesh import Mesh
from toonset.view import View

Size = tuple[float, float, float]


def boxes(*parts: tuple[Size, Size], colors: Iterable[tuple[int, ...]] = ()) -> Mesh:
    """Return boxes of given sizes and middles as one mesh of as many parts."""
    made = [trimesh.creation.box(size).apply_translation(middle) for size, middle in parts]
    faces = np.concatenate([box.faces + 8 * i for i, box in enumerate(made)])
    painted = np.repeat(np.array([*colors], np.uint8), 12, axis=0) if colors else None
    vertices = np.concatenate([box.vertices for box in made])
    return Mesh(vertices, np.ascontiguousarray(faces, dtype=np.int32), painted)


def drawn(
    mesh: Mesh, pixels_of: Callable[[np.ndarray], np.ndarray], size_wh: tuple[int, int]
) -> View:
    """Return the silhouette of a mesh, each pixel as opaque as it is covered."""
    width, height = size_wh
    pixels, faces = pixels_of(mesh.vertices) * 4, np.ascontiguousarray(mesh.faces, dtype=np.int32)
    fine = silhouette_mask(pixels, faces, (width * 4, height * 4))
    rgba = np.full((height, width, 4), 90, np.uint8)
    rgba[..., 3] = np.round(255 * fine.reshape(height, 4, width, 4).mean(axis=(1, 3)))
    return View(rgba, (0, 0, width, height), 0.0, "000.png")
