"""Select a view's camera model and its outlying landmark pairs by their likelihood.

The orthographic camera on all pairs is the first explanation. It is extended, one step at a time
and as long as that pays, by what explains the pixels best: perspective (one more number), or a
pair given up as misplaced (two numbers, its own shift). An extension that leaves f degrees of
freedom gains

    f log(RSS before / RSS after) - cost,

which is BIC's gain with the freedom that is left in place of all 2n coordinates: with few pairs a
small residual proves little. For a pair given up the first term is -2 log of the F test's p-value
exactly.

Source: misplaced points as mean shifts, one deletion at a time: Cook and Weisberg, Residuals and
Influence in Regression (1982), section 2.2.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from toonset.calib.fit.landmark_pose import (
    Pixels,
    Points,
    depth_reversed,
    on_a_line,
    orthographic_starts,
    pinhole_starts,
    refined,
    squared_error,
)
from toonset.calib.outline.pose import PARAMETERS, Pose
from toonset.camera import rotation_distance

MARGIN = 6.0  # "strong" evidence (Kass and Raftery 1995), as for outlines
MISPLACED = 2 * float(np.log(100))  # a pair is given up at 1 % significance over all pairs
LEAST_KEPT = 5  # pairs; fewer cannot tell which of them is wrong
LEAST_FOR_PERSPECTIVE = 4  # pairs; seven unknowns
ROUNDING_PX = 1e-3  # no pixel is given more exactly; keeps noise-free ratios finite
SAME_POSE = np.radians(1.0)
Kept = Bool[np.ndarray, " n"]


@dataclass(frozen=True, eq=False)
class Explanation:
    """The optima of one camera model on some pairs.

    Attributes:
        poses: distinct, best first.
        errors: squared pixel error of each, with what rounding adds.
        pairs: how many.
        perspective: free k; else k = 0.
    """

    poses: tuple[Pose, ...]
    errors: tuple[float, ...]
    pairs: int
    perspective: bool

    @property
    def freedom(self) -> int:
        """Return the degrees of freedom that are left."""
        return 2 * self.pairs - PARAMETERS - self.perspective

    def gain_over(self, simpler: Explanation) -> float:
        """Return the gain in fit, before its cost; see the module docstring."""
        return self.freedom * float(np.log(simpler.errors[0] / self.errors[0]))


def choose(points: Points, pixels: Pixels) -> tuple[Kept, Explanation, float]:
    """Return which pairs are kept, their explanation, and BIC's gain by perspective.

    Args:
        points: at least three, not on a line, relative to the surface's middle.
        pixels: where they appear.
    """
    kept = _kept_pairs(points, pixels)
    flat = explain(points[kept], pixels[kept], perspective=False)
    deep = _with_perspective(points[kept], pixels[kept])
    if deep is None:
        return kept, flat, 0.0
    gain = deep.gain_over(flat) - _perspective_cost(flat)
    return kept, deep if gain > MARGIN else flat, gain


def explain(points: Points, pixels: Pixels, *, perspective: bool) -> Explanation:
    """Return all optima of a model."""
    flat = _settled(points, pixels, orthographic_starts(points, pixels), perspective=False)
    starts = [*flat.poses, depth_reversed(flat.poses[0], points)]
    if perspective:
        starts += pinhole_starts(points, pixels, flat.poses[0])
    return _settled(points, pixels, starts, perspective=perspective)


def _kept_pairs(points: Points, pixels: Pixels) -> Kept:
    """Return which pairs are kept; perspective is weighed as an explanation of errors, too."""
    kept = np.ones(len(points), dtype=bool)
    current = explain(points, pixels, perspective=False)
    while True:
        offers = [(0.0, kept, current)]
        deep = None if current.perspective else _with_perspective(points[kept], pixels[kept])
        if deep is not None:
            cost = MARGIN + _perspective_cost(current)
            offers.append((deep.gain_over(current) - cost, kept, deep))
        cost = MISPLACED + 2 * float(np.log(current.pairs))
        for fewer, without in _one_fewer(points, pixels, kept, current):
            offers.append((without.gain_over(current) - cost, fewer, without))
        gain, kept, current = max(offers, key=lambda offer: offer[0])
        if gain == 0:
            return kept


def _one_fewer(
    points: Points, pixels: Pixels, kept: Kept, current: Explanation
) -> Iterator[tuple[Kept, Explanation]]:
    """Yield the explanations without each of the pairs that are kept."""
    for index in np.flatnonzero(kept) if current.pairs > LEAST_KEPT else ():
        fewer = kept & (np.arange(len(points)) != index)
        if on_a_line(points[fewer]):
            continue
        own, seen = points[fewer], pixels[fewer]
        fresh = min(orthographic_starts(own, seen), key=lambda p: squared_error(p, own, seen))
        starts = [current.poses[0], fresh]
        yield fewer, _settled(own, seen, starts, perspective=current.perspective)


def _with_perspective(points: Points, pixels: Pixels) -> Explanation | None:
    if len(points) < LEAST_FOR_PERSPECTIVE:
        return None
    return explain(points, pixels, perspective=True)


def _perspective_cost(flat: Explanation) -> float:
    return float(np.log(2 * flat.pairs))


def _settled(
    points: Points, pixels: Pixels, starts: Sequence[Pose], *, perspective: bool
) -> Explanation:
    """Return the distinct optima that refinement reaches from `starts`, best first."""
    floor = 2 * len(points) * ROUNDING_PX**2
    ends = [refined(start, points, pixels, perspective=perspective) for start in starts]
    ranked = sorted(
        ((squared_error(end, points, pixels) + floor, end) for end in ends), key=lambda e: e[0]
    )
    distinct: list[tuple[float, Pose]] = []
    for error, pose in ranked:
        turns = (rotation_distance(pose.rotation, other.rotation) for _, other in distinct)
        if all(turn > SAME_POSE for turn in turns):
            distinct.append((error, pose))
    errors, poses = zip(*distinct, strict=True)
    return Explanation(poses, errors, len(points), perspective)
