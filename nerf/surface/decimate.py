"""Decimate a mesh by quadric error, keeping the borders of colours.

A vertex' cost is its squared distance from the planes of the faces that were merged into it. On an
edge between two labels stands one more plane, upright on each face, so borders cost what outlines
cost. An edge collapses only where the surface stays closed (its ends share exactly two neighbours)
and no face turns over.

Source: Garland and Heckbert, "Surface simplification using quadric error metrics", 1997, and for
borders "Simplifying surfaces with color and texture", 1998; link condition: Dey et al. 1999.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int

BORDER_WEIGHT = 4.0  # of a border's planes against faces' planes
STEPS_BETWEEN = 1000  # of two reports of how far it is
LEAST_TURN = 0.2  # cosine between a face's normal before and after
SINGULAR = 1e-6  # of the matrix' scale to the third: then ends and middle are tried instead

Point = tuple[float, float, float]
Triangles = tuple[
    Float[np.ndarray, "vertices 3"], Int[np.ndarray, "faces 3"], Int[np.ndarray, " faces"]
]


def decimate(
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    labels: Int[np.ndarray, " f"],
    wanted: int,
    progress: Callable[[float], None] = lambda done: None,
) -> Triangles:
    """Return a closed surface with at most `wanted` faces, or as few as keep it closed.

    Args:
        vertices: places.
        faces: triangles of a closed surface; of any, where there is but one label. Edges of a
            single face stay.
        labels: of every face; faces keep theirs.
        wanted: number of faces to stop at.
        progress: told which share of the faces that go is gone.
    """
    scale = float(np.ptp(vertices, axis=0).max())
    middle = vertices.mean(axis=0)
    unit = (vertices - middle) / scale  # one unit for all thresholds
    net = _Net(unit, faces, _quadrics(unit, faces, labels))
    net.collapse(wanted, progress)
    kept = np.array([f for f, corners in enumerate(net.faces) if corners], dtype=np.int64)
    corners = np.array([net.faces[f] for f in kept], dtype=np.int64).reshape(-1, 3)
    used, index = np.unique(corners, return_inverse=True)
    places = np.array(net.places)[used] * scale + middle
    return places, index.reshape(-1, 3), labels[kept]


def _quadrics(
    vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"], labels: Int[np.ndarray, " f"]
) -> Float[np.ndarray, "v 10"]:
    """Return the upper half of every vertex' 4 x 4 matrix: faces by area, borders by length."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    cross = np.cross(b - a, c - a)
    double = np.linalg.norm(cross, axis=1)
    normal = cross / np.maximum(double, 1e-30)[:, None]
    total = np.zeros((len(vertices), 10))
    plane = _plane(normal, a) * (double / 2)[:, None]
    for corner in range(3):
        np.add.at(total, faces[:, corner], plane)
    if (labels == labels[0]).all():
        return total
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    face = np.repeat(np.arange(len(faces)), 3)
    edge = np.sort(np.stack([start, end], axis=1), axis=1)
    order = np.lexsort(edge.T)
    one, other = order[::2], order[1::2]  # a closed surface has every edge twice
    border = labels[face[one]] != labels[face[other]]
    for side in (one[border], other[border]):
        along = vertices[end[side]] - vertices[start[side]]
        length = np.linalg.norm(along, axis=1)
        upright = np.cross(along, normal[face[side]]) / np.maximum(length, 1e-30)[:, None]
        weighted = _plane(upright, vertices[start[side]]) * (BORDER_WEIGHT * length**2)[:, None]
        np.add.at(total, start[side], weighted)
        np.add.at(total, end[side], weighted)
    return total


def _plane(
    normal: Float[np.ndarray, "n 3"], point: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 10"]:
    row = np.column_stack([normal, -(normal * point).sum(axis=1)])
    upper = np.triu_indices(4)
    return row[:, upper[0]] * row[:, upper[1]]


class _Net:
    """A surface while its edges collapse; plain lists, since steps are small and many."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, quadrics: np.ndarray) -> None:
        self.places: list[Point] = [(p[0], p[1], p[2]) for p in vertices.tolist()]
        self.faces: list[tuple[int, int, int] | None] = [(f[0], f[1], f[2]) for f in faces.tolist()]
        self.quadrics: list[list[float]] = quadrics.tolist()
        self.around: list[set[int]] = [set() for _ in self.places]
        for number, corners in enumerate(self.faces):
            for vertex in corners or ():
                self.around[vertex].add(number)
        self.changes = [0] * len(self.places)
        self.heap: list[tuple[float, int, int, int, Point]] = []

    def collapse(self, wanted: int, progress: Callable[[float], None]) -> None:
        """Collapse edges until `wanted` faces are left, or none may collapse."""
        for vertex in range(len(self.places)):
            for other in self.neighbours(vertex):
                if vertex < other:
                    self._offer(vertex, other)
        left = whole = len(self.faces)
        while left > wanted and self.heap:
            _, a, b, changes, place = heapq.heappop(self.heap)
            if changes != self.changes[a] + self.changes[b] or not self._allowed(a, b, place):
                continue
            self._merge(a, b, place)
            left -= 2
            if left % STEPS_BETWEEN < 2:
                progress((whole - left) / (whole - wanted))
            for other in self.neighbours(a):
                self._offer(a, other)

    def neighbours(self, vertex: int) -> set[int]:
        """Return the vertices that share a face with one."""
        found = {v for f in self.around[vertex] for v in self.faces[f] or ()}
        found.discard(vertex)
        return found

    def _offer(self, a: int, b: int) -> None:
        quadric = [x + y for x, y in zip(self.quadrics[a], self.quadrics[b], strict=True)]
        cost, place = _best(quadric, self.places[a], self.places[b])
        heapq.heappush(self.heap, (cost, a, b, self.changes[a] + self.changes[b], place))

    def _allowed(self, a: int, b: int, place: Point) -> bool:
        shared = self.around[a] & self.around[b]
        if len(shared) != 2 or len(self.neighbours(a) & self.neighbours(b)) != 2:
            return False
        return all(
            self._stays(f, vertex, place)
            for vertex in (a, b)
            for f in self.around[vertex]
            if f not in shared
        )

    def _stays(self, face: int, vertex: int, place: Point) -> bool:
        """Return whether a face keeps its side when one of its corners moves."""
        corners = self.faces[face]
        assert corners is not None
        old = [self.places[v] for v in corners]
        new = [place if v == vertex else p for v, p in zip(corners, old, strict=True)]
        n, m = _normal(*old), _normal(*new)
        length = (_dot(n, n) * _dot(m, m)) ** 0.5
        return length > 0 and _dot(n, m) > LEAST_TURN * length

    def _merge(self, a: int, b: int, place: Point) -> None:
        for face in self.around[a] & self.around[b]:
            for vertex in self.faces[face] or ():
                self.around[vertex].discard(face)
            self.faces[face] = None
        for face in self.around[b]:
            x, y, z = (a if v == b else v for v in self.faces[face] or ())
            self.faces[face] = (x, y, z)
        self.around[a] |= self.around[b]
        self.around[b] = set()
        self.places[a] = place
        self.quadrics[a] = [x + y for x, y in zip(self.quadrics[a], self.quadrics[b], strict=True)]
        self.changes[a] += self.changes[b] + 1
        self.changes[b] = -1 << 60  # no offer that names it is valid any more


def _best(q: list[float], a: Point, b: Point) -> tuple[float, Point]:
    """Return the least cost and its place: by Cramer's rule, or of the ends and the middle."""
    xx, xy, xz, xw, yy, yz, yw, zz, zw, _ = q
    c0, c1, c2 = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    det = xx * c0 + xy * c1 + xz * c2
    middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2)
    if det > SINGULAR * (xx + yy + zz) ** 3:
        c3, c4, c5 = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
        place = (
            -(c0 * xw + c1 * yw + c2 * zw) / det,
            -(c1 * xw + c3 * yw + c4 * zw) / det,
            -(c2 * xw + c4 * yw + c5 * zw) / det,
        )
        return _cost(q, place), place
    return min((_cost(q, p), p) for p in (middle, a, b))


def _cost(q: list[float], p: Point) -> float:
    x, y, z = p
    xx, xy, xz, xw, yy, yz, yw, zz, zw, ww = q
    by_x = x * (xx * x + 2 * (xy * y + xz * z + xw))
    by_y = y * (yy * y + 2 * (yz * z + yw))
    return by_x + by_y + z * (zz * z + 2 * zw) + ww


def _normal(a: Point, b: Point, c: Point) -> Point:
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    u, v, w = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return y * w - z * v, z * u - x * w, x * v - y * u


def _dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
