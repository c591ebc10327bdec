"""Weigh what is written on a sheet against what its drawings say.

A caption may stand under the wrong figure or be misread. So it chooses between the alternatives
that the drawings leave open, never makes a view ok, and lowers what it contradicts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from toonset.calib.options import VerdictThresholds
from toonset.calib.result import SEVERITY, Calibration
from toonset.calib.verdict.checks import off_labels
from toonset.dataset.split_folder.view_labels import Label

SAME_WAY = np.radians(22.5)  # half of what neighbouring directions lie apart


def weigh_captions(
    found: Calibration,
    captions: Sequence[Label],
    as_captioned: Callable[[], Calibration],
    limits: VerdictThresholds,
) -> Calibration:
    """Return the cameras that drawings and captions speak for together.

    Args:
        found: without the captions.
        captions: possible yaws of every view, radians; empty where nothing is written.
        as_captioned: calibrates as if a person had typed the captions.
        limits: which tell how far off its label a view may be.
    """
    most = np.radians(limits.far_from_label_deg)
    if not found.is_certain:
        read = as_captioned()
        agrees = off_labels(read.views, captions).max() <= most
        if agrees and _keeps_certain_views(found, read) and read.doubtfulness < found.doubtfulness:
            sure = [view.verdict == "ok" for view in found.views]
            reason = "its direction rests on its caption: confirm it with --views"
            return _lowered(read, [not one for one in sure], reason)
    off = off_labels(found.views, captions) > most
    return _lowered(found, off.tolist(), "its caption says otherwise: which of them is right?")


def _keeps_certain_views(found: Calibration, read: Calibration) -> bool:
    """Return whether captions leave alone what the drawings are sure of."""
    yaws = np.array([[view.camera.angles[0] for view in own.views] for own in (found, read)])
    apart = np.abs((yaws[0] - yaws[1] + np.pi) % (2 * np.pi) - np.pi)
    sure = np.array([view.verdict == "ok" for view in found.views])
    return bool((apart[sure] <= SAME_WAY).all())


def _lowered(found: Calibration, doubted: Sequence[bool], reason: str) -> Calibration:
    """Return the calibration with views that were ok made weak, and the sheet with them."""
    views = tuple(
        replace(view, verdict="weak", reason=reason) if doubt and view.verdict == "ok" else view
        for view, doubt in zip(found.views, doubted, strict=True)
    )
    changed = [old.name for old, new in zip(found.views, views, strict=True) if old is not new]
    if not changed:
        return found
    said = f"{', '.join(changed)}: {reason.replace('its', 'their') if len(changed) > 1 else reason}"
    return replace(
        found,
        views=views,
        verdict=max("weak", found.verdict, key=SEVERITY.index),
        reason="; ".join(part for part in (found.reason, said) if part),
    )
