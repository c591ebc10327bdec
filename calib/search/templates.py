"""Match a drawing with low-resolution silhouettes of the mesh over yaw and elevation.

Silhouettes are normalised to unit height and centred on their bounding box, so scale and shift drop
out; the score is intersection over union of soft masks, all templates at once as one product.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

from toonset.calib.outline.mesh_edges import Surface
from toonset.calib.outline.occluding_contour import mask_at
from toonset.calib.outline.pose import Pose, project
from toonset.camera import rotation_distance, rotation_from_angles
from toonset.view import View

YAW_STEP = np.radians(10.0)  # the contour alignment pulls in from 15 to 20 degrees
ELEVATIONS = np.radians([-20.0, 0.0, 20.0, 40.0])
CELL_PX = 48
OVERSAMPLE = 2
FIGURE_OF_CELL = 0.75  # figure height over cell height; the rest is room for wide poses
ROUND = 0.97  # overlap of all sides from which a body is one of revolution
MIN_SEPARATION = np.radians(14.0)  # between two hypotheses


@dataclass(frozen=True, eq=False)
class Templates:
    """Normalised silhouettes of a mesh.

    Attributes:
        rotations: (n, 3, 3) camera_from_world.
        masks: (n, CELL_PX ** 2) coverage in [0, 1].
        boxes: (n, 4) left, top, width, height of the silhouette in world units, image axes,
            relative to the projected middle.
    """

    rotations: Float[np.ndarray, "n 3 3"]
    masks: Float[np.ndarray, "n pixels"]
    boxes: Float[np.ndarray, "n 4"]


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A coarse pose with its silhouette overlap in [0, 1]."""

    pose: Pose
    overlap: float


def build_templates(surface: Surface) -> Templates:
    """Return the mesh's silhouettes on the grid of yaws and elevations."""
    rotations = grid()
    masks, boxes = [], []
    size = CELL_PX * OVERSAMPLE
    for rotation in rotations:
        pixels = project(Pose(rotation, np.zeros(2), 1.0), surface.vertices)
        low, extent = pixels.min(axis=0), np.ptp(pixels, axis=0)
        scale = FIGURE_OF_CELL * size / max(extent[1], 1e-9)
        centred = Pose(rotation, size / 2 - scale * (low + extent / 2), scale)
        mask = mask_at(surface, centred, (size, size))
        masks.append(_shrink(mask.astype(np.float32)).ravel())
        boxes.append([*low, *extent])
    return Templates(rotations, np.stack(masks), np.array(boxes))


def grid() -> Float[np.ndarray, "n 3 3"]:
    """Return the templates' rotations."""
    yaws = np.arange(0, 2 * np.pi - 1e-9, YAW_STEP)
    return np.stack([rotation_from_angles(y, e, 0.0) for e in ELEVATIONS for y in yaws])


def find_hypotheses(view: View, templates: Templates, count: int) -> list[Hypothesis]:
    """Return the best `count` poses, at least 14 degrees apart, best first."""
    mask, box = normalised(view)
    shared = templates.masks @ mask.ravel()
    union = templates.masks.sum(axis=1) + mask.sum() - shared
    overlap = shared / np.maximum(union, 1e-9)
    chosen: list[int] = []
    for index in np.argsort(-overlap, kind="stable"):
        apart = (
            rotation_distance(templates.rotations[index], templates.rotations[other])
            for other in chosen
        )
        if all(angle >= MIN_SEPARATION for angle in apart):
            chosen.append(int(index))
        if len(chosen) == count:
            break
    return [Hypothesis(pose_on_box(templates, i, box), float(overlap[i])) for i in chosen]


def turns_visibly(templates: Templates) -> bool:
    """Return whether the mesh looks different from different sides (a vase does not)."""
    level = np.abs(templates.rotations[:, 2, 1]) < 1e-6  # seen at eye level
    masks = templates.masks[level]
    shared = np.minimum(masks, masks[0]).sum(axis=1)
    union = np.maximum(masks, masks[0]).sum(axis=1)
    return bool((shared / union).min() < ROUND)


def pose_on_box(templates: Templates, index: int, box: Float[np.ndarray, " 4"]) -> Pose:
    """Return the pose that lays a template's box over the drawn one (same height, same middle)."""
    low, extent = templates.boxes[index, :2], templates.boxes[index, 2:]
    scale = float(box[3] / max(extent[1], 1e-9))
    shift = box[:2] + box[2:] / 2 - scale * (low + extent / 2)
    return Pose(templates.rotations[index], shift, scale)


def normalised(view: View) -> tuple[Float[np.ndarray, "cell cell"], Float[np.ndarray, " 4"]]:
    """Return a drawing's coverage in the templates' cell, and its box in the picture."""
    mask = view.mask
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    box = np.array(
        [columns[0], rows[0], columns[-1] + 1 - columns[0], rows[-1] + 1 - rows[0]], dtype=float
    )
    size = CELL_PX * OVERSAMPLE
    scale = FIGURE_OF_CELL * size / box[3]
    middle = box[:2] + box[2:] / 2
    affine = np.array(
        [[scale, 0, size / 2 - scale * middle[0]], [0, scale, size / 2 - scale * middle[1]]]
    )
    affine[:, 2] += 0.5 * scale - 0.5  # our pixel centres are at .5, OpenCV's at integers
    coverage = view.rgba[..., 3].astype(np.float32) / 255
    # area-like reduction: blur to the target's pixel size before sampling
    if scale < 1:
        coverage = cv2.GaussianBlur(coverage, (0, 0), 0.5 / scale)
    warped = cv2.warpAffine(coverage, affine, (size, size), flags=cv2.INTER_LINEAR)
    return _shrink(warped), box


def _shrink(image: Float[np.ndarray, "size size"]) -> Float[np.ndarray, "cell cell"]:
    blocks = image.reshape(CELL_PX, OVERSAMPLE, CELL_PX, OVERSAMPLE)
    return blocks.mean(axis=(1, 3))
