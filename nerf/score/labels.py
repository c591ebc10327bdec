"""Score a rendering's palette labels: mIoU and the share of right pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from toonset.nerf.score.metrics import MOST_SHIFT_PX
from toonset.palette.pixels.labels import UNLABELLED

Labels = UInt8[np.ndarray, "height width"]


@dataclass(frozen=True)
class LabelScore:
    """Labels of one view against the truth's, where both have one.

    Attributes:
        accuracy: share of these pixels with the right label.
        miou: mean intersection over union of the labels that the truth has there.
        pixels: how many these are.
    """

    accuracy: float
    miou: float
    pixels: int


def score_labels(rendered: Labels, true: Labels) -> LabelScore | None:
    """Return the score over pixels that are labelled in both; None without any.

    In the truth these are the pixels that are no blends, in the rendering those of the figure.
    """
    both = (rendered != UNLABELLED) & (true != UNLABELLED)
    found, wanted = rendered[both], true[both]
    if not len(wanted):
        return None
    hits = np.bincount(wanted[found == wanted], minlength=UNLABELLED)
    sizes = np.bincount(wanted, minlength=UNLABELLED)
    union = sizes + np.bincount(found, minlength=UNLABELLED) - hits
    present = sizes > 0
    miou = float((hits[present] / union[present]).mean())
    return LabelScore(float((found == wanted).mean()), miou, len(wanted))


def shifted_miou(rendered: Labels, true: Labels) -> float | None:
    """Return the mIoU after that shift by up to 2 whole pixels a side that sets most labels right.

    One shift for the whole picture, as of `shifted_psnr`; None where no pixel is labelled in both.
    """
    m, (height, width) = MOST_SHIFT_PX, true.shape
    padded = np.pad(rendered, m, constant_values=UNLABELLED)
    scores = [
        score_labels(padded[y : y + height, x : x + width], true)
        for y in range(2 * m + 1)
        for x in range(2 * m + 1)
    ]
    known = [score for score in scores if score is not None]
    best = max(known, key=lambda score: (score.accuracy * score.pixels, score.miou), default=None)
    return None if best is None else best.miou
