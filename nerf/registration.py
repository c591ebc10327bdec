"""Registering drawings: a shift and a size per drawing, so that their outlines agree.

Artists place and size the views of a sheet by eye. What is moved is each view's camera (its
principal point and its scale), never a pixel: nothing is resampled, and the correction is exact.
Drawings that agree within a rim's own error are left as they are, to the bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from toonset.camera import Camera
from toonset.dataset.scene import Frame, Scene
from toonset.nerf.silhouette import alpha_of, has_figure
from toonset.nerf.warp_fit import Fit, fit_moves
from toonset.nerf.warp_moves import ShiftAndScale
from toonset.nerf.warp_outline import Outline, Outlines, outlines_of

EXPECTED = 0.01  # of the figure's square: how far off drawings are placed, as a first guess
ROUNDS = 6
FEWEST_VIEWS = 3  # two outlines nearly always share a body


@dataclass(frozen=True)
class ViewMove:
    """How one drawing was off.

    Attributes:
        shift_px: (x, y) by which the drawing sits too far right and down, pixels of the picture.
        scale: its size relative to what the sheet's other drawings ask for.
    """

    shift_px: tuple[float, float]
    scale: float


@dataclass(frozen=True, eq=False)
class Registration:
    """What was found about the drawings' places and sizes.

    Attributes:
        applied: whether the cameras were moved.
        gain_nats: log marginal likelihood for errors over none; moved where > 0.
        error_px: typical size of the errors that the sheet asks for, pixels.
        apart_px: root mean square disagreement of the outlines, before and after, pixels.
        views: per frame of the scene, as found (also where not applied).
    """

    applied: bool
    gain_nats: float
    error_px: float
    apart_px: tuple[float, float]
    views: tuple[ViewMove, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the numbers for a report."""
        return {
            "applied": self.applied,
            "gain_nats": round(self.gain_nats, 3),
            "error_px": round(self.error_px, 4),
            "apart_px": [round(value, 4) for value in self.apart_px],
            "views": [
                {"shift_px": [round(v, 4) for v in view.shift_px], "scale": round(view.scale, 6)}
                for view in self.views
            ],
        }


def registered(scene: Scene) -> tuple[Scene, Registration]:
    """Return the scene with each camera moved to where its drawing sits, and the evidence.

    Pictures without a figure, and scenes with fewer than FEWEST_VIEWS, are returned as they are.

    Raises:
        BundleError: the cameras do not belong together (see `box_of_masks`).
    """
    drawn = [i for i, frame in enumerate(scene.frames) if has_figure(frame)]
    still = [ViewMove((0.0, 0.0), 1.0)] * len(scene.frames)
    if len(drawn) < FEWEST_VIEWS:
        return scene, Registration(False, 0.0, 0.0, (0.0, 0.0), tuple(still))
    frames = [scene.frames[i] for i in drawn]
    outlines = outlines_of([f.camera for f in frames], [alpha_of(f) for f in frames])
    fit = fit_moves(outlines, ShiftAndScale.expected(), EXPECTED, ROUNDS)
    numbers = _without_common_size(fit)
    moved = list(scene.frames)
    for i, outline, own in zip(drawn, outlines.views, numbers, strict=True):
        camera = scene.frames[i].camera
        moved[i] = replace(moved[i], camera=_moved(camera, outline, own))
        still[i] = _found(camera, moved[i].camera, outline, own)
    ratio = size_ratio(frames, outlines)
    apart = (fit.apart_px[0] / ratio, fit.apart_px[1] / ratio)
    error = fit.tau * outlines.size_px / ratio
    found = Registration(fit.gain_nats > 0, fit.gain_nats, error, apart, tuple(still))
    return (replace(scene, frames=tuple(moved)) if found.applied else scene), found


def size_ratio(frames: Sequence[Frame], outlines: Outlines) -> float:
    """Return how many pixels of the outlines a pixel of the pictures is."""
    return outlines.views[0].camera.scale / frames[0].camera.scale


def _without_common_size(fit: Fit) -> Float[np.ndarray, "views 3"]:
    """Return the numbers without what all drawings share: a larger character is no error."""
    numbers = fit.numbers.copy()
    numbers[:, 2] -= numbers[:, 2].mean()
    return numbers


def _moved(camera: Camera, outline: Outline, own: Float[np.ndarray, " 3"]) -> Camera:
    """Return the camera whose pixel of a point is the moved one: u + d(u), exactly."""
    ratio = outline.camera.scale / camera.scale
    square, growth = outline.square, 1 + 2 * own[2]
    low, size = square.low / ratio, square.size / ratio
    middle = low + size / 2
    center = middle + growth * (camera.center - middle) + size * own[:2]
    return replace(camera, center=center, scale=camera.scale * growth)


def _found(
    camera: Camera, moved: Camera, outline: Outline, own: Float[np.ndarray, " 3"]
) -> ViewMove:
    size = outline.square.size * camera.scale / outline.camera.scale
    return ViewMove((float(size * own[0]), float(size * own[1])), moved.scale / camera.scale)
