"""Compute the likelihood of a sheet's yaws from outlines that mirror each other.

At eye level, without perspective, the outline seen from behind is the mirror image of the one from
the front; a character whose left is like its right shows mirror images at yaw and -yaw, too, front
and back being their own. So every pair of drawings (and every drawing with itself) has an angle at
which one would see the other's mirror image, and a smaller one means outlines that are more alike:

    log(apart) = offset of the sheet + EXPECTED[angle] + noise

Likewise for outlines that are not mirrored: they are alike at one yaw, and at yaw and 180 - yaw.
Poses differ between drawings: that moves the offset, not the order of the pairs.

Source: Cipolla and Giblin, "Visual Motion of Curves and Surfaces", 2000, chapter 4: the outlines of
opposite orthographic views are mirror images.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

from toonset.calib.evidence.cylinder import figure_height
from toonset.view import View

HEIGHT_PX = 64  # working height of a figure: 1.6 % of the height a pixel, as drawings err
ROWS_PX = (-2, 0, 2)  # by which drawings may stand higher or lower than their boxes say
FAINTEST = 0.02  # of both areas: outlines are never nearer
# Means of log(apart) by angle, over 330 drawings by artists, of sprites and of rendered sheets
ANGLES = np.radians([0.0, 45.0, 90.0, 135.0, 180.0])
EXPECTED = np.array([-0.50, 0.08, 0.28, 0.35, 0.15])
NOISE = 0.3  # standard deviation of log(apart) about its mean, the sheet's offset aside
INDEPENDENT = 0.5  # of the pairs: one odd drawing is in several


@dataclass(frozen=True, eq=False)
class MirroredOutlines:
    """How far apart a sheet's outlines are, pair by pair.

    Attributes:
        first: (pairs,) index of a view.
        second: (pairs,) index of a view, the same or another.
        mirrored: (pairs,) the second one is mirrored.
        log_apart: (pairs,) log of the area that only one covers over both areas.
    """

    first: np.ndarray
    second: np.ndarray
    mirrored: np.ndarray
    log_apart: Float[np.ndarray, " pairs"]


def read_mirrored_outlines(views: Sequence[View]) -> MirroredOutlines:
    """Return how far apart the views' outlines are, mirrored and not; all views have one scale."""
    masks = _masks(views)
    count = len(views)
    pairs = [(i, j, True) for i in range(count) for j in range(i + 1)]
    pairs += [(i, j, False) for i in range(count) for j in range(i)]
    apart = [_apart(masks[i], masks[j][:, ::-1] if flip else masks[j]) for i, j, flip in pairs]
    first, second, mirrored = (np.array(column) for column in zip(*pairs, strict=True))
    return MirroredOutlines(first, second, mirrored, np.log(np.array(apart) + FAINTEST))


def mirrored_log_likelihood(
    outlines: MirroredOutlines, yaws: Float[np.ndarray, "turns views"]
) -> Float[np.ndarray, " turns"]:
    """Return the log-likelihood (nats) of every row of yaws (radians), the offset profiled out."""
    one, other = yaws[:, outlines.first], yaws[:, outlines.second]
    half = np.where(outlines.mirrored, np.pi, 0.0)
    apart = np.minimum(_angle(one - other - half), _angle(one + other - np.pi + half))
    off = outlines.log_apart - np.interp(apart, ANGLES, EXPECTED)
    off -= off.mean(axis=1, keepdims=True)
    return -0.5 * INDEPENDENT * np.square(off / NOISE).sum(axis=1)


def _angle(angles: Float[np.ndarray, "turns pairs"]) -> Float[np.ndarray, "turns pairs"]:
    """Return the size of angles, 0 to pi."""
    return np.abs((angles + np.pi) % (2 * np.pi) - np.pi)


def _masks(views: Sequence[View]) -> list[Float[np.ndarray, "height width"]]:
    """Return the figures on canvases of one size, standing on one line, at the working scale."""
    factor = HEIGHT_PX / figure_height(views)
    small = []
    for view in views:
        rows, columns = (np.flatnonzero(view.mask.any(axis=axis)) for axis in (1, 0))
        crop = view.mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].astype(np.float32)
        size = tuple(max(1, round(factor * side)) for side in crop.shape[::-1])
        small.append(cv2.resize(crop, size, interpolation=cv2.INTER_AREA))
    pad = max(ROWS_PX)
    height = max(len(mask) for mask in small) + 2 * pad
    width = 2 * max(mask.shape[1] for mask in small)
    placed = []
    for mask in small:
        canvas = np.zeros((height, width), np.float32)
        low, left = height - pad, (width - mask.shape[1]) // 2
        canvas[low - len(mask) : low, left : left + mask.shape[1]] = mask
        placed.append(canvas)
    return placed


def _apart(
    one: Float[np.ndarray, "height width"], other: Float[np.ndarray, "height width"]
) -> float:
    """Return the least share of both areas that only one covers, over shifts of the other."""
    area = float(one.sum() + other.sum())
    spectrum = np.fft.rfft(one, axis=1)
    shared = [
        np.fft.irfft(
            (spectrum * np.fft.rfft(np.roll(other, rows, axis=0), axis=1).conj()).sum(axis=0),
            one.shape[1],
        ).max()
        for rows in ROWS_PX
    ]
    return max(0.0, 1 - 2 * float(max(shared)) / area)
