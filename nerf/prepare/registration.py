"""Register drawings by a shift and a size each, so that their outlines agree.

Artists place and size the views of a sheet by eye. What is moved is each view's camera (its
principal point and its scale), never a pixel: nothing is resampled, and the correction is exact.
Drawings that agree within an outline's own error are left as they are, to the bit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from toonset.dataset.bundle.scene import Scene
from toonset.dataset.silhouettes.alignment import Alignment, alignment_of
from toonset.dataset.silhouettes.displacement import ShiftAndScale
from toonset.dataset.silhouettes.outlines import Square
from toonset.dataset.silhouettes.turn_fit import displace_camera

ROUNDS = 6  # of Gauss-Newton


@dataclass(frozen=True)
class ViewMove:
    """Shift and size of one drawing.

    Attributes:
        shift_px: (x, y) by which the drawing sits too far right and down, pixels of the picture.
        scale: its size relative to what the sheet's other drawings ask for.
    """

    shift_px: tuple[float, float]
    scale: float

    @classmethod
    def of(cls, square: Square, own: Float[np.ndarray, " 3"]) -> ViewMove:
        """Return the move of a drawing's numbers of `ShiftAndScale`."""
        x, y = square.size * own[:2]
        return cls((float(x), float(y)), float(1 + 2 * own[2]))


@dataclass(frozen=True, eq=False)
class Registration(Alignment):
    """Registration of a sheet's drawings.

    Attributes:
        views: per frame of the scene, as found (also where not applied).
    """

    views: tuple[ViewMove, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the numbers for a report."""
        return super().to_json() | {
            "views": [
                {"shift_px": [round(v, 4) for v in view.shift_px], "scale": round(view.scale, 6)}
                for view in self.views
            ]
        }


def register_drawings(scene: Scene) -> tuple[Scene, Registration]:
    """Return the scene with each camera moved to where its drawing sits, and the evidence.

    Pictures without a figure, and scenes with fewer than FEWEST_VIEWS, are returned as they are.

    Raises:
        BundleError: the cameras do not belong together (see `box_of_masks`).
    """
    found, numbers = alignment_of(scene, ShiftAndScale.expected(), ROUNDS)
    frames = list(scene.frames)
    views = [ViewMove((0.0, 0.0), 1.0)] * len(frames)
    for i, (square, own) in numbers.items():
        frames[i] = replace(frames[i], camera=displace_camera(frames[i].camera, square, own))
        views[i] = ViewMove.of(square, own)
    registration = Registration(**vars(found), views=tuple(views))
    return (replace(scene, frames=tuple(frames)) if found.applied else scene), registration
