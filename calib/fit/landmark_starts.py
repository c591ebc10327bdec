"""Start a view's camera from its landmarks by OpenCV's perspective-n-point solver.

An orthographic camera is a pinhole `FAR` radii away. SQPnP needs three points, in a plane or not.
Its solution comes with its depth reversal: seen from far away, points near a plane and their mirror
image in depth project alike, and refinement tells which of the two fits better. Every pair is left
out once, so that one start is free of a wrong one.

Source: Terzakis and Lourakis, A consistently fast and globally optimal solution to the
perspective-n-point problem, ECCV 2020; two poses of a plane: Oberkampf, DeMenthon and Davis, CVIU
63 (1996).
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Float

from toonset.calib.outline.pose import Pose, project

FAR = 30.0  # radii of the points: from 1000 on, OpenCV 5 refuses every set of points
LINE = 1e-3  # width over length of points that lie on a line
LEAST_PAIRS = 3

Points = Float[np.ndarray, "n 3"]
Pixels = Float[np.ndarray, "n 2"]


def start_poses(points: Points, pixels: Pixels) -> list[Pose]:
    """Return orthographic poses near every optimum, also where one of four pairs or more is wrong.

    Args:
        points: at least three, not on a line, relative to the surface's middle.
        pixels: where they appear.
    """
    everything = np.ones(len(points), dtype=bool)
    subsets = [everything]
    if len(points) > LEAST_PAIRS:
        subsets += [~own for own in np.eye(len(points), dtype=bool)]
    return [
        pose
        for kept in subsets
        if not on_a_line(points[kept])
        for pose in _solved(points[kept], pixels[kept])
    ]


def depth_reversed(pose: Pose, points: Points) -> Pose:
    """Return the pose that differs by a reflection in the points' best plane and in depth.

    For points in a plane both project alike under orthography, whatever the noise.
    """
    normal = np.linalg.svd(points - points.mean(axis=0), full_matrices=True)[2][2]
    mirror = np.eye(3) - 2 * np.outer(normal, normal)
    moved = replace(pose, rotation=np.diag([1.0, 1.0, -1.0]) @ pose.rotation @ mirror)
    middle = points.mean(axis=0)[None]
    return replace(moved, shift=pose.shift + (project(pose, middle) - project(moved, middle))[0])


def on_a_line(points: Points) -> bool:
    """Return whether the points leave the turn about a line open."""
    sizes = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(sizes[1] <= LINE * sizes[0])


def _solved(points: Points, pixels: Pixels) -> list[Pose]:
    """Return SQPnP's poses before the camera and their depth reversals."""
    middle, seen = points.mean(axis=0), pixels.mean(axis=0)
    focal = np.linalg.norm(pixels - seen, axis=1).max() * FAR
    K = np.array([[focal, 0, seen[0]], [0, focal, seen[1]], [0, 0, 1.0]])
    centred = points - middle
    try:
        _, turns, offsets, _ = cv2.solvePnPGeneric(
            centred, pixels, K, None, flags=cv2.SOLVEPNP_SQPNP
        )
    except cv2.error:  # an assertion on the points' variance
        return []
    found = []
    for turn, offset in zip(turns, offsets, strict=True):
        depth = float(offset[2, 0])
        if not np.isfinite([turn, offset]).all() or depth <= 0:
            continue
        rotation = cv2.Rodrigues(turn)[0]
        pose = Pose(rotation, np.zeros(2), focal / depth)
        pose = replace(pose, shift=seen - project(pose, middle[None])[0])
        found += [pose, depth_reversed(pose, points)]
    return found
