"""Turning cameras that were estimated, as far as their sigmas let them.

Where the mannequin is not quite the character, calibration's yaws and distance are off by more than
outlines forgive. Cameras are turned, placed and sized together until the outlines are those of one
body; pixels stay as they are, and cameras that are known exactly (no sigma) stay to the bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from toonset.dataset.bundle.scene import Scene
from toonset.dataset.silhouettes.alignment import FEWEST_VIEWS, Alignment
from toonset.dataset.silhouettes.mask import alpha_of, has_figure
from toonset.dataset.silhouettes.outlines import Square, outlines_of
from toonset.dataset.silhouettes.turn_fit import PLACE, YAW, camera_moved, fit_turns
from toonset.nerf.prepare.registration import ViewMove

ROUNDS = 6  # of Gauss-Newton
PLACED = 0.003  # of the figure's square: how far a fit misplaces a drawing, as a first guess
WIDER = 3.0  # sigmas; with a mannequin of another body yaws are off by two (`bench calib`)
K_SIGMA = 0.03  # of log k, which calibration gives no sigma of; 5 to 9 % were seen, 1 % is usual


@dataclass(frozen=True)
class ViewTurn(ViewMove):
    """How one camera was off.

    Attributes:
        yaw: by which the camera has to turn, radians.
    """

    yaw: float


@dataclass(frozen=True, eq=False)
class Turning(Alignment):
    """What was found about the cameras' yaws, places, sizes and common perspective.

    Attributes:
        views: per frame of the scene, as found (also where not applied).
        k_ratio: by which every camera's k = 1 / distance has to grow.
    """

    views: tuple[ViewTurn, ...]
    k_ratio: float

    def to_json(self) -> dict[str, Any]:
        """Return the numbers for a report."""
        return super().to_json() | {
            "k_ratio": round(self.k_ratio, 6),
            "views": [
                {
                    "yaw_deg": round(math.degrees(view.yaw), 4),
                    "shift_px": [round(v, 4) for v in view.shift_px],
                    "scale": round(view.scale, 6),
                }
                for view in self.views
            ],
        }


def turned(scene: Scene) -> tuple[Scene, Turning | None]:
    """Return the scene with its cameras turned, and the evidence.

    The scene is returned as it is where the evidence is against it; without evidence (None) where a
    drawing's camera has no sigma, none may turn, or fewer than FEWEST_VIEWS show a figure.

    Raises:
        BundleError: the cameras do not belong together (see `box_of_masks`).
    """
    shown = {i: frame for i, frame in enumerate(scene.frames) if has_figure(frame)}
    sigmas = [frame.yaw_sigma for frame in shown.values() if frame.yaw_sigma is not None]
    if len(shown) < FEWEST_VIEWS or len(sigmas) < len(shown) or not any(sigmas):
        return scene, None
    cameras = [frame.camera for frame in shown.values()]
    outlines = outlines_of(cameras, [alpha_of(frame) for frame in shown.values()])
    k_sigma = 0.0 if any(camera.is_orthographic for camera in cameras) else K_SIGMA
    fit = fit_turns(outlines, WIDER * np.array(sigmas), k_sigma, PLACED, ROUNDS)
    ratio = outlines.ratio(cameras[0])
    frames = list(scene.frames)
    views = [ViewTurn((0.0, 0.0), 1.0, 0.0)] * len(frames)
    for i, outline, own in zip(shown, outlines.views, fit.numbers, strict=True):
        square = Square(outline.square.low / ratio, outline.square.size / ratio)
        frames[i] = replace(
            frames[i], camera=camera_moved(frames[i].camera, square, own, fit.log_k)
        )
        views[i] = ViewTurn(**vars(ViewMove.of(square, own[PLACE])), yaw=float(own[YAW]))
    apart = (fit.apart_px[0] / ratio, fit.apart_px[1] / ratio)
    applied = fit.gain_nats > 0
    turning = Turning(
        applied,
        fit.gain_nats,
        fit.tau * outlines.size_px / ratio,
        apart,
        tuple(views),
        math.exp(fit.log_k),
    )
    return (replace(scene, frames=tuple(frames)) if applied else scene), turning
