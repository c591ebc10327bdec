"""List the turns that a sheet's views may show, with their prior.

A turn is a pattern of yaws, where it starts, which way round it goes and from which side the sheet
is read. Weights of `PATTERNS` follow what collected sheets show; a half turn goes to the left as
often as to the right. Labels that a person gave count for more than all of that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from toonset.dataset.split_folder.view_labels import Label, label_rows
from toonset.view import View

STARTS = 8  # in a circle
P_FRONT_FIRST = 0.85  # that views begin where their pattern does; other starts share the rest
P_LEFT = 0.5  # that views run to the character's left
P_FROM_RIGHT = 0.05  # that a sheet is to be read from the right
P_LABEL_WRONG = 0.01  # of each label
P_AS_LABELLED = 0.5  # that views labelled one and all are seen from just there
P_MISREAD = 0.02  # that all labels are half a turn off; as often mirrored; as often both
P_MISPLACED = 0.005  # that labels were meant for the turn that the drawings speak for
NEAR = np.radians(22.5)  # half of what neighbouring directions lie apart
P_REPEATED = 0.5  # that rows of equal length show the same directions
# Yaws in degrees in sheet order, and their weights: of three and four drawings how many collected
# sheets show them (docs/decisions.md); what is thinkable and was not seen weighs a third or half of
# a sheet; of other numbers a judgement
PATTERNS: dict[int, tuple[tuple[tuple[float, ...], float], ...]] = {
    1: (((0,), 1),),
    2: (((0, 180), 5), ((0, 90), 3), ((0, 45), 1), ((45, 225), 0.5), ((90, 270), 0.5)),
    3: (
        ((0, 90, 180), 10),
        ((90, 0, 180), 0.5),
        ((90, 45, 180), 0.5),
        ((0, 45, 90), 1),
        ((0, 45, 180), 1),
        ((0, 90, 270), 0.5),
        ((0, 180, 90), 0.5),
        ((0, 120, 240), 0.3),
    ),
    4: (
        ((0, 45, 90, 180), 6),
        ((0, 90, 180, 270), 5),
        ((0, 270, 90, 180), 4),
        ((0, 180, 90, 270), 0.5),
        ((0, 45, 315, 180), 0.5),
        ((45, 0, 90, 180), 0.5),
        ((0, 45, 135, 180), 0.5),
        ((0, 45, 180, 225), 0.3),
        ((0, 45, 90, 135), 0.3),
    ),
    5: (
        ((0, 45, 90, 135, 180), 10),
        ((45, 0, 90, 135, 180), 1),
        ((0, 45, 90, 180, 270), 0.3),
        ((0, 72, 144, 216, 288), 0.3),
    ),
    6: (
        ((0, 60, 120, 180, 240, 300), 3),
        ((0, 45, 90, 135, 180, 270), 0.5),
        ((0, 45, 90, 180, 270, 315), 0.5),
    ),
}


@dataclass(frozen=True, eq=False)
class TurnHypotheses:
    """Alternative turns of a sheet, with their prior.

    Attributes:
        yaws: (turns, views) radians.
        log_prior: (turns,) nats.
        pattern: (turns,) turns of one pattern and direction differ by a common yaw only.
    """

    yaws: Float[np.ndarray, "turns views"]
    log_prior: Float[np.ndarray, " turns"]
    pattern: Float[np.ndarray, " turns"]

    def joined(self, other: TurnHypotheses, share: float) -> TurnHypotheses:
        """Return these turns and then the others, which have so much of the probability."""
        return TurnHypotheses(
            np.concatenate([self.yaws, other.yaws]),
            np.concatenate([self.log_prior + np.log(1 - share), other.log_prior + np.log(share)]),
            np.concatenate([self.pattern, self.pattern.max() + 1 + other.pattern]),
        )


def turn_hypotheses(
    views: int, labels: Sequence[Label] = (), in_row: int | None = None
) -> TurnHypotheses:
    """Return the turns that `views` drawings may be, with their log probabilities.

    Args:
        views: their number.
        labels: possible yaws of every view, radians; empty where nothing is said.
        in_row: drawings in every row of the sheet, where there are several such rows.
    """
    yaws, odds = [], []
    for steps, share in _patterns(views, in_row):
        for way, p_way in ((1, P_LEFT), (-1, 1 - P_LEFT)):
            for start in range(STARTS):
                p_start = P_FRONT_FIRST if start == 0 else (1 - P_FRONT_FIRST) / (STARTS - 1)
                turn = start * 2 * np.pi / STARTS + way * steps
                yaws += [turn, turn[::-1]]
                odds += [share * p_way * p_start * p for p in (1 - P_FROM_RIGHT, P_FROM_RIGHT)]
    found = _distinct(np.array(yaws), np.array(odds))
    return labelled(found, labels) if any(labels) else found


def views_in_row(views: Sequence[View]) -> int | None:
    """Return how many views stand in every row of the sheet; None: one row, or unequal ones.

    A view begins a row where its box lies left of the box before it and below its middle.
    """
    boxes = [view.box for view in views]
    begins = [0] + [
        i
        for i, (last, own) in enumerate(pairwise(boxes), 1)
        if own[0] < last[0] and own[1] > last[1] + last[3] / 2
    ]
    lengths = set(np.diff([*begins, len(views)]).tolist())
    return lengths.pop() if len(begins) > 1 and len(lengths) == 1 else None


def _patterns(
    views: int, in_row: int | None = None
) -> list[tuple[Float[np.ndarray, " views"], float]]:
    """Return patterns of yaws, radians, with their shares."""
    listed = [(np.radians(steps), float(count)) for steps, count in PATTERNS.get(views, ())]
    if not listed:
        ring = np.arange(views) * 2 * np.pi / views
        listed = [(ring, 0.9), (np.linspace(0, np.pi, views), 0.1)]
    total = sum(count for _, count in listed)
    shares = [(steps, count / total) for steps, count in listed]
    if in_row is None or in_row < 2:
        return shares
    repeated = [(np.tile(s, views // in_row), P_REPEATED * p) for s, p in _patterns(in_row)]
    return repeated + [(steps, (1 - P_REPEATED) * share) for steps, share in shares]


def _distinct(
    yaws: Float[np.ndarray, "turns views"], odds: Float[np.ndarray, " turns"]
) -> TurnHypotheses:
    """Return turns once each, with the sum of their odds."""
    degrees = np.round(np.degrees(yaws)) % 360
    _, first, same = np.unique(degrees, axis=0, return_index=True, return_inverse=True)
    relative = (degrees[first] - degrees[first, :1]) % 360
    _, pattern = np.unique(relative, axis=0, return_inverse=True)
    total = np.bincount(same.ravel(), odds)
    return TurnHypotheses(yaws[first], np.log(total), pattern.ravel())


def labelled(turns: TurnHypotheses, labels: Sequence[Label]) -> TurnHypotheses:
    """Return the turns as labels make them likely, and the labels' own readings."""
    log_prior = turns.log_prior + sum(
        np.where(_is_near(turns.yaws[:, i], label), 0.0, np.log(P_LABEL_WRONG))
        for i, label in enumerate(labels)
        if label
    )
    if not all(labels):
        return TurnHypotheses(turns.yaws, log_prior, turns.pattern)
    rows, odds = label_rows(tuple(labels))
    whole = np.isfinite(rows).all(axis=1)
    rows, odds = rows[whole], odds[whole] + np.log(P_AS_LABELLED)
    own = turns.pattern.max() + 1 + np.arange(len(rows))
    read = TurnHypotheses(
        np.concatenate([turns.yaws, rows]),
        np.concatenate([log_prior, odds]),
        np.concatenate([turns.pattern, own]),
    )
    return _with_misread(read, len(labels)) if len(rows) == 1 else read


def _with_misread(turns: TurnHypotheses, labels: int) -> TurnHypotheses:
    """Return the turns with what their last is, misread; too unlikely to be chosen."""
    last = turns.pattern[-1]  # half a turn off, its outlines are the same
    return TurnHypotheses(
        np.concatenate([turns.yaws, misread(turns.yaws[-1])]),
        np.concatenate([turns.log_prior, np.full(3, labels * np.log(P_LABEL_WRONG))]),
        np.concatenate([turns.pattern, [last, last + 1, last + 1]]),
    )


def misread(yaws: Float[np.ndarray, " views"]) -> Float[np.ndarray, "3 views"]:
    """Return what a turn is if its labels are half a turn off, mirrored, or both."""
    return np.stack([yaws + np.pi, -yaws, np.pi - yaws])


def held(
    turns: TurnHypotheses, asked: Float[np.ndarray, " views"], kept: Float[np.ndarray, " views"]
) -> TurnHypotheses:
    """Return the turns with the views where a person put them.

    An even ring stays even but for its locked views: a camera is dragged less exactly than artists
    divide a circle.

    Args:
        turns: alternatives.
        asked: yaws at which a person put views, radians; nan elsewhere.
        kept: those that are locked.
    """
    if not np.isfinite(asked).any():
        return turns
    even = np.array([is_even(row) for row in turns.yaws])[:, None]
    there = np.where(even, kept, asked)
    return replace(turns, yaws=np.where(np.isfinite(there), there, turns.yaws))


def _is_near(yaws: Float[np.ndarray, " turns"], label: Label) -> np.ndarray:
    return np.min([np.abs(wrapped(yaws - yaw)) for yaw in label], axis=0) <= NEAR


def wrapped(angles: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return angles in [-pi, pi)."""
    return (angles + np.pi) % (2 * np.pi) - np.pi


def is_even(yaws: Float[np.ndarray, " views"]) -> bool:
    """Return whether four yaws or more, in their order, are an even ring."""
    steps = wrapped(np.diff(np.append(yaws, yaws[0])))
    one_way = np.allclose(steps, steps[0], atol=1e-6)
    return len(yaws) >= 4 and one_way and bool(np.isclose(abs(steps[0]), 2 * np.pi / len(yaws)))
