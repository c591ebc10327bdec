"""Compute every metric of one rendering against its drawing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from toonset.dataset.silhouettes.mask import mask_of
from toonset.nerf.score.appearance import block_psnr, dirt, sharpness
from toonset.nerf.score.flip import FlipMap, load_flip
from toonset.nerf.score.lines import line_f1
from toonset.nerf.score.lpips import Lpips, load_lpips
from toonset.nerf.score.metrics import Figures, compare, shifted_psnr, silhouette_iou, ssim
from toonset.view import over_white


@dataclass(frozen=True)
class Judges:
    """The metrics that need a package; a text in its place says why one is missing."""

    flip: FlipMap | str
    lpips: Lpips | str

    @property
    def absent(self) -> dict[str, str]:
        """Return the reason of every metric that is missing."""
        return {name: why for name, why in vars(self).items() if isinstance(why, str)}


def load_judges() -> Judges:
    """Load the metrics that this machine has; nothing is downloaded."""
    return Judges(load_flip(), load_lpips())


def figures_of(
    rendered: UInt8[np.ndarray, "height width 4"],
    drawn: UInt8[np.ndarray, "height width 4"],
    judges: Judges,
) -> tuple[Figures, Float[np.ndarray, "height width"]]:
    """Return all figures, and the error per pixel in [0, 1].

    Names that end in `_mask` count the pixels where the drawing has any alpha. The error is FLIP's,
    without it the mean absolute difference. What cannot be said is None: of an empty mask, of a
    picture that is too small, of lines where none are drawn.
    """
    a, b, mask = over_white(rendered), over_white(drawn), drawn[..., 3] > 0
    quick = compare(rendered, drawn)
    shifted, shifted_inside = shifted_psnr(a, b, mask)
    error = np.abs(a - b).mean(axis=-1)
    flip: float | None = None
    flip_inside: float | None = None
    if not isinstance(judges.flip, str):
        error = judges.flip(b, a)
        flip, flip_inside = float(error.mean()), float(error[mask].mean()) if mask.any() else None
    figures = {
        **quick,
        "ssim_mask": ssim(a, b, mask),
        "psnr_shift": shifted,
        "psnr_shift_mask": shifted_inside,
        "psnr_blocks": block_psnr(a, b),
        "sharpness": sharpness(a, b, mask_of(drawn)),
        "dirt": dirt(a, b, mask_of(drawn)),
        "flip": flip,
        "flip_mask": flip_inside,
        "lpips": None if isinstance(judges.lpips, str) else judges.lpips(a, b),
        "silhouette_iou": silhouette_iou(rendered, drawn),
        "ink_f1": line_f1(rendered, drawn),
    }
    return figures, error
