"""Find distinct seams of least cost from the top to the bottom of a picture.

A way may run along a row as far as it likes but never turns back up: least costs follow row by row,
as in seam carving with steps of any length.
Source: S. Avidan, A. Shamir, "Seam carving for content-aware image resizing" (2007).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

DETOUR = 0.02  # cost of a step aside, in pixels of paint
ROUNDS = 4  # times that the ways found so far are made dearer
DEARER = 1.0  # cost added to the paint that an earlier way crossed
AROUND = 1 / 80  # of the height: so far from an earlier way it is dearer
MOST_WAYS = 5  # of one round, the cheapest
AT_THE_SIDES = 0.08  # of the paint that at least lies to each side in the middle row


@dataclass(frozen=True, eq=False)
class Seam:
    """A way from the top to the bottom.

    Attributes:
        columns: per row the first column that is right of it.
        rows_met: of the cells that it goes through, from the top.
        columns_met: of the same cells.
    """

    columns: Int[np.ndarray, " height"]
    rows_met: Int[np.ndarray, " cells"]
    columns_met: Int[np.ndarray, " cells"]

    def along(self, picture: np.ndarray) -> np.ndarray:
        """Return a picture's values on the way."""
        values: np.ndarray = picture[self.rows_met, self.columns_met]
        return values

    def is_right(self, width: int) -> Bool[np.ndarray, "height width"]:
        """Return which cells lie right of it."""
        right: Bool[np.ndarray, "height width"] = np.arange(width) >= self.columns[:, None]
        return right


def distinct_ways(
    prices: Float[np.ndarray, "kinds height width"],
    drawn: Float[np.ndarray, "height width"],
    dearest: float,
) -> Iterator[list[Seam]]:
    """Yield ways that part the paint, round by round; the same may come twice.

    After every round the paint that was crossed is dearer, so that the next goes elsewhere.

    Args:
        prices: of every cell, by several measures.
        drawn: share of every cell that is paint.
        dearest: cost from which ways are of no interest.
    """
    prices = prices.copy()
    middle = prices.shape[1] // 2
    share = np.cumsum(drawn.sum(axis=0)) / max(float(drawn.sum()), 1.0)
    inner = (share > AT_THE_SIDES) & (share < 1 - AT_THE_SIDES)
    for _ in range(ROUNDS):
        down, up = least_costs(prices), least_costs(prices[:, ::-1])[:, ::-1]
        ways = []
        for kind, price in enumerate(prices):
            through = down[kind, middle] + up[kind, middle] - price[middle]
            for column in _valleys(np.where(inner, through, np.inf))[:MOST_WAYS]:
                if through[column] > dearest:
                    break
                seam = _way(down[kind], up[kind], column)
                _make_dearer(price, drawn, seam)
                ways.append(seam)
        yield ways


def least_costs(
    prices: Float[np.ndarray, "kinds height width"],
) -> Float[np.ndarray, "kinds height width"]:
    """Return the least cost of a way from the top row to every cell, itself included."""
    total = np.empty(prices.shape)
    total[:, 0] = prices[:, 0]
    for row in range(1, prices.shape[1]):
        price = prices[:, row] + DETOUR
        above = total[:, row - 1]
        to_right = _swept(above, price)
        to_left = _swept(above[:, ::-1], price[:, ::-1])[:, ::-1]
        total[:, row] = np.minimum(to_right, to_left) - DETOUR
    return total


def _swept(above: np.ndarray, price: np.ndarray) -> np.ndarray:
    """Return the least cost of coming down at or left of every cell and running right to it."""
    run = np.cumsum(price, axis=1)
    swept: np.ndarray = np.minimum.accumulate(above - run + price, axis=1) + run
    return swept


def _valleys(cost: Float[np.ndarray, " width"]) -> list[int]:
    """Return the columns at which a way is cheapest among its neighbours, the cheapest first."""
    padded = np.pad(cost, 1, constant_values=np.inf)
    low = (cost <= padded[:-2]) & (cost <= padded[2:]) & np.isfinite(cost)
    starts = np.flatnonzero(low & ~np.append(False, low[:-1]))
    stops = np.flatnonzero(low & ~np.append(low[1:], False))
    middles = (starts + stops) // 2
    return [int(c) for c in middles[np.argsort(cost[middles], kind="stable")]]


def _way(down: np.ndarray, up: np.ndarray, column: int) -> Seam:
    """Return the cheapest way through a column of the middle row."""
    middle = len(down) // 2
    above = _climbed(down[: middle + 1], column)
    below = [(len(down) - 1 - row, c) for row, c in _climbed(up[middle:][::-1], column)]
    columns = np.zeros(len(down), dtype=int)
    for row, c in reversed(above + below):  # the cell nearest to the middle row counts
        columns[row] = c
    met = np.array(above[::-1] + below[1:])
    return Seam(columns, met[:, 0], met[:, 1])


def _climbed(costs: np.ndarray, column: int) -> list[tuple[int, int]]:
    """Return the cells (row, column) of the cheapest way from the last row to the first."""
    row, width = len(costs) - 1, costs.shape[1]
    cells = [(row, column)]
    while row > 0:
        asides = [c for c in (column - 1, column + 1) if 0 <= c < width]
        aside = min(asides, key=costs[row].__getitem__)
        if costs[row - 1, column] <= costs[row, aside] + DETOUR:
            row -= 1
        else:
            column = aside
        cells.append((row, column))
    return cells


def _make_dearer(price: np.ndarray, drawn: np.ndarray, seam: Seam) -> None:
    crossed = np.zeros(drawn.shape, dtype=np.uint8)
    crossed[seam.rows_met, seam.columns_met] = seam.along(drawn) > 0.3
    size = 2 * max(1, round(AROUND * len(drawn))) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    price += DEARER * cv2.dilate(crossed, disc) * drawn
