"""Find a mesh's head and arms by its landmarks, or by the names of its parts.

With landmarks every vertex belongs to the nearest bone (the segment between two of them) and the
bones of head and arms are what moves. Without, parts are taken by the words of their names
("head", "left arm", "upperarm.l"). A mesh that has neither has neither head nor arms.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from toonset.mesh import Mesh

HEAD_WORDS = {"head", "hair", "face", "nose", "eye", "eyes", "ear", "ears", "hat", "helmet"}
ARM_WORDS = {"arm", "upperarm", "lowerarm", "forearm", "elbow", "wrist", "hand"}
SIDES = ("left", "right")
TRUNK = ("neck", "left_hip"), ("neck", "right_hip")  # bones, as pairs of landmarks
LEG = ("hip", "knee"), ("knee", "ankle"), ("ankle", "toe")
ARM = ("shoulder", "elbow"), ("elbow", "wrist")
HEAD = (("neck", "head_top"),)
HAND = 0.5  # of the forearm: a hand reaches so far beyond the wrist
INNER = 0.15  # of an arm's width: its shoulder's end

Point = Float[np.ndarray, " 3"]
Bone = tuple[Point, Point]


@dataclass(frozen=True, eq=False)
class Limb:
    """Part of a body that turns about a joint.

    Attributes:
        joint: world coordinates.
        vertices: which of the mesh's move.
    """

    joint: Point
    vertices: Bool[np.ndarray, " vertices"]


@dataclass(frozen=True, eq=False)
class BodyParts:
    """Head and arms of a body; None and () where unknown."""

    head: Limb | None = None
    arms: tuple[Limb, ...] = ()


def find_body_parts(mesh: Mesh, landmarks: Mapping[str, Sequence[float]]) -> BodyParts:
    """Return head and arms of a mesh.

    Args:
        mesh: +Y up, front +Z.
        landmarks: world points by the names of `toonset mannequin`; may be empty.
    """
    points = {name: np.array(point, dtype=float) for name, point in landmarks.items()}
    return _by_bones(mesh, points) if "neck" in points else _by_names(mesh)


def _by_bones(mesh: Mesh, points: dict[str, Point]) -> BodyParts:
    bones: dict[str, list[Bone]] = {"head": _bones(points, HEAD), "body": _bones(points, TRUNK)}
    for side in SIDES:
        bones["body"] += _bones(points, LEG, f"{side}_")
        bones[side] = _bones(points, ARM, f"{side}_")
        if len(bones[side]) == len(ARM):
            elbow, wrist = bones[side][-1]
            bones[side].append((wrist, wrist + HAND * (wrist - elbow)))
    named = [(name, bone) for name, some in bones.items() for bone in some]
    away = np.stack([_distance(mesh.vertices, *bone) for _, bone in named])
    owner = np.array([name for name, _ in named])[away.argmin(axis=0)]
    arms = [Limb(bones[side][0][0], owner == side) for side in SIDES if (owner == side).any()]
    head = owner == "head"
    return BodyParts(Limb(points["neck"], head) if head.any() else None, tuple(arms))


def _bones(
    points: dict[str, Point], pairs: Sequence[tuple[str, str]], side: str = ""
) -> list[Bone]:
    named = [(side + a, side + b) for a, b in pairs]
    return [(points[a], points[b]) for a, b in named if a in points and b in points]


def _distance(
    vertices: Float[np.ndarray, "vertices 3"], start: Point, end: Point
) -> Float[np.ndarray, " vertices"]:
    """Return how far every vertex is from a segment."""
    along = end - start
    length2 = max(float(along @ along), 1e-12)
    at = np.clip((vertices - start) @ along / length2, 0, 1)
    return np.linalg.norm(vertices - start - at[:, None] * along, axis=1)


def _by_names(mesh: Mesh) -> BodyParts:
    head, arms = (_vertices_of(mesh, words) for words in (HEAD_WORDS, ARM_WORDS))
    left = mesh.vertices[:, 0] > mesh.middle[0]
    limbs = [_arm(mesh, own) for own in (arms & left, arms & ~left) if own.any()]
    return BodyParts(_head(mesh, head) if head.any() else None, tuple(limbs))


def _head(mesh: Mesh, own: Bool[np.ndarray, " vertices"]) -> Limb:
    """Return the head with its joint where the neck should be."""
    points = mesh.vertices[own]
    low, high = points.min(axis=0), points.max(axis=0)
    x, _, z = (low + high) / 2
    return Limb(np.array([x, low[1], z]), own)


def _arm(mesh: Mesh, own: Bool[np.ndarray, " vertices"]) -> Limb:
    """Return an arm with its joint in the middle of its inner end."""
    points = mesh.vertices[own]
    out = np.abs(points[:, 0] - mesh.middle[0])
    inner = points[out <= out.min() + INNER * np.ptp(out)]
    return Limb((inner.min(axis=0) + inner.max(axis=0)) / 2, own)


def _vertices_of(mesh: Mesh, words: set[str]) -> Bool[np.ndarray, " vertices"]:
    own = np.zeros(len(mesh.vertices), dtype=bool)
    if mesh.face_parts is None:
        return own
    named = [
        number
        for number, name in enumerate(mesh.part_names)
        if words & set(re.split(r"[^a-z]+", name.lower()))
    ]
    own[mesh.faces[np.isin(mesh.face_parts, named)].ravel()] = True
    return own
