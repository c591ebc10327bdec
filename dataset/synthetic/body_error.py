"""Deform the body as an artist who draws another one in every view.

Head and arms turn about their joints, the face is pulled round the head towards the viewer, and
all points move by a smooth field of plane waves,

    d(p) = sum over j of a_j cos(2 pi f_j . p / height + phase_j),      |f_j| in WAVES,

a_j normal; its mean over the surface is removed and its root mean square set exactly.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from toonset.dataset.synthetic.artist_options import BodyErrors
from toonset.dataset.synthetic.body_parts import BodyParts, Limb
from toonset.mesh import Mesh

COUNT = 24  # waves
WAVES = (0.4, 1.2)  # per body height: proportions drift over a limb, and surfaces stay smooth

Points = Float[np.ndarray, "points 3"]


def deform(
    mesh: Mesh, parts: BodyParts, errors: BodyErrors, yaw: float, generator: np.random.Generator
) -> Mesh:
    """Return the body that a drawing shows; without errors it is the mesh itself.

    Args:
        mesh: +Y up, front +Z.
        parts: its head and arms; those that are not known do not move.
        errors: how large.
        yaw: of the camera in radians: the face follows it.
        generator: asked for the same number of draws, whatever the errors and parts.
    """
    of_head, of_arms = generator.uniform(-1, 1, 2), generator.uniform(-1, 1, (2, 2))
    waves, weights = generator.standard_normal((COUNT, 3)), generator.standard_normal((COUNT, 3))
    lengths, phases = generator.uniform(*WAVES, COUNT), generator.uniform(0, 2 * math.pi, COUNT)
    if errors == BodyErrors():
        return mesh
    vertices = np.array(mesh.vertices)
    if parts.head is not None:
        turn, tilt = math.radians(errors.head_turn_deg) * of_head * (1, 0.5)
        pull = math.radians(errors.face_turn_deg) * math.sin(yaw)
        _pull_face(vertices, parts.head, pull)
        _turn(vertices, parts.head, _about_z(tilt) @ _about_y(turn))
    for arm, (ahead, aside) in zip(
        parts.arms, math.radians(errors.arm_swing_deg) * of_arms, strict=False
    ):
        _turn(vertices, arm, _about_z(aside) @ _about_x(ahead))
    waves *= (lengths / np.linalg.norm(waves, axis=1))[:, None]
    field = np.cos(2 * math.pi * mesh.vertices @ waves.T / mesh.height + phases) @ weights
    vertices += errors.field_height_fraction * mesh.height * _of_unit_size(field, mesh)
    return replace(mesh, vertices=vertices)


def _turn(vertices: Points, limb: Limb, rotation: Float[np.ndarray, "3 3"]) -> None:
    own = limb.vertices
    vertices[own] = (vertices[own] - limb.joint) @ rotation.T + limb.joint


def _pull_face(vertices: Points, head: Limb, angle: float) -> None:
    """Turn the head's points about its vertical middle: the face by `angle`, its back by 0."""
    points = vertices[head.vertices]
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    out = points - middle
    ahead = out[:, 2] / np.maximum(np.hypot(out[:, 0], out[:, 2]), 1e-9)
    angles = angle * ((1 + ahead) / 2) ** 2
    c, s = np.cos(angles), np.sin(angles)
    x, z = c * out[:, 0] + s * out[:, 2], c * out[:, 2] - s * out[:, 0]
    vertices[head.vertices] = np.stack([x, out[:, 1], z], axis=1) + middle


def _of_unit_size(field: Points, mesh: Mesh) -> Points:
    """Return the field without its mean over the surface, of root mean square 1 there."""
    corners = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    weights = np.bincount(mesh.faces.ravel(), np.repeat(areas, 3), len(field))
    shares = weights / weights.sum()
    centred = field - shares @ field
    return centred / np.sqrt(shares @ (centred**2).sum(axis=1))


def _about_x(angle: float) -> Float[np.ndarray, "3 3"]:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def _about_y(angle: float) -> Float[np.ndarray, "3 3"]:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def _about_z(angle: float) -> Float[np.ndarray, "3 3"]:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
