"""Add mirrored drawings of a body that is its own mirror image.

Sheets of half a turn (front, side, back) leave one side undrawn. Where drawings along the mirror
plane show that left and right are alike, every drawing is one of the other side, too: flipped, from
the mirrored camera. Mirrored drawings count only where nothing was drawn.

The plane is x = const, since bundles have the front at +Z; where along x, the drawings say.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from toonset.camera import Camera, rotation_distance
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.silhouettes.mask import mask_of

FACING = math.radians(10)  # between the mirror plane and a drawing that shows both sides
NEW = math.radians(20)  # a mirrored drawing this near to a drawn one adds nothing
ALIKE = 0.96  # of the pixels of every facing drawing; a bag costs 5 to 10 %
REACH_PX = 2  # within which a pixel may have its like on the other side
SAME_COLOR = 0.2  # largest difference of a premultiplied channel or of alpha
MOST_SHIFT = 0.1  # of the picture's width, between its figure's middle and the mirror plane


@dataclass(frozen=True)
class Symmetry:
    """Evidence of mirror symmetry.

    Attributes:
        alike: per facing drawing, the share of the figure's pixels that have their like on the
            other side.
        plane_x: where the mirror plane lies, world units.
        mirrored: names of the drawings whose mirror images were added.
    """

    alike: tuple[float, ...]
    plane_x: float
    mirrored: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the numbers for a report."""
        alike = [round(share, 4) for share in self.alike]
        return {"alike": alike, "plane_x": self.plane_x, "mirrored": list(self.mirrored)}


def add_mirrored_views(scene: Scene) -> tuple[Scene, Symmetry | None]:
    """Add mirror images of drawings where no drawing shows the body; return the evidence, too.

    None: no drawing shows both sides, or no mirror image would be new.
    """
    facing = [frame for frame in scene.frames if _faces(frame.camera) and mask_of(frame.rgba).any()]
    cameras = [frame.camera for frame in scene.frames]
    new = [frame for frame in scene.frames if not _seen(mirrored(frame, 0.0).camera, cameras)]
    if not facing or not new:
        return scene, None
    middles = [_mirror_axis(frame.rgba) for frame in facing]
    pairs = list(zip(facing, middles, strict=True))
    alike = tuple(likeness(frame.rgba, middle) for frame, middle in pairs)
    plane_x = float(np.mean([_plane_x(frame.camera, middle) for frame, middle in pairs]))
    if min(alike) < ALIKE:
        return scene, Symmetry(alike, plane_x, ())
    found = Symmetry(alike, plane_x, tuple(frame.name for frame in new))
    return mirror_found(scene, found), found


def mirror_found(scene: Scene, found: Symmetry | None) -> Scene:
    """Add the mirror images that were found to be drawings of the scene."""
    if found is None or not found.mirrored:
        return scene
    sources = (frame for frame in scene.frames if frame.name in found.mirrored)
    images = (mirrored(frame, found.plane_x) for frame in sources)
    more = (replace(image, name=f"{image.name}, mirrored") for image in images)
    return replace(scene, frames=(*scene.frames, *more))


def mirror_all(scene: Scene) -> Scene:
    """Add every drawing's mirror image: all that symmetry could ever show."""
    names = tuple(frame.name for frame in scene.frames)
    return mirror_found(scene, Symmetry((), 0.0, names))


def mirrored(frame: Frame, plane_x: float) -> Frame:
    """Return the drawing as one of the body's mirror image."""
    camera, flip = frame.camera, np.diag([-1.0, 1.0, 1.0])
    target = np.array([2 * plane_x - camera.target[0], *camera.target[1:]])
    center = np.array([camera.size_wh[0] - camera.center[0], camera.center[1]])
    rotation = flip @ camera.rotation @ flip
    return replace(
        frame,
        camera=replace(camera, rotation=rotation, target=target, center=center),
        rgba=np.ascontiguousarray(frame.rgba[:, ::-1]),
        labels=None if frame.labels is None else np.ascontiguousarray(frame.labels[:, ::-1]),
    )


def likeness(rgba: UInt8[np.ndarray, "height width 4"], middle: float) -> float:
    """Return the share of a figure's pixels with their like nearby when flipped about a column.

    Args:
        rgba: the drawing.
        middle: the column, in pixels from the picture's left edge; a multiple of 1/2.
    """
    drawn = rgba / np.float32(255)
    drawn[..., :3] *= drawn[..., 3:]
    flipped = _flipped(drawn, middle)
    least = np.full(drawn.shape[:2], np.inf, dtype=np.float32)
    offsets = range(-REACH_PX, REACH_PX + 1)
    for shift in ((dy, dx) for dy in offsets for dx in offsets):
        other = np.roll(flipped, shift, (0, 1))
        least = np.minimum(least, np.abs(drawn - other).max(axis=-1))
    figure = (drawn[..., 3] >= 0.5) | (flipped[..., 3] >= 0.5)
    return float((least[figure] <= SAME_COLOR).mean())


def _faces(camera: Camera) -> bool:
    """Return whether a camera looks along the mirror plane."""
    x, _, z = camera.rotation[2]
    return bool(abs(math.atan2(x, abs(z))) <= FACING)


def _seen(camera: Camera, cameras: list[Camera]) -> bool:
    turns = (rotation_distance(camera.rotation, other.rotation) for other in cameras)
    return any(turn <= NEW for turn in turns)


def _mirror_axis(rgba: UInt8[np.ndarray, "height width 4"]) -> float:
    """Return the column about which a figure's mask is most alike when flipped."""
    mask = mask_of(rgba)
    columns = np.flatnonzero(mask.any(axis=0))
    middle, reach = (columns[0] + columns[-1] + 1) / 2, round(MOST_SHIFT * mask.shape[1])
    tried = middle + np.arange(-reach, reach + 1) / 2
    overlaps = [(mask & _flipped(mask, column)).sum() for column in tried]
    return float(tried[int(np.argmax(overlaps))])


def _flipped(picture: np.ndarray, middle: float) -> np.ndarray:
    """Return a picture flipped about a column; what comes from beyond its edge is empty."""
    width = picture.shape[1]
    source = round(2 * middle) - 1 - np.arange(width)
    inside = (source >= 0) & (source < width)
    result = np.zeros_like(picture)
    result[:, inside] = picture[:, source[inside]]
    return result


def _plane_x(camera: Camera, middle: float) -> float:
    """Return the x of the points at the target's depth that appear in a column."""
    right: Float[np.ndarray, " 3"] = camera.rotation[0]
    along = (middle - camera.center[0]) / camera.scale
    return float(camera.target[0] + along * right[0])
