"""Test whether the mannequin is the drawn body, by predicting left-out drawings.

Every drawing's outline is compared with the mannequin's, and with that of the visual hull of the
other drawings. Where the mannequin's lies nearer, it knows more of the body than the drawings tell
of each other, between the drawn views most of all. What no bend of the drawings explains is a part
that one of both lacks: a body without the drawn hat is another body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import cv2
import numpy as np
import torch
from jaxtyping import Float

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Scene
from toonset.dataset.silhouettes.mask import alpha_of, figure_px, has_figure
from toonset.dataset.silhouettes.outlines import FIGURE_PX, Outline, Outlines, outlines_of
from toonset.errors import BundleError
from toonset.nerf.hull.hull import LEVEL, Hull, carve
from toonset.nerf.hull.mannequin_shape import Shape
from toonset.nerf.hull.march import march, rays_of
from toonset.nerf.hull.support import alpha_at
from toonset.nerf.kernels.threads import side_by_side

FEWEST_VIEWS = 3  # two drawings leave no hull to compare with
MOST_OFF = 0.016  # of the square: another body, whatever else is known
FARTHEST = 0.06  # of the square: what is farther apart counts no more
PART = 0.02  # of the square: where outlines are so far apart after bending, a part is missing
MOST_LEFT = 0.006  # of the outlines' length may be so far apart
VOXELS = 96  # of the other drawings' hull, along its longest side
RAYS = 2  # per pixel and axis, of that hull's outline

Alpha = Float[np.ndarray, "height width"]


@dataclass(frozen=True)
class MannequinFit:
    """Distances of predicted outlines from drawn ones, in shares of the figure's `Square`.

    Attributes:
        mannequin: root mean square distance of the mannequin's; mean of the drawings.
        drawings: the same of the hulls of all drawings but the one that is predicted, as carved;
            None: they were not asked, the mannequin is too far off.
        left: share of the outlines that lie more than PART apart once drawings are bent to show the
            mannequin; 0 until they are.
    """

    mannequin: float
    drawings: float | None
    left: float = 0.0

    @property
    def chosen(self) -> bool:
        """Return whether the mannequin is taken for the character's shape."""
        if self.drawings is None or self.mannequin > MOST_OFF:
            return False
        return self.mannequin < self.drawings and self.left <= MOST_LEFT

    def to_json(self) -> dict[str, Any]:
        """Return the numbers for a report."""
        return {
            "chosen": self.chosen,
            "mannequin_off": round(self.mannequin, 6),
            "drawings_off": None if self.drawings is None else round(self.drawings, 6),
            "parts_left": round(self.left, 6),
        }


def mannequin_fit(scene: Scene, shape: Shape) -> MannequinFit | None:
    """Return how well a mannequin and the drawings predict drawings.

    Args:
        scene: posed drawings, as drawn.
        shape: the mannequin in their world.

    Returns:
        The distances; None where fewer than FEWEST_VIEWS show a figure, or a camera that drew one
        does not see the mannequin.
    """
    frames = [frame for frame in scene.frames if has_figure(frame)]
    if len(frames) < FEWEST_VIEWS:
        return None
    cameras = [frame.camera for frame in frames]
    drawn = [alpha_of(frame) for frame in frames]
    seen = [shape.seen(camera).alpha for camera in cameras]
    if not all((alpha >= LEVEL).any() for alpha in seen):
        return None
    own = apart(paired(cameras, drawn, seen))
    if own > MOST_OFF:
        return MannequinFit(own, None)
    small = min(1.0, FIGURE_PX / max(figure_px(frame) for frame in frames))
    cameras = [camera.resized(small) for camera in cameras]
    drawn = [
        cv2.resize(alpha, camera.size_wh, interpolation=cv2.INTER_AREA)
        for alpha, camera in zip(drawn, cameras, strict=True)
    ]
    return MannequinFit(own, apart(paired(cameras, drawn, _by_others(cameras, drawn))))


def paired(cameras: Sequence[Camera], first: Sequence[Alpha], second: Sequence[Alpha]) -> Outlines:
    """Return the outlines of both, the second ones behind the first, in small pictures."""
    return outlines_of([*cameras, *cameras], [*first, *second])


def apart(outlines: Outlines) -> float:
    """Return the mean distance of `paired` outlines, in shares of the square."""
    views = outlines.views
    half = len(views) // 2
    return float(np.mean([_apart(*pair) for pair in zip(views[:half], views[half:], strict=True)]))


def parts_left(outlines: Outlines) -> float:
    """Return the share of `paired` outlines that lie more than PART from the other, by drawings.

    What is drawn beside the second ones, or lies within them and is not drawn: the larger share.
    """
    views = outlines.views
    half = len(views) // 2
    pairs = list(zip(views[:half], views[half:], strict=True))
    beyond = [_beyond(one, other) for one, other in pairs]
    within = [_beyond(other, one) for one, other in pairs]
    return float(max(np.mean(beyond), np.mean(within)))


def _beyond(one: Outline, other: Outline) -> float:
    """Return the share of an outline that lies more than PART outside of the other."""
    return (
        float(np.mean(other.at(one.points)[0] < -PART * one.square.size))
        if _both(one, other)
        else 1
    )


def _apart(one: Outline, other: Outline) -> float:
    if not _both(one, other):
        return FARTHEST
    farthest = FARTHEST * one.square.size
    squares = [
        np.square(np.minimum(np.abs(to.at(outline.points)[0]), farthest)).mean()
        for to, outline in ((one, other), (other, one))
    ]
    return float(np.sqrt(np.mean(squares))) / one.square.size


def _both(one: Outline, other: Outline) -> bool:
    """Return whether both have an outline: specks, and a picture that is all figure, have none."""
    return len(one.points) > 0 and len(other.points) > 0


def _by_others(cameras: Sequence[Camera], alphas: Sequence[Alpha]) -> list[Alpha]:
    """Return every view of the hull of the other drawings; all of the picture where it is empty."""
    pictures = [torch.as_tensor(alpha) for alpha in alphas]
    try:
        grid = carve(cameras, pictures, VOXELS, 1)
    except BundleError:
        return [np.ones_like(alpha) for alpha in alphas]
    points = grid.centres()
    values = torch.stack([alpha_at(points, *view) for view in zip(cameras, pictures, strict=True)])
    least, second = values.topk(2, dim=0, largest=False).values

    def view(number: int) -> Alpha:
        support = torch.where(values[number] <= least, second, least).view(grid.support.shape)
        return _outline_of(replace(grid, support=support), cameras[number])

    return side_by_side([partial(view, number) for number in range(len(cameras))])


def _outline_of(hull: Hull, camera: Camera) -> Alpha:
    fine = camera.resized(RAYS)
    width, height = fine.size_wh
    hit = np.zeros(width * height, dtype=np.float32)
    samples = march(
        rays_of(fine, fine.pixel_grid().reshape(-1, 2), hull), hull, hull.voxel, 1, LEVEL
    )
    hit[samples.ray.numpy()] = 1
    seen = cv2.resize(hit.reshape(height, width), camera.size_wh, interpolation=cv2.INTER_AREA)
    return seen if (seen >= LEVEL).any() else np.ones_like(seen)
