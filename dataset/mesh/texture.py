"""Look up texels, and cut a surface along what a texture leaves transparent.

Hair, leaves and lace are often cards: large triangles whose texture is opaque only where the strand
is. What is not seen is cut away, so that the outline is the strands', not the cards'.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

FINEST = 32  # pieces along an edge of a triangle that is cut (docs/decisions.md)
TEXELS = 2.0  # along an edge per piece: a finer cut would follow single texels
MOST_PIECES = 200_000  # of all triangles that are cut: more cards are cut more coarsely
SLICE = 1 << 18  # pieces that are looked at together

Pieces = Float[np.ndarray, "pieces 3 3"]


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture on a surface.

    Attributes:
        rgba: sRGB, straight alpha; row 0 is on top.
        matrix: what texture coordinates, v from the lower edge up, are multiplied with.
        offset: added to them then.
    """

    rgba: UInt8[np.ndarray, "height width 4"]
    matrix: Float[np.ndarray, "2 2"]
    offset: Float[np.ndarray, " 2"]

    def at(
        self, uvs: Float[np.ndarray, "points 2"]
    ) -> tuple[UInt8[np.ndarray, "points 4"], Bool[np.ndarray, " points"]]:
        """Return the texel at every coordinate, and which coordinates are finite.

        The picture is repeated outside [0, 1].
        """
        moved = uvs
        if self.offset.any() or not np.array_equal(self.matrix, np.eye(2)):
            moved = uvs @ self.matrix.T + self.offset
        finite = np.asarray(np.isfinite(moved).all(axis=1))
        height, width = self.rgba.shape[:2]
        u, v = np.where(finite[:, None], moved, 0.0).T % 1.0
        column = np.minimum((u * width).astype(int), width - 1)
        row = np.minimum(((1 - v) * height).astype(int), height - 1)
        return self.rgba[row, column], finite

    def texels_along(self, corners: Float[np.ndarray, "faces 3 2"]) -> Float[np.ndarray, " faces"]:
        """Return how many texels the longest edge of every face passes; 0 without coordinates."""
        size = np.array(self.rgba.shape[1::-1])
        edges = (corners - np.roll(corners, 1, axis=1)) @ self.matrix.T * size
        return np.nan_to_num(np.linalg.norm(edges, axis=2).max(axis=1))


def corner_values(
    values: Float[np.ndarray, "values width"], corners: Int[np.ndarray, "faces 3"]
) -> Float[np.ndarray, "faces 3 width"]:
    """Return the values at the corners of every face; NaN where an index is out of range."""
    known = (corners >= 0) & (corners < len(values))
    padded = np.concatenate([values, np.full((1, values.shape[1]), np.nan)])
    return padded[np.where(known, corners, len(values))]


@dataclass(frozen=True, eq=False)
class Cut:
    """The pieces of a surface that are seen.

    Attributes:
        parents: the face that every piece is of.
        weights: barycentric coordinates of the corners of every piece in that face.
        whole: the piece is the face.
    """

    parents: Int[np.ndarray, " pieces"]
    weights: Pieces
    whole: Bool[np.ndarray, " pieces"]

    @property
    def middles(self) -> Float[np.ndarray, "pieces 3"]:
        """Return the barycentric coordinates of the middle of every piece in its face."""
        return np.asarray(self.weights.mean(axis=1))

    def apply(
        self, vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "faces 3"]
    ) -> tuple[Float[np.ndarray, "more 3"], Int[np.ndarray, "pieces 3"]]:
        """Return the vertices and the pieces as faces; whole faces keep their vertices."""
        part = ~self.whole
        corners = vertices[faces[self.parents[part]]]
        new = np.einsum("pij,pjw->piw", self.weights[part], corners).reshape(-1, 3)
        pieces = faces[self.parents]
        pieces[part] = len(vertices) + np.arange(len(new)).reshape(-1, 3)
        return np.concatenate([vertices, new]), pieces


def whole(faces: int) -> Cut:
    """Return a surface all of which is seen."""
    weights = np.broadcast_to(np.eye(3), (faces, 3, 3))
    return Cut(np.arange(faces), weights, np.ones(faces, dtype=bool))


def cut_away(
    texels: Float[np.ndarray, " faces"],
    seen: Callable[[Int[np.ndarray, " pieces"], Float[np.ndarray, "pieces 3"]], np.ndarray],
) -> Cut | None:
    """Return the pieces of a surface that are seen; None if all of it is.

    A face is divided into equal triangles, as many along an edge as its texture has room for, and
    each of them is seen if its middle is. A face that is seen throughout stays whole.

    Args:
        texels: along the longest edge of every face.
        seen: tells of places on faces (number, barycentric coordinates) whether they are seen.
    """
    wanted = np.clip(texels / TEXELS, 1, FINEST)
    steps = 2 ** np.ceil(np.log2(wanted)).astype(np.int64)
    shown = [_shown(np.flatnonzero(steps == n), int(n), seen) for n in np.unique(steps)]
    full = np.zeros(len(texels), dtype=bool)
    mixed: list[tuple[int, Int[np.ndarray, " faces"]]] = []
    for n, faces, share in shown:
        full[faces[share == 1]] = True
        mixed.append((n, faces[(share > 0) & (share < 1)]))
    if full.all():
        return None
    finest = FINEST
    while finest > 1 and sum(len(faces) * min(n, finest) ** 2 for n, faces in mixed) > MOST_PIECES:
        finest //= 2
    parents, weights = [np.flatnonzero(full)], [np.broadcast_to(np.eye(3), (full.sum(), 3, 3))]
    for n, faces in mixed:
        for part in _slices(faces, min(n, finest) ** 2):
            number, pieces = _divided(part, min(n, finest))
            kept = seen(number, pieces.mean(axis=1))
            parents.append(number[kept])
            weights.append(pieces[kept])
    order = np.argsort(np.concatenate(parents), kind="stable")
    whole = np.arange(len(order)) < full.sum()
    return Cut(np.concatenate(parents)[order], np.concatenate(weights)[order], whole[order])


def _shown(
    faces: Int[np.ndarray, " faces"],
    steps: int,
    seen: Callable[[Int[np.ndarray, " pieces"], Float[np.ndarray, "pieces 3"]], np.ndarray],
) -> tuple[int, Int[np.ndarray, " faces"], Float[np.ndarray, " faces"]]:
    """Return the steps, the faces, and the share of every face that is seen."""
    shares = [np.zeros(0)]
    for part in _slices(faces, steps**2):
        number, pieces = _divided(part, steps)
        shares.append(seen(number, pieces.mean(axis=1)).reshape(len(part), -1).mean(axis=1))
    return steps, faces, np.concatenate(shares)


def _slices(faces: Int[np.ndarray, " faces"], pieces: int) -> list[Int[np.ndarray, " faces"]]:
    return np.array_split(faces, max(1, -(-len(faces) * pieces // SLICE)))


def _divided(
    faces: Int[np.ndarray, " faces"], steps: int
) -> tuple[Int[np.ndarray, " pieces"], Pieces]:
    """Return the face of every piece, and its corners' barycentric coordinates in it."""
    i, j = (each.ravel() for each in np.mgrid[:steps, :steps])
    up, down = i + j < steps, i + j < steps - 1
    corners = [((0, 0), (1, 0), (0, 1)), ((1, 0), (1, 1), (0, 1))]
    pieces = []
    for inside, places in zip((up, down), corners, strict=True):
        at = np.stack([np.stack([i[inside] + a, j[inside] + b], axis=1) for a, b in places], axis=1)
        pieces.append(np.concatenate([steps - at.sum(axis=2, keepdims=True), at], axis=2) / steps)
    one = np.concatenate(pieces)
    return np.repeat(faces, len(one)), np.tile(one, (len(faces), 1, 1))
