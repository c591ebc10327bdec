"""Fit closed contours by cubic Bézier curves, all of a picture at once.

A segment between two knots of a contour is the least-squares cubic with the contour's own tangents
at its ends; one that lies farther off than the tolerance is divided where it is farthest off. Knots
are the corners first. All segments of a round are fitted together, as sums over their points.
Before, a contour is smoothed without shrinking: steps of pixels are no shape.

Sources: Schneider, "An Algorithm for Automatically Fitting Digitized Curves", Graphics Gems, 1990;
Taubin, "Curve and surface smoothing without shrinkage", 1995.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

SPACING_PX = 0.75  # of a contour's points
REACH = 3  # points to either side that a tangent is measured over
CORNER = np.cos(np.deg2rad(50))  # of the angle that a contour turns by at a corner, or more
ROUNDS = 2  # of moving every point's parameter to the nearest place of the curve
SMOOTHING = 3 * (0.5, -0.53)  # share of the way to the middle of the neighbours, and back
TINY = 1e-9

Points = Float[np.ndarray, "n 2"]
Curve = Float[np.ndarray, "segments 3 2"]


@dataclass(frozen=True, eq=False)
class _Contours:
    """Points of all contours, one after another, each with its first point again at its end.

    Attributes:
        at: (n, 2) places.
        ahead, behind: (n, 2) unit tangents of the segments that begin and end at a point.
        along: (n,) length up to a point.
    """

    at: Points
    ahead: Points
    behind: Points
    along: Float[np.ndarray, " n"]


def fit_closed(contours: Sequence[Points], tolerance: float) -> list[Curve]:
    """Return closed curves: per segment its two handles and its end; the last end is the start.

    Args:
        contours: closed, without their first point again, three points or more.
        tolerance: how far a curve may be off its contour, pixels.
    """
    if not contours:
        return []
    parts, first, knots = [], 0, []
    for points in contours:
        part, own = _measured(_spaced(points))
        parts.append(part)
        knots.append(np.stack([own[:-1], own[1:]]) + first)
        first += len(part.at)
    every = _Contours(
        *(
            np.concatenate([getattr(one, name) for one in parts])
            for name in _Contours.__annotations__
        )
    )
    starts, curves = _fitted(every, np.concatenate(knots, axis=1), tolerance)
    order = np.argsort(starts, kind="stable")
    ends = np.cumsum([len(one.at) for one in parts])
    return np.split(curves[order], np.searchsorted(starts[order], ends[:-1]))


def flattened(curve: Curve, steps: int = 8) -> Points:
    """Return points along a closed curve, `steps` to a segment."""
    start = np.roll(curve[:, 2], 1, axis=0)
    cubic = np.stack([start, curve[:, 0], curve[:, 1], curve[:, 2]])
    t = np.arange(steps) / steps
    return np.einsum("tk,ksc->stc", _bernstein(t).T, cubic).reshape(-1, 2)


def _spaced(points: Points) -> Points:
    """Return a closed contour in even steps."""
    closed = np.concatenate([points, points[:1]])
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    count = max(8, round(float(along[-1]) / SPACING_PX))
    where = np.arange(count) * (along[-1] / count)
    return np.stack([np.interp(where, along, closed[:, axis]) for axis in (0, 1)], axis=1)


def _measured(points: Points) -> tuple[_Contours, Int[np.ndarray, " knots"]]:
    """Return a contour from a knot to the same knot, with tangents; and its knots."""
    reach = min(REACH, len(points) // 4)
    before, after = (np.roll(points, by, axis=0) for by in (reach, -reach))
    into, out, through = (_unit(way) for way in (points - before, after - points, after - before))
    turn = (into * out).sum(axis=1)
    around = np.stack([np.roll(turn, by) for by in range(-reach, reach + 1)])
    corner = (turn < CORNER) & (turn <= around.min(axis=0))
    points = _smoothed(points, corner)
    before, after = (np.roll(points, by, axis=0) for by in (reach, -reach))
    into, out, through = (_unit(way) for way in (points - before, after - points, after - before))
    found = np.flatnonzero(corner)
    if len(found) < 2:
        first = int(found[0]) if len(found) else 0
        away = np.square(points - points[first]).sum(axis=1)
        found = np.array([first, int(away.argmax())])
    order = np.append(np.roll(np.arange(len(points)), -int(found.min())), found.min())
    ahead = np.where(corner[:, None], out, through)[order]
    behind = np.where(corner[:, None], into, through)[order]
    at = points[order]
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(at, axis=0), axis=1))])
    knots = np.append(np.sort(found) - found.min(), len(points))
    return _Contours(at, ahead, behind, along), knots


def _smoothed(points: Points, corner: Bool[np.ndarray, " n"]) -> Points:
    """Return a contour without the steps of pixels; corners stay, and it does not shrink."""
    for by in SMOOTHING:
        middle = (np.roll(points, 1, axis=0) + np.roll(points, -1, axis=0)) / 2
        points = np.where(corner[:, None], points, points + by * (middle - points))
    return points


def _fitted(
    contours: _Contours, spans: Int[np.ndarray, "2 segments"], tolerance: float
) -> tuple[Int[np.ndarray, " all"], Curve]:
    """Return first points and curves of all segments, divided until they are near enough."""
    starts, curves = [], []
    while spans.shape[1]:
        cubic, off, worst = _fit_round(contours, spans)
        done = (off <= tolerance) | (spans[1] - spans[0] < 2)
        starts.append(spans[0, done])
        curves.append(cubic[done, 1:])
        first, last, at = spans[0, ~done], spans[1, ~done], worst[~done]
        spans = np.concatenate([np.stack([first, at]), np.stack([at, last])], axis=1)
    return np.concatenate(starts), np.concatenate(curves)


def _fit_round(
    contours: _Contours, spans: Int[np.ndarray, "2 segments"]
) -> tuple[
    Float[np.ndarray, "segments 4 2"], Float[np.ndarray, " segments"], Int[np.ndarray, " s"]
]:
    """Return the cubic of every segment, how far it is off, and its point farthest off."""
    first, last = spans
    counts = last - first + 1
    begins = np.cumsum(counts) - counts
    segment = np.repeat(np.arange(len(counts)), counts)
    index = np.arange(len(segment)) - np.repeat(begins - first, counts)
    at = contours.at[index]
    whole = np.maximum(contours.along[last] - contours.along[first], TINY)
    t = (contours.along[index] - contours.along[first][segment]) / whole[segment]
    ends = contours.at[first], contours.at[last]
    tangents = contours.ahead[first], -contours.behind[last]
    cubic = _least_squares(at, t, segment, ends, tangents, whole)
    for _ in range(ROUNDS):
        t = _nearer(cubic[segment], at, t)
        cubic = _least_squares(at, t, segment, ends, tangents, whole)
    off = np.square(_points(cubic[segment], t) - at).sum(axis=1)
    worst = np.maximum.reduceat(off, begins)
    is_worst = np.flatnonzero(off >= worst[segment])
    where = index[is_worst[np.searchsorted(segment[is_worst], np.arange(len(counts)))]]
    inner = np.clip(where, first + 1, np.maximum(last - 1, first + 1))
    return cubic, np.sqrt(worst), inner


def _least_squares(
    at: Points,
    t: Float[np.ndarray, " n"],
    segment: Int[np.ndarray, " n"],
    ends: tuple[Points, Points],
    tangents: tuple[Points, Points],
    whole: Float[np.ndarray, " segments"],
) -> Float[np.ndarray, "segments 4 2"]:
    """Return the cubics whose handles lie on the tangents, nearest to the points."""
    count = len(whole)
    basis = _bernstein(t)
    base = (basis[0] + basis[1])[:, None] * ends[0][segment]
    base += (basis[2] + basis[3])[:, None] * ends[1][segment]
    ways = basis[1][:, None] * tangents[0][segment], basis[2][:, None] * tangents[1][segment]

    def total(a: Points, b: Points) -> Float[np.ndarray, " segments"]:
        return np.bincount(segment, (a * b).sum(axis=1), count)

    aa, ab, bb = total(ways[0], ways[0]), total(ways[0], ways[1]), total(ways[1], ways[1])
    ax, bx = total(ways[0], at - base), total(ways[1], at - base)
    scale = aa * bb - ab * ab
    fine = scale > TINY * np.maximum(aa * bb, TINY)
    safe = np.where(fine, scale, 1)
    third = whole / 3
    lengths = [(ax * bb - bx * ab) / safe, (bx * aa - ax * ab) / safe]
    good = fine & (np.minimum(*lengths) > 0.01 * whole) & (np.maximum(*lengths) < whole)
    handles = [
        end + np.where(good, length, third)[:, None] * way
        for end, length, way in zip(ends, lengths, tangents, strict=True)
    ]
    return np.stack([ends[0], *handles, ends[1]], axis=1)


def _nearer(
    cubic: Float[np.ndarray, "n 4 2"], at: Points, t: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Return parameters after one Newton step to the nearest place of the curve."""
    speed = 3 * np.diff(cubic, axis=1)
    bend = 2 * np.diff(speed, axis=1)
    s = 1 - t
    way = _points(cubic, t) - at
    first = (
        (s * s)[:, None] * speed[:, 0]
        + (2 * s * t)[:, None] * speed[:, 1]
        + (t * t)[:, None] * speed[:, 2]
    )
    second = s[:, None] * bend[:, 0] + t[:, None] * bend[:, 1]
    slope = (first * first).sum(axis=1) + (way * second).sum(axis=1)
    step = np.where(slope > TINY, (way * first).sum(axis=1) / np.where(slope > TINY, slope, 1), 0)
    moved = np.clip(t - step, 0, 1)
    return np.where((t > 0) & (t < 1), moved, t)


def _points(cubic: Float[np.ndarray, "n 4 2"], t: Float[np.ndarray, " n"]) -> Points:
    return np.asarray(np.einsum("kn,nkc->nc", _bernstein(t), cubic))


def _bernstein(t: Float[np.ndarray, " n"]) -> Float[np.ndarray, "4 n"]:
    s = 1 - t
    return np.stack([s**3, 3 * s * s * t, 3 * s * t * t, t**3])


def _unit(way: Points) -> Points:
    return way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), TINY)
