"""One sheet: what its run says of itself, and how its new views look beside the truth.

The look of a view is FLIP in units that do not depend on what is drawn: over FLIP of the true
picture moved by a pixel, as a share of the figure's height. 0.01 looks as wrong as a figure that is
moved by a hundredth of its height.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float

from toonset.dataset.bundle.scene import Scene
from toonset.dataset.images.picture import encode_png
from toonset.dataset.silhouettes.mask import figure_px, mask_of
from toonset.errors import SetupError
from toonset.nerf.options import TrainOptions
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.layers import default_layer
from toonset.nerf.render.views import render
from toonset.nerf.score.between import BetweenView, views_between
from toonset.nerf.score.flip import FlipMap, load_flip
from toonset.nerf.score.verdict import verdict_of
from toonset.nerf.training import train
from toonset.view import over_white

TERMS = ("off", "apart", "borders", "outline")
VIEWS = 6  # between drawings
QUICK = TrainOptions(steps=100, resolution=90)  # shape is settled by then, and so is the drawn look


@dataclass(frozen=True)
class Judged:
    """A sheet.

    Attributes:
        name: of it.
        verdict: "ok" or "weak".
        reasons: of it.
        off: the worst drawing, share of the figure's height (see `toonset.nerf.score.left_out`).
        look: per held-out view where pixels count, share of the figure's height.
        terms: what may tell it (TERMS), of its drawings and views between them.
        flip: per held-out view FLIP over the figure, the truth's and the view's.
    """

    name: str
    verdict: str
    reasons: tuple[str, ...]
    off: float
    look: tuple[float, ...]
    terms: tuple[float, ...] = ()
    flip: tuple[float, ...] = ()

    @property
    def worst_look(self) -> float:
        """Return the look of the worst held-out view."""
        return max(self.look)


def judge(
    name: str,
    scene: Scene,
    test: Scene,
    options: TrainOptions,
    where: Sequence[Bool[np.ndarray, "height width"]] | None = None,
) -> tuple[Judged, bytes]:
    """Return a sheet's verdict and look, and a PNG of held-out views, truth above, in a row.

    Args:
        name: of the sheet.
        scene: what is trained on.
        test: held-out views.
        options: of the training.
        where: per held-out view the pixels that count; None: all of them.
    """
    flip = needed_flip()
    run = train(scene, options, threads=1)
    layer = default_layer(run.field)
    baked = Baked.of(run.training.result)
    found = verdict_of(run.training, run.scene, baked)
    terms = terms_of(found.off, views_between(baked, VIEWS))
    looks, figures, tiles = [], [], []
    for number, frame in enumerate(test.frames):
        shown = render(run.field, frame.camera).picture(layer)
        truth, seen = over_white(frame.rgba), over_white(shown)
        counted = where[number] if where else np.ones(truth.shape[:2], dtype=bool)
        per_px = float(by_pixel(flip, truth)[counted].sum()) * max(figure_px(frame), 1)
        error = flip(truth, seen)
        if per_px:
            looks.append(float(error[counted].sum()) / per_px)
        figure = counted & (mask_of(frame.rgba) | mask_of(shown))
        if figure.any():
            figures.append(float(error[figure].mean()))
        tiles.append(np.concatenate([truth, seen]))
    judged = Judged(
        name, found.verdict, found.reasons, found.off, tuple(looks), terms, tuple(figures)
    )
    return judged, encode_png((np.concatenate(tiles, axis=1) * 255 + 0.5).astype(np.uint8))


def terms_of(off: float, views: Sequence[BetweenView]) -> tuple[float, ...]:
    """Return TERMS: of the worst drawing left out, and means over views between drawings.

    How far the two drawings beside a view paint it apart; how much more its borders of paint turn
    than theirs, and how far its outline is from theirs in that, as logarithms of ratios.
    """
    rows = [
        (
            view.apart,
            max(0.0, _log_ratio(view.borders, view.own_borders)),
            abs(_log_ratio(view.outline, view.own_outline)),
        )
        for view in views
    ]
    return (off, *np.mean(rows, axis=0).tolist()) if rows else (off, 0.0, 0.0, 0.0)


def _log_ratio(turns: float, own: float) -> float:
    """Return that of turns, each at least a disc's: a blank picture has none."""
    return math.log(max(turns, 1.0) / max(own, 1.0))


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
