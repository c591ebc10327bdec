"""One sheet: what its run says of itself, and how its new views look beside the truth.

The look of a view is FLIP in units that do not depend on what is drawn: over FLIP of the true
picture moved by a pixel, as a share of the figure's height. 0.01 looks as wrong as a figure that is
moved by a hundredth of its height.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from toonset.dataset.bundle.scene import Scene
from toonset.dataset.images.picture import encode_png
from toonset.dataset.silhouettes.mask import figure_px
from toonset.errors import SetupError
from toonset.nerf.options import TrainOptions
from toonset.nerf.render.layers import default_layer
from toonset.nerf.render.views import render
from toonset.nerf.score.flip import FlipMap, load_flip
from toonset.nerf.score.verdict import MOST_OFF, verdict_of
from toonset.nerf.training import train
from toonset.view import over_white

QUICK = TrainOptions(steps=100, resolution=90)  # shape is settled by then, and so is the drawn look
FULL = TrainOptions()

Picture = UInt8[np.ndarray, "height width 4"]


@dataclass(frozen=True)
class Judged:
    """A sheet.

    Attributes:
        name: of it.
        verdict: "ok" or "weak".
        reasons: of it.
        guesses: reasons that need no training: too few drawings.
        off: per drawing, shares of the figure's height (see `toonset.nerf.score.left_out`).
        flip: per held-out view, mean over the picture.
        look: per held-out view, shares of the figure's height.
    """

    name: str
    verdict: str
    reasons: tuple[str, ...]
    guesses: int
    off: dict[str, float]
    flip: tuple[float, ...]
    look: tuple[float, ...]

    @property
    def statistic(self) -> float:
        """Return what the verdict rests on: the worst drawing; 0 of none."""
        return max(self.off.values(), default=0.0)

    @property
    def worst_look(self) -> float:
        """Return the look of the worst held-out view."""
        return max(self.look)


def judge(name: str, scene: Scene, test: Scene, options: TrainOptions) -> tuple[Judged, bytes]:
    """Return a sheet's verdict and look, and a PNG of held-out views, truth above, in a row."""
    flip = needed_flip()
    run = train(scene, options, threads=1)
    layer = default_layer(run.field)
    found = verdict_of(run.training, run.scene)
    flips, looks, tiles = [], [], []
    for frame in test.frames:
        shown = render(run.field, frame.camera).picture(layer)
        truth, seen = over_white(frame.rgba), over_white(shown)
        error = flip(truth, seen)
        flips.append(float(error.mean()))
        looks.append(float(error.sum()) / by_pixel(flip, truth).sum() / max(figure_px(frame), 1))
        tiles.append(np.concatenate([truth, seen]))
    judged = Judged(
        name,
        found.verdict,
        found.reasons,
        len(found.reasons) - (found.off > MOST_OFF),
        {view.name: view.off for view in found.views},
        tuple(flips),
        tuple(looks),
    )
    return judged, encode_png((np.concatenate(tiles, axis=1) * 255 + 0.5).astype(np.uint8))


def needed_flip() -> FlipMap:
    """Return FLIP.

    Raises:
        SetupError: there is none on this machine.
    """
    flip = load_flip()
    if isinstance(flip, str):
        raise SetupError(f"the look of views is measured with FLIP: {flip}")
    return flip


def by_pixel(flip: FlipMap, truth: np.ndarray) -> Float[np.ndarray, "height width"]:
    """Return FLIP of a picture moved by a pixel, mean over both axes."""
    moves = ([[1, 0, 1], [0, 1, 0]], [[1, 0, 0], [0, 1, 1]])
    size = truth.shape[1::-1]
    moved = (
        cv2.warpAffine(truth, np.array(move, float), size, borderMode=cv2.BORDER_REPLICATE)
        for move in moves
    )
    return np.mean([flip(truth, picture) for picture in moved], axis=0)
