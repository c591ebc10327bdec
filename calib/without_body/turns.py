"""List the turns that a sheet's views may show, with their prior.

A turn is a pattern of steps, where it starts and which way round it goes. Before anything is
looked at, a sheet of four or more is probably an even ring, starts at the front and runs to the
character's left, read from the left; labels that a person gave count for more than all of that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.dataset.split_folder.view_labels import Label, label_rows

STARTS = 8  # in a circle
P_EVEN = 0.9  # that four views or more are an even ring
P_FRONT_FIRST = 0.5  # the other starts share the rest
P_LEFT = 0.7  # that views run to the character's left
P_FROM_RIGHT = 0.1  # that a sheet is to be read from the right
P_LABEL_WRONG = 0.01  # of each label
P_AS_LABELLED = 0.5  # that views labelled one and all are seen from just there
NEAR = np.radians(22.5)  # half of what neighbouring directions lie apart
FEW: dict[int, tuple[tuple[float, ...], ...]] = {  # degrees
    1: ((0,),),
    2: ((0, 90), (0, 180), (0, 45)),
    3: ((0, 90, 180), (0, 45, 90), (0, 45, 180), (0, 120, 240)),
    4: ((0, 45, 90, 180),),
    5: ((0, 45, 90, 135, 180),),
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


def turn_hypotheses(views: int, labels: Sequence[Label] = ()) -> TurnHypotheses:
    """Return the turns that `views` drawings may be, with their log probabilities.

    Args:
        views: their number.
        labels: possible yaws of every view, radians; empty where nothing is said.
    """
    patterns = [np.radians(steps) for steps in FEW.get(views, ())]
    shares = np.full(len(patterns), 1.0 / max(len(patterns), 1))
    if views >= 4:
        ring = np.arange(views) * 2 * np.pi / views
        shares = np.append(P_EVEN, (1 - P_EVEN) * shares) if patterns else np.ones(1)
        patterns = [ring, *patterns]
    yaws, odds = [], []
    for steps, share in zip(patterns, shares, strict=True):
        for way, p_way in ((1, P_LEFT), (-1, 1 - P_LEFT)):
            for start in range(STARTS):
                p_start = P_FRONT_FIRST if start == 0 else (1 - P_FRONT_FIRST) / (STARTS - 1)
                turn = start * 2 * np.pi / STARTS + way * steps
                yaws += [turn, turn[::-1]]
                odds += [share * p_way * p_start * p for p in (1 - P_FROM_RIGHT, P_FROM_RIGHT)]
    found = _distinct(np.array(yaws), np.array(odds))
    return labelled(found, labels) if any(labels) else found


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
    return TurnHypotheses(
        np.concatenate([turns.yaws, rows]),
        np.concatenate([log_prior, odds]),
        np.concatenate([turns.pattern, own]),
    )


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
