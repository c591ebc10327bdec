"""Turns that are no even ring: every view's yaw from outlines and paint.

Coordinate ascent from several starts: outlines alone know uneven yaws to 13 degrees (five views,
six characters), with the paint that moves as the body turns to 7 (docs/decisions.md).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from toonset.calib.evidence.texture import Paint, paint_evidence
from toonset.calib.without_body.placing import (
    Figures,
    coherence_log_likelihood,
    elevation_log_prior,
)

STARTS = 4  # even, and three that are not
STEPS = np.radians([24.0, 12.0, 6.0, 3.0])
SWEEPS = 4  # at most, of every step
PAINT = 0.3  # of its nats: the body is no stack of cylinders, and yaws follow its every error
LEAST_GAP, GAP_SIGMA = np.radians(25.0), np.radians(5.0)  # nobody draws one direction twice
TILT = np.radians(4.0)  # step of the elevation
FIRST_TILT, MOST_TILT = np.radians(10.0), np.radians(45.0)
ROUGH = 0.004  # of the height: outlines whose places are not fitted are this far apart
CONCENTRATION = 4.0  # of the starts' gaps about even ones


def uneven_yaws(figures: Figures, paint: Paint) -> tuple[Float[np.ndarray, " views"], float]:
    """Return the yaws under which outlines and paint agree best, the first 0, and their gain.

    The gain is in nats, over the even ring that runs to the same side.
    """
    views = len(figures.views)
    rng = np.random.default_rng(0)
    even = np.full(views, 2 * np.pi / views)
    gaps = [even, *(2 * np.pi * rng.dirichlet(np.full(views, CONCENTRATION), STARTS - 1))]
    best, begun = (-np.inf, np.zeros(views)), []
    for way in (1, -1):
        for gap in gaps:
            start = way * np.concatenate([[0.0], np.cumsum(gap)[:-1]])
            first, found = _climbed(figures, paint, start)
            begun.append(first if gap is even else -np.inf)
            best = max(best, found, key=lambda pair: pair[0])
    return best[1], float(best[0] - max(begun))


def _climbed(
    figures: Figures, paint: Paint, start: Float[np.ndarray, " views"]
) -> tuple[float, tuple[float, Float[np.ndarray, " views"]]]:
    """Return the worth of a start, and the worth and yaws that it leads to."""
    yaws, tilt = start, float(FIRST_TILT)
    best = _worth(figures, paint, yaws, tilt)
    for step in STEPS:
        for _ in range(SWEEPS):
            before = best
            for view in range(1, len(yaws)):
                for move in (-step, step):
                    other = yaws.copy()
                    other[view] += move
                    worth = _worth(figures, paint, other, tilt)
                    if worth > best:
                        best, yaws = worth, other
            for move in (-TILT, TILT):
                if 0 <= tilt + move <= MOST_TILT:
                    worth = _worth(figures, paint, yaws, tilt + move)
                    if worth > best:
                        best, tilt = worth, tilt + move
            if best <= before:
                break
    return _worth_at_best_tilt(figures, paint, start), (best, yaws)


def _worth_at_best_tilt(figures: Figures, paint: Paint, yaws: Float[np.ndarray, " views"]) -> float:
    tilts = np.arange(0.0, MOST_TILT, 2 * TILT)
    return max(_worth(figures, paint, yaws, float(tilt)) for tilt in tilts)


def _worth(figures: Figures, paint: Paint, yaws: Float[np.ndarray, " views"], tilt: float) -> float:
    apart = figures.contradiction(figures.cameras(yaws, tilt))
    outlines = coherence_log_likelihood(np.array([apart]), len(yaws), ROUGH)
    around = np.sort(yaws % (2 * np.pi))
    gaps = np.diff(np.append(around, around[0] + 2 * np.pi))
    crowded = np.square(np.maximum(LEAST_GAP - gaps, 0) / GAP_SIGMA).sum()
    tilted = elevation_log_prior(np.array([tilt]))
    return float(
        outlines[0] + tilted[0] - 0.5 * crowded + PAINT * paint_evidence(paint, yaws[None])[0]
    )
