"""Solve a camera's pose from pairs of 3D points and pixels: closed-form starts and refinement.

Orthographic, n >= 3 points X, pixels U = shift + s R12 X (R12: the first two rows of a rotation):

- n >= 4 points that do not lie in a plane: U is affine in X; the nearest scaled rotation rows of
  the least-squares matrix are a start.
- points in a plane, or nearly: the plane's part B of the matrix is known. s R12 = B + c n^T, with
  n the plane's normal, has orthogonal rows of equal length only for c = +- sqrt(l1 - l2) e2, where
  l1 >= l2 and e1, e2 are eigenvalues and eigenvectors of B B^T: the two poses of the depth
  reversal, which no orthographic picture of a plane tells apart.

Perspective: OpenCV's EPnP and SQPnP at a few camera distances, kept where every point lies before
the camera. The iterative solver is never used from scratch: for a far camera it returns poses
behind the camera as a success. All starts end in the same Levenberg-Marquardt over the nested
model of `toonset.calib.outline.pose`.

Source: orthographic-n-point as a Procrustes problem: Steger, J. Math. Imaging Vis. 60 (2018); two
poses of a plane: Oberkampf, DeMenthon and Davis, CVIU 63 (1996).
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Float

from toonset.calib.outline.pose import PARAMETERS, Pose, project, project_with_jacobian

NEAREST = 0.6  # largest k times the points' radius: all points lie well before the camera
PINHOLE_STARTS = (0.1, 0.25, 0.5)  # k times radius: cameras at about 5, 2 and 1 body heights
FIRST_K = 0.02  # k times radius where an orthographic start becomes a perspective one
MAX_STEPS = 60  # most starts need 5 to 10
LARGEST_STEP = 1.0  # radians, log scale: beyond it the linearisation means nothing
LINE = 1e-3  # width over length of points that lie on a line
CONVERGED = 1e-9  # relative change of the squared error

Points = Float[np.ndarray, "n 3"]
Pixels = Float[np.ndarray, "n 2"]


def orthographic_starts(points: Points, pixels: Pixels) -> list[Pose]:
    """Return orthographic poses near every optimum, for points that do not lie on a line.

    Args:
        points: at least three, relative to the surface's middle.
        pixels: where they appear.
    """
    middle, seen = points.mean(axis=0), pixels.mean(axis=0)
    axes = plane_axes(points)
    along = (points - middle) @ axes.T
    affine = np.linalg.lstsq(along, pixels - seen, rcond=1e-9)[0].T
    flat = np.linalg.lstsq(along[:, :2], pixels - seen, rcond=1e-9)[0].T
    values, vectors = np.linalg.eigh(flat @ flat.T)
    tilt = np.sqrt(values[1] - values[0]) * vectors[:, 0]
    rows = [np.column_stack([flat, side * tilt]) for side in (1.0, -1.0)]
    return [_pose_of_rows(matrix @ axes, middle, seen) for matrix in (affine, *rows)]


def pinhole_starts(points: Points, pixels: Pixels, near: Pose) -> list[Pose]:
    """Return pinhole poses by EPnP and SQPnP at a few distances; empty if both fail.

    Args:
        points: at least four, relative to the surface's middle.
        pixels: where they appear.
        near: an orthographic pose; the focal length follows from its scale, the principal point
            is its shift.
    """
    radius = float(np.linalg.norm(points, axis=1).max())
    found = []
    for k in np.array(PINHOLE_STARTS) / radius:
        for method in (cv2.SOLVEPNP_EPNP, cv2.SOLVEPNP_SQPNP):
            pose = solve_pinhole(points, pixels, near.shift, near.scale / k, method)
            if pose is not None and pose.k * radius < NEAREST:
                found.append(pose)
    return found


def solve_pinhole(
    points: Points, pixels: Pixels, principal: Float[np.ndarray, " 2"], focal_px: float, method: int
) -> Pose | None:
    """Return OpenCV's pose for a known pinhole, or None where it finds none before the camera.

    The pose model has the surface's middle on the optical axis; OpenCV's has it anywhere. The
    rotation that turns the axis there makes both agree to first order.
    """
    K = np.array([[focal_px, 0, principal[0]], [0, focal_px, principal[1]], [0, 0, 1.0]])
    try:
        solved, turn, offset = cv2.solvePnP(points, pixels, K, None, flags=method)
    except cv2.error:  # raised for far cameras by an assertion on the points' variance
        return None
    if not solved or not np.isfinite([turn, offset]).all():
        return None
    rotation, middle = cv2.Rodrigues(turn)[0], offset[:, 0]
    if (points @ rotation[2] + middle[2]).min() <= 0:
        return None
    distance = float(np.linalg.norm(middle))
    toward = middle / distance
    axis = np.cross(toward, [0.0, 0.0, 1.0])
    angle = np.arctan2(np.linalg.norm(axis), toward[2])
    centring = cv2.Rodrigues(axis * angle / max(float(np.sin(angle)), 1e-12))[0]
    shift = principal + focal_px * middle[:2] / middle[2]
    return Pose(centring @ rotation, shift, focal_px / distance, 1 / distance)


def depth_reversed(pose: Pose, points: Points) -> Pose:
    """Return the pose that differs by a reflection in the points' best plane and in depth.

    For points in a plane both project alike under orthography, whatever the noise.
    """
    normal = plane_axes(points)[2]
    middle = points.mean(axis=0)
    rotation = (
        np.diag([1.0, 1.0, -1.0]) @ pose.rotation @ (np.eye(3) - 2 * np.outer(normal, normal))
    )
    moved = replace(pose, rotation=rotation)
    return replace(
        moved, shift=pose.shift + (project(pose, middle[None]) - project(moved, middle[None]))[0]
    )


def refined(pose: Pose, points: Points, pixels: Pixels, *, perspective: bool) -> Pose:
    """Return the optimum of the squared pixel error that Levenberg-Marquardt reaches.

    Args:
        pose: the start.
        points: relative to the surface's middle.
        pixels: where they appear.
        perspective: free k, from 0 to `NEAREST` over the points' radius; else k stays as it is.
    """
    radius = float(np.linalg.norm(points, axis=1).max())
    if perspective and pose.k == 0:
        pose = replace(pose, k=FIRST_K / radius)
    free = PARAMETERS + perspective
    damping, error = 1e-3, squared_error(pose, points, pixels)
    for _ in range(MAX_STEPS):
        seen, slopes = project_with_jacobian(pose, points)
        rows = slopes[..., :free].reshape(-1, free)
        normal, gradient = rows.T @ rows, rows.T @ (seen - pixels).ravel()
        trial, lower = pose, np.inf
        while damping < 1e9:
            step = -np.linalg.solve(_damped(normal, damping), gradient)
            trial = _stepped(pose, step, NEAREST / radius)
            lower = squared_error(trial, points, pixels)
            if lower <= error:
                break
            damping *= 10
        if lower > error:
            break
        settled = error - lower <= CONVERGED * error
        pose, error, damping = trial, lower, max(damping / 10, 1e-9)
        if settled:
            break
    return pose


def squared_error(pose: Pose, points: Points, pixels: Pixels) -> float:
    """Return the sum of squared pixel distances."""
    return float(((project(pose, points) - pixels) ** 2).sum())


def on_a_line(points: Points) -> bool:
    """Return whether the points leave the turn about a line open."""
    sizes = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(sizes[1] <= LINE * sizes[0])


def plane_axes(points: Points) -> Float[np.ndarray, "3 3"]:
    """Return the points' principal axes as rows, the best plane's normal last."""
    return np.linalg.svd(points - points.mean(axis=0), full_matrices=True)[2]


def _pose_of_rows(
    rows: Float[np.ndarray, "2 3"], middle: Float[np.ndarray, " 3"], seen: Float[np.ndarray, " 2"]
) -> Pose:
    """Return the pose with the nearest scaled rotation rows that maps `middle` to `seen`."""
    u, sizes, vt = np.linalg.svd(rows, full_matrices=False)
    first, second = u @ vt
    scale = max(float(sizes.mean()), 1e-12)
    rotation = np.stack([first, second, np.cross(first, second)])
    return Pose(rotation, seen - scale * rotation[:2] @ middle, scale)


def _damped(normal: np.ndarray, damping: float) -> np.ndarray:
    diagonal = np.diag(normal)
    return normal + np.diag(damping * diagonal + 1e-15 * diagonal.max() + 1e-300)


def _stepped(pose: Pose, step: np.ndarray, max_k: float) -> Pose:
    largest = max(float(np.abs(step[:3]).max()), abs(float(step[5])))
    step = step * min(1.0, LARGEST_STEP / max(largest, 1e-12))
    moved = pose.moved(step[:PARAMETERS])
    if len(step) == PARAMETERS:
        return moved
    return replace(moved, k=float(np.clip(pose.k + step[PARAMETERS], 0.0, max_k)))
