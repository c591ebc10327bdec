"""Define the drawings that a shape is made of, all at one working resolution.

Lengths in this room are pixels of working drawings: a figure is TALL of them high, however large it
was drawn, so constants in pixels are fractions of the height, and a sheet's size costs nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Bool, Float

from toonset import raster
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame
from toonset.dataset.silhouettes.mask import mask_of
from toonset.errors import BundleError

TALL = 240  # px: a figure's height in working drawings
MARGIN = 12  # px round a figure
DARK = 0.22  # brightest channel below which paint may be a line
LITTLE = 1e-6  # what cameras' targets weigh against rays, where a figure's middle is
ROW = 8192  # pixels that OpenCV is given as one row
SPREAD_PX = 2.5  # by which paint is blurred, over lines

Picture = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]
Pixels = Float[np.ndarray, "*n 2"]


@dataclass(frozen=True, eq=False)
class Drawing:
    """A figure at working resolution.

    Attributes:
        camera: where it is seen from; all drawings of a shape have one scale.
        rgba: (height, width, 4) in [0, 1], straight alpha.
        mirrored: whether it is the mirror image of a drawing.
    """

    camera: Camera
    rgba: Float[np.ndarray, "height width 4"]
    mirrored: bool = False

    @property
    def yaw(self) -> float:
        """Return where the camera stands, radians from the front."""
        return yaw_of(self.camera)

    @cached_property
    def mask(self) -> Mask:
        """Return the figure's pixels."""
        return self.rgba[..., 3] > 0.5

    @cached_property
    def distance(self) -> Picture:
        """Return the signed distance to the outline, negative inside."""
        return signed_distance(self.rgba[..., 3])

    @cached_property
    def paint(self) -> Float[np.ndarray, "height width 4"]:
        """Return the colours without dark lines, spread a little, and how much was drawn there."""
        color = self.rgba[..., :3]
        drawn = self.rgba[..., 3] * (color.max(axis=-1) > DARK) + 1e-3
        weight = cv2.GaussianBlur(drawn, (0, 0), SPREAD_PX)
        mean = cv2.GaussianBlur(color * drawn[..., None], (0, 0), SPREAD_PX) / weight[..., None]
        return np.dstack([mean, weight])

    def masked(self, mask: Mask) -> Drawing:
        """Return the drawing of a part of the figure."""
        alpha = np.where(mask, self.rgba[..., 3], 0)
        return replace(self, rgba=np.dstack([self.rgba[..., :3], alpha]))

    def pixels(self, points_world: Float[np.ndarray, "*n 3"]) -> Pixels:
        """Return where points appear, in single precision; none may lie behind the camera."""
        camera = self.camera
        local = (points_world - camera.target.astype(np.float32)) @ camera.rotation.T.astype("f4")
        plane = local[..., :2] * camera.scale_uv.astype(np.float32)
        if camera.k:
            plane = plane / (1 + np.float32(camera.k) * local[..., 2:])
        return plane + camera.center.astype(np.float32)

    def distance_at(self, points_world: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, " *n"]:
        """Return the signed distance to the outline where points appear."""
        return sample(self.distance, self.pixels(points_world))


def working_drawings(frames: Sequence[Frame]) -> tuple[tuple[Drawing, ...], float]:
    """Return the drawings at working resolution, and the world's units per pixel.

    They have their rows in common: seen at eye level, a row shows one height in all of them.

    Raises:
        BundleError: fewer than two frames show a figure, or it lies behind a camera.
    """
    shown = [frame for frame in frames if mask_of(frame.rgba).any()]
    if len(shown) < 2:
        raise BundleError(f"{len(shown)} picture(s) with an opaque figure; two views are needed")
    masks = [mask_of(frame.rgba) for frame in shown]
    middle = _middle([frame.camera for frame in shown], masks)
    aimed = [replace(frame, camera=_aimed_at(middle, frame.camera)) for frame in shown]
    rows = [np.flatnonzero(mask.any(axis=1))[[0, -1]] + [0, 1] for mask in masks]
    levels = [frame.camera.project(middle[None])[0][0, 1] for frame in aimed]
    spans = [
        (ends - level) / frame.camera.scale_uv[1]
        for frame, ends, level in zip(aimed, rows, levels, strict=True)
    ]
    per_px = float(max(np.ptp(span) for span in spans)) / TALL
    above = -float(min(span[0] for span in spans)) / per_px + MARGIN
    below = float(max(span[1] for span in spans)) / per_px + MARGIN
    drawings = [
        _resized(frame, 1 / (per_px * frame.camera.scale), level, (above, below))
        for frame, level in zip(aimed, levels, strict=True)
    ]
    return tuple(drawings), per_px


def mirrored(drawing: Drawing, plane_x: float) -> Drawing:
    """Return the drawing as one of the other side, for a body symmetric about x = `plane_x`."""
    camera = mirrored_camera(drawing.camera, plane_x)
    return Drawing(camera, np.ascontiguousarray(drawing.rgba[:, ::-1]), mirrored=True)


def mirrored_camera(camera: Camera, plane_x: float) -> Camera:
    """Return the camera that sees the mirror image about x = `plane_x` as the flipped picture."""
    flip = np.diag([-1.0, 1.0, 1.0])
    return replace(
        camera,
        rotation=flip @ camera.rotation @ flip,
        target=np.array([2 * plane_x - camera.target[0], *camera.target[1:]]),
        center=np.array([camera.size_wh[0] - camera.center[0], camera.center[1]]),
    )


def yaw_of(camera: Camera) -> float:
    """Return where a camera stands, radians from the front."""
    x, _, z = camera.rotation[2].tolist()
    return math.atan2(-x, -z)


def signed_distance(alpha: Picture) -> Picture:
    """Return the signed distance of a coverage map's outline, px, negative inside.

    Beside the outline the coverage says where between pixels it runs.
    """
    distance = -raster.signed_distance(alpha > 0.5)
    return np.where(np.abs(distance) < 1, (distance + 0.5 - alpha) / 2, distance).astype(np.float32)


def sample(picture: Picture, pixels: Pixels) -> Float[np.ndarray, " *n"]:
    """Return a picture's values at pixels, bilinear; beyond its edge, the edge's."""
    count = int(np.prod(pixels.shape[:-1]))
    places = np.zeros((-(-count // ROW) * ROW, 2), np.float32)
    places[:count] = pixels.reshape(-1, 2)
    places = places.reshape(-1, ROW, 2) - np.float32(0.5)  # OpenCV's first centre is at 0
    maps = np.ascontiguousarray(places[..., 0]), np.ascontiguousarray(places[..., 1])
    values = cv2.remap(
        picture.astype(np.float32, copy=False),
        *maps,
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return values.reshape(-1)[:count].reshape(pixels.shape[:-1])


def cells(shape: tuple[int, ...], pixels: Pixels) -> tuple[np.ndarray, np.ndarray]:
    """Return row and column of the pixels of a picture that hold the places given."""
    across, down = (np.floor(pixels[..., i]).astype(np.int32) for i in (0, 1))
    return down.clip(0, shape[0] - 1), across.clip(0, shape[1] - 1)


def _middle(cameras: Sequence[Camera], masks: Sequence[Mask]) -> Float[np.ndarray, " 3"]:
    """Return the point nearest to the rays through the figures' middles.

    Along what all cameras look along, it is as far as their targets.

    Raises:
        BundleError: it lies behind a camera.
    """
    target = np.mean([camera.target for camera in cameras], axis=0)
    normal, right = LITTLE * np.eye(3), LITTLE * target
    for camera, mask in zip(cameras, masks, strict=True):
        drawn = [np.flatnonzero(mask.any(axis=axis)) for axis in (0, 1)]
        pixel = np.array([[(d[0] + d[-1] + 1) / 2 for d in drawn]])
        origins, ways = camera.rays(pixel)
        across = np.eye(3) - np.outer(ways[0], ways[0])
        normal += across
        right += across @ origins[0]
    middle = np.linalg.solve(normal, right)
    if not all(camera.project(middle[None])[2][0] for camera in cameras):
        raise BundleError(
            "cameras: the figures' common middle lies behind a camera; check the axes of "
            "transform_matrix (OpenGL: x right, y up, z back)"
        )
    return middle


def _aimed_at(point: Float[np.ndarray, " 3"], camera: Camera) -> Camera:
    """Return the same camera with its target at the depth of a point, so that scale holds there."""
    _, depth, _ = camera.project(point[None])
    relative = 1 + camera.k * float(depth[0])
    target = camera.unproject(camera.center[None], depth)[0]
    return replace(camera, target=target, scale=camera.scale / relative, k=camera.k / relative)


def _resized(frame: Frame, factor: float, level: float, reach: tuple[float, float]) -> Drawing:
    """Return a drawing of another size, cut to its figure with a margin.

    Args:
        frame: a drawing.
        factor: new over old pixels.
        level: the row, as drawn, of the body's middle.
        reach: how many new rows there are above and below of it.
    """
    columns = np.flatnonzero(mask_of(frame.rgba).any(axis=0))
    room = math.ceil(MARGIN / factor)
    left, right = int(columns[0]) - room, int(columns[-1]) + 1 + room
    top, bottom = math.floor(level - reach[0] / factor), math.ceil(level + reach[1] / factor)
    canvas = np.zeros((bottom - top, right - left, 4), np.float32)
    y0, x0 = max(top, 0), max(left, 0)
    part = frame.rgba[y0:bottom, x0:right].astype(np.float32) / 255
    canvas[y0 - top : y0 - top + part.shape[0], x0 - left : x0 - left + part.shape[1]] = part
    canvas[..., :3] *= canvas[..., 3:]
    how = cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR
    found = cv2.resize(canvas, None, fx=factor, fy=factor, interpolation=how)  # exact factors
    rows = math.ceil(sum(reach))
    found = np.pad(found, ((0, max(0, rows - len(found))), (0, 0), (0, 0)))[:rows]
    alpha = found[..., 3:]
    found[..., :3] = np.where(alpha > 1e-3, found[..., :3] / np.maximum(alpha, 1e-3), 1)
    camera = frame.camera.moved((left, top), (right - left, bottom - top)).resized(factor)
    return Drawing(replace(camera, size_wh=(found.shape[1], rows)), found)
