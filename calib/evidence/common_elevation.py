"""Estimate the elevation error that all cameras of a sheet share, from the drawings alone.

A common error of elevation is what drawings contradict most (see `coherence_state`): a foot in
front goes down when seen from above, the same foot goes up when seen from behind, and the profile
views say how far in front it is. A mannequin of other proportions cannot know that as well.

The contradiction is scanned over a common offset; a parabola through the smallest value and its
neighbours gives the offset.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.camera import Camera, rotation_from_angles
from toonset.dataset.silhouettes.hull_rays import Silhouette, middle_of
from toonset.dataset.silhouettes.turned_rays import TurnedRays
from toonset.errors import CameraError
from toonset.view import View

OFFSETS = np.radians(np.linspace(-15, 15, 11))
SIGMA = math.radians(3.0)  # as measured, see docs/decisions.md
PROVEN = 0.005  # of the height: contradiction by which both ends must be worse than the smallest


@dataclass(frozen=True, eq=False)
class CommonElevation:
    """Elevation error common to all cameras of a sheet.

    Attributes:
        offset: radians to add to every camera's elevation.
        sigma: its standard deviation; infinite where the drawings do not tell.
        contradictions: mean square contradiction at each of `OFFSETS`, over the height squared.
    """

    offset: float
    sigma: float
    contradictions: Float[np.ndarray, " offsets"]


def common_elevation(views: Sequence[View], cameras: Sequence[Camera]) -> CommonElevation:
    """Return the elevation offset under which the drawings agree best.

    Args:
        views: the drawings, at least two.
        cameras: theirs, in pixels of the views' crops, all in the right turning direction: for
            the mirror twins of all cameras the offset changes its sign.

    Raises:
        CameraError: fewer than two views, or not one camera per view.
    """
    if len(views) < 2 or len(views) != len(cameras):
        raise CameraError(
            f"common elevation: found {len(views)} views and {len(cameras)} cameras; two views or "
            "more with one camera each are needed; a single drawing agrees with any elevation"
        )
    silhouettes = [Silhouette(view, camera) for view, camera in zip(views, cameras, strict=True)]
    curve = np.array([_contradiction_at(silhouettes, offset) for offset in OFFSETS])
    smallest = int(np.clip(curve.argmin(), 1, len(curve) - 2))
    known = min(curve[0], curve[-1]) - curve.min() > PROVEN**2
    offset = _lowest(curve, smallest) if known else 0.0
    return CommonElevation(offset, SIGMA if known else math.inf, curve)


def _contradiction_at(silhouettes: Sequence[Silhouette], offset: float) -> float:
    anchor = middle_of(silhouettes)
    moved = [s.seen_by(_tilted(s.camera, anchor, offset)) for s in silhouettes]
    return TurnedRays.of(moved).mean_square()


def _tilted(camera: Camera, anchor: Float[np.ndarray, " 3"], offset: float) -> Camera:
    """Return the camera at another elevation, with `anchor` at the same pixel."""
    yaw, elevation, roll = camera.angles
    tilted = replace(camera, rotation=rotation_from_angles(yaw, elevation + offset, roll))
    before, after = (c.project(anchor[None])[0][0] for c in (camera, tilted))
    return replace(tilted, center=tilted.center + before - after)


def _lowest(curve: Float[np.ndarray, " offsets"], i: int) -> float:
    before, here, after = curve[i - 1 : i + 2]
    bend = before - 2 * here + after
    step = OFFSETS[1] - OFFSETS[0]
    return float(OFFSETS[i] + step * np.clip((before - after) / (2 * max(bend, 1e-12)), -1, 1))
