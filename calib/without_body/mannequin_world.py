"""Put cameras that were found without a body into the world of a mannequin that was refused.

The mannequin is another body, but its world is the one that everything else of a person's scene
lies in. Of all similarities that keep the yaws, the one is taken under which the mannequin's head
and feet appear where the figures' do, and its axis where theirs is: with X_found = a X + b a
camera's pixels of the mannequin's extreme points and middle are linear in (a, b).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.calib.result import Calibration, ViewCalibration
from toonset.camera import Camera
from toonset.mesh import Mesh
from toonset.view import View

ROUNDS = 8  # of reweighting: props and arms move the middle of single views
NEAR = 0.02  # of the height: places of another body that agree


@dataclass(frozen=True, eq=False)
class Similarity:
    """X_found = scale X_mannequin + shift."""

    scale: float
    shift: Float[np.ndarray, " 3"]

    def moved(self, camera: Camera) -> Camera:
        """Return the camera that sees the mannequin's world as this one sees the found one."""
        target = (camera.target - self.shift) / self.scale
        k = camera.k * self.scale
        return replace(camera, target=target, scale=camera.scale * self.scale, k=k)


def in_mannequin_world(found: Calibration, views: Sequence[View], mesh: Mesh) -> Calibration:
    """Return the calibration in the mannequin's frame and units; the mannequin stays as it is.

    Args:
        found: without a body.
        views: its drawings.
        mesh: the mannequin that was refused.
    """
    similarity = best_similarity([view.camera for view in found.views], views, mesh)

    def moved(view: ViewCalibration) -> ViewCalibration:
        others = tuple(
            replace(other, camera=similarity.moved(other.camera)) for other in view.alternatives
        )
        return replace(
            view,
            camera=similarity.moved(view.camera),
            twin=similarity.moved(view.twin),
            alternatives=others,
        )

    own = tuple(map(moved, found.views))
    return replace(found, views=own, mesh=mesh, mannequin=mesh.vertices)


def best_similarity(cameras: Sequence[Camera], views: Sequence[View], mesh: Mesh) -> Similarity:
    """Return the similarity that lays the mannequin over the figures; yaws stay.

    Args:
        cameras: one per view, in the found world.
        views: the drawings.
        mesh: the mannequin.
    """
    rows, seen = [], []
    for camera, view in zip(cameras, views, strict=True):
        right, down = camera.rotation[:2]
        v, u = np.nonzero(view.mask)
        along = mesh.vertices @ down
        own = np.array(
            [mesh.vertices.mean(axis=0), *mesh.vertices[[along.argmin(), along.argmax()]]]
        )
        pixels = (u.mean() + 0.5, v.min(), v.max() + 1.0)
        center = (camera.center[0], camera.center[1], camera.center[1])
        for axis, point, pixel, middle in zip(
            (right, down, down), own, pixels, center, strict=True
        ):
            rows.append([axis @ point, *axis])
            seen.append((pixel - middle) / camera.scale + axis @ camera.target)
    matrix, wanted = np.array(rows), np.array(seen)
    weight = np.ones(len(wanted))
    for _ in range(ROUNDS):
        root = np.sqrt(weight)[:, None]
        numbers = np.linalg.lstsq(root * matrix, root[:, 0] * wanted, rcond=None)[0]
        off = matrix @ numbers - wanted
        weight = 1 / (1 + np.square(off / (NEAR * numbers[0] * mesh.height)))
    return Similarity(float(numbers[0]), numbers[1:])
