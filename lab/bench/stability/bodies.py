"""Bodies changed for a sweep: pose, proportions, parts that follow the viewer, eyes, colours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from toonset.mesh import Mesh

HEAD = ("head", "hair", "nose")
EARS = ("left ear", "right ear")
EYES = ("left eye", "right eye")
EAR_DEPTH = 0.3  # of its radius
EYE_DEPTH = 0.5
BLACK = (20, 20, 24)
VASE = ((0, 0), (0.35, 0), (0.2, 0.15), (0.45, 0.9), (0.5, 1.2), (0.2, 1.6), (0.3, 1.8), (0, 1.8))


def vase() -> Mesh:
    """Return a surface of revolution as tall as a body: nothing tells its yaw."""
    import trimesh

    shape = trimesh.creation.revolve(np.array(VASE, dtype=float), sections=96)
    x, y, z = shape.vertices.T  # turned round z there, round y here
    return Mesh(np.stack([x, z, -y], axis=1), np.asarray(shape.faces), name="vase")


def with_arms_raised(body: Mesh, angle: float) -> Mesh:
    """Return a body of `random_body` with both arms raised sideways by `angle` radians."""
    vertices = np.array(body.vertices)
    for name, side in (("left arm", 1), ("right arm", -1)):
        own = _vertices_of(body, (name,))
        points = vertices[own]
        inner = (side * points[:, 0]).min() * side
        shoulder = np.array([inner, points[:, 1].max(), 0.0])
        c, s = math.cos(side * angle), math.sin(side * angle)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        vertices[own] = (points - shoulder) @ turn.T + shoulder
    return replace(body, vertices=vertices)


def with_head_grown(body: Mesh, growth: float) -> Mesh:
    """Return a body of `random_body` with its head larger by the share `growth`."""
    vertices = np.array(body.vertices)
    own = _vertices_of(body, HEAD)
    chin = vertices[_vertices_of(body, ("head",))].min(axis=0)[1]
    foot = np.array([0.0, chin, 0.0])
    vertices[own] = (vertices[own] - foot) * (1 + growth) + foot
    return replace(body, vertices=vertices)


def with_ears(body: Mesh, radius: float) -> Mesh:
    """Return the body with a round flat ear on either side of the head's top, facing the front.

    Args:
        body: of `random_body`.
        radius: of the ears in world units; 0 leaves the body as it is.
    """
    head = body.vertices[_vertices_of(body, ("head",))]
    middle, half = (head.max(axis=0) + head.min(axis=0)) / 2, np.ptp(head, axis=0) / 2
    away = np.array([0.75, 0.75, 0.0])
    away[:2] = away[:2] * half[:2] + 0.6 * radius
    return _with_pair(body, EARS, middle, away, radius, EAR_DEPTH, BLACK)


def with_eyes(body: Mesh, radius: float, color: tuple[int, int, int] = BLACK) -> Mesh:
    """Return the body with two round eyes on its face; radius 0 leaves it as it is."""
    head = body.vertices[_vertices_of(body, ("head",))]
    middle, half = (head.max(axis=0) + head.min(axis=0)) / 2, np.ptp(head, axis=0) / 2
    away = np.array([0.4, 0.0, math.sqrt(1 - 0.4**2)]) * half
    return _with_pair(body, EYES, middle, away, radius, EYE_DEPTH, color)


def recolored(body: Mesh, part: str, color: Sequence[int]) -> Mesh:
    """Return the body with one part in another colour."""
    assert body.face_colors is not None
    colors = body.face_colors.copy()
    colors[_faces_of(body, (part,))] = color
    return replace(body, face_colors=colors)


def _with_pair(
    body: Mesh,
    names: tuple[str, str],
    middle: Float[np.ndarray, " 3"],
    away: Float[np.ndarray, " 3"],
    radius: float,
    depth: float,
    color: tuple[int, int, int],
) -> Mesh:
    """Return the body with two flat balls at `away` from `middle`, and at the mirrored place."""
    import trimesh

    if radius <= 0:
        return body
    for name, side in zip(names, (1, -1), strict=True):
        ball = trimesh.creation.icosphere(subdivisions=3)
        ball.apply_scale([radius, radius, depth * radius])
        ball.apply_translation(middle + away * (side, 1, 1))
        body = _joined(body, name, ball, color)
    return body


def _joined(body: Mesh, name: str, shape: Any, color: tuple[int, int, int]) -> Mesh:
    assert body.face_colors is not None
    assert body.face_parts is not None
    faces = np.asarray(shape.faces)
    return replace(
        body,
        vertices=np.concatenate([body.vertices, shape.vertices]),
        faces=np.concatenate([body.faces, faces + len(body.vertices)]),
        face_colors=np.concatenate(
            [body.face_colors, np.tile(np.array(color, np.uint8), (len(faces), 1))]
        ),
        face_parts=np.concatenate([body.face_parts, np.full(len(faces), len(body.part_names))]),
        part_names=(*body.part_names, name),
    )


def _faces_of(body: Mesh, names: Sequence[str]) -> Bool[np.ndarray, " faces"]:
    """Return which faces belong to the parts; every ball of a limb is a part of that name."""
    assert body.face_parts is not None
    numbers = [i for i, name in enumerate(body.part_names) if name in names]
    return np.isin(body.face_parts, numbers)


def _vertices_of(body: Mesh, names: Sequence[str]) -> Bool[np.ndarray, " vertices"]:
    own = np.zeros(len(body.vertices), dtype=bool)
    own[body.faces[_faces_of(body, names)].ravel()] = True
    return own
