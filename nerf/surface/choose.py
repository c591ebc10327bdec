"""Choose the drawing that paints each face of a surface, by graph cuts.

    cost = sum over faces of   area (1 - how frontal and how far from an edge it is drawn)
         + sum over seams of   length (colours apart + SEAM + FEATURE where an eye or a button is)

Seams run where two drawings show the same colour, and round features, never across. A face that no
drawing shows is the field's.

Source: Lempitsky and Ivanov, "Seamless mosaicing of image-based texture maps", 2007; expansion
moves: Boykov, Veksler and Zabih 2001; their graph: Kolmogorov and Zabih 2004.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from toonset.camera import Camera
from toonset.dataset.mesh.rasterize import depth_map
from toonset.nerf.look.crisp_depth import SQUARE
from toonset.nerf.look.places import Places, sample_picture
from toonset.nerf.surface.paint import Paint
from toonset.nerf.surface.unwrap import areas, neighbours

INNER = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
ALONG = np.array([0.2, 0.5, 0.8])  # of an edge: where seams are looked at
SHOWN = 0.6  # of a face's points must be in sight
GRAZING = 0.15  # cosine: a face seen more askew is not seen
BEHIND = 0.01  # of the figure's height, that a face may lie behind what is seen
FINER = 2.0  # pixels of the depth picture per pixel of the drawing
APART, SEAM, FEATURE = 12.0, 2.0, 40.0  # per pixel of a seam; colours in [0, 1]
TALL = 270.0  # pixels of a figure, in costs
UNIT = 64  # of costs, which are whole numbers: a graph's capacities
NEVER = 1 << 24
SWEEPS = 3


def merits(
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    paints: Sequence[Paint],
    height: float,
) -> Float[np.ndarray, "f drawings"]:
    """Return how well each drawing shows each face: 1 frontal and far from edges, 0 not at all.

    Args:
        vertices: world.
        faces: of the surface.
        paints: of the drawings.
        height: of the figure, world units.
    """
    corners = vertices[faces]
    points = np.einsum("kc,fcx->fkx", INNER, corners)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    result = np.zeros((len(faces), len(paints)))
    for number, paint in enumerate(paints):
        camera = paint.texture.camera
        deepest = cv2.dilate(
            depth_map(vertices, faces, camera.resized(FINER)).astype(np.float32), SQUARE
        )
        (x, y), depth = _places(camera, points)
        across, down = (np.float32(FINER) * (at + 0.5) - np.float32(0.5) for at in (x, y))
        limit = cv2.remap(deepest, across, down, cv2.INTER_NEAREST, borderValue=-np.inf)
        cover = cv2.remap(paint.texture.whole[..., 3], x, y, cv2.INTER_LINEAR)
        seen = (depth <= limit + BEHIND * height) & (cover > 0.5)
        ways = camera.rotation[2] + camera.k * (points[:, 0] - camera.target)
        frontal = -(normal * ways).sum(axis=1) / np.linalg.norm(ways, axis=1)
        good = frontal * sample_picture(paint.trust, (x, y), cv2.INTER_LINEAR).mean(axis=1)
        shown = (seen.mean(axis=1) >= SHOWN) & (frontal > GRAZING)
        result[:, number] = np.where(shown, good, 0)
    return result


def chosen(
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    merit: Float[np.ndarray, "f drawings"],
    paints: Sequence[Paint],
    height: float,
) -> Int[np.ndarray, " f"]:
    """Return the drawing of every face; the number behind the last one for the field.

    Args:
        vertices: world.
        faces: of a closed surface.
        merit: see `merits`.
        paints: of the drawings.
        height: of the figure, world units.
    """
    px_per_unit = TALL / height
    area = areas(vertices[faces]) * px_per_unit**2
    unseen = ~(merit > 0).any(axis=1)
    own = np.where(merit > 0, np.rint(UNIT * area[:, None] * (1 - merit)), NEVER)
    own = np.column_stack([own, np.where(unseen, 0, NEVER)]).astype(np.int64)
    seams = _seams(vertices, faces, paints, px_per_unit)
    label = own.argmin(axis=1)
    for _ in range(SWEEPS):
        before = label
        for new in range(own.shape[1]):
            label = _expanded(label, new, own, seams)
        if (label == before).all():
            break
    return label


@dataclass(frozen=True, eq=False)
class _Seams:
    """The edges between faces, and what two drawings that meet there cost.

    Attributes:
        one, other: (e,) faces.
        length: (e,) pixels.
        color: (drawings and field, e, samples, 3) what each shows along the edge.
        feature: (drawings and field, e) how much of it lies on a feature.
    """

    one: Int[np.ndarray, " e"]
    other: Int[np.ndarray, " e"]
    length: Float[np.ndarray, " e"]
    color: Float[np.ndarray, "n e samples 3"]
    feature: Float[np.ndarray, "n e"]

    def cost(
        self, first: Int[np.ndarray, " e"], second: Int[np.ndarray, " e"]
    ) -> Int[np.ndarray, " e"]:
        """Return the cost of each edge; a metric over the drawings."""
        edge = np.arange(len(self.one))
        apart = np.abs(self.color[first, edge] - self.color[second, edge]).mean(axis=(1, 2))
        feature = self.feature[first, edge] + self.feature[second, edge]
        cost = UNIT * self.length * (APART * apart + SEAM + FEATURE * feature)
        return np.where(first == second, 0, np.rint(cost)).astype(np.int64)


def _seams(
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    paints: Sequence[Paint],
    px_per_unit: float,
) -> _Seams:
    one, other, ends = neighbours(faces)
    start, end = vertices[ends[:, 0]], vertices[ends[:, 1]]
    length = np.linalg.norm(end - start, axis=1) * px_per_unit
    points = start[:, None] + ALONG[:, None] * (end - start)[:, None]
    colors, features = [], []
    for paint in paints:
        places, _ = _places(paint.texture.camera, points)
        colors.append(sample_picture(paint.texture.paint, places, cv2.INTER_LINEAR))
        on = sample_picture(paint.feature.astype(np.float32), places, cv2.INTER_NEAREST)
        features.append(on.mean(axis=1))
    color = np.stack([*colors, np.mean(colors, axis=0)])
    return _Seams(one, other, length, color, np.stack([*features, np.zeros(len(ends))]))


def _places(
    camera: Camera, points: Float[np.ndarray, "rows columns 3"]
) -> tuple[Places, Float[np.ndarray, "rows columns"]]:
    """Return columns and rows in a drawing, the first pixel's centre at 0, and depth."""
    pixels, depth, _ = camera.project(points)
    x, y = (np.nan_to_num(pixels[..., k] - 0.5, nan=-1e4).astype(np.float32) for k in (0, 1))
    return (x, y), depth


def _expanded(
    label: Int[np.ndarray, " f"], new: int, own: Int[np.ndarray, "f n"], seams: _Seams
) -> Int[np.ndarray, " f"]:
    """Return the labels after the best move of any faces to one label, by a minimal cut."""
    count, one, other = len(label), seams.one, seams.other
    everywhere = np.full(len(one), new)
    stay = seams.cost(label[one], label[other])
    other_moves = seams.cost(label[one], everywhere)
    one_moves = seams.cost(everywhere, label[other])
    face = np.arange(count)
    moving = own[:, new] - own[face, label]
    np.add.at(moving, one, one_moves - stay)
    np.add.at(moving, other, -one_moves)
    link = np.maximum(other_moves + one_moves - stay, 0)
    source, sink = count, count + 1  # on the source's side: stays
    rows = np.concatenate([np.full(count, source), face, one])
    columns = np.concatenate([face, np.full(count, sink), other])
    capacity = np.concatenate([np.maximum(moving, 0), np.maximum(-moving, 0), link])
    shape = (count + 2, count + 2)
    graph = sparse.csr_matrix((capacity.astype(np.int32), (rows, columns)), shape=shape)
    left = graph - maximum_flow(graph, source, sink).flow
    left.eliminate_zeros()
    moves = np.ones(count + 2, dtype=bool)
    moves[breadth_first_order(left, source, return_predecessors=False)] = False
    return np.where(moves[:count], new, label)
