"""Unwrap a surface into charts of one atlas, and find the place under every texel.

Charts end at the borders of `groups`. Between charts is a gutter wide enough for four mip levels;
texels there belong to the nearest face, whose plane goes on beyond its edges.

Source: xatlas (J. Young), after thekla_atlas (I. Castano).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from toonset.dataset.mesh.rasterize import face_numbers
from toonset.errors import SetupError
from toonset.raster import distance_to, nearest

GUTTER = 4  # texels round every chart
MOST_SIDE = 2048  # texels, about: half a GiB of memory while it is painted
FILLED = 0.7  # of a picture that charts cover, usually
LEAST_PART = 0.01  # of the surface: a smaller group (an eye, a button) stays in the chart around it
NO_XATLAS = (
    "xatlas: is not installed, and --texture needs it; pip install xatlas (it takes a C++ compiler "
    "where there is no build for the platform), or leave --texture out"
)


@dataclass(frozen=True, eq=False)
class Atlas:
    """A flattened surface.

    Attributes:
        vertex: (corners,) vertex of the surface at every corner of a chart.
        uv: (corners, 2) its place, texels to the right and down.
        faces: (faces, 3) corners; the faces of the surface in their order.
        size_wh: of the picture, texels.
    """

    vertex: Int[np.ndarray, " corners"]
    uv: Float[np.ndarray, "corners 2"]
    faces: Int[np.ndarray, "faces 3"]
    size_wh: tuple[int, int]


def check_xatlas() -> None:
    """Refuse, before any work, to unwrap without the package for it.

    Raises:
        SetupError: xatlas is not installed.
    """
    if find_spec("xatlas") is None:
        raise SetupError(NO_XATLAS)


def unwrap(
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    groups: Int[np.ndarray, " f"],
    texels_per_unit: float,
) -> Atlas:
    """Return a surface's atlas.

    Args:
        vertices: world.
        faces: triangles; neighbours share vertices.
        groups: of every face; see `parts_of`. No chart holds faces of two.
        texels_per_unit: how fine, per world unit; coarser where the picture would be too large.

    Raises:
        SetupError: xatlas is not installed.
    """
    check_xatlas()
    import xatlas

    corners = vertices[faces]
    area = float(areas(corners).sum())
    fitting = math.sqrt(FILLED * MOST_SIDE**2 / area)
    atlas = xatlas.Atlas()
    order = [np.flatnonzero(groups == group) for group in range(int(groups.max()) + 1)]
    used = []
    for chosen in order:
        own, index = np.unique(faces[chosen], return_inverse=True)
        used.append(own)
        atlas.add_mesh(vertices[own].astype(np.float32), index.reshape(-1, 3).astype(np.uint32))
    packing = xatlas.PackOptions()
    packing.padding, packing.texels_per_unit = GUTTER, min(texels_per_unit, fitting)
    atlas.generate(pack_options=packing)
    found = [atlas.get_mesh(i) for i in range(len(order))]
    starts = np.cumsum([0] + [len(vertex) for vertex, _, _ in found])
    flat = np.zeros(faces.shape, dtype=np.int64)
    for chosen, start, (_, index, _) in zip(order, starts, found, strict=False):
        flat[chosen] = index.astype(np.int64) + start
    uv = np.concatenate([place for _, _, place in found]) * [atlas.width, atlas.height]
    vertex = np.concatenate([own[new] for own, (new, _, _) in zip(used, found, strict=True)])
    width, height = (-(-size // GUTTER) * GUTTER for size in (atlas.width, atlas.height))
    return Atlas(vertex, uv.astype(np.float64), flat, (width, height))


def parts_of(
    vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"], kinds: Int[np.ndarray, " f"]
) -> Int[np.ndarray, " f"]:
    """Return the connected parts of one kind; small ones count to the part around them.

    Args:
        vertices: world.
        faces: of a closed surface.
        kinds: of every face.
    """
    one, other, ends = neighbours(faces)
    length = np.linalg.norm(vertices[ends[:, 0]] - vertices[ends[:, 1]], axis=1)
    area = areas(vertices[faces])
    part = _connected(len(faces), one, other, kinds[one] == kinds[other])
    while True:
        size = np.bincount(part, area)
        border = part[one] != part[other]
        small = size < LEAST_PART * size.sum()
        if not (small[part[one]] | small[part[other]])[border].any():
            return part
        count = len(size)
        pairs = sparse.coo_array(
            (length[border], (part[one][border], part[other][border])), shape=(count, count)
        ).tocsr()
        pairs = (pairs + pairs.T).tocsr()
        least = int(np.where(small & (pairs.sum(axis=1) > 0), size, np.inf).argmin())
        row = pairs[[least]].tocoo()
        around = int(row.coords[1][row.data.argmax()])
        part = np.unique(np.where(part == least, around, part), return_inverse=True)[1]


def neighbours(
    faces: Int[np.ndarray, "f 3"],
) -> tuple[Int[np.ndarray, " e"], Int[np.ndarray, " e"], Int[np.ndarray, "e 2"]]:
    """Return the two faces at every edge of a closed surface, and the edge's ends."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    order = np.lexsort(ends.T)
    face = np.repeat(np.arange(len(faces)), 3)[order]
    return face[::2], face[1::2], ends[order[::2]]


def texel_faces(
    atlas: Atlas,
) -> tuple[
    Int[np.ndarray, "height width"],
    Bool[np.ndarray, "height width"],
    tuple[Int[np.ndarray, "height width"], Int[np.ndarray, "height width"]],
]:
    """Return the face under every texel, which texels lie on or near one, and the nearest of those.

    In the gutters it is the nearest face.
    """
    face = face_numbers(atlas.uv[atlas.faces], atlas.size_wh)
    inside = face >= 0
    near = distance_to(inside) <= GUTTER
    return face[nearest(inside)], near, nearest(near)


def texel_places(
    atlas: Atlas, face: Int[np.ndarray, "height width"]
) -> Float[np.ndarray, "height width 3"]:
    """Return the barycentric place of every texel's middle in its face's plane."""
    height, width = face.shape
    middles = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1)
    a, b, c = np.moveaxis(atlas.uv[atlas.faces], 1, 0)
    one, two = b - a, c - a
    twice = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    inverse = 1 / np.where(np.abs(twice) > 1e-9, twice, np.inf)
    way = middles - a[face]
    along = (way[..., 0] * two[face, 1] - way[..., 1] * two[face, 0]) * inverse[face]
    across = (one[face, 0] * way[..., 1] - one[face, 1] * way[..., 0]) * inverse[face]
    return np.stack([1 - along - across, along, across], axis=-1)


def areas(corners: Float[np.ndarray, "f 3 3"]) -> Float[np.ndarray, " f"]:
    """Return the areas of triangles."""
    a, b, c = np.moveaxis(corners, 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def _connected(
    count: int,
    one: Int[np.ndarray, " e"],
    other: Int[np.ndarray, " e"],
    joined: Bool[np.ndarray, " e"],
) -> Int[np.ndarray, " count"]:
    links = (np.ones(int(joined.sum())), (one[joined], other[joined]))
    graph = sparse.coo_array(links, shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
