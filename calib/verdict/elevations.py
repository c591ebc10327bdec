"""Check a sheet's elevations for outliers and views from below, as mirrored drawings give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toonset.calib.result import ViewCalibration

FAR_FROM_LEVEL = np.radians(12.0)  # four times what the views of a sheet differ in elevation
LOOKING_UP = np.radians(5.0)  # nobody draws a turnaround from so far below


def downgrade_by_elevations(views: Sequence[ViewCalibration]) -> list[ViewCalibration]:
    """Downgrade views that look down far more or less than the sheet does.

    It may be drawn so; more often it is a mirrored drawing that fits in its twin. Nor is any where
    all look up: the mirror image of a sheet from above is, front and back swapped, one from below.
    """
    elevations = np.array([view.camera.angles[1] for view in views])
    level = float(np.median(elevations))
    typical = f"{abs(np.degrees(level)):.0f} degrees"
    if level < -LOOKING_UP:
        doubtful = np.ones(len(views), dtype=bool)
        reason = f"the sheet looks up by {typical}: is it mirrored, or front and back swapped?"
    else:
        doubtful = np.abs(elevations - level) > FAR_FROM_LEVEL
        reason = f"the sheet looks down by {typical}: mirrored?"
    return [
        replace(view, verdict="weak", reason=reason) if view.verdict == "ok" and doubt else view
        for view, doubt in zip(views, doubtful, strict=True)
    ]
