"""Cut triangles where two labels are equally likely.

two labels:    the cut runs from edge to edge, 3 triangles
three labels:  cuts meet in the middle, 6 triangles
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

SHORTEST = 0.1  # of an edge: nearer to its end no cut is made, for thin triangles' sake

Cut = tuple[Float[np.ndarray, "vertices 3"], Int[np.ndarray, "faces 3"], Int[np.ndarray, " faces"]]


def cut(
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    chances: Float[np.ndarray, "v labels"],
) -> Cut:
    """Return vertices, faces and a label of every face, cut along the labels' borders.

    Neighbouring faces share the vertices of a cut, and faces keep their orientation.

    Args:
        vertices: places.
        faces: triangles.
        chances: how likely a vertex is to have each label.
    """
    label = chances.argmax(axis=1)
    ends = np.sort(np.concatenate([faces, np.roll(faces, -1, axis=1)], axis=0).reshape(2, -1).T, 1)
    edges, which = np.unique(ends, axis=0, return_inverse=True)
    which = which.reshape(faces.shape)  # [:, i]: the edge from corner i to the next
    mixed = label[edges[:, 0]] != label[edges[:, 1]]
    number = len(vertices) + np.cumsum(mixed) - 1  # of the vertex on an edge that is cut
    places = _crossings(vertices, chances, label, edges[mixed])
    kinds = label[faces]
    changes = kinds != np.roll(kinds, -1, axis=1)
    plain, three = ~changes.any(axis=1), changes.all(axis=1)
    two = ~plain & ~three
    # turned so that the odd corner comes first: no change from the second to the third
    lone = np.argmin(changes[two], axis=1)
    order = (lone[:, None] + np.array([2, 0, 1])) % 3
    lone_first = [np.take_along_axis(a[two], order, axis=1) for a in (faces, kinds, which)]
    pair = _two(lone_first[0], lone_first[1], number[lone_first[2]])
    first = len(vertices) + len(places)
    middles = vertices[faces[three]].mean(axis=1)
    triple = _three(faces[three], kinds[three], number[which[three]], first)
    return (
        np.concatenate([vertices, places, middles]),
        np.concatenate([faces[plain], pair[0], triple[0]]),
        np.concatenate([kinds[plain, 0], pair[1], triple[1]]),
    )


def _crossings(
    vertices: Float[np.ndarray, "v 3"],
    chances: Float[np.ndarray, "v labels"],
    label: Int[np.ndarray, " v"],
    edges: Int[np.ndarray, "e 2"],
) -> Float[np.ndarray, "e 3"]:
    """Return where on each edge the labels of its ends are equally likely."""
    a, b = edges.T
    at_a = chances[a, label[a]] - chances[a, label[b]]
    at_b = chances[b, label[b]] - chances[b, label[a]]
    share = at_a / np.maximum(at_a + at_b, 1e-12)
    share = share.clip(SHORTEST, 1 - SHORTEST)[:, None]
    return (1 - share) * vertices[a] + share * vertices[b]


def _two(
    faces: Int[np.ndarray, "f 3"], kinds: Int[np.ndarray, "f 3"], cuts: Int[np.ndarray, "f 3"]
) -> tuple[Int[np.ndarray, "g 3"], Int[np.ndarray, " g"]]:
    (a, b, c), (ab, _, ca) = faces.T, cuts.T
    rows = [np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, c), (ab, c, ca))]
    return np.concatenate(rows), np.concatenate([kinds[:, 0], kinds[:, 1], kinds[:, 1]])


def _three(
    faces: Int[np.ndarray, "f 3"],
    kinds: Int[np.ndarray, "f 3"],
    cuts: Int[np.ndarray, "f 3"],
    first: int,
) -> tuple[Int[np.ndarray, "g 3"], Int[np.ndarray, " g"]]:
    middle = first + np.arange(len(faces))
    rows, labels = [], []
    for i in range(3):
        here, after, before = faces[:, i], cuts[:, i], cuts[:, i - 1]
        rows += [np.stack([here, after, middle], 1), np.stack([here, middle, before], 1)]
        labels += [kinds[:, i]] * 2
    return np.concatenate(rows), np.concatenate(labels)
