"""Compute palette probabilities at points of a field's surface, as seen from in front."""

from __future__ import annotations

import math

import numpy as np
import torch
from jaxtyping import Float, Int
from scipy import sparse

from toonset.errors import PaletteError
from toonset.nerf.fields.trained_field import NO_PALETTE, TrainedField
from toonset.nerf.hull.hull import occupancy
from toonset.nerf.hull.march import Rays, march
from toonset.nerf.kernels.compositing import compositing_weights, pad
from toonset.nerf.kernels.loss_terms import straight

STEEPEST = math.radians(30)  # drawings are seen from about level; from above they say nothing
BEFORE = 1.5  # voxels in front of the surface at which a look begins
POINTS_PER_CHUNK = 1 << 13


@torch.no_grad()
def label_probabilities(
    trained: TrainedField,
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    rounds: int,
) -> Float[np.ndarray, "v colors"]:
    """Return how likely each vertex of a surface is to have each palette colour.

    Args:
        trained: the field.
        vertices: of its surface.
        faces: of its surface.
        rounds: how often every vertex takes the mean of itself and its neighbours.

    Raises:
        PaletteError: the run was trained without palette.
    """
    if trained.classifier is None or trained.palette is None:
        raise PaletteError(NO_PALETTE)
    directions = _looks(vertices, faces)
    parts = []
    for start in range(0, len(vertices), POINTS_PER_CHUNK):
        part = slice(start, start + POINTS_PER_CHUNK)
        color = _seen(trained, vertices[part], directions[part])
        parts.append(torch.softmax(trained.classifier(color), dim=1))
    chances = torch.cat(parts).double().numpy()
    mean = neighbour_mean(faces, len(vertices))
    for _ in range(rounds):
        chances = mean @ chances
    return chances


def vertex_normals(
    vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"]
) -> Float[np.ndarray, "v 3"]:
    """Return outward unit normals, means of the faces' by area; +Z where faces cancel."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    total = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(total, faces[:, corner], normal)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 0, total / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])


def _looks(
    vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"]
) -> Float[np.ndarray, "v 3"]:
    """Return directions of sight: against the normals, but never steeper than drawings are."""
    normals = vertex_normals(vertices, faces)
    level = np.hypot(normals[:, 0], normals[:, 2])
    steep = math.tan(STEEPEST)
    height = np.where(
        level > 1e-6, normals[:, 1].clip(-steep * level, steep * level), normals[:, 1]
    )
    looks = -np.stack([normals[:, 0], height, normals[:, 2]], axis=1)
    return looks / np.linalg.norm(looks, axis=1, keepdims=True)


def _seen(
    trained: TrainedField, points: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]
) -> Float[torch.Tensor, "n 3"]:
    """Return the colours that rays through the points see from just in front of them."""
    origins, toward = (torch.as_tensor(a, dtype=torch.float32) for a in (points, directions))
    start = torch.full((len(points),), -BEFORE * trained.hull.voxel)
    samples = march(Rays(origins, toward, start), trained.hull, trained.step, trained.samples)
    density, rgb = trained.field(samples.points)
    depth = density * occupancy(samples.support) * trained.step
    packed = torch.cat([depth[:, None], rgb], dim=1)
    table = pad(packed, samples.ray, samples.order, samples.rays, trained.samples)
    weights = compositing_weights(table[..., 0])
    return straight((weights[..., None] * table[..., 1:]).sum(dim=1), weights.sum(dim=1))


def neighbour_mean(faces: Int[np.ndarray, "f 3"], count: int) -> sparse.csr_array:
    """Return the matrix that averages every vertex with its neighbours."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    rows, columns = np.concatenate([ends, ends[:, ::-1]]).T
    joined = sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    joined.data[:] = 1
    matrix = joined + sparse.eye_array(count)
    return sparse.csr_array(sparse.diags_array(1 / matrix.sum(axis=1)) @ matrix)
