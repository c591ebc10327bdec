"""Render new views of a trained field.

One ray goes through every pixel that may show the figure, more through pixels on borders: outlines,
folds, where one colour meets the next. Outlines are soft through the hull's occupancy. Where a
voxel covers several pixels the view is rendered smaller and enlarged: it has no finer detail.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from toonset.camera import Camera
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.fields.triplane import TriplaneField
from toonset.nerf.kernels.threads import one_thread
from toonset.nerf.look.drawn_view import Geometry
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.cast import ViewRays, cast
from toonset.nerf.render.labels import NONE, labels_of, palette_shares
from toonset.nerf.render.layers import FieldView, Rendering
from toonset.palette.pixels.labels import UNLABELLED
from toonset.raster import nearest, taken

SEEN_FROM = 0.5  # opacity from which a pixel has a depth and a label
RAYS_PER_SIDE = 2  # of a pixel on a border
TOLERANCE = 0.15  # difference of neighbours that makes a border
FINEST = 1.5  # pixels of a voxel's side
ROOM = 4  # pixels round a figure: enlarging by cubic curves reaches two pixels
CHANNELS = 4  # that OpenCV warps at a time
CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], dtype=np.uint8)


def render(source: TrainedField | Baked, camera: Camera) -> Rendering:
    """Return the view of `camera`, orthographic or pinhole, of any size.

    Args:
        source: a trained field; what is prepared for its first view is kept for the next ones.
        camera: where it is seen from.
    """
    baked = source if isinstance(source, Baked) else baked_of(source)
    cast_view, surface = partial(_seen, baked, camera), partial(surface_of, baked, camera)
    return Rendering(camera, baked.trained, cast_view, surface)


@torch.no_grad()
@one_thread()
def surface_of(baked: Baked, camera: Camera) -> Geometry:
    """Return opacity and depth alone, a ray per voxel: the drawn look smooths more away."""
    small = camera.resized(min(1.0, 1 / max(_detail(baked.trained) * camera.scale, 1e-9)))
    width, height = small.size_wh
    rays = _grid(height, width)
    seen = cast(ViewRays.of(baked, small), rays, colored=False).view(5, height, width)
    found = _field_view(seen.numpy(), None)
    if small.size_wh != camera.size_wh:
        found = enlarged(found, small, camera, 2 * baked.trained.hull.voxel)
    return Geometry(camera, found.alpha, found.depth)


@torch.no_grad()
@one_thread()
def _seen(baked: Baked, camera: Camera) -> FieldView:
    detail_px = _detail(baked.trained) * camera.scale
    small = camera.resized(min(1.0, FINEST / detail_px)) if detail_px > FINEST else camera
    width, height = small.size_wh
    sight = ViewRays.of(baked, small)
    seen = cast(sight, _grid(height, width)).view(5, height, width)
    labels, shares = torch.full((height, width), NONE), None
    if baked.labels is not None:
        labels = labels_of(baked.labels, seen[:3], seen[3])
    border = borders(seen[:4].numpy(), labels.numpy())
    places = places_within(border)
    rays = torch.as_tensor(places.reshape(-1, 2).T, dtype=torch.float32)
    more = cast(sight, rays).view(5, *places.shape[:2])
    chosen = torch.as_tensor(border)
    if baked.labels is not None:
        shares = palette_shares(baked.labels, baked.paints, seen[3], labels, chosen, more)
    seen[:, chosen] = more.mean(dim=2)
    means = seen.numpy(), None if shares is None else shares.numpy()
    found = _field_view(*means)
    if small.size_wh == camera.size_wh:
        return found
    return enlarged(found, small, camera, 2 * baked.trained.hull.voxel)


def _detail(trained: TrainedField) -> float:
    """Return the finest that a field can show, world units; 0 where nothing is known."""
    hull, field = trained.hull, trained.field
    if not isinstance(field, TriplaneField):
        return 0.0
    return min(hull.voxel, float(hull.box.size.max()) / field.resolution)


def enlarged(view: FieldView, small: Camera, camera: Camera, apart: float) -> FieldView:
    """Return a view as a larger camera of the same sight has it.

    Args:
        view: what is enlarged.
        small: its camera.
        camera: of the same rotation and middle.
        apart: world units: nearer depths belong to one surface.
    """
    finer = camera.scale / small.scale
    part_of, large = _figure_boxes(view.alpha > 0, finer, camera.size_wh)
    corner = np.array([one.start for one in large[::-1]])
    start = np.array([one.start for one in part_of[::-1]])
    size = tuple(one.stop - one.start for one in large[::-1])
    shift = (corner + 0.5) / finer - 0.5 - start
    inverse = np.array([[1 / finer, 0, shift[0]], [0, 1 / finer, shift[1]]])

    def warped(picture: np.ndarray, how: int) -> np.ndarray:
        flags = how | cv2.WARP_INVERSE_MAP
        border = cv2.BORDER_REPLICATE
        found = cv2.warpAffine(
            np.ascontiguousarray(picture[part_of]), inverse, size, flags=flags, borderMode=border
        )
        return found

    def placed(part: np.ndarray, beyond: float = 0) -> np.ndarray:
        whole = np.full((*camera.size_wh[::-1], *part.shape[2:]), beyond, part.dtype)
        whole[large] = part
        return whole

    alpha = warped(view.alpha, cv2.INTER_CUBIC).clip(0, 1)
    rgb = warped(view.rgb, cv2.INTER_CUBIC).clip(0, alpha[..., None])
    shares = labels = None
    if view.shares is not None:
        shares = np.empty((*alpha.shape, view.shares.shape[-1]), np.float32)
        for first in range(0, shares.shape[-1], CHANNELS):
            part = slice(first, first + CHANNELS)
            shares[..., part] = warped(view.shares[..., part], cv2.INTER_LINEAR).reshape(
                *alpha.shape, -1
            )
    seen = np.isfinite(view.depth[part_of])
    depth = np.full(alpha.shape, np.nan, np.float32)
    if seen.any():
        whole = view.depth.copy().astype(np.float32)
        whole[part_of] = taken(whole[part_of], nearest(seen))
        slope, step = (warped(whole, how) for how in (cv2.INTER_LINEAR, cv2.INTER_NEAREST))
        # across a step in depth no place lies half way
        near = np.abs(slope - step) < apart
        depth = np.where(alpha >= SEEN_FROM, np.where(near, slope, step), np.nan)
    if shares is not None:
        found = np.where(alpha >= SEEN_FROM, shares.argmax(axis=-1), UNLABELLED).astype(np.uint8)
        shares, labels = placed(shares), placed(found, UNLABELLED)
    parts = (placed(rgb), placed(alpha), placed(depth, np.nan), labels, shares)
    return FieldView(*parts)


def _figure_boxes(
    there: Bool[np.ndarray, "height width"], finer: float, size_wh: tuple[int, int]
) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return a picture's rows and columns that are not empty, with room; and the enlarged ones."""
    small, large = [], []
    for axis, size in ((1, size_wh[1]), (0, size_wh[0])):
        filled = np.flatnonzero(there.any(axis=axis))
        first, last = (int(filled[0]), int(filled[-1]) + 1) if len(filled) else (0, 1)
        first, last = max(0, first - ROOM), min(there.shape[1 - axis], last + ROOM)
        small.append(slice(first, last))
        end = size if last == there.shape[1 - axis] else min(size, int(finer * last))
        large.append(slice(int(finer * first), end))
    return (small[0], small[1]), (large[0], large[1])


def baked_of(field: TrainedField) -> Baked:
    """Return what a field's views share: kept with the field, made anew when its values change."""
    if field.kept.get("state") != _state(field):
        keep(field, Baked.of(field))
    baked: Baked = field.kept["baked"]
    return baked


def keep(field: TrainedField, baked: Baked) -> None:
    """Let a field's views share what was prepared for the same field in other clothes."""
    field.kept.update(state=_state(field), baked=replace(baked, trained=field))


def _state(field: TrainedField) -> list[int]:
    models = [model for model in (field.field, field.classifier) if model is not None]
    return [values._version for model in models for values in model.parameters()]


def _grid(height: int, width: int) -> Float[Tensor, "2 pixels"]:
    """Return the centre of every pixel."""
    v, u = torch.meshgrid(torch.arange(height) + 0.5, torch.arange(width) + 0.5, indexing="ij")
    return torch.stack([u, v]).view(2, -1)


def _field_view(
    mean: Float[np.ndarray, "5 height width"],
    shares: Float[np.ndarray, "height width colors"] | None,
) -> FieldView:
    alpha = mean[3].clip(0, 1)
    seen = alpha >= SEEN_FROM
    depth = np.where(seen, mean[4] / np.where(seen, alpha, 1), np.nan)
    labels = None
    if shares is not None:
        labels = np.where(seen, shares.argmax(axis=-1), UNLABELLED).astype(np.uint8)
    rgb = np.ascontiguousarray(np.moveaxis(mean[:3], 0, -1))
    return FieldView(rgb, alpha, depth, labels, shares)


def borders(
    values: Float[np.ndarray, "channels height width"], labels: Int[np.ndarray, "height width"]
) -> Bool[np.ndarray, "height width"]:
    """Return the pixels that differ from one of their four neighbours.

    Args:
        values: what is seen at the pixels' centres, in [0, 1]: colour, opacity.
        labels: differ or not.
    """
    found = _range(labels.astype(np.float32)) > 0
    for channel in values:
        found |= _range(channel) > TOLERANCE
    return found


def _range(values: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    return cv2.dilate(values, CROSS) - cv2.erode(values, CROSS)


def places_within(
    chosen: Bool[np.ndarray, "height width"], side: int = RAYS_PER_SIDE
) -> Float[np.ndarray, "n rays 2"]:
    """Return where `side` x `side` rays go through each chosen pixel (first centre at 0.5)."""
    rows, columns = np.nonzero(chosen)
    part = (np.arange(side) + 0.5) / side
    down, right = (grid.reshape(-1) for grid in np.meshgrid(part, part, indexing="ij"))
    return np.stack([columns[:, None] + right, rows[:, None] + down], axis=-1)
