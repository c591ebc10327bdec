"""Make the default mannequin: a plain body with named parts and landmarks.

One closed surface, mirror symmetric to the last bit, 1.7 world units tall, feet on y = 0, facing
+Z, its left at +X. The same options give the same body.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.dataset.mannequin.body import Part, parts_of, whole
from toonset.dataset.mannequin.joints import TRUNK_DEPTH, Joints, Sizes, joints_of, sizes_of
from toonset.dataset.mannequin.options import MannequinOptions
from toonset.dataset.mannequin.solids import Solid
from toonset.dataset.mannequin.surface import half_surface, with_mirror_image
from toonset.mesh import Mesh

HEIGHT = 1.7  # world units
MARGIN = 0.12  # round the joints and the head, of the height: thicker than any limb
IN_THE_MIDDLE = ("head", "neck", "torso", "pelvis")

Point = Float[np.ndarray, " 3"]


@dataclass(frozen=True, eq=False)
class Mannequin:
    """A body and the points by which a drawing of it may be told.

    Attributes:
        mesh: the surface; `face_parts` and `part_names` name head, neck, torso, pelvis and the
            left and right upper_arm, forearm, hand, thigh, shin and foot.
        landmarks: world points by name; joints inside the flesh, the others on the surface. Left
            and right are the character's own.
    """

    mesh: Mesh
    landmarks: dict[str, Point]


@cache
def default_mannequin() -> Mannequin:
    """Return the mannequin that stands in where nobody has given a mesh, made once."""
    return make_mannequin(MannequinOptions())


def make_mannequin(options: MannequinOptions) -> Mannequin:
    """Return the mannequin that the options describe."""
    sizes = sizes_of(options)
    joints = joints_of(sizes, options.pose)
    parts = parts_of(sizes, joints)
    solid = whole(parts)
    low, high = _box(sizes, joints)
    half, half_faces, at_plane = half_surface(solid, low, high, _cell(sizes))
    vertices, faces = with_mirror_image(half, half_faces, at_plane)
    in_middle = np.asarray(at_plane[half_faces].any(axis=1))
    nearest = _nearest_parts(parts, half[half_faces].mean(axis=1), in_middle)
    numbers, names = _named(nearest, parts)
    ground, height = vertices[:, 1].min(), np.ptp(vertices[:, 1])

    def to_world(points: np.ndarray) -> np.ndarray:
        return (points - [0, ground, 0]) * (HEIGHT / height)

    mesh = Mesh(to_world(vertices), faces, None, numbers, names, "mannequin")
    points = _landmarks(sizes, joints, solid)
    return Mannequin(mesh, {name: to_world(point) for name, point in points.items()})


def _cell(sizes: Sizes) -> float:
    """Return a grid cell for about 6,000 faces: big heads have most of the surface."""
    return min(0.0145 + 0.014 * sizes.head, 0.75 * sizes.arm)  # no finer limb than a cell


def _box(sizes: Sizes, joints: Joints) -> tuple[Point, Point]:
    """Return the corners of a box round the left half."""
    width, depth = sizes.head_widths
    deepest = max(depth / 2, TRUNK_DEPTH * sizes.torso)
    points = np.array([*joints.values(), (width / 2, 1, deepest), (0, 0, -deepest)])
    return points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN


def _nearest_parts(
    parts: tuple[Part, ...],
    points: Float[np.ndarray, "points 3"],
    in_middle: Bool[np.ndarray, " points"],
) -> Int[np.ndarray, " points"]:
    """Return the part that each point of the surface belongs to.

    Where two parts share a joint both are equally near: the nearer middle decides. What touches
    the middle plane belongs to the trunk, so that no left part meets a right one.
    """
    off = np.stack(
        [p.solid(points) + 0.1 * np.linalg.norm(points - p.middle, axis=1) for p in parts]
    )
    sided = np.array([p.name not in IN_THE_MIDDLE for p in parts])
    off[sided[:, None] & in_middle] = np.inf
    return np.argmin(off, axis=0)


def _named(
    left: Int[np.ndarray, " faces"], parts: tuple[Part, ...]
) -> tuple[Int[np.ndarray, " all_faces"], tuple[str, ...]]:
    """Return part numbers of the left half's faces and their images', and all parts' names."""
    names = [p.name if p.name in IN_THE_MIDDLE else f"left_{p.name}" for p in parts]
    images = [name.replace("left_", "right_") for name in names]
    every = tuple(dict.fromkeys([*names, *images]))
    of_left, of_image = (np.array([every.index(n) for n in side]) for side in (names, images))
    return np.concatenate([of_left[left], of_image[left]]), every


def _landmarks(sizes: Sizes, joints: Joints, solid: Solid) -> dict[str, Point]:
    head, chin, (width, _) = sizes.head, sizes.chin, sizes.head_widths
    points = {
        "head_top": _on_surface(solid, (0, chin + head / 2, 0), (0, 1, 0)),
        "chin": _on_surface(solid, (0, chin + 0.27 * head, 0), (0, -0.6, 0.8)),
        "nose": _on_surface(solid, (0, chin + 0.36 * head, 0), (0, 0, 1)),
        "neck": np.array(joints["neck"]),
    }
    eye = _on_surface(solid, (0.21 * width, chin + 0.48 * head, 0), (0, 0, 1))
    sided = {"eye": eye, "toe": _on_surface(solid, joints["toe"], (0, 0, 1))}
    for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle"):
        sided[name] = np.array(joints[name])
    for name, point in sided.items():
        points[f"left_{name}"] = point
        points[f"right_{name}"] = point * [-1, 1, 1]
    return points


def _on_surface(
    solid: Solid, inside: tuple[float, float, float], direction: tuple[float, float, float]
) -> Point:
    """Return where a ray from inside the body leaves it (bisection, ends within the height)."""
    near, far = 0.0, 1.0
    for _ in range(30):  # to 1e-9 of the height
        middle = (near + far) / 2
        point = np.array(inside) + middle * np.array(direction)
        near, far = (middle, far) if solid(point[None])[0] < 0 else (near, middle)
    return np.array(inside) + near * np.array(direction)
