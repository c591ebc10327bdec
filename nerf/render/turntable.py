"""Place cameras that turn round a trained figure, as high as its sheet is drawn.

Drawings are directions (yaw, elevation, roll). Those about as high as the sheet's median are its
ring; a turn follows the ring, straight from drawing to drawing in all three angles: every drawing
on the way is one of its views. Between two drawings its steps are equal, and every further step
goes where steps are widest: the widest step is then as small as it can be, and drawings that lie on
an even grid are met by even steps.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from toonset.camera import Camera
from toonset.dataset.silhouettes.mask import mask_of
from toonset.errors import UsageError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.hull.hull import Hull
from toonset.nerf.look.drawing import Original

RING = math.radians(15)  # above or below the sheet's elevation: further ones are no part of a turn
SAME = math.radians(1)  # nearer drawings are one direction
FRONT = math.radians(22.5)  # a drawing within it is the front
SNAP = 0.25  # of a step: how far a view moves to a drawing where drawings outnumber views
TURN = 2 * math.pi

Angles = Float[np.ndarray, "n 3"]
Yaws = Float[np.ndarray, " n"]


def ring_of(cameras: Sequence[Camera]) -> Angles:
    """Return the directions on a sheet's ring by rising yaw from 0; of twins the first."""
    angles = [camera.angles for camera in cameras]
    level = statistics.median_low([elevation for _, elevation, _ in angles]) if angles else 0.0
    ring: list[tuple[float, float, float]] = []
    for yaw, elevation, roll in angles:
        alone = all(abs(math.remainder(yaw - other, TURN)) > SAME for other, _, _ in ring)
        if alone and abs(elevation - level) <= RING:
            ring.append((yaw % TURN, elevation, roll))
    return np.array(sorted(ring)).reshape(-1, 3)


def turn_angles(ring: Angles, count: int) -> Angles:
    """Return `count` directions all round, yaw rising from the front.

    Args:
        ring: the drawings, as `ring_of` returns them; none: equal turns at elevation 0.
        count: at least as many as drawings: each drawing is one of the directions. Fewer: equal
            turns, moved to drawings that are near.
    """
    if not len(ring):
        return at_yaws(ring, _even(0.0, count))
    yaws = ring[:, 0]
    if count >= len(ring):
        found = _between(yaws, _shares(_arcs(yaws), count), 0)
    else:
        found = _snapped(_even(_front(yaws), count), yaws)
    return at_yaws(ring, _from_front(found, _front(yaws)))


def angles_between(ring: Angles, count: int) -> Angles:
    """Return `count` directions as far from drawings as can be, yaw rising from the front.

    They lie half way between neighbours; those of a wide gap are several, and if there are more
    gaps than asked for, the directions are those that lie farthest apart.
    """
    if not len(ring):
        return at_yaws(ring, _even(TURN / count / 4, count))
    yaws = ring[:, 0]
    parts = _shares(_arcs(yaws), max(count + len(yaws), 2 * len(yaws)), least=2)
    return at_yaws(ring, _from_front(_farthest(_between(yaws, parts, 1), yaws, count), 0.0))


def at_yaws(ring: Angles, yaws: Yaws) -> Angles:
    """Return the ring's directions at yaws: elevation and roll are straight between drawings."""
    if not len(ring):
        return np.stack([yaws, np.zeros_like(yaws), np.zeros_like(yaws)], axis=1)
    tilts = [np.interp(yaws % TURN, ring[:, 0], ring[:, k], period=TURN) for k in (1, 2)]
    return np.stack([yaws, *tilts], axis=1)


def _arcs(yaws: Yaws) -> Yaws:
    """Return how far each drawing's successor lies from it."""
    return np.diff(yaws, append=yaws[0] + TURN)


def _shares(arcs: Yaws, count: int, least: int = 1) -> list[int]:
    """Return into how many steps each arc is cut, `count` in all, the widest step least."""
    parts = np.full(len(arcs), least)
    for _ in range(count - int(parts.sum())):
        parts[np.argmax(np.round(arcs / parts, 9))] += 1
    return [int(part) for part in parts]


def _between(yaws: Yaws, parts: Sequence[int], first: int) -> Yaws:
    """Return the ends of the steps that arcs are cut into; `first` 1 leaves the drawings out."""
    cut = zip(yaws, _arcs(yaws), parts, strict=True)
    return np.concatenate([yaw + arc * np.arange(first, n) / n for yaw, arc, n in cut])


def _farthest(found: Yaws, yaws: Yaws, count: int) -> Yaws:
    """Return `count` of some yaws: that farthest from drawings, then always farthest from those."""
    chosen, taken = yaws, found[:0]
    while len(taken) < count:
        apart = np.abs(_wrapped(found[:, None] - chosen)).min(axis=1)
        best = found[np.argmax(np.round(apart, 9))]
        chosen = taken = np.append(taken, best)
    return taken


def _snapped(even: Yaws, yaws: Yaws) -> Yaws:
    """Return yaws at equal steps, each moved to the drawing that is near."""
    apart = _wrapped(yaws - even[:, None])
    nearest = np.take_along_axis(apart, np.abs(apart).argmin(axis=1)[:, None], axis=1)[:, 0]
    return even + np.where(np.abs(nearest) <= SNAP * TURN / len(even), nearest, 0.0)


def _even(start: float, count: int) -> Yaws:
    return start + TURN * np.arange(count) / count


def _front(yaws: Yaws) -> float:
    """Return the yaw of the drawing that is the front, or 0 if there is none."""
    nearest = float(_wrapped(yaws)[np.abs(_wrapped(yaws)).argmin()])
    return nearest if abs(nearest) <= FRONT else 0.0


def _from_front(found: Yaws, front: float) -> Yaws:
    """Return yaws in the order of a turn that begins nearest to `front`."""
    start = float(found[np.abs(_wrapped(found - front)).argmin()])
    return math.remainder(start, TURN) + np.sort((found - start) % TURN)


def _wrapped(yaw: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return angles within half a turn of 0."""
    return (yaw + math.pi) % TURN - math.pi


FILL = 0.94  # of the picture's side that the figure may take


def turntable(
    trained: TrainedField, count: int, elevation: float | None = None, size: int | None = None
) -> tuple[Camera, ...]:
    """Return `count` cameras all round, the first in front, all at one scale.

    They pass through the drawings' own directions, each of which is one of them if there are as
    many.

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
