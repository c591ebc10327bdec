"""Measure how far a sheet's silhouettes contradict each other under its cameras, without a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toonset.camera import Camera
from toonset.dataset.silhouettes.coherence import coherence
from toonset.view import View

# Sheets with cameras that are right contradict themselves by 0.4 to 0.9 %, wrong ones by 1.8 % on
MOST_CONTRADICTION = 0.012
# Under it a mannequin of another shape is not a reason to doubt the cameras (docs/decisions.md)
CONFIRMING = 0.008
STEEP = np.radians(30.0)  # turnarounds are drawn from about eye level, none of ours from above 20
TELLING_VIEWS = 5  # fewer silhouettes cut out a hull that contradicts hardly anything


@dataclass(frozen=True)
class SheetState:
    """Coherence of a sheet's silhouettes as a whole.

    Attributes:
        yaw_observable: the mannequin looks different from different sides.
        contradiction: of the drawings with each other, over the height; nan for a single view.
        odd_view: the one drawing that disagrees with the others, if any.
        views: how many there are.
        elevation: of the typical camera, radians.
    """

    yaw_observable: bool
    contradiction: float
    odd_view: int | None
    views: int
    elevation: float

    @property
    def drawings_agree(self) -> bool:
        """Return whether the drawings do not contradict the cameras."""
        return self.views >= TELLING_VIEWS and self.contradiction < MOST_CONTRADICTION

    @property
    def drawings_confirm(self) -> bool:
        """Return whether the drawings confirm the cameras without the mannequin."""
        return not self.unconfirmed

    @property
    def unconfirmed(self) -> str:
        """Return why the drawings alone do not confirm the cameras; "" where they do.

        How far all cameras look down is the mannequin's word alone: steeply, if its shape is
        another's.
        """
        if self.views < TELLING_VIEWS:
            return f"{TELLING_VIEWS} drawings or more could confirm the camera all the same"
        if self.contradiction >= CONFIRMING:
            off = f"{100 * self.contradiction:.1f} % of the height"
            return f"the drawings, {off} off each other, do not confirm the camera"
        if abs(self.elevation) >= STEEP:
            return "drawings from so steeply above cannot confirm the camera"
        return ""


def state_of(
    views: Sequence[View], cameras: Sequence[Camera], *, yaw_observable: bool = True
) -> SheetState:
    """Return the coherence of the drawings under these cameras.

    Args:
        views: the drawings, at least one.
        cameras: theirs, in pixels of the views' crops.
        yaw_observable: the mannequin looks different from different sides.
    """
    elevation = float(np.median([camera.angles[1] for camera in cameras]))
    if len(views) < 2:
        return SheetState(yaw_observable, float("nan"), None, len(views), elevation)
    found = coherence(views, cameras)
    return SheetState(yaw_observable, found.contradiction, found.odd_view, len(views), elevation)
