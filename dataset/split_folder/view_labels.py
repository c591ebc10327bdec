"""Parse view labels: `front,3q,side,back`, yaws in degrees, or "?" for unknown."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from jaxtyping import Float

from toonset.errors import SheetError, did_you_mean

Label = tuple[float, ...]  # possible yaws in radians; empty where nothing is said

_QUARTER, _SIDE, _BACK_QUARTER = (45.0, 315.0), (90.0, 270.0), (135.0, 225.0)
NAMES: dict[str, tuple[float, ...]] = {  # degrees; at 90 the character faces the left edge
    **dict.fromkeys(("front", "f", "face", "0q"), (0.0,)),
    **dict.fromkeys(("back", "b", "rear", "behind"), (180.0,)),
    **dict.fromkeys(("side", "profile", "s"), _SIDE),
    **dict.fromkeys(("left", "l", "side-left", "left-side", "profile-left"), (90.0,)),
    **dict.fromkeys(("right", "r", "side-right", "right-side", "profile-right"), (270.0,)),
    **dict.fromkeys(
        ("3q", "3/4", "34", "quarter", "three-quarter", "3q-front", "front-3q"), _QUARTER
    ),
    **dict.fromkeys(("3q-left", "left-3q", "front-left", "fl", "3ql"), (45.0,)),
    **dict.fromkeys(("3q-right", "right-3q", "front-right", "fr", "3qr"), (315.0,)),
    **dict.fromkeys(("3q-back", "back-3q", "back-quarter", "rear-3q", "bq"), _BACK_QUARTER),
    **dict.fromkeys(("back-left", "left-back", "rear-left", "bl"), (135.0,)),
    **dict.fromkeys(("back-right", "right-back", "rear-right", "br"), (225.0,)),
    **dict.fromkeys(("?", "-", "unknown", ""), ()),
}
SAME_DIRECTION = 10.0  # odds of a sheet that turns one way to one that does not
TWICE_THE_SAME = 0.1  # odds of a sheet that shows a direction again
MOST_ROWS = 256


def parse_labels(text: str, views: int) -> tuple[Label, ...]:
    """Return every view's possible yaws from a list such as "front,3q,side,back" or "0,45,90,180".

    Args:
        text: one entry per view in sheet order, separated by commas.
        views: number of views of the sheet.

    Raises:
        SheetError: a name that is not known, or not one entry per view.
    """
    entries = [
        entry.strip().lower().replace("_", "-").replace(" ", "-") for entry in text.split(",")
    ]
    if len(entries) != views:
        raise SheetError(
            f"--views: {len(entries)} labels for {views} views; give one per view in sheet order, "
            '"?" where you do not know'
        )
    return tuple(_label(entry) for entry in entries)


def front_label(number: int, views: int) -> str:
    """Return the labels of a sheet of which only the front is known.

    Args:
        number: of the view that shows the front, from 0 as in overlay.png.
        views: number of views of the sheet.

    Raises:
        SheetError: there is no such view.
    """
    if number not in range(views):
        raise SheetError(f"--front {number}: the views are numbered 0 to {views - 1}; give one")
    return ",".join("front" if i == number else "?" for i in range(views))


def label_rows(
    labels: tuple[Label, ...],
) -> tuple[Float[np.ndarray, "rows views"], Float[np.ndarray, " rows"]]:
    """Return every reading of the labels (yaws, nan where unknown) and its log probability.

    "side" is either side; readings that turn one way and show no direction twice are likelier.
    """
    choices: list[Label] = [label or (math.nan,) for label in labels]
    total = math.prod(len(choice) for choice in choices)
    while total > MOST_ROWS:  # too many open sides: leave the last of them to the outlines
        last = max(i for i, choice in enumerate(choices) if len(choice) > 1)
        total //= len(choices[last])
        choices[last] = (math.nan,)
    rows = np.array(list(product(*choices)))
    log_odds = np.array([_log_odds(row[np.isfinite(row)]) for row in rows])
    return rows, log_odds - np.log(np.exp(log_odds).sum())


def _label(entry: str) -> Label:
    if entry in NAMES:
        return tuple(math.radians(yaw) for yaw in NAMES[entry])
    try:
        yaw = float(entry.removesuffix("deg"))
    except ValueError:
        yaw = math.nan
    if not math.isfinite(yaw):
        near = did_you_mean(entry, (name for name in NAMES if len(name) > 1))
        hint = f"{near} " if near else ""
        raise SheetError(
            f"--views: {entry!r} is no direction; {hint}use front, 3q, side, back, left, right, "
            '3q-left, back-right ..., a yaw in degrees, or "?"'
        )
    return (math.radians(yaw) % (2 * math.pi),)


def _log_odds(row: Float[np.ndarray, " n"]) -> float:
    if len(row) < 2:
        return 0.0
    steps = np.diff(row) % (2 * np.pi)
    one_way = any(s.sum() < 2 * np.pi - 1e-6 for s in (steps, (2 * np.pi - steps) % (2 * np.pi)))
    apart = np.abs((row[:, None] - row + np.pi) % (2 * np.pi) - np.pi)
    again = (np.triu(apart < 1e-6, 1)).sum()
    return float(one_way * np.log(SAME_DIRECTION) + again * np.log(TWICE_THE_SAME))
