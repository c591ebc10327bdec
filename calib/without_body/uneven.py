"""Estimate every view's yaw where a turn is not evenly spaced, from outlines and paint.

Coordinate ascent from several starts: outlines alone know uneven yaws to 13 degrees (five views,
six characters), with the paint that moves as the body turns to 7 (docs/decisions.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.calib.evidence.texture import Paint, paint_evidence
from toonset.calib.fit.tilt import elevation_log_prior
from toonset.calib.without_body.placing import Figures, coherence_log_likelihood
from toonset.dataset.silhouettes.turned_rays import TurnedRays

STARTS = 4  # even, and three that are not
STEPS = np.radians([24.0, 12.0, 6.0, 3.0])
SWEEPS = 4  # at most, of every step
PAINT = 0.3  # of its nats: the body is not a stack of cylinders, and yaws follow its every error
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


@dataclass(frozen=True, eq=False)
class _Stand:
    """Yaws of the views, and their evidence.

    Attributes:
        yaws: radians.
        tilt: elevation of all views, radians.
        rays: the outlines' under these cameras.
        worth: log-likelihood of the whole, nats.
    """

    yaws: Float[np.ndarray, " views"]
    tilt: float
    rays: TurnedRays
    worth: float

    @classmethod
    def of(
        cls, figures: Figures, paint: Paint, yaws: Float[np.ndarray, " views"], tilt: float
    ) -> _Stand:
        """Weigh yaws."""
        rays = figures.rays(figures.cameras(yaws, tilt))
        return cls(yaws, tilt, rays, _worth(rays, paint, yaws, tilt))

    def turned(self, figures: Figures, paint: Paint, view: int, by: float) -> _Stand:
        """Weigh the yaws with one view turned."""
        yaws = self.yaws.copy()
        yaws[view] += by
        camera = figures.cameras(yaws, self.tilt)[view]
        rays = self.rays.with_turned(view, figures.silhouettes[view].seen_by(camera))
        return replace(self, yaws=yaws, rays=rays, worth=_worth(rays, paint, yaws, self.tilt))


def _climbed(
    figures: Figures, paint: Paint, start: Float[np.ndarray, " views"]
) -> tuple[float, tuple[float, Float[np.ndarray, " views"]]]:
    """Return the worth of a start, and the worth and yaws that it leads to."""
    best = _Stand.of(figures, paint, start, float(FIRST_TILT))
    for step in STEPS:
        for _ in range(SWEEPS):
            before = best
            for view in range(1, len(start)):
                for move in (-step, step):
                    other = best.turned(figures, paint, view, move)
                    best = max(best, other, key=lambda stand: stand.worth)
            for move in (-TILT, TILT):
                if 0 <= best.tilt + move <= MOST_TILT:
                    other = _Stand.of(figures, paint, best.yaws, best.tilt + move)
                    best = max(best, other, key=lambda stand: stand.worth)
            if best is before:
                break
    return _worth_at_best_tilt(figures, paint, start), (best.worth, best.yaws)


def _worth_at_best_tilt(figures: Figures, paint: Paint, yaws: Float[np.ndarray, " views"]) -> float:
    tilts = np.arange(0.0, MOST_TILT, 2 * TILT)
    return max(_Stand.of(figures, paint, yaws, float(tilt)).worth for tilt in tilts)


def _worth(rays: TurnedRays, paint: Paint, yaws: Float[np.ndarray, " views"], tilt: float) -> float:
    outlines = coherence_log_likelihood(np.array([rays.contradiction()]), len(yaws), ROUGH)
    around = np.sort(yaws % (2 * np.pi))
    gaps = np.diff(np.append(around, around[0] + 2 * np.pi))
    crowded = np.square(np.maximum(LEAST_GAP - gaps, 0) / GAP_SIGMA).sum()
    tilted = elevation_log_prior(np.array([tilt]))
    return float(
        outlines[0] + tilted[0] - 0.5 * crowded + PAINT * paint_evidence(paint, yaws[None])[0]
    )
