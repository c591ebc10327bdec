"""Measure how far a sheet's silhouettes contradict each other under its cameras, without a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toonset.calib.options import VerdictThresholds
from toonset.camera import Camera
from toonset.dataset.silhouettes.coherence import coherence
from toonset.view import View


@dataclass(frozen=True)
class SheetState:
    """Coherence of a sheet's silhouettes as a whole.

    Attributes:
        yaw_observable: the mannequin looks different from different sides.
        contradiction: of the drawings with each other, over the height; nan for a single view.
        odd_view: the one drawing that disagrees with the others, if any.
        views: how many there are.
        elevation: of the typical camera, radians.
        thresholds: where to begin to doubt.
    """

    yaw_observable: bool
    contradiction: float
    odd_view: int | None
    views: int
    elevation: float
    thresholds: VerdictThresholds = VerdictThresholds()

    @property
    def drawings_agree(self) -> bool:
        """Return whether the drawings do not contradict the cameras."""
        least, most = self.thresholds.telling_views, self.thresholds.most_contradiction
        return self.views >= least and self.contradiction < most

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
        limits = self.thresholds
        if self.views < limits.telling_views:
            return f"{limits.telling_views} drawings or more could confirm the camera all the same"
        if self.contradiction >= limits.confirming_contradiction:
            off = f"{100 * self.contradiction:.1f} % of the height"
            return f"the drawings, {off} off each other, do not confirm the camera"
        if abs(self.elevation) >= np.radians(limits.steep_deg):
            return "drawings from so steeply above cannot confirm the camera"
        return ""


def state_of(
    views: Sequence[View],
    cameras: Sequence[Camera],
    thresholds: VerdictThresholds = VerdictThresholds(),
    *,
    yaw_observable: bool = True,
) -> SheetState:
    """Return the coherence of the drawings under these cameras.

    Args:
        views: the drawings, at least one.
        cameras: theirs, in pixels of the views' crops.
        thresholds: where to begin to doubt.
        yaw_observable: the mannequin looks different from different sides.
    """
    elevation = float(np.median([camera.angles[1] for camera in cameras]))
    found = coherence(views, cameras) if len(views) > 1 else None
    contradiction = found.contradiction if found else float("nan")
    odd = found.odd_view if found else None
    return SheetState(yaw_observable, contradiction, odd, len(views), elevation, thresholds)
