"""Compute each view's likelihood of yaw from facial features inside the head.

A face has skin, more drawing than a back of the head, and small dark spots: eyes, mouth, brows.
Each of these cues is a density over the head; it says twice where the face is:

- front: the view of the sheet that has more of it than the others shows the face (cos yaw);
- side: it lies on the side to which the face is turned (at yaw 90 the image's left: -t = sin yaw).

The cues are added to two numbers (c, s), and a view's likelihood of yaw is von Mises,
exp(c cos(yaw) + s sin(yaw)): a generalised linear model whose log-likelihood is concave in the
weights (Fisher and Lee, "Regression models for an angular response", Biometrics 1992). Views of a
sheet err together (a hat band at the back looks like eyes in each of them), therefore TEMPER.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float

from toonset.calib.evidence.cylinder import Sections, figure_height, read_sections
from toonset.calib.evidence.texture import BROKEN, bessel
from toonset.view import View

SEARCH_PX = 160  # figure height at which the neck is looked for
NECK_FROM, NECK_TO = 0.1, 0.5  # of the height: adults have 8 heads, chibis 2
NECK_BELOW = 0.2  # of the height: shoulders begin within this below a neck
LEAST_HEAD = 0.4  # of the shoulders' width: a narrower thing is a plume or an antenna
NECK_DEPTH = 1.12  # widths beside a neck over its own
NO_NECK = 0.35  # of the height: where a figure has no neck
HEAD_PX = 48  # working height of a head
RIM_PX = 3.0
SPOT_PX = 7  # dark spots are narrower: a chibi's eyes are a seventh of the head
STRONGEST_EDGE = 0.12  # OKLab per pixel: an edge counts no more for being black on white
LEAST_PIXELS = 30  # of a head
# OKLab lightness, chroma and hue (radians) of skin, mean and spread over light to dark
SKIN = np.array([[0.78, 0.085, 1.01], [0.13, 0.04, 0.31]])
FAINTEST = np.array([1.0, 0.005, 0.01])  # skin is compared as it is, the others by ratio
# Fitted to 59 turnarounds of 25 characters, equal weight each: skin, detail, dark spots
FRONT = np.array([3.3, 2.0, 2.35])
SIDE = np.array([3.75, 1.55, 2.1])
# Single views fit best at 1; from 0.7 on no whole sheet of a character left out is surely wrong
TEMPER = 0.7


@dataclass(frozen=True, eq=False)
class FaceEvidence:
    """Facial evidence of a sheet's heads.

    Attributes:
        natural: (views, 2) weights of cos(yaw) and sin(yaw) in the log-likelihood; zeros where
            nothing can be told.
    """

    natural: Float[np.ndarray, "views 2"]


def read_faces(views: Sequence[View]) -> FaceEvidence:
    """Return the evidence in all views of one sheet, compared with each other."""
    front, side = face_cues(views)
    return FaceEvidence(TEMPER * np.stack([front @ FRONT, side @ SIDE], axis=1))


def face_log_likelihood(
    evidence: FaceEvidence, index: int, yaw: Float[np.ndarray, "*n"]
) -> Float[np.ndarray, "*n"]:
    """Return view `index`'s log-likelihood (nats) of yaws in radians; 0 = what any yaw has.

    It never falls below log(BROKEN): there are masks on the back of heads.
    """
    cosine, sine = evidence.natural[index]
    strength = float(np.hypot(cosine, sine))
    wave = cosine * np.cos(yaw) + sine * np.sin(yaw)
    (mean,) = bessel(np.zeros(1, int), strength)
    density = np.exp(wave - strength) / mean
    return np.log((1 - BROKEN) * density + BROKEN)


def face_cues(
    views: Sequence[View],
) -> tuple[Float[np.ndarray, "views cues"], Float[np.ndarray, "views cues"]]:
    """Return how much each view shows of skin, detail and dark spots, and how far to which side.

    The first are differences from the sheet's mean; the second are positive on the image's left.
    """
    height = figure_height(views)
    factor = SEARCH_PX / height
    neck = neck_height([read_sections(view, factor, 0.0, SEARCH_PX) for view in views])
    factor *= HEAD_PX / (neck * SEARCH_PX)
    tops = [_top(view, 2 * neck * height) for view in views]
    heads = [_moments(read_sections(top, factor, RIM_PX, HEAD_PX / neck)) for top in tops]
    known = np.array([moments is not None for moments in heads])
    front, side = np.zeros((2, len(views), 3))
    if known.any():
        front[known], side[known] = np.swapaxes([m for m in heads if m is not None], 0, 1)
        mean = front[known].mean(axis=0)
        unit = np.where(FAINTEST < 1, mean + FAINTEST, 1.0)
        front[known] = (front[known] - mean) / unit
        side /= unit
    return front, side


def _top(view: View, rows: float) -> View:
    """Return the view without what lies more than `rows` pixels below the figure's top."""
    first = int(np.flatnonzero(view.mask.any(axis=1))[0])
    return replace(view, rgba=view.rgba[: first + max(1, round(rows))])


def neck_height(figures: Sequence[Sections]) -> float:
    """Return where the neck is, in heights from the top: the narrowest place below the head."""
    rows = max(SEARCH_PX, *(len(figure.widths) for figure in figures))
    padded = [np.pad(figure.widths, (0, rows - len(figure.widths))) for figure in figures]
    typical = np.median(padded, axis=0).astype(np.float32)
    widths = cv2.GaussianBlur(typical[:, None], (0, 0), 1.5)[:, 0]
    neck, deepest = NO_NECK, NECK_DEPTH
    for row in range(int(NECK_FROM * SEARCH_PX), int(NECK_TO * SEARCH_PX)):
        above = widths[:row].max()
        below = widths[row : row + int(NECK_BELOW * SEARCH_PX)].max()
        depth = min(above, below) / max(widths[row], 1.0)
        if above >= LEAST_HEAD * below and depth > deepest:
            neck, deepest = row / SEARCH_PX, float(depth)
    return neck


def _moments(figure: Sections) -> Float[np.ndarray, "2 cues"] | None:
    """Return the cues' means over the head and their lean to the left; None where no head is seen.

    A pixel counts by how much it faces the viewer.
    """
    row, column = np.nonzero(figure.inside[:HEAD_PX])
    if len(row) < LEAST_PIXELS:
        return None
    densities = [_skin(figure.lab), drawn_detail(figure.lab), _dark_spots(figure.lab)]
    cues = np.stack(densities, axis=-1)[row, column]
    across = figure.across[row, column]
    facing = np.sqrt(1 - across**2)
    lean = -3 * ((cues - cues.mean(axis=0)) * across[:, None]).mean(axis=0)
    return np.stack([facing @ cues / facing.sum(), lean])


def _skin(lab: Float[np.ndarray, "height width 3"]) -> Float[np.ndarray, "height width"]:
    chroma, hue = np.hypot(lab[..., 1], lab[..., 2]), np.arctan2(lab[..., 2], lab[..., 1])
    z = (np.stack([lab[..., 0], chroma, hue], axis=-1) - SKIN[0]) / SKIN[1]
    return np.exp(-0.5 * (z**2).sum(axis=-1))


def drawn_detail(lab: Float[np.ndarray, "height width 3"]) -> Float[np.ndarray, "height width"]:
    """Return how much is drawn at every pixel: the colour's slope, OKLab per pixel."""
    smooth = cv2.GaussianBlur(lab.astype(np.float32), (0, 0), 1.0)
    slopes = [cv2.Sobel(smooth, cv2.CV_32F, *way, scale=1 / 8) for way in ((1, 0), (0, 1))]
    return np.minimum(np.sqrt(np.sum(np.square(slopes), axis=(0, 3))), STRONGEST_EDGE)


def _dark_spots(lab: Float[np.ndarray, "height width 3"]) -> Float[np.ndarray, "height width"]:
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (SPOT_PX, SPOT_PX))
    return cv2.morphologyEx(lab[..., 0].astype(np.float32), cv2.MORPH_BLACKHAT, disc)
