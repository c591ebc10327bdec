"""Views of a mannequin in the drawings' colours: what one would do without a field.

    colour(x) = sum_v w_v colour_v(project_v(x)) / sum_v w_v,   w_v = cos^4 of the angle of sight

over the drawings in which the mannequin hides x behind nothing: the rule of the coloured hull
(`bench.train.painted_hull`), so that the two differ in shape alone. A point that no drawing
shows, or only beside its figure, takes the colour of the nearest one that a drawing's pixel lies
on.

It is asked anew for every point that a view shows, so no texture limits how fine it is.

Source: what hides what is read from a depth picture per drawing, as shadows are; Williams, "Casting
curved shadows on curved surfaces", 1978.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8
from scipy.ndimage import map_coordinates
from scipy.spatial import KDTree

from bench.train.painted_hull import GRAZING, SHARPNESS
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.synthetic.gl_render import render_labels
from toonset.errors import BundleError
from toonset.mesh import Mesh

SAMPLES = 4  # per pixel and axis, of what is drawn; half as many cost 3 dB where the mesh is true
MOST_SIDE_PX = 2048  # of those samples: half a GiB of points
HIDDEN_PX = 1.0  # a point is hidden by what lies more than a drawing's pixel in front of it
LEAST = 1e-9  # weight of a point that some drawing shows


@dataclass(frozen=True, eq=False)
class Drawn:
    """One drawing and what of the mannequin its camera sees.

    Attributes:
        camera: in pixels of the drawing.
        colors: (height, width, 4) premultiplied, in [0, 1].
        depth: (height * samples, width * samples) world units past the target; inf = nothing.
        samples: per pixel and axis.
    """

    camera: Camera
    colors: Float[np.ndarray, "height width 4"]
    depth: Float[np.ndarray, "rows columns"]
    samples: int


@dataclass(frozen=True, eq=False)
class PaintedMannequin:
    """A mannequin and where its points get their colours from.

    Attributes:
        mesh: world coordinates.
        drawings: all of them.
        points: (n, 3) surface points, one under every drawn pixel, as a tree of nearest ones.
        point_colors: (n, 3) in [0, 1].
    """

    mesh: Mesh
    drawings: tuple[Drawn, ...]
    points: KDTree
    point_colors: Float[np.ndarray, "n 3"]


def paint_mannequin(mesh: Mesh, scene: Scene) -> PaintedMannequin:
    """Return the mannequin in the colours of the scene's drawings.

    Raises:
        BundleError: no drawing shows any of it.
        CameraError: it reaches behind a camera.
        SetupError: EGL or Mesa is missing.
    """
    drawings = tuple(_drawn(mesh, frame) for frame in scene.frames)
    found = [_under_pixels(drawing) for drawing in drawings]
    points = np.concatenate([points for points, _ in found])
    if not len(points):
        raise BundleError(f"{scene.name}: no drawing shows {mesh.name} where its camera sees it")
    colors = np.concatenate([colors for _, colors in found])
    return PaintedMannequin(mesh, drawings, KDTree(points), colors)


def mannequin_view(
    painted: PaintedMannequin, camera: Camera
) -> UInt8[np.ndarray, "height width 4"]:
    """Return what a camera sees of the mannequin, with straight alpha."""
    samples = _samples(camera)
    fine = camera.resized(samples)
    depth = _depth(painted.mesh, fine)
    hit = np.isfinite(depth)
    pixels = fine.pixel_grid()
    points = fine.unproject(pixels, np.where(hit, depth, 0.0))
    _, sight = fine.rays(pixels[hit])
    rgba = np.zeros((*hit.shape, 4))
    rgba[hit, :3] = _colors(painted, points[hit], _normals(points)[hit], sight)
    rgba[hit, 3] = 1.0
    width, height = camera.size_wh
    mean = rgba.reshape(height, samples, width, samples, 4).mean(axis=(1, 3))
    mean[..., :3] /= np.maximum(mean[..., 3:], LEAST)
    return (mean.clip(0, 1) * 255 + 0.5).astype(np.uint8)


def _colors(
    painted: PaintedMannequin,
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    sight: Float[np.ndarray, "n 3"],
) -> Float[np.ndarray, "n 3"]:
    """Return the colours of surface points that are seen along `sight`."""
    away = (normals * sight).sum(axis=1) > 0
    inward = np.where(away[:, None], normals, -normals)
    total = np.zeros((len(points), 4))
    for drawing in painted.drawings:
        pixels, depth, _ = drawing.camera.project(points)
        _, toward = drawing.camera.rays(pixels)
        facing = (inward * toward).sum(axis=1).clip(GRAZING, 1) ** SHARPNESS
        seen = _is_seen(drawing, pixels, depth)
        total[seen] += facing[seen, None] * _sampled(drawing.colors, pixels[seen])
    bare = total[:, 3] <= LEAST
    colors = total[:, :3] / np.maximum(total[:, 3:], LEAST)
    if bare.any():
        colors[bare] = painted.point_colors[painted.points.query(points[bare])[1]]
    return colors


def _is_seen(
    drawing: Drawn, pixels: Float[np.ndarray, "n 2"], depth: Float[np.ndarray, " n"]
) -> Bool[np.ndarray, " n"]:
    """Return which points the mannequin does not hide from a drawing's camera."""
    rows, columns = drawing.depth.shape
    column, row = np.floor(np.nan_to_num(pixels, nan=-1.0) * drawing.samples).astype(np.intp).T
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    nearest = drawing.depth[row.clip(0, rows - 1), column.clip(0, columns - 1)]
    return inside & (depth <= nearest + HIDDEN_PX / drawing.camera.scale)


def _drawn(mesh: Mesh, frame: Frame) -> Drawn:
    samples = _samples(frame.camera)
    colors = frame.rgba / 255.0
    colors[..., :3] *= colors[..., 3:]  # what is transparent has no colour to mix in
    return Drawn(frame.camera, colors, _depth(mesh, frame.camera.resized(samples)), samples)


def _under_pixels(drawing: Drawn) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
    """Return a surface point under every pixel that the figure covers by half, and its colour."""
    middle = slice(drawing.samples // 2, None, drawing.samples)
    fine = drawing.camera.resized(drawing.samples)
    depth, pixels = drawing.depth[middle, middle], fine.pixel_grid()[middle, middle]
    shown = np.isfinite(depth) & (drawing.colors[..., 3] >= 0.5)
    colors = drawing.colors[shown]
    return fine.unproject(pixels[shown], depth[shown]), colors[:, :3] / colors[:, 3:]


def _normals(points: Float[np.ndarray, "height width 3"]) -> Float[np.ndarray, "height width 3"]:
    """Return unit normals of the surface that a picture of points shows, of either sign."""
    normal = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0))
    return normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), LEAST**2)


def _sampled(
    colors: Float[np.ndarray, "height width 4"], pixels: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n 4"]:
    """Return a picture's values at pixels, bilinear; beyond the edges nothing."""
    places = pixels.T[::-1] - 0.5
    return np.stack(
        [
            map_coordinates(layer, places, order=1, mode="constant")
            for layer in np.moveaxis(colors, 2, 0)
        ],
        axis=1,
    )


def _depth(mesh: Mesh, camera: Camera) -> Float[np.ndarray, "height width"]:
    return render_labels(mesh, np.zeros(len(mesh.faces), dtype=np.intp), camera).depth


def _samples(camera: Camera) -> int:
    return max(1, min(SAMPLES, MOST_SIDE_PX // max(camera.size_wh)))
