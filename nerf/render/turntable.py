"""Place cameras that turn round a trained figure, as high as its sheet is drawn."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from toonset.camera import Camera
from toonset.dataset.silhouettes.mask import mask_of
from toonset.errors import UsageError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.hull.hull import Hull
from toonset.nerf.look.drawings import Original
from toonset.nerf.render.turn_angles import Angles, angles_between, ring_of, turn_angles

FILL = 0.94  # of the picture's side that the figure may take


def turntable(
    trained: TrainedField, count: int, elevation: float | None = None, size: int | None = None
) -> tuple[Camera, ...]:
    """Return `count` cameras all round, the first in front, all at one scale.

    They pass through the drawings' own directions, each of which is one of them if there are as
    many: see `toonset.nerf.render.turn_angles`.

    Args:
        trained: the figure; cameras see as far (or as parallel) as its training cameras.
        count: number of views, yaw rising.
        elevation: radians, > 0 looks down, no camera leans; None: as the sheet is drawn, and each
            drawing's own at its direction.
        size: side of the square pictures, px; None: the figure is as large as in the drawings,
            and at a drawing's direction on the same pixels as there.

    Raises:
        UsageError: no view, or pictures without a pixel.
    """
    _check(count, size)
    angles = turn_angles(drawn_ring(trained), count)
    if elevation is not None:
        angles[:, 1:] = (elevation, 0.0)
    return framed(trained, angles, size)


def between_drawings(
    trained: TrainedField, count: int, size: int | None = None
) -> tuple[Camera, ...]:
    """Return `count` cameras half way between drawings, the first nearest to front.

    Mirrored drawings count, too: the view from there is one of them, turned round.

    Args:
        trained: see `turntable`.
        count: number of views, yaw rising.
        size: see `turntable`.

    Raises:
        UsageError: no view, or pictures without a pixel.
    """
    _check(count, size)
    views = () if trained.drawings is None else trained.drawings.views
    ring = ring_of([view.as_drawn.camera for view in views])
    return framed(trained, angles_between(ring, count), size)


def drawn_ring(trained: TrainedField) -> Angles:
    """Return yaw, elevation and roll of the drawings that a turn passes through, yaw rising."""
    return ring_of([own.camera for own in drawn_on_sheet(trained)])


def filled_box(hull: Hull) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and highest corner of what is inside the hull."""
    cells = np.argwhere(hull.inside.numpy())
    return hull.low + hull.voxel * cells.min(axis=0), hull.low + hull.voxel * (
        cells.max(axis=0) + 1
    )


def _check(count: int, size: int | None) -> None:
    if count < 1 or (size is not None and size < 1):
        raise UsageError(f"turntable: {count} views of {size} px; 1 or more of each are needed")


def drawn_on_sheet(trained: TrainedField) -> list[Original]:
    """Return the drawings as they are on the sheet; mirror images do not count."""
    views = () if trained.drawings is None else trained.drawings.views
    return [view.as_drawn for view in views if not view.mirrored]


def framed(trained: TrainedField, angles: Angles, size: int | None) -> tuple[Camera, ...]:
    """Return cameras at directions, with one scale and size that figure and drawings fit in.

    See `turntable`; `angles` are yaw, elevation and roll, radians.
    """
    low, high = filled_box(trained.hull)
    target = (low + high) / 2
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    corners = low + corners * (high - low)

    def placed(scale: float, side: int) -> tuple[Camera, ...]:
        return tuple(
            Camera.looking_at(target, yaw, elevation, scale, (side, side), roll, k=trained.k)
            for yaw, elevation, roll in angles
        )

    drawn = drawn_on_sheet(trained)
    around = [float(np.abs(c.project(corners)[0] - c.center).max()) for c in placed(1.0, 1)]
    reach = max([*around, *(_reach(own, target) for own in drawn)])
    if size is None and drawn:
        scale = float(np.median([_scale_at(own.camera, target) for own in drawn]))
        cameras = placed(scale, math.ceil(2 * reach * scale / FILL))
        return tuple(_on_its_pixels(camera, [own.camera for own in drawn]) for camera in cameras)
    side = size or trained.size_px
    return placed(FILL * side / 2 / reach, side)


def _reach(own: Original, target: Float[np.ndarray, " 3"]) -> float:
    """Return how far from a point a drawing shows the figure, which a surface may lack in part."""
    rows, columns = (np.flatnonzero(mask_of(own.rgba).any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return 0.0
    corners = np.array([[columns[0], rows[0]], [columns[-1] + 1, rows[-1] + 1]])
    away = corners - own.camera.project(target[None])[0][0]
    return float(np.abs(away).max()) / _scale_at(own.camera, target)


def _on_its_pixels(camera: Camera, drawn: list[Camera]) -> Camera:
    """Return a camera moved by half a pixel at most, so that a drawing seen as it is stays sharp.

    Its pixels are then those of the drawing that has its rotation, if there is one.
    """
    for own in drawn:
        if np.allclose(own.rotation, camera.rotation, rtol=0, atol=1e-9):
            away = own.project(camera.target[None])[0][0] - camera.center
            return replace(camera, center=camera.center + away - np.rint(away))
    return camera


def _scale_at(camera: Camera, point: Float[np.ndarray, " 3"]) -> float:
    """Return a camera's pixels per world unit at a point's depth."""
    depth = float(camera.project(point[None])[1][0])
    return camera.scale / (1 + camera.k * depth)
