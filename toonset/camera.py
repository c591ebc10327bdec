"""Define cameras, orthographic and pinhole as one nested model, and toonset's conventions.

Conventions, stated once:

- World = the mesh's own frame and units; right-handed, +Y up, the character faces +Z, its left
  hand is at +X.
- Camera axes are OpenCV's: x right, y down, z forward. OpenGL/Blender/NeRF axes exist only in
  readers and writers (`toonset.frames`).
- Pixel (u, v): the first pixel's centre is (0.5, 0.5), u to the right, v down.
- `a_from_b` maps coordinates in frame b to frame a. Radians inside, degrees at the command line.
- Yaw is the turn of the character as the viewer sees it: 0 = front, 90 = the camera stands on the
  character's left side (+X), 180 = back. Elevation > 0 looks down. Roll > 0 turns the figure
  clockwise in the image.

The camera model, with X_c = R (X - target) and k = 1 / distance:

    u = cu + s   * x_c / (1 + k z_c)
    v = cv + s a * y_c / (1 + k z_c)

k = 0 *is* orthography; k > 0 is a pinhole whose centre lies `1 / k` in front of `target` (against
the viewing direction), with fx = s / k, fy = a s / k and principal point (cu, cv). No focal length
ever runs to infinity, so one solver serves both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from toonset.errors import CameraError

MIN_RELATIVE_DEPTH = 1e-6  # of the distance: nearer than this a pinhole's pixel has no meaning


@dataclass(frozen=True, eq=False)
class Camera:
    """One view's camera; see the module docstring for the equation.

    Attributes:
        rotation: camera_from_world, (3, 3), orthonormal, determinant +1.
        target: (3,) world point on the optical axis at whose depth `scale` holds.
        scale: pixels per world unit at the target's depth.
        center: (2,) pixel at which the target appears (the principal point).
        size_wh: image width and height in pixels.
        k: 1 / distance between camera centre and target in 1 / world units; 0 = orthographic.
        pixel_aspect: fy / fx.
    """

    rotation: Float[np.ndarray, "3 3"]
    target: Float[np.ndarray, " 3"]
    scale: float
    center: Float[np.ndarray, " 2"]
    size_wh: tuple[int, int]
    k: float = 0.0
    pixel_aspect: float = 1.0

    def __post_init__(self) -> None:
        """Refuse cameras that cannot exist.

        Raises:
            CameraError: a value is not finite, the rotation is not one, a size is not positive.
        """
        for name in ("rotation", "target", "center"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        shapes = (self.rotation.shape, self.target.shape, self.center.shape)
        if shapes != ((3, 3), (3,), (2,)):
            raise CameraError(f"camera: shapes (3, 3), (3,), (2,) needed, found {shapes}")
        numbers = [*self.rotation.flat, *self.target, *self.center]
        numbers += [self.scale, self.k, self.pixel_aspect]
        if not np.isfinite(numbers).all():
            raise CameraError("camera: a value is not finite; every number must be")
        if np.abs(self.rotation @ self.rotation.T - np.eye(3)).max() > 1e-5:
            raise CameraError(
                "camera: rotation is not orthonormal (R R^T differs from 1 by > 1e-5)"
            )
        if np.linalg.det(self.rotation) < 0:
            raise CameraError("camera: rotation mirrors (determinant -1); +1 is needed")
        if self.scale <= 0 or self.pixel_aspect <= 0 or self.k < 0 or min(self.size_wh) <= 0:
            raise CameraError(
                f"camera: scale {self.scale}, aspect {self.pixel_aspect}, size {self.size_wh} must "
                f"be positive and k {self.k} not negative"
            )

    @classmethod
    def looking_at(
        cls,
        target: Float[np.ndarray, " 3"],
        yaw: float,
        elevation: float,
        scale: float,
        size_wh: tuple[int, int],
        roll: float = 0.0,
        center: Float[np.ndarray, " 2"] | None = None,
        k: float = 0.0,
    ) -> Camera:
        """Return the camera at `yaw`, `elevation`, `roll` (radians) that looks at `target`."""
        middle = np.array(size_wh, dtype=np.float64) / 2 if center is None else center
        rotation = rotation_from_angles(yaw, elevation, roll)
        return cls(rotation, target, scale, middle, size_wh, k)

    @classmethod
    def from_pinhole(
        cls,
        world_from_camera: Float[np.ndarray, "4 4"],
        K: Float[np.ndarray, "3 3"],
        size_wh: tuple[int, int],
        near: Float[np.ndarray, " 3"] | None = None,
    ) -> Camera:
        """Return the same pinhole in the nested form.

        Args:
            world_from_camera: rigid pose, OpenCV axes.
            K: intrinsics in pixels, no skew, pixel centres at 0.5.
            size_wh: image width and height.
            near: world point whose depth becomes the target's; default the world origin. Any
                choice in front of the camera gives the same projection.

        Raises:
            CameraError: skew, or a matrix that is not a rigid pose.
        """
        pose = np.asarray(world_from_camera, dtype=np.float64)
        if abs(K[0, 1]) > 1e-9 * abs(K[0, 0]):
            raise CameraError(f"camera: skew {K[0, 1]} is not supported; undistort the images")
        rotation, centre = pose[:3, :3].T, pose[:3, 3]
        point = np.zeros(3) if near is None else np.asarray(near, dtype=np.float64)
        distance = float(rotation[2] @ (point - centre))
        if distance <= 1e-9 * max(float(np.linalg.norm(point - centre)), 1.0):
            distance = max(float(np.linalg.norm(point - centre)), 1.0)
        target = centre + distance * rotation[2]
        fx, fy = float(K[0, 0]), float(K[1, 1])
        return cls(rotation, target, fx / distance, K[:2, 2], size_wh, 1 / distance, fy / fx)

    @property
    def is_orthographic(self) -> bool:
        """Return whether all rays are parallel."""
        return self.k == 0.0

    @property
    def angles(self) -> tuple[float, float, float]:
        """Return (yaw, elevation, roll) in radians, yaw in (-pi, pi]."""
        return angles_from_rotation(self.rotation)

    @property
    def K(self) -> Float[np.ndarray, "3 3"]:
        """Return the pinhole intrinsics in pixels.

        Raises:
            CameraError: the camera is orthographic; call `as_pinhole` first.
        """
        if self.is_orthographic:
            raise CameraError("camera: an orthographic camera has no K; call as_pinhole(distance)")
        fx = self.scale / self.k
        fy = fx * self.pixel_aspect
        return np.array([[fx, 0, self.center[0]], [0, fy, self.center[1]], [0, 0, 1.0]])

    @property
    def world_from_camera(self) -> Float[np.ndarray, "4 4"]:
        """Return the pose (OpenCV axes); an orthographic camera's frame sits in the target."""
        distance = 0.0 if self.is_orthographic else 1 / self.k
        pose = np.eye(4)
        pose[:3, :3] = self.rotation.T
        pose[:3, 3] = self.target - distance * self.rotation[2]
        return pose

    @property
    def camera_from_world(self) -> Float[np.ndarray, "4 4"]:
        """Return the inverse of `world_from_camera`."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = -self.rotation @ self.world_from_camera[:3, 3]
        return matrix

    def project(
        self, points_world: Float[np.ndarray, "*n 3"]
    ) -> tuple[Float[np.ndarray, "*n 2"], Float[np.ndarray, " *n"], Bool[np.ndarray, " *n"]]:
        """Return pixels, depth (world units past the target's plane) and whether in front.

        Points behind a pinhole (or in its centre's plane) get NaN pixels and False.
        """
        local = (np.asarray(points_world, dtype=np.float64) - self.target) @ self.rotation.T
        depth = local[..., 2]
        pixels = np.empty((*depth.shape, 2))
        for axis in range(2):  # each by itself: NumPy is slow where the last axis is short
            np.multiply(local[..., axis], self.scale_uv[axis], out=pixels[..., axis])
        if self.is_orthographic:
            for axis in range(2):
                pixels[..., axis] += self.center[axis]
            return pixels, depth, np.ones(depth.shape, dtype=bool)
        relative = 1 + self.k * depth
        in_front = relative > MIN_RELATIVE_DEPTH
        divisor = np.where(in_front, relative, np.nan)
        for axis in range(2):
            pixels[..., axis] /= divisor
            pixels[..., axis] += self.center[axis]
        return pixels, depth, in_front

    def unproject(
        self, pixels: Float[np.ndarray, "*n 2"], depth: Float[np.ndarray, " *n"]
    ) -> Float[np.ndarray, "*n 3"]:
        """Return the world points seen at `pixels` with `depth` past the target's plane."""
        depth = np.asarray(depth, dtype=np.float64)
        pixels = np.asarray(pixels, dtype=np.float64)
        relative = 1 + self.k * depth
        local = np.empty((*depth.shape, 3))
        for axis in range(2):  # each by itself: NumPy is slow where the last axis is short
            plane = (pixels[..., axis] - self.center[axis]) / self.scale_uv[axis]
            np.multiply(plane, relative, out=local[..., axis])
        local[..., 2] = depth
        points = local @ self.rotation
        for axis in range(3):
            points[..., axis] += self.target[axis]
        return points

    def unproject_grid(
        self, depth: Float[np.ndarray, "height width"]
    ) -> Float[np.ndarray, "height width 3"]:
        """Return what `unproject` does of every pixel's centre, several times as fast.

        In memory the coordinates lie one after the other, as `project_grid` reads them.
        """
        depth = np.asarray(depth, dtype=np.float64)
        width, height = self.size_wh
        u = (np.arange(width) + 0.5 - self.center[0]) / self.scale_uv[0]
        v = (np.arange(height) + 0.5 - self.center[1]) / self.scale_uv[1]
        points = np.empty((3, height, width))
        relative = None if self.is_orthographic else 1 + self.k * depth
        for axis, (right, down, forward) in enumerate(self.rotation.T):
            plane = right * u + (down * v)[:, None]
            if relative is not None:
                plane *= relative
            np.multiply(depth, forward, out=points[axis])
            points[axis] += plane
            points[axis] += self.target[axis]
        return np.moveaxis(points, 0, -1)

    def project_grid(
        self, points_world: Float[np.ndarray, "height width 3"]
    ) -> tuple[
        Float[np.ndarray, "2 height width"],
        Float[np.ndarray, "height width"],
        Bool[np.ndarray, "height width"],
    ]:
        """Return what `project` does of a picture of world points, the pixels axis by axis."""
        points = np.ascontiguousarray(np.moveaxis(points_world, -1, 0))
        turn = np.array([*self.scale_uv, 1.0])[:, None] * self.rotation
        start = -turn @ self.target
        if self.is_orthographic:
            start[:2] += self.center
        local = turn @ points.reshape(3, -1)
        local += start[:, None]
        local = local.reshape(points.shape)
        pixels, depth = local[:2], local[2]
        if self.is_orthographic:
            return pixels, depth, np.ones(depth.shape, dtype=bool)
        relative = 1 + self.k * depth
        in_front = relative > MIN_RELATIVE_DEPTH
        pixels /= np.where(in_front, relative, np.nan)
        pixels += self.center[:, None, None]
        return pixels, depth, in_front

    def rays(
        self, pixels: Float[np.ndarray, "*n 2"]
    ) -> tuple[Float[np.ndarray, "*n 3"], Float[np.ndarray, "*n 3"]]:
        """Return origins in the target's plane and unit directions of the rays through `pixels`.

        A pinhole's centre is at -1 / k along the optical axis from these origins, so parameters
        t < 0 along a ray are valid down to there.
        """
        origins = self.unproject(pixels, np.zeros(np.shape(pixels)[:-1]))
        plane = (np.asarray(pixels, dtype=np.float64) - self.center) / self.scale_uv
        local = np.concatenate([self.k * plane, np.ones((*plane.shape[:-1], 1))], axis=-1)
        local /= np.linalg.norm(local, axis=-1, keepdims=True)
        return origins, local @ self.rotation

    def pixel_grid(self) -> Float[np.ndarray, "height width 2"]:
        """Return the centre of every pixel."""
        width, height = self.size_wh
        u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        return np.stack([u, v], axis=-1)

    def as_pinhole(self, distance: float) -> Camera:
        """Return an orthographic camera as a pinhole `distance` world units before the target.

        A pinhole is returned as it is. `pinhole_error_px` bounds the difference in the image.
        """
        return replace(self, k=1 / distance) if self.is_orthographic else self

    def pinhole_error_px(self, distance: float, radius: float) -> float:
        """Return a bound in px on `as_pinhole`'s error for points within `radius` of the target."""
        if not self.is_orthographic:
            return 0.0
        largest = max(1.0, self.pixel_aspect) * self.scale * radius
        return largest * radius / (distance - radius) if distance > radius else math.inf

    def moved(self, offset_uv: tuple[float, float], size_wh: tuple[int, int]) -> Camera:
        """Return the camera of a crop (or pad) of size `size_wh` whose corner is at `offset_uv`."""
        return replace(self, center=self.center - np.array(offset_uv), size_wh=size_wh)

    def resized(self, factor: float) -> Camera:
        """Return the camera of the image scaled by `factor` (size rounded, edges aligned)."""
        width, height = (max(1, round(factor * n)) for n in self.size_wh)
        center = self.center * factor
        return replace(self, scale=self.scale * factor, center=center, size_wh=(width, height))

    def twin(self) -> Camera:
        """Return the mirror twin: for a body symmetric in x, the same outline under orthography.

        R' = diag(1, 1, -1) R diag(-1, 1, 1); angles (yaw, elevation) become (180 - yaw, -elevation)
        """
        rotation = np.diag([1.0, 1.0, -1.0]) @ self.rotation @ np.diag([-1.0, 1.0, 1.0])
        return replace(self, rotation=rotation, target=self.target * [-1.0, 1.0, 1.0])

    @property
    def scale_uv(self) -> Float[np.ndarray, " 2"]:
        """Return pixels per world unit along u and v, at the target's depth."""
        return np.array([self.scale, self.scale * self.pixel_aspect])


def rotation_from_angles(yaw: float, elevation: float, roll: float) -> Float[np.ndarray, "3 3"]:
    """Return camera_from_world of a camera at the given angles (radians; see the module)."""
    cy, sy, ce, se = math.cos(yaw), math.sin(yaw), math.cos(elevation), math.sin(elevation)
    right = np.array([cy, 0.0, -sy])
    down = np.array([sy * se, -ce, cy * se])
    forward = np.array([-sy * ce, -se, -cy * ce])
    cr, sr = math.cos(roll), math.sin(roll)
    spin = np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1.0]])
    return spin @ np.stack([right, down, forward])


def angles_from_rotation(rotation: Float[np.ndarray, "3 3"]) -> tuple[float, float, float]:
    """Return (yaw, elevation, roll) in radians; seen from straight above or below roll is 0."""
    forward = rotation[2]
    elevation = math.asin(float(np.clip(-forward[1], -1, 1)))
    if math.hypot(forward[0], forward[2]) < 1e-9:
        return math.atan2(float(-rotation[0, 2]), float(rotation[0, 0])), elevation, 0.0
    yaw = math.atan2(float(-forward[0]), float(-forward[2]))
    unrolled = rotation_from_angles(yaw, elevation, 0.0)
    spin = rotation @ unrolled.T
    return yaw, elevation, math.atan2(float(spin[1, 0]), float(spin[0, 0]))


def rotation_distance(a: Float[np.ndarray, "3 3"], b: Float[np.ndarray, "3 3"]) -> float:
    """Return the angle in radians of the rotation between `a` and `b`."""
    return math.acos(float(np.clip((np.trace(a.T @ b) - 1) / 2, -1, 1)))
