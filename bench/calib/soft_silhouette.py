"""What one would write first with torch: Adam on a soft silhouette, from the nominal angles.

A face covers a pixel by sigmoid(d / sigma), d the signed distance of the pixel's centre from the
face's outline, positive within. The silhouette is what is not left free by all faces, which are
taken to be independent:

    alpha = 1 - prod_faces (1 - sigmoid(d / sigma)) = 1 - exp(-sum_faces softplus(d / sigma))

Source: Liu, Li, Chen and Li, "Soft Rasterizer", ICCV 2019; its silhouette and its loss, with the
distance instead of its square.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn.functional import softplus

from bench.calib.baselines import Placed, Rotation, nominal_cameras, timed
from bench.cases.cases import CalibCase
from toonset.camera import Camera
from toonset.mesh import Mesh
from toonset.nerf.surface.decimate import decimated
from toonset.projection import project_offsets, rotate
from toonset.view import View

GRID = 80  # side of the pictures that are compared, in pixels
ROOM = 1.25  # side of a picture over the figure's longer one: 64 px
FACES = 800  # of the mannequin
SIGMA = 0.1  # pixels; wider ones add to every side of a limb, and turn the body
REACH = 5.0  # sigmas beyond which a face covers nothing: sigmoid(-5) = 0.007
STEPS = 100
RATE = 0.02  # radians a step
SHIFT_PX, LOG_SCALE = 16.0, 0.5  # what shift and log scale move by where a rotation is 1 radian

Faces = Int[Tensor, "faces 3"]


def by_soft_silhouette(case: CalibCase, seed: int) -> Placed:
    """Return Adam's rotations; nothing is random. The mannequin's decimation is not timed."""
    del seed
    mesh = coarse(case.mesh, FACES)
    starts = nominal_cameras(case)
    return timed(lambda: _finite(descended(mesh, case.views, starts)))


def coarse(mesh: Mesh, faces: int) -> Mesh:
    """Return the mesh with at most so many faces, or as few as keep it closed."""
    if len(mesh.faces) <= faces:
        return mesh
    one = np.zeros(len(mesh.faces), dtype=np.int64)
    vertices, kept, _ = decimated(mesh.vertices, mesh.faces, one, faces)
    return Mesh(vertices, kept, name=mesh.name)


def descended(
    mesh: Mesh, views: tuple[View, ...], starts: list[Camera], steps: int = STEPS
) -> Float[np.ndarray, "views 3 3"]:
    """Return the rotations that Adam reaches on all views at once.

    Args:
        mesh: coarse.
        views: drawings.
        starts: orthographic cameras, in pixels of the views.
        steps: of Adam; its rate falls to nothing along half a cosine.
    """
    pairs = [picture_of(view, start) for view, start in zip(views, starts, strict=True)]
    target = torch.from_numpy(np.stack([picture for picture, _ in pairs]))
    cameras = [camera for _, camera in pairs]
    rotation, center, scale = (
        torch.tensor(np.array([getattr(c, name) for c in cameras]), dtype=torch.float32)
        for name in ("rotation", "center", "scale")
    )
    offsets = [mesh.vertices - camera.target for camera in cameras]
    points = torch.tensor(np.array(offsets), dtype=torch.float32)
    faces = torch.from_numpy(mesh.faces.astype(np.int64))
    raw = torch.zeros(len(views), 6, requires_grad=True)
    adam = torch.optim.Adam([raw], lr=RATE)
    decay = torch.optim.lr_scheduler.CosineAnnealingLR(adam, steps)
    for _ in range(steps):
        adam.zero_grad()
        turned = rotate(rotation, raw[:, :3])
        sizes = (scale * (LOG_SCALE * raw[:, 5]).exp())[:, None].expand(-1, 2)
        middles = center + SHIFT_PX * raw[:, 3:5]
        pixels = project_offsets(turned, middles, sizes, torch.zeros(len(views)), points)
        loss = missed(soft_silhouette(pixels, faces, GRID), target).sum()
        loss.backward()
        adam.step()
        decay.step()
    with torch.no_grad():
        return rotate(rotation, raw[:, :3]).double().numpy()


def picture_of(view: View, camera: Camera) -> tuple[Float[np.ndarray, "grid grid"], Camera]:
    """Return the figure's coverage in the middle of a small square, and the camera there."""
    x, y, width, height = view.figure_box
    side = math.ceil(ROOM * max(width, height))
    left = x - view.box[0] - (side - width) // 2
    top = y - view.box[1] - (side - height) // 2
    own = view.rgba[max(top, 0) : top + side, max(left, 0) : left + side, 3]
    square = np.zeros((side, side), dtype=np.float32)
    down, right = max(-top, 0), max(-left, 0)
    square[down : down + own.shape[0], right : right + own.shape[1]] = own / np.float32(255)
    small = cv2.resize(square, (GRID, GRID), interpolation=cv2.INTER_AREA)
    return small, camera.moved((left, top), (side, side)).resized(GRID / side)


def soft_silhouette(
    pixels: Float[Tensor, "views points 2"], faces: Faces, grid: int, sigma: float = SIGMA
) -> Float[Tensor, "views grid grid"]:
    """Return how far the projected faces cover each pixel, 0 to 1; differentiable in `pixels`.

    A face is compared with the pixels near it only.
    """
    views = len(pixels)
    x, y = pixels[:, faces].reshape(-1, 3, 2).permute(2, 1, 0)  # 3 corners by views and faces
    face, column, row = _near_pairs(x.detach(), y.detach(), grid, REACH * sigma)
    edge_x, edge_y = x.roll(-1, dims=0) - x, y.roll(-1, dims=0) - y
    lengths = (edge_x * edge_x + edge_y * edge_y).clamp(min=1e-9)
    toward_x, toward_y = column + 0.5 - x[:, face], row + 0.5 - y[:, face]
    along_x, along_y = edge_x[:, face], edge_y[:, face]
    share = ((toward_x * along_x + toward_y * along_y) / lengths[:, face]).clamp(0, 1)
    squared = (toward_x - share * along_x) ** 2 + (toward_y - share * along_y) ** 2
    distance = squared.amin(dim=0).clamp(min=1e-9).sqrt()  # the root has no slope at 0
    side = (along_x * toward_y - along_y * toward_x).detach()
    inside = (side > 0).all(dim=0) | (side < 0).all(dim=0)
    signed = torch.where(inside, distance, -distance)
    place = (face // len(faces) * grid + row) * grid + column
    total = torch.zeros(views * grid * grid, dtype=pixels.dtype)
    covered = total.index_add(0, place, softplus(signed / sigma))
    return (1 - torch.exp(-covered)).reshape(views, grid, grid)


def missed(
    alpha: Float[Tensor, "views grid grid"], target: Float[Tensor, "views grid grid"]
) -> Float[Tensor, " views"]:
    """Return 1 - intersection over union of soft silhouettes."""
    both = (alpha * target).sum(dim=(1, 2))
    return 1 - both / (alpha + target - alpha * target).sum(dim=(1, 2))


def _near_pairs(
    x: Float[Tensor, "3 rows"], y: Float[Tensor, "3 rows"], grid: int, reach: float
) -> tuple[Int[Tensor, " n"], Int[Tensor, " n"], Int[Tensor, " n"]]:
    """Return the number, and the picture's column and row, of all pixels in the faces' boxes."""
    left, top = ((v.amin(dim=0) - reach).floor().clamp(0, grid).long() for v in (x, y))
    right, bottom = ((v.amax(dim=0) + reach).ceil().clamp(0, grid).long() for v in (x, y))
    width, height = right - left, bottom - top
    counts = width * height
    face = torch.repeat_interleave(torch.arange(len(counts)), counts)
    number = torch.arange(len(face)) - (counts.cumsum(0) - counts)[face]
    return face, left[face] + number % width[face], top[face] + number // width[face]


def _finite(rotations: Float[np.ndarray, "views 3 3"]) -> list[Rotation | None]:
    return [r if np.isfinite(r).all() else None for r in rotations]
