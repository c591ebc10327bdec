"""Project surface points inside the solver, with the analytic Jacobian.

The model is that of `toonset.camera` with the surface's middle as target:

    X_c = exp([w]) R X,   (u, v) = shift + exp(a) s (x_c, y_c) / (1 + k z_c)

with increments (w: 3, shift: 2, a: 1) per view and k shared or fixed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float

from toonset.camera import Camera

PARAMETERS = 6  # rotation vector (3), shift (2), log scale (1)


@dataclass(frozen=True, eq=False)
class Pose:
    """One view's camera relative to the surface's middle.

    Attributes:
        rotation: camera_from_world.
        shift: (2,) pixel of the surface's middle.
        scale: pixels per world unit there.
        k: 1 / distance, 1 / world units; 0 = orthographic.
    """

    rotation: Float[np.ndarray, "3 3"]
    shift: Float[np.ndarray, " 2"]
    scale: float
    k: float = 0.0

    def scaled(self, factor: float) -> Pose:
        """Return the pose for the drawing scaled by `factor`."""
        return replace(self, shift=self.shift * factor, scale=self.scale * factor)

    def moved(self, step: Float[np.ndarray, " 6"]) -> Pose:
        """Return the pose after an increment (w, shift, log scale)."""
        return replace(
            self,
            rotation=cv2.Rodrigues(step[:3])[0] @ self.rotation,
            shift=self.shift + step[3:5],
            scale=float(self.scale * np.exp(step[5])),
        )

    def twin(self) -> Pose:
        """Return the mirror twin about the surface's own x = 0 plane."""
        rotation = np.diag([1.0, 1.0, -1.0]) @ self.rotation @ np.diag([-1.0, 1.0, 1.0])
        return replace(self, rotation=rotation)

    def camera(self, target: Float[np.ndarray, " 3"], size_wh: tuple[int, int]) -> Camera:
        """Return the camera in world coordinates."""
        u, _, vt = np.linalg.svd(self.rotation)  # rounding of hundreds of steps
        return Camera(u @ vt, target, self.scale, self.shift, size_wh, self.k)


def project(pose: Pose, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 2"]:
    """Return the pixels of points given relative to the surface's middle."""
    local = points @ pose.rotation.T
    return pose.shift + pose.scale * local[:, :2] / (1 + pose.k * local[:, 2:])


def pixel_slopes(pose: Pose, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 2 3"]:
    """Return the derivatives of the pixels by the points."""
    local = points @ pose.rotation.T
    divisor = (1 + pose.k * local[:, 2])[:, None, None]
    pull = pose.k * local[:, :2, None] * pose.rotation[2]
    return pose.scale * (pose.rotation[:2] - pull / divisor) / divisor


def project_with_jacobian(
    pose: Pose, points: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2 7"]]:
    """Return pixels and their derivatives by (w, shift, log scale, k)."""
    local = points @ pose.rotation.T
    x, y, z = local.T
    divisor = 1 + pose.k * z
    a = pose.scale / divisor
    flat = a[:, None] * local[:, :2]
    jacobian = np.zeros((len(points), 2, 7))
    # d X_c = w x X_c: (wy z - wz y, wz x - wx z, wx y - wy x)
    pull = -(pose.k / divisor)[:, None] * flat  # d (u, v) / d z_c
    jacobian[:, :, 0] = pull * y[:, None]
    jacobian[:, 1, 0] -= a * z
    jacobian[:, :, 1] = -pull * x[:, None]
    jacobian[:, 0, 1] += a * z
    jacobian[:, 0, 2] = -a * y
    jacobian[:, 1, 2] = a * x
    jacobian[:, 0, 3] = 1
    jacobian[:, 1, 4] = 1
    jacobian[:, :, 5] = flat
    jacobian[:, :, 6] = -(z / divisor)[:, None] * flat
    return pose.shift + flat, jacobian
