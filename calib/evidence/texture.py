"""Compute the likelihood of a sheet's yaws from the colours painted on the turning body.

Outlines have mirror twins: yaw and 180 - yaw look the same under orthography. What is painted on
the body does not: between two views it moves to the left or to the right, comes round one edge and
leaves over the other. No face, no skin, no meaning is needed: a belt, a cape, a parting will do.

The figure is a stack of bands, each a turning cylinder whose paint is a short Fourier series in
longitude, mostly left-right symmetric (sines have a tenth of the cosines' variance), the same in
all views. A cell at longitude phi = yaw + asin(t) shows it with noise. Bayesian linear regression
(Bishop, Pattern Recognition and Machine Learning, 2006, section 3.5) integrates the series out;
each band's noise level is profiled. Cells of a drawing err together, so that only a few
measurements per view count, and the model as a whole may be wrong: no yaws are ever excluded.

Turning all views by 180 degrees leaves the likelihood as it is; outlines, or a face, tell that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from toonset.calib.evidence.cylinder import figure_height, read_sections
from toonset.view import View

HEIGHT_PX = 160  # working height of a figure: small sprites have 60, more shows no other colours
BAND_PX = 8
CELLS = 7  # across a cross-section
RIM_PX = 1.0
LEAST_PIXELS = 2  # of a cell
ORDER = 3  # of the Fourier series
SMOOTHNESS = 1.0  # concentration of the von Mises kernel between longitudes
ASYMMETRY = 0.1  # variance of what differs between left and right, over that of what does not
CIRCLE = np.linspace(0, 2 * np.pi, 512, endpoint=False)
NOISE = 2.0  # variance of a cell over that of the paint: limbs move, cylinders are no bodies
FAINTEST = 0.02  # OKLab: differences below are not seen, nor drawn on purpose
# 80 to 100 fit best, whichever of 25 characters is left out; fewer where cameras look steeply down
MEASUREMENTS_PER_VIEW = 60.0
BROKEN = 0.02  # of sheets the model may not hold at all


@dataclass(frozen=True, eq=False)
class Paint:
    """Colours of a sheet's views, cell by cell.

    Attributes:
        lab: (bands, views * CELLS, 3) mean OKLab of the cells, about the band's mean.
        seen: (bands, views * CELLS) 1 where a cell shows something, else 0.
    """

    lab: Float[np.ndarray, "bands cells 3"]
    seen: Float[np.ndarray, "bands cells"]


def read_paint(views: Sequence[View]) -> Paint:
    """Return the colours of a sheet's views, band by band; all views have one scale."""
    factor = HEIGHT_PX / figure_height(views)
    read = [_cells(view, factor) for view in views]
    lab = np.concatenate([mean for mean, _ in read], axis=1)
    seen = np.concatenate([there for _, there in read], axis=1)
    centre = (lab * seen[..., None]).sum(axis=1) / np.maximum(seen.sum(axis=1), 1)[:, None]
    return Paint((lab - centre[:, None]) * seen[..., None], seen)


def paint_log_likelihood(
    paint: Paint, yaws: Float[np.ndarray, "hypotheses views"]
) -> Float[np.ndarray, " hypotheses"]:
    """Return the log-likelihood (nats, relative to the best) of every row of yaws (radians).

    The rows should hold all that is possible: 1 / BROKEN is the most that one is preferred by.
    """
    evidence = paint_evidence(paint, yaws)
    relative = np.exp(evidence - evidence.max(initial=-np.inf))
    return np.log((1 - BROKEN) * relative + BROKEN)


def paint_evidence(
    paint: Paint, yaws: Float[np.ndarray, "hypotheses views"]
) -> Float[np.ndarray, " hypotheses"]:
    """Return the rows' log-likelihoods (nats) if the model holds, comparable between calls."""
    rows, place = np.unique(np.asarray(yaws, float), axis=0, return_inverse=True)
    each = np.array([_evidence(paint, row) for row in rows])
    return MEASUREMENTS_PER_VIEW * rows.shape[1] * each[place.reshape(-1)]


def _evidence(paint: Paint, yaws: Float[np.ndarray, " views"]) -> float:
    """Return the log-likelihood per measurement, the mean over bands."""
    across = (np.arange(CELLS) + 0.5) * 2 / CELLS - 1
    longitude = (yaws[:, None] + np.arcsin(across)).ravel()
    waves, variance = _series(longitude)
    counts = paint.seen.sum(axis=1)
    bands = counts > len(variance) / 2  # fewer cells than that say nothing
    if not bands.any():
        return 0.0
    seen, lab, counts = paint.seen[bands], paint.lab[bands], counts[bands]
    gram = np.einsum("bc,ci,cj->bij", seen, waves, waves)
    posterior = gram + np.diag(1 / variance)
    moments = np.einsum("ci,bcx->bix", waves, lab)
    explained = (moments * np.linalg.solve(posterior, moments)).sum(axis=(1, 2))
    unexplained = ((lab**2).sum(axis=(1, 2)) - explained) / (3 * counts)
    spread = np.linalg.slogdet(posterior)[1] + np.log(variance).sum()
    return float(-0.5 * np.mean(np.log(unexplained + NOISE * FAINTEST**2) + spread / counts))


def _series(
    longitude: Float[np.ndarray, " cells"],
) -> tuple[Float[np.ndarray, "cells waves"], Float[np.ndarray, " waves"]]:
    """Return constant, cosines and sines at the longitudes, and their variances over the noise's.

    exp(k (cos d - 1)) = e^-k (I_0(k) + 2 sum_n I_n(k) cos(n d)): a Fourier series with these
    variances has a von Mises kernel, here between mirrored longitudes as well.
    """
    orders = np.arange(1, ORDER + 1)
    angles = longitude[:, None] * orders
    waves = np.concatenate([np.ones((len(angles), 1)), np.cos(angles), np.sin(angles)], axis=1)
    power = 2 * bessel(orders, SMOOTHNESS)
    unknown_mean = np.array([100.0])
    return waves, np.concatenate([unknown_mean, power, ASYMMETRY * power]) / NOISE


def bessel(orders: Int[np.ndarray, " n"], k: float) -> Float[np.ndarray, " n"]:
    """Return exp(-k) I_n(k): the mean of exp(k (cos t - 1)) cos(n t) over the circle."""
    return (np.exp(k * (np.cos(CIRCLE) - 1)) * np.cos(orders[:, None] * CIRCLE)).mean(axis=-1)


def _cells(
    view: View, factor: float
) -> tuple[Float[np.ndarray, "bands cells 3"], Float[np.ndarray, "bands cells"]]:
    """Return the mean OKLab of a view's cells and which of them show enough."""
    sections = read_sections(view, factor, RIM_PX, HEIGHT_PX)
    bands = HEIGHT_PX // BAND_PX
    row, column = np.nonzero(sections.inside)
    cell = ((sections.across[row, column] + 1) / 2 * CELLS).astype(int).clip(0, CELLS - 1)
    at = np.minimum(row // BAND_PX, bands - 1) * CELLS + cell
    count = np.bincount(at, minlength=bands * CELLS)
    sums = [np.bincount(at, c, bands * CELLS) for c in sections.lab[row, column].T]
    mean = np.stack(sums, axis=-1) / np.maximum(count, 1)[:, None]
    seen = (count >= LEAST_PIXELS).astype(np.float64)
    return mean.reshape(bands, CELLS, 3), seen.reshape(bands, CELLS)
