"""Place drawings sideways by the middles of their rows.

At eye level without perspective a row of every drawing shows the same section of the body, and
the middle of a round section is seen in the middle from everywhere: from `yaw` it lies
X cos(yaw) + Z sin(yaw) beside the axis. Minimised over where the axis stands in every drawing:

    sum over rows of | axis_i + X_row cos(yaw_i) + Z_row sin(yaw_i) - middle_i,row |

A row in which an arm is posed otherwise errs as a whole and counts little. Outlines' own tangents
cannot tell: at eye level they are level lines. Where the axis stands in the body stays open;
there the middles of the boxes are kept.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

ROWS = 60
ROUNDS = 30  # of reweighting
LEAST_OFF = 0.004  # of the height: rows that agree so well weigh alike
SAME = 1e-6  # of the larger singular value: front and back alone share one direction


def axis_columns(
    masks: Sequence[Bool[np.ndarray, "height width"]], yaws: Float[np.ndarray, " views"]
) -> Float[np.ndarray, " views"]:
    """Return the column of every drawing's axis, pixels.

    Args:
        masks: the figures as drawn, equally high but for drawing error; each has a pixel.
        yaws: of the drawings, radians.
    """
    measured = [_measured(mask) for mask in masks]
    boxes = np.array([box for box, _, _ in measured])
    height = float(np.median([height for _, height, _ in measured]))
    middles = np.stack([rows for _, _, rows in measured], axis=1)
    bases, sizes, _ = np.linalg.svd(np.stack([np.cos(yaws), np.sin(yaws)], axis=1), False)
    of_body = bases[:, sizes > SAME * sizes[0]]
    placing = np.eye(len(yaws)) - of_body @ of_body.T
    rows = (middles - boxes) @ placing
    axis = np.median(rows, axis=0)
    for _ in range(ROUNDS):
        off = np.linalg.norm(rows - axis, axis=1)
        weights = 1 / np.maximum(off, LEAST_OFF * height)
        axis = weights @ rows / weights.sum()
    return boxes + axis


def _measured(
    mask: Bool[np.ndarray, "height width"],
) -> tuple[float, int, Float[np.ndarray, " rows"]]:
    """Return the box's middle column, its height, and the mean column of evenly spaced rows."""
    columns = np.flatnonzero(mask.any(axis=0))
    rows = np.flatnonzero(mask.any(axis=1))
    top, height = rows[0], rows[-1] + 1 - rows[0]
    mean = mask[rows] @ (np.arange(mask.shape[1]) + 0.5) / mask[rows].sum(axis=1)
    at = top + (np.arange(ROWS) + 0.5) / ROWS * height - 0.5
    return (columns[0] + columns[-1] + 1) / 2, int(height), np.interp(at, rows, mean)
