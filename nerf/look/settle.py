"""Settle the borders of paints where pieces of drawings meet in a view.

A seam, a step of the surface and paint that goes on beyond what a drawing shows leave borders that
are ragged by a few pixels. Beside such discontinuities every pixel takes the paint that most of its
neighbourhood has, and borders are softened by one pixel; thin lines count as much more as they must
to keep their width.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import erf, sqrt

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from toonset.nerf.look.choose import Look, Mask
from toonset.nerf.look.features import lines_of
from toonset.raster import broad_blur, dilate

JUMP_PX = 2.5  # neighbouring pixels show places farther apart, in the view's pixels, across a step
SIGMA, LEAST_PX = 0.004, 0.7  # of the figure's height, and pixels: of the neighbourhood
RAGGED = 2.0  # times sigma: so far beside a discontinuity borders are settled
FINER = 0.6  # times sigma: the neighbourhood in which lines count
MOST_WEIGHT = 4.0  # times paint: so much a thin line counts at most
LEAST_SHARE = 1e-3  # of a neighbourhood: a paint with less is not in it


def discontinuities(looks: Sequence[Look], chosen: Int[np.ndarray, "h w"], inside: Mask) -> Mask:
    """Return the pixels beside which a view shows another drawing, or another place of the same.

    Args:
        looks: the drawings.
        chosen: of them, -1 where none is shown.
        inside: pixels of the figure; its outline does not count.
    """
    x, y = (np.zeros(chosen.shape, np.float32) for _ in range(2))
    for number, look in enumerate(looks):
        here = (chosen == number).view(np.uint8)
        for whole, its in ((x, look.x), (y, look.y)):
            cv2.copyTo(np.float32(look.scale) * its, here, whole)
    found = np.zeros(chosen.shape, dtype=bool)
    for here, there in (
        ((slice(None), slice(-1)), (slice(None), slice(1, None))),
        ((slice(-1), slice(None)), (slice(1, None), slice(None))),
    ):
        off = cv2.max(cv2.absdiff(x[here], x[there]), cv2.absdiff(y[here], y[there]))
        apart = (chosen[here] != chosen[there]) | (off > JUMP_PX)
        apart &= inside[here] & inside[there]
        found[here] |= apart
        found[there] |= apart
    return found


def settled(
    color: Float[np.ndarray, "h w 3"],
    labels: UInt8[np.ndarray, "h w"],
    breaks: Mask,
    inside: Mask,
    pen: tuple[float, tuple[int, int, int]] | None,
    figure_px: float,
) -> tuple[Float[np.ndarray, "h w 3"], UInt8[np.ndarray, "h w"]]:
    """Return a view's paint with smooth borders where its drawings meet; all else as it is.

    Args:
        color: straight, in [0, 1].
        labels: of the paint.
        breaks: pixels at which pieces of drawings meet: see `discontinuities`.
        inside: pixels of the figure.
        pen: of the drawings' lines, as wide as in the view; None: there are none.
        figure_px: height of the figure.
    """
    sigma = max(LEAST_PX, SIGMA * figure_px)
    band = dilate(breaks, int(np.ceil(RAGGED * sigma))) & inside
    if not band.any():
        return color, labels
    best, second = (np.full(band.shape, -1, np.float32) for _ in range(2))
    first, other, kind = color.copy(), color.copy(), labels.copy()
    lines = lines_of(color, pen, beside=False) & inside
    ink = np.bincount(labels[lines], minlength=1).argmax()  # the label that lines have
    room = int(np.ceil(3 * sigma))
    for number, here, box in _kinds(labels, lines, inside, band, room):
        at, own, here = band[box], color[box], here[box]
        shares = here.astype(np.float32)
        near = cv2.GaussianBlur(shares, (0, 0), sigma)
        mean = broad_blur(own * shares[..., None], sigma) / np.maximum(near, 1e-4)[..., None]
        shown = cv2.copyTo(own, here.view(np.uint8), mean)
        if number is None and pen:  # an edge of a line beside paint stays where it is
            fine = FINER * sigma
            weight = min(MOST_WEIGHT, 1 / erf(pen[0] / (fine * sqrt(2))))
            near = weight * cv2.GaussianBlur(shares, (0, 0), fine)
        near = np.where(near < LEAST_SHARE, -1, near)
        leads, follows = at & (near > best[box]), at & (near > second[box])
        for condition, values, kept in (
            (follows, shown, other[box]),
            (leads, first[box], other[box]),
            (leads, shown, first[box]),
        ):
            cv2.copyTo(values, condition.view(np.uint8), kept)
        second[box] = np.where(leads, best[box], np.maximum(near, second[box]))
        best[box] = np.maximum(near, best[box])
        kind[box][leads] = ink if number is None else number
    away = (best - np.maximum(second, 0)) * sigma * np.float32(np.sqrt(np.pi / 2))  # pixels
    part = np.clip(0.5 + away[band], 0, 1)[:, None]
    found = color.copy()
    found[band] = other[band] + part * (first[band] - other[band])
    return found, np.where(band, kind, labels)


def _kinds(
    labels: UInt8[np.ndarray, "h w"], lines: Mask, inside: Mask, band: Mask, room: int
) -> Iterator[tuple[int | None, Mask, tuple[slice, slice]]]:
    """Yield every paint near a band with its pixels and their box; None with thin lines."""
    around = dilate(band, room) & inside
    for number in (*np.unique(labels[around & ~lines]).tolist(), None):
        here = around & (lines if number is None else (labels == number) & ~lines)
        if here.any():
            rows, columns = (np.flatnonzero(here.any(axis=axis)) for axis in (1, 0))
            top, bottom, left, right = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
            box = (
                slice(max(0, top - room), bottom + room),
                slice(max(0, left - room), right + room),
            )
            yield number, here, box
