"""Measure how ragged outlines and borders of paint are: how far their direction turns in all.

Contours, those of holes and islands included, are sampled at equal steps of a share of the figure's
height, so that large and small pictures of one shape turn alike; total turning is the sum of the
absolute angles between neighbouring steps. A convex figure turns once, every dent adds to it, every
crumb or hole is a turn more.

Source: Milnor 1950, "On the total curvature of knots" (inscribed polygons).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from toonset.palette.pixels.labels import UNLABELLED, nearest_labels

LEVEL = 0.5  # of coverage, at the outline
FEWEST = 3  # samples of a closed curve
TURN = 2 * np.pi


@dataclass(frozen=True)
class Scale:
    """How finely contours are looked at, in shares of the figure's height.

    Attributes:
        step: between samples of a contour.
        soft: sigma of the blur before.
    """

    step: float
    soft: float


# A disc of 200 px turns 1.06 times at OUTLINE, with half its blur 1.27 times; borders of labels
# are not antialiased: the disc turns 1.3 times at BORDER, and 4.3 times at OUTLINE
OUTLINE, BORDER = Scale(0.01, 0.005), Scale(0.02, 0.008)


def outline_turning(
    alpha: Float[np.ndarray, "height width"], height_px: float, scale: Scale = OUTLINE
) -> float:
    """Return how many whole turns the outlines make in all; 0 of an empty picture.

    Args:
        alpha: coverage in [0, 1].
        height_px: of the figure.
        scale: below which wiggles do not count.
    """
    from skimage.measure import find_contours

    soft = cv2.GaussianBlur(np.pad(alpha, 2).astype(np.float32), (0, 0), scale.soft * height_px)
    curves = (_sampled(curve, scale.step * height_px) for curve in find_contours(soft, LEVEL))
    return sum(_turning(curve) for curve in curves if len(curve) >= FEWEST) / TURN


def border_turning(
    rgba: UInt8[np.ndarray, "height width 4"],
    paints: UInt8[np.ndarray, "paints 3"],
    height_px: float,
) -> float:
    """Return how many whole turns the borders of paints make, each seen from both its sides.

    Args:
        rgba: a picture, straight alpha; every pixel counts as its nearest paint.
        paints: colours.
        height_px: of the figure.
    """
    labels = nearest_labels(rgba, paints)
    there = np.unique(labels[labels != UNLABELLED]).tolist()
    return sum(outline_turning((labels == paint) * 1.0, height_px, BORDER) for paint in there)


def _sampled(curve: Float[np.ndarray, "n 2"], step_px: float) -> Float[np.ndarray, "m 2"]:
    """Return a closed curve (its end is its start) at equal steps, the end left out."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    at = np.arange(round(along[-1] / step_px)) * (along[-1] / max(round(along[-1] / step_px), 1))
    return np.stack([np.interp(at, along, curve[:, k]) for k in (0, 1)], axis=1)


def _turning(curve: Float[np.ndarray, "n 2"]) -> float:
    """Return the sum of a closed polygon's absolute turning angles, radians."""
    edges = np.roll(curve, -1, axis=0) - curve
    heading = np.arctan2(edges[:, 0], edges[:, 1])
    turns = np.diff(heading, append=heading[0])
    return float(np.abs((turns + np.pi) % TURN - np.pi).sum())
