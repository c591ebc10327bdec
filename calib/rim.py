"""The mannequin's outline from any direction: contour generators and silhouette masks, no OpenGL.

A contour generator is an edge whose two faces turn different sides to the camera (or an edge of an
open surface). Its points on the outer silhouette are kept by a low-resolution mask. In the image a
rim point's normal is perpendicular to its edge, away from the faces. To first order in the pose a
rim point may be treated as fixed on the mesh: its sliding moves it along the outline only.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.mesh import Mesh

FAR = 9.0  # depth that means "nothing here" in the rasteriser
OUTER_PX = 1.3  # a rim point nearer than this to the background lies on the outer silhouette


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh prepared for outlines.

    Attributes:
        vertices: (n, 3), shifted so that the middle of the bounding box is the origin.
        faces: (m, 3) int32.
        edges: (e, 2) vertex indices of every edge.
        edge_faces: (e, 2) the faces at an edge; the same face twice where there is only one, or
            where more than two meet (such an edge is always a candidate).
        opposite: (e,) the vertex across the edge in its first face.
        middle: (3,) world coordinates of the origin.
        height: world units along +Y.
        radius: farthest vertex from the origin.
    """

    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "faces 3"]
    edges: Int[np.ndarray, "edges 2"]
    edge_faces: Int[np.ndarray, "edges 2"]
    opposite: Int[np.ndarray, " edges"]
    middle: Float[np.ndarray, " 3"]
    height: float
    radius: float


@dataclass(frozen=True, eq=False)
class Rim:
    """Points of the mesh on its outline in one view.

    Attributes:
        points: (n, 3) in the surface's coordinates.
        normals: (n, 2) outward in the image.
    """

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 2"]


def prepare_surface(mesh: Mesh) -> Surface:
    """Return the mesh with its edges and their faces."""
    faces = np.ascontiguousarray(mesh.faces, dtype=np.int32)
    corners = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    owner = np.tile(np.arange(len(faces)), 3)
    across = np.concatenate([faces[:, 2], faces[:, 0], faces[:, 1]])
    keys = np.sort(corners, axis=1)
    order = np.lexsort((keys[:, 1], keys[:, 0]))
    keys, owner, across = keys[order], owner[order], across[order]
    first = np.concatenate([[True], (np.diff(keys, axis=0) != 0).any(axis=1)])
    starts = np.flatnonzero(first)
    counts = np.diff(np.append(starts, len(keys)))
    second = np.where(counts == 2, starts + (counts > 1), starts)
    edge_faces = np.stack([owner[starts], owner[second]], axis=1)
    vertices = mesh.vertices - mesh.middle
    return Surface(
        vertices,
        faces,
        keys[starts],
        edge_faces,
        across[starts],
        mesh.middle,
        mesh.height,
        mesh.radius,
    )


def silhouette_mask(
    pixels: Float[np.ndarray, "vertices 2"],
    faces: Int[np.ndarray, "faces 3"],
    size_wh: tuple[int, int],
) -> Bool[np.ndarray, "height width"]:
    """Return which pixel centres the projected triangles cover."""
    width, height = size_wh
    flat = np.empty((len(pixels), 3), dtype=np.float32)
    flat[:, 0] = (pixels[:, 0] * 2 - width) / height
    flat[:, 1] = 1 - pixels[:, 1] * (2 / height)
    flat[:, 2] = -1
    depth = np.full((height, width), FAR, dtype=np.float32)
    eye = np.eye(4, dtype=np.float32)
    cv2.triangleRasterizeDepth(flat, faces, depth, eye, np.pi / 2, 0.1, FAR, _no_culling())
    return depth < FAR - 0.1


def find_rim(
    surface: Surface,
    pixels: Float[np.ndarray, "vertices 2"],
    size_wh: tuple[int, int],
    spacing_px: float,
) -> Rim:
    """Return the points of the surface on its outer silhouette.

    Args:
        surface: the prepared mesh.
        pixels: its projected vertices; pixels also set the resolution of the visibility test.
        size_wh: image size that holds them.
        spacing_px: distance of neighbouring rim points along an edge.
    """
    mask = silhouette_mask(pixels, surface.faces, size_wh)
    a, b, c = (pixels[surface.faces[:, i]] for i in range(3))
    ab, ac = b - a, c - a
    turned = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0] > 0
    left, right = surface.edge_faces.T
    candidates = np.flatnonzero((turned[left] != turned[right]) | (left == right))
    edges = surface.edges[candidates]
    start, along = pixels[edges[:, 0]], pixels[edges[:, 1]] - pixels[edges[:, 0]]
    length = np.linalg.norm(along, axis=1)
    count = np.maximum(1, np.ceil(length / spacing_px)).astype(np.intp)
    which = np.repeat(np.arange(len(edges)), count)
    step = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    fraction = ((step + 0.5) / count[which])[:, None]
    at = start[which] + fraction * along[which]
    keep = _on_outer_silhouette(mask, at) & (length[which] > 1e-6)
    which, fraction = which[keep], fraction[keep]
    edge_points = surface.vertices[edges[which]]
    normal = np.stack([-along[which, 1], along[which, 0]], axis=1) / length[which, None]
    inward = pixels[surface.opposite[candidates[which]]] - start[which]
    normal *= -np.sign((normal * inward).sum(axis=1, keepdims=True) + 1e-12)
    return Rim(edge_points[:, 0] * (1 - fraction) + edge_points[:, 1] * fraction, normal)


def _on_outer_silhouette(
    mask: Bool[np.ndarray, "height width"], pixels: Float[np.ndarray, "n 2"]
) -> Bool[np.ndarray, " n"]:
    height, width = mask.shape
    inside = cv2.distanceTransform(
        np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
    )[1:-1, 1:-1]
    column, row = np.floor(pixels).astype(np.intp).T
    seen = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    near = inside[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)] <= OUTER_PX
    return seen & near


@cache
def _no_culling() -> Any:
    settings = cv2.TriangleRasterizeSettings()
    settings.setCullingMode(cv2.RASTERIZE_CULLING_NONE)
    return settings
