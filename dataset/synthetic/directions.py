"""Say from which directions the drawings of a sheet are seen. Imports nothing heavy.

`even` goes all round from the front on, as turnarounds for modellers do; `between` lies half way
between even steps, where a sheet of as many drawings shows nothing; `half` is what most sheets of
artists have: front, side and back, a view in between, and the other side last, if at all.
"""

from __future__ import annotations

from typing import Literal

Turn = Literal["even", "between", "half"]

HALF_TURNS: dict[int, tuple[float, ...]] = {  # degrees, by the number of drawings
    1: (0,),
    2: (0, 180),
    3: (0, 90, 180),
    4: (0, 45, 90, 180),
    5: (0, 45, 90, 135, 180),
    6: (0, 45, 90, 135, 180, 270),
    7: (0, 45, 90, 135, 180, 270, 315),
    8: (0, 45, 90, 135, 180, 225, 270, 315),
}
MOST_OF_HALF = max(HALF_TURNS)


def directions_deg(turn: Turn, views: int) -> tuple[float, ...]:
    """Return the yaws in degrees that the drawings of a sheet are meant to have, in sheet order.

    Args:
        turn: see the module.
        views: drawings; `half` has MOST_OF_HALF at most.
    """
    if turn == "half":
        return HALF_TURNS[views]
    first = 0.5 if turn == "between" else 0.0
    return tuple((first + i) * (360 / views) for i in range(views))
