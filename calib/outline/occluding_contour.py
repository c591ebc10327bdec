"""Find the mannequin's occluding contour and mask from any direction, without OpenGL.

A contour generator is an edge whose two faces lie on one side of it in the image (or an edge of an
open surface). Its points on the outer silhouette are kept by a low-resolution mask. In the image an
occluding point's normal is perpendicular to its edge, away from the faces. To first order in the
pose it may be treated as fixed on the mesh: its sliding moves it along the outline only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.calib.outline.covered_pixels import covered
from toonset.calib.outline.mesh_edges import Surface as Surface
from toonset.calib.outline.mesh_edges import folds_of
from toonset.calib.outline.mesh_edges import prepare_surface as prepare_surface
from toonset.calib.outline.pose import Pose, project

OUTSIDE_PX = 0.75  # beside a straight outline the pixel there is background, however it lies


@dataclass(frozen=True, eq=False)
class OccludingContour:
    """Points of the mesh on its outline in one view.

    Attributes:
        points: (n, 3) in the surface's coordinates.
        normals: (n, 2) outward in the image.
    """

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 2"]


def occluding_contour_at(
    surface: Surface, pose: Pose, size_wh: tuple[int, int], spacing_px: float, subpixels: int = 1
) -> OccludingContour:
    """Return the points of the surface on its outer silhouette, seen from `pose`.

    Args:
        surface: the prepared mesh.
        pose: of the camera; its pixels also set the resolution of the visibility test.
        size_wh: image size that holds the figure.
        spacing_px: distance of neighbouring occluding points along an edge.
        subpixels: the visibility test's pixels per pixel, along an axis: the contour of a leg that
            is hidden by less than such a pixel counts as seen.
    """
    ends, pixels, layers = _seen_folds(surface, pose)
    return _rim(ends, pixels, layers, size_wh, spacing_px, subpixels)


def mask_at(
    surface: Surface, pose: Pose, size_wh: tuple[int, int]
) -> Bool[np.ndarray, "height width"]:
    """Return which pixel centres the surface covers, seen from `pose`."""
    _, pixels, layers = _seen_folds(surface, pose)
    return covered(pixels[:, 0], pixels[:, 1], layers, size_wh)


def find_occluding_contour(
    surface: Surface,
    pixels: Float[np.ndarray, "vertices 2"],
    size_wh: tuple[int, int],
    spacing_px: float,
) -> OccludingContour:
    """Return the same for any projection: `pixels` are the projected vertices."""
    a, b, c = (pixels[surface.faces[:, i]] for i in range(3))
    ab, ac = b - a, c - a
    folds, layers = folds_of(surface, ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0] > 0)
    edges = surface.edges[folds]
    return _rim(surface.vertices[edges], pixels[edges], layers, size_wh, spacing_px, 1)


def _seen_folds(
    surface: Surface, pose: Pose
) -> tuple[
    Float[np.ndarray, "folds 2 3"], Float[np.ndarray, "folds 2 2"], Int[np.ndarray, " folds"]
]:
    """Return the ends of the folds in space and in the picture, and `covered`'s layers."""
    toward = np.append(pose.rotation[2], pose.k)  # the camera's centre, homogeneous, negated
    turned = surface.planes @ toward > 0  # clockwise on the screen, u right and v down
    folds, layers = folds_of(surface, turned)
    edges = surface.edges.take(folds, axis=0)  # several times as fast as an index in brackets
    ends = surface.vertices.take(edges, axis=0)
    return ends, project(pose, ends.reshape(-1, 3)).reshape(-1, 2, 2), layers


def _rim(
    ends: Float[np.ndarray, "folds 2 3"],
    pixels: Float[np.ndarray, "folds 2 2"],
    layers: Int[np.ndarray, " folds"],
    size_wh: tuple[int, int],
    spacing_px: float,
    subpixels: int,
) -> OccludingContour:
    (u, v), (du, dv) = pixels[:, 0].T, (pixels[:, 1] - pixels[:, 0]).T
    length = np.hypot(du, dv)
    count = np.where(length > 1e-6, np.maximum(1, np.ceil(length / spacing_px)), 0).astype(np.intp)
    which = np.repeat(np.arange(len(count)), count)
    step = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    fraction = (step + 0.5) / count[which]
    outward = np.sign(layers[which]) / length[which]
    normals = np.stack([outward * dv[which], -outward * du[which]], axis=1)
    at = np.stack([u[which] + fraction * du[which], v[which] + fraction * dv[which]], axis=1)
    beside = at * subpixels + OUTSIDE_PX * normals
    size = (size_wh[0] * subpixels, size_wh[1] * subpixels)
    keep = np.flatnonzero(_is_background(beside, pixels * subpixels, layers, size))
    which, fraction = which[keep], fraction[keep, None]
    points = ends[which, 0] * (1 - fraction) + ends[which, 1] * fraction
    return OccludingContour(points, normals[keep])


def _is_background(
    points: Float[np.ndarray, "n 2"],
    folds: Float[np.ndarray, "folds 2 2"],
    layers: Int[np.ndarray, " folds"],
    size_wh: tuple[int, int],
) -> Bool[np.ndarray, " n"]:
    """Return which points lie in the picture, in a pixel of the background."""
    if len(points) == 0:
        return np.zeros(0, dtype=bool)
    left, right = _span(folds[..., 0], size_wh[0])
    top, bottom = _span(folds[..., 1], size_wh[1])
    width, height = right - left, bottom - top
    if width == 0 or height == 0:
        return np.zeros(len(points), dtype=bool)
    near = folds - np.array([left, top])
    mask = covered(near[:, 0], near[:, 1], layers, (width, height)).ravel()
    column, row = np.floor(points - (left, top)).astype(np.intp).T
    seen = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    place = np.where(seen, row * width + column, 0)
    return seen & ~mask[place]


def _span(values: Float[np.ndarray, "folds 2"], size: int) -> tuple[int, int]:
    """Return the first and last pixel, exclusive, around `values` with one to spare each side."""
    low, high = math.floor(values.min()) - 1, math.ceil(values.max()) + 1
    return min(max(low, 0), size), min(max(high, 0), size)
