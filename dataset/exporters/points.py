"""Sample coloured points of the mannequin that drawings show, as a start for 3D reconstruction.

A point is kept if no drawing has background where the point projects. A view sees it if nothing of
the mannequin lies before it. Its colour comes from the view in which it lies deepest inside the
drawing, farthest from ink and from outlines that do not match.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame
from toonset.dataset.mesh.rasterize import depth_map
from toonset.mesh import Mesh
from toonset.raster import distance_to, nearest

OUTSIDE = 0.03  # of the body height: drawn outlines differ from the mannequin's by so much
BEHIND = 0.01  # of the body height: a point deeper than the surface by more is hidden
PLY_VERTEX = np.dtype(
    [
        *((name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")),
        *((name, "u1") for name in ("red", "green", "blue")),
    ]
)


@dataclass(frozen=True, eq=False)
class TrackedPoints:
    """Coloured points and the views that see them; each is seen by at least one.

    Attributes:
        xyz: (points, 3) in the world.
        rgb: (points, 3) sRGB.
        seen: (views, points) which view sees which point.
        pixels: (views, points, 2) projections; projected, not measured.
        what: they are, in words.
    """

    xyz: Float[np.ndarray, "points 3"]
    rgb: UInt8[np.ndarray, "points 3"]
    seen: Bool[np.ndarray, "views points"]
    pixels: Float[np.ndarray, "views points 2"]
    what: str = "on the mannequin, projected (not measured), coloured from the drawings"


def sample_surface(mesh: Mesh, count: int, seed: int) -> Float[np.ndarray, "count 3"]:
    """Return random points of the surface, equally dense everywhere.

    Source: Turk, Generating random points in triangles, Graphics Gems 1990.
    """
    rng = np.random.default_rng(seed)
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    which = rng.choice(len(area), count, p=area / area.sum())
    root, v = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    return (1 - root) * a[which] + root * (1 - v) * b[which] + root * v * c[which]


def track_points(
    candidates: Float[np.ndarray, "candidates 3"],
    mesh: Mesh,
    frames: Sequence[Frame],
    pinholes: Sequence[Camera],
) -> TrackedPoints:
    """Return those of the mannequin's points that the drawings show, coloured.

    Args:
        candidates: points of the mannequin.
        mesh: the mannequin.
        frames: the drawings.
        pinholes: one per drawing.
    """
    count = len(candidates)
    seen = np.zeros((len(frames), count), dtype=bool)
    pixels = np.zeros((len(frames), count, 2))
    kept = np.ones(count, dtype=bool)
    rgb = np.zeros((count, 3), dtype=np.uint8)
    deepest = np.full(count, -1.0)
    for i, (frame, camera) in enumerate(zip(frames, pinholes, strict=True)):
        pixels[i], _, _ = camera.project(candidates)
        away, inside, color = look_up(frame.rgba, pixels[i])
        kept &= away <= OUTSIDE * mesh.height * camera.scale
        seen[i] = _visible(candidates, mesh, camera)
        better = seen[i] & (inside > deepest)
        rgb[better], deepest[better] = color[better], inside[better]
    kept &= seen.any(axis=0)
    return TrackedPoints(candidates[kept], rgb[kept], seen[:, kept], pixels[:, kept])


def look_up(
    rgba: UInt8[np.ndarray, "height width 4"], pixels: Float[np.ndarray, "n 2"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"], UInt8[np.ndarray, "n 3"]]:
    """Return px to the figure, px inside of it, and the colour of its nearest pixel."""
    height, width = rgba.shape[:2]
    figure = np.pad(rgba[..., 3] >= 128, 1)  # a figure cut off by the frame ends there
    away, inside = distance_to(figure), distance_to(~figure)
    rows, columns = nearest(figure)
    column, row, within = _cells(pixels, (width, height))
    at = row + 1, column + 1
    color = rgba[rows[at] - 1, columns[at] - 1, :3]
    return np.where(within, away[at], np.inf), inside[at], color


def _visible(
    points: Float[np.ndarray, "n 3"], mesh: Mesh, pinhole: Camera
) -> Bool[np.ndarray, " n"]:
    """Return which points lie in the picture and not behind the surface.

    The farthest depth of a pixel's neighbours counts: on the rim, half of them see past the body.
    """
    deepest = cv2.dilate(depth_map(mesh.vertices, mesh.faces, pinhole), np.ones((3, 3), np.uint8))
    pixels, depth, in_front = pinhole.project(points)
    column, row, within = _cells(pixels, pinhole.size_wh)
    return within & in_front & (depth <= deepest[row, column] + BEHIND * mesh.height)


def _cells(
    pixels: Float[np.ndarray, "n 2"], size_wh: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray, Bool[np.ndarray, " n"]]:
    """Return column and row (clipped to the picture) and which pixels lie inside of it."""
    width, height = size_wh
    finite = np.nan_to_num(pixels, nan=-1.0)
    column, row = np.floor(np.clip(finite, -1, max(size_wh))).astype(np.intp).T
    within = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    return np.clip(column, 0, width - 1), np.clip(row, 0, height - 1), within


def encode_ply(points: TrackedPoints) -> bytes:
    """Return coloured points as a binary PLY; normals are 0, but Gaussian splatting wants them."""
    vertices = np.zeros(len(points.xyz), dtype=PLY_VERTEX)
    for axis, name in enumerate(("x", "y", "z")):
        vertices[name] = points.xyz[:, axis]
    for channel, name in enumerate(("red", "green", "blue")):
        vertices[name] = points.rgb[:, channel]
    return _header(len(vertices)) + vertices.tobytes()


def _header(count: int) -> bytes:
    kinds: Sequence[tuple[str, str]] = [
        (name, "uchar" if PLY_VERTEX[name] == np.uint8 else "float")
        for name in PLY_VERTEX.names or ()
    ]
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    lines += [f"property {kind} {name}" for name, kind in kinds]
    return ("\n".join([*lines, "end_header"]) + "\n").encode()
