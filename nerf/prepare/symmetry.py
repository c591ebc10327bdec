"""Mirror the drawings of a character whose left and right are alike.

Artists draw half a turn (front, side, back): the other side is the mirror image, unless they say
otherwise. Each drawing from a side is one of the other side, too: flipped, from the mirrored
camera. Drawings along the mirror plane see both halves. They place the plane, and they have the
last word: where one of them shows left and right differently, nothing is mirrored there.

The plane is x = const, since bundles have the front at +Z; where along x, the drawings say.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.camera import Camera, rotation_distance
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.silhouettes.mask import mask_of
from toonset.nerf.sections.drawing import mirrored_camera
from toonset.options import Symmetric

FACING = math.radians(20)  # between the mirror plane and a drawing that shows both sides
NEW = math.radians(20)  # a mirrored drawing this near to a drawn one adds nothing
# Of what both halves of a facing drawing cover; 35 fronts and backs have .90 and more, halves in
# two colours less than .3 (docs/decisions.md)
LEAST_ALIKE = 0.75
WORKING_PX = 96  # height of the figure at which halves are compared
BLUR_PX = 0.7  # there: lines and grain are no paint
REACH = 0.02  # of the height: hands err by so much between left and right
SAME_COLOR = 0.2  # largest difference of a premultiplied channel
MOST_SHIFT = 0.25  # of the figure's width, between its middle and the mirror plane


@dataclass(frozen=True)
class Symmetry:
    """Evidence of mirror symmetry.

    Attributes:
        asked: "auto", "on" or "off".
        alike: per facing drawing, the share of what both halves cover that is painted alike.
        plane_x: where the mirror plane lies, world units.
        mirrored: names of the drawings whose mirror images were added.
    """

    asked: Symmetric
    alike: tuple[float, ...]
    plane_x: float
    mirrored: tuple[str, ...]

    @property
    def contradicted(self) -> bool:
        """Return whether a drawing shows that left and right differ."""
        return min(self.alike, default=1.0) < LEAST_ALIKE

    def to_json(self) -> dict[str, Any]:
        """Return the numbers for a report."""
        alike = [round(share, 4) for share in self.alike]
        return {
            "asked": self.asked,
            "alike": alike,
            "plane_x": self.plane_x,
            "mirrored": list(self.mirrored),
        }


def find_symmetry(scene: Scene, asked: Symmetric = "auto") -> Symmetry | None:
    """Find the mirror plane, and the drawings whose mirror images show another side.

    None: symmetry is off, or no mirror image would be new.

    Args:
        scene: posed drawings, the front at +Z.
        asked: "on" mirrors whatever drawings show, "auto" unless they show that left and right
            differ.
    """
    if asked == "off":
        return None
    shown = [frame for frame in scene.frames if mask_of(frame.rgba).any()]
    cameras = [frame.camera for frame in shown]
    aside = [frame for frame in shown if not faces(frame.camera)]
    new = [frame for frame in aside if not _seen(mirrored(frame, 0.0).camera, cameras)]
    if not new:
        return None
    halves = [(frame, Halves.of(frame.rgba)) for frame in shown if faces(frame.camera)]
    planes = [_plane_x(frame.camera, half.middle) for frame, half in halves]
    # Without a front or back the figure's middle, at which cameras look, is the best guess.
    middles = planes or [float(camera.target[0]) for camera in cameras]
    found = Symmetry(
        asked,
        tuple(half.alike for _, half in halves),
        float(np.mean(middles)),
        tuple(frame.name for frame in new),
    )
    return replace(found, mirrored=()) if asked == "auto" and found.contradicted else found


def add_mirrored_views(scene: Scene, found: Symmetry | None) -> Scene:
    """Add the mirror images that symmetry gives to the drawings of a scene."""
    if found is None or not found.mirrored:
        return scene
    sources = (frame for frame in scene.frames if frame.name in found.mirrored)
    return replace(scene, frames=(*scene.frames, *(mirrored(f, found.plane_x) for f in sources)))


def differences(scene: Scene) -> list[Bool[np.ndarray, "height width"] | None]:
    """Return where each facing drawing shows that left and right differ; None of the others."""
    return [
        Halves.of(frame.rgba).differs
        if faces(frame.camera) and not frame.mirrored and mask_of(frame.rgba).any()
        else None
        for frame in scene.frames
    ]


def mirrored(frame: Frame, plane_x: float) -> Frame:
    """Return the drawing as one of the body's mirror image."""
    return replace(
        frame,
        name=f"{frame.name}, mirrored",
        camera=mirrored_camera(frame.camera, plane_x),
        rgba=np.ascontiguousarray(frame.rgba[:, ::-1]),
        labels=None if frame.labels is None else np.ascontiguousarray(frame.labels[:, ::-1]),
        mirrored=True,
    )


def faces(camera: Camera) -> bool:
    """Return whether a camera looks along the mirror plane."""
    x, _, z = camera.rotation[2]
    return bool(abs(math.atan2(x, abs(z))) <= FACING)


@dataclass(frozen=True, eq=False)
class Halves:
    """The halves of a facing drawing, compared with each other.

    Attributes:
        middle: column of the mirror plane, pixels from the picture's left edge.
        alike: share of what both halves cover that is painted alike.
        differs: (height, width) where the other half is painted otherwise, or is not.
    """

    middle: float
    alike: float
    differs: Bool[np.ndarray, "height width"]

    @classmethod
    def of(cls, rgba: UInt8[np.ndarray, "height width 4"]) -> Halves:
        """Compare the halves of a drawing that shows a figure."""
        mask = mask_of(rgba)
        rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
        part = rgba[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] / np.float32(255)
        part[..., :3] *= part[..., 3:]
        size = (max(2, round(part.shape[1] * WORKING_PX / len(part))), WORKING_PX)
        small = cv2.resize(part, size, interpolation=cv2.INTER_AREA)
        room = size[0] // 2 + math.ceil(REACH * WORKING_PX)
        drawn = cv2.GaussianBlur(np.pad(small, ((0, 0), (room, room), (0, 0))), (0, 0), BLUR_PX)
        twice = _twice_the_middle(drawn, round(MOST_SHIFT * size[0]))
        other = _flipped(drawn, twice)
        unlike = _least_difference(drawn, other) > SAME_COLOR
        solid, its = drawn[..., 3] > 0.5, other[..., 3] > 0.5
        both = solid & its
        alike = 1.0 - float(unlike[both].mean()) if both.any() else 0.0
        differs = np.zeros(mask.shape, dtype=bool)
        inside = (unlike & solid)[:, room:-room].astype(np.uint8)
        whole = cv2.resize(inside, part.shape[1::-1], interpolation=cv2.INTER_NEAREST) > 0
        differs[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] = whole
        middle = columns[0] + ((twice + 1) / 2 - room) * part.shape[1] / size[0]
        return cls(float(middle), alike, differs & mask)


def _twice_the_middle(drawn: Float[np.ndarray, "height width 4"], reach: int) -> int:
    """Return twice the column, less 1, about which a figure is most its own mirror image."""
    width = drawn.shape[1]
    tried = width - 1 + np.arange(-2 * reach, 2 * reach + 1)
    apart = [np.abs(drawn - _flipped(drawn, int(twice))).sum() for twice in tried]
    return int(tried[int(np.argmin(apart))])


def _flipped(picture: np.ndarray, twice: int) -> np.ndarray:
    """Return a picture flipped: column `twice` - i for column i; empty beyond its edges."""
    width = picture.shape[1]
    source = twice - np.arange(width)
    inside = (source >= 0) & (source < width)
    result = np.zeros_like(picture)
    result[:, inside] = picture[:, source[inside]]
    return result


def _least_difference(
    drawn: Float[np.ndarray, "height width 4"], other: Float[np.ndarray, "height width 4"]
) -> Float[np.ndarray, "height width"]:
    """Return the least difference of a pixel from the other picture's within REACH."""
    reach = round(REACH * WORKING_PX)
    least = np.full(drawn.shape[:2], np.inf, dtype=np.float32)
    for down in range(-reach, reach + 1):
        for across in range(-reach, reach + 1):
            moved = np.roll(other, (down, across), (0, 1))
            np.minimum(least, np.abs(drawn - moved).max(axis=-1), out=least)
    return least


def _seen(camera: Camera, cameras: Sequence[Camera]) -> bool:
    turns = (rotation_distance(camera.rotation, other.rotation) for other in cameras)
    return any(turn <= NEW for turn in turns)


def _plane_x(camera: Camera, middle: float) -> float:
    """Return the x of the points at the target's depth that appear in a column."""
    right: Float[np.ndarray, " 3"] = camera.rotation[0]
    along = (middle - camera.center[0]) / camera.scale
    return float(camera.target[0] + along * right[0])
