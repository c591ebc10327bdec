"""Find parts of a mannequin that no drawing shows: a stand, a floor, a weapon left at home.

Cameras that fit an outline with such a part bend to hide it, and look well met. Where a part alone
would be seen, outside of all the rest, some drawing must have paint.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.camera import Camera
from toonset.dataset.mesh.rasterize import depth_map
from toonset.dataset.mesh.surroundings import connected_pieces
from toonset.mesh import Mesh
from toonset.raster import quick_distance_to
from toonset.view import View

HEIGHT_PX = 200  # of the pictures in which it is looked for
LARGE = 0.15  # of the second largest part's extent: smaller ones bend no camera
MOST_PARTS = 12  # are looked at
AWAY = 0.05  # of the figure's height: a part must stick out so far to be missed
SPILL = 0.02  # of the figure's height: paint beside a drawn part
MOST_MISSED = 0.5  # of what only the part shows (docs/decisions.md)
POINTS = 400  # of a part


def undrawn_part(mesh: Mesh, cameras: Sequence[Camera], drawings: Sequence[View]) -> str:
    """Return the name of a part that is in no drawing; "" if all are drawn.

    Args:
        mesh: the mannequin as it was fitted.
        cameras: one per drawing, in pixels of its crop.
        drawings: theirs.
    """
    parts = [*_parts(mesh)]
    if not parts:
        return ""
    sheet = [_Drawn(camera, view) for camera, view in zip(cameras, drawings, strict=True)]
    for name, faces in parts:
        points = _points(mesh, faces)
        seen, missed, farthest = 0, 0, 0.0
        for drawn in sheet:
            alone, outside = drawn.alone(mesh, faces, points)
            seen += int(alone.sum())
            missed += int((alone & (outside > SPILL)).sum())
            farthest = max(farthest, float(outside[alone].max(initial=0)))
        if seen and farthest > AWAY and missed > MOST_MISSED * seen:
            return name
    return ""


class _Drawn:
    """A drawing, and its camera, as small as it is looked at."""

    def __init__(self, camera: Camera, view: View) -> None:
        rows = np.flatnonzero(view.mask.any(axis=1))
        factor = HEIGHT_PX / max(int(rows[-1] - rows[0]) + 1 if len(rows) else 1, 1)
        self.camera = camera.resized(factor)
        self.ends = factor * np.array(view.ends)
        width, height = self.camera.size_wh
        small = cv2.resize(
            view.mask.astype(np.uint8), (width, height), interpolation=cv2.INTER_AREA
        )
        drawn = np.pad(small > 0, 1)
        self.away = quick_distance_to(drawn)[1:-1, 1:-1] / HEIGHT_PX

    def alone(
        self, mesh: Mesh, faces: Bool[np.ndarray, " faces"], points: Float[np.ndarray, "points 3"]
    ) -> tuple[Bool[np.ndarray, " points"], Float[np.ndarray, " points"]]:
        """Return which points only this part shows, and how far from all paint each is seen.

        Points beyond a side where the figure is cut off are not looked for.
        """
        pixels = self.camera.project(points)[0]
        width, height = self.camera.size_wh
        u, v = np.clip(np.nan_to_num(pixels).T, -1e6, 1e6)
        beyond = np.maximum.reduce([-u, u - width, -v, v - height, np.zeros(len(u))]) / HEIGHT_PX
        column = np.clip(u, 0, width - 1).astype(int)
        row = np.clip(v, 0, height - 1).astype(int)
        rest = np.isfinite(depth_map(mesh.vertices, mesh.faces[~faces], self.camera))
        covered = cv2.dilate(rest.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
        covered = covered[row, column] & (beyond == 0)
        left, top, right, bottom = self.ends
        covered |= (u < left) | (v < top) | (u > right) | (v > bottom)
        return ~covered, self.away[row, column] + beyond


def _parts(mesh: Mesh) -> Iterator[tuple[str, Bool[np.ndarray, " faces"]]]:
    """Yield name and faces of parts and loose pieces, those that matter most to the outline."""
    pieces, part_of = connected_pieces(mesh)
    if len(part_of) == 1:
        return
    numberings = [(pieces, False)]
    if mesh.face_parts is not None:
        numberings.append((part_of[pieces], True))
    groups: list[tuple[float, str, Int[np.ndarray, " faces"]]] = []
    for numbers, is_part in numberings:
        order = np.argsort(numbers, kind="stable")
        faces = np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1)
        extents, overhangs = _sizes(mesh, faces)
        least = LARGE * np.sort(extents)[-2]  # the largest may be a scene around all others
        for own, extent, overhang in zip(faces, extents, overhangs, strict=True):
            if extent >= least:
                part = mesh.part_names[part_of[pieces[own[0]]]]
                named = is_part or len(mesh.part_names) > 1
                name = part if named else f"piece of {len(own)} faces"
                groups.append((float(extent + overhang), name, own))
    groups.sort(key=lambda group: -group[0])
    for _, name, own in groups[:MOST_PARTS]:
        chosen = np.zeros(len(mesh.faces), dtype=bool)
        chosen[own] = True
        yield name, chosen


def _sizes(
    mesh: Mesh, groups: Sequence[Int[np.ndarray, " faces"]]
) -> tuple[Float[np.ndarray, " groups"], Float[np.ndarray, " groups"]]:
    """Return the extent of every group of faces, and how far it leaves the box of all others."""
    corners = [mesh.vertices[mesh.faces[own]].reshape(-1, 3) for own in groups]
    high = np.array([[*own.max(axis=0), *-own.min(axis=0)] for own in corners])
    first, second = np.sort(high, axis=0)[-1], np.sort(high, axis=0)[-2]
    overhangs = np.where(high == first, first - second, 0).max(axis=1)
    return (high[:, :3] + high[:, 3:]).max(axis=1), overhangs


def _points(mesh: Mesh, faces: Bool[np.ndarray, " faces"]) -> Float[np.ndarray, "points 3"]:
    """Return points spread evenly over a part: the same ones every time."""
    a, b, c = (mesh.vertices[mesh.faces[faces][:, i]] for i in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    at = (np.arange(POINTS) + 0.5) / POINTS * areas.sum()
    chosen = np.minimum(np.searchsorted(np.cumsum(areas), at), len(areas) - 1)
    golden = np.array([0.7548776662466927, 0.5698402909980532])  # R2 sequence, M. Roberts 2018
    s, t = (np.arange(1, POINTS + 1)[:, None] * golden % 1).T
    s, t = np.where(s + t > 1, 1 - s, s), np.where(s + t > 1, 1 - t, t)
    return a[chosen] + s[:, None] * (b - a)[chosen] + t[:, None] * (c - a)[chosen]
