"""Report how large one kind of error in a sheet's drawings is, and whether it is proven."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from toonset.dataset.bundle.scene import Scene
from toonset.dataset.silhouettes.displacement import Moves
from toonset.dataset.silhouettes.mask import alpha_of, has_figure
from toonset.dataset.silhouettes.outlines import Square, outlines_of
from toonset.dataset.silhouettes.register import fit_moves

EXPECTED = 0.01  # of the figure's square: a careful hand's error, as a first guess
FEWEST_VIEWS = 3  # two outlines nearly always share a body


@dataclass(frozen=True, eq=False)
class Alignment:
    """The evidence for errors of one kind.

    Attributes:
        applied: whether they were taken out.
        gain_nats: log marginal likelihood for errors over none; only taken out where > 0.
        error_px: typical size of the errors that the sheet asks for, pixels of the pictures.
        apart_px: root mean square disagreement of the outlines, before and after, pixels.
    """

    applied: bool
    gain_nats: float
    error_px: float
    apart_px: tuple[float, float]

    def to_json(self) -> dict[str, Any]:
        """Return the numbers for a report."""
        return {
            "applied": self.applied,
            "gain_nats": round(self.gain_nats, 3),
            "error_px": round(self.error_px, 4),
            "apart_px": [round(value, 4) for value in self.apart_px],
        }


Moved = dict[int, tuple[Square, Float[np.ndarray, " k"]]]


def alignment_of(scene: Scene, moves: Moves, rounds: int) -> tuple[Alignment, Moved]:
    """Return the evidence for a family of errors, and each drawing's.

    Args:
        scene: posed drawings.
        moves: the family.
        rounds: of Gauss-Newton.

    Returns:
        The evidence, and by frame the figure's square in pixels of the picture and the numbers of
        `moves`; nothing of frames without a figure, nor where fewer than FEWEST_VIEWS show one.

    Raises:
        BundleError: the cameras do not belong together (see `box_of_masks`).
    """
    frames = {i: frame for i, frame in enumerate(scene.frames) if has_figure(frame)}
    if len(frames) < FEWEST_VIEWS:
        return Alignment(False, 0.0, 0.0, (0.0, 0.0)), {}
    cameras = [frame.camera for frame in frames.values()]
    outlines = outlines_of(cameras, [alpha_of(frame) for frame in frames.values()])
    fit = fit_moves(outlines, moves, EXPECTED, rounds)
    ratio = outlines.ratio(cameras[0])
    squares = [Square(view.square.low / ratio, view.square.size / ratio) for view in outlines.views]
    apart = (fit.apart_px[0] / ratio, fit.apart_px[1] / ratio)
    found = Alignment(fit.gain_nats > 0, fit.gain_nats, fit.tau * squares[0].size, apart)
    return found, dict(zip(frames, zip(squares, fit.numbers, strict=True), strict=True))
