"""Drawings that are strongly off: their errors make no alternative camera and no other body."""

import numpy as np
import pytest

from lab.bench.stability.sheets import DrawnSheet, draw_sheet
from toonset.calib import pipeline
from toonset.calib.find_cameras import find_cameras
from toonset.calib.fit.model_selection import PROPORTIONS, UNSTEADY, UNSTEADY_MARGIN
from toonset.calib.fit.sheet_adjustment import JointFit
from toonset.calib.outline.correspondences import Drawing
from toonset.calib.outline.pose import Pose
from toonset.calib.result import Calibration
from toonset.calib.search.alternatives import WORTH, refine_alternatives
from toonset.calib.search.candidates import MIRROR, OTHER, SAME_POSE, Candidates
from toonset.camera import rotation_distance


def calibrated(sheet: DrawnSheet) -> Calibration:
    return find_cameras([view for view, _ in sheet.drawings], sheet.mesh)


def test_a_rival_that_only_drawing_error_makes_is_none() -> None:
    sheet = draw_sheet(1012, warp_percent=2.0)
    found = calibrated(sheet)
    off = [
        rotation_distance(view.camera.rotation, camera.rotation)
        for view, (_, camera) in zip(found.views, sheet.drawings, strict=True)
    ]
    assert np.degrees(max(off)) < 5
    assert [view.verdict for view in found.views] == ["ok"] * len(off)


def test_unsteady_drawings_do_not_bend_the_mannequin_on_little_evidence() -> None:
    found = calibrated(draw_sheet(1003, warp_percent=2.0))
    model_test = next(
        model_test for model_test in found.model.tried if model_test.name == PROPORTIONS
    )
    assert found.noise.smooth > UNSTEADY
    assert (model_test.margin, model_test.is_proven) == (UNSTEADY_MARGIN, False)
    assert model_test.bic_gain > 100


@pytest.mark.parametrize("percent", [0.0, 2.0])
def test_the_chosen_camera_and_its_twin_stay_among_the_candidates(monkeypatch, percent):
    seen: list[tuple[Candidates, Candidates, Pose]] = []

    def watched(drawing: Drawing, joint: JointFit, index: int, found: Candidates) -> Candidates:
        steady = refine_alternatives(drawing, joint, index, found)
        seen.append((found, steady, joint.poses[index]))
        return steady

    monkeypatch.setattr(pipeline, "refine_alternatives", watched)
    calibrated(draw_sheet(1012, warp_percent=percent))
    assert len(seen) == 5
    for found, steady, pose in seen:
        twin = pose.twin()
        assert nearest(steady, twin) <= max(nearest(found, twin), MIRROR)
        assert steady.energies.min() == 0
        if any(is_doubtful(found, pose)):
            assert nearest(steady, pose) <= SAME_POSE
        else:
            assert steady is found
    assert all(steady is found for found, steady, _ in seen) == (percent == 0)


def nearest(candidates: Candidates, pose: Pose) -> float:
    turns = [rotation_distance(fit.pose.rotation, pose.rotation) for fit in candidates.fits]
    return float(min(turns))


def is_doubtful(found: Candidates, pose: Pose) -> list[bool]:
    turns = [rotation_distance(fit.pose.rotation, pose.rotation) for fit in found.fits]
    mirrored = [rotation_distance(fit.pose.rotation, pose.twin().rotation) for fit in found.fits]
    return [
        energy < WORTH and turn > OTHER and twin > MIRROR
        for energy, turn, twin in zip(found.energies, turns, mirrored, strict=True)
    ]
