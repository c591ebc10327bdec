"""What is known of a sheet weakens its views: elevation, labels, locks, other views."""

import math
from dataclasses import replace

import numpy as np
import pytest

from toonset.calib.evidence.coherence_state import CONFIRMING, TELLING_VIEWS, SheetState
from toonset.calib.result import Sigmas, ViewCalibration
from toonset.calib.verdict.elevations import downgrade_by_elevations
from toonset.calib.verdict.judge import (
    downgrade_by_labels,
    downgrade_by_locks,
    downgrade_by_places,
    downgrade_by_sheet,
    judge_sheet,
)
from toonset.camera import Camera


def seen_from(yaw_deg: float = 0.0, elevation_deg: float = 10.0) -> ViewCalibration:
    camera = Camera.looking_at(
        np.zeros(3), math.radians(yaw_deg), math.radians(elevation_deg), 90.0, (100, 100)
    )
    sigmas = Sigmas(0.01, 0.01, 0.01, 0.01, 0.5)
    return ViewCalibration(
        "000.png", camera, sigmas, np.eye(6), 0.0, camera.twin(), (), 0.01, 0.99, "ok", ""
    )


def verdicts(views) -> list[str]:
    return [view.verdict for view in views]


def test_a_view_that_looks_up_where_the_sheet_looks_down_is_not_ok():
    views = [seen_from(elevation_deg=e) for e in (10, 8, 12, -10)]
    judged = downgrade_by_elevations(views)
    assert verdicts(judged) == ["ok", "ok", "ok", "weak"]
    assert "mirrored" in judged[3].reason


def test_a_view_that_leaves_the_even_turn_is_not_ok():
    views = [seen_from(yaw_deg=y) for y in (23, 90, 181, 270)]
    judged = downgrade_by_places(views, np.radians([23, 0, 0, 0]))
    assert verdicts(judged) == ["weak", "ok", "ok", "ok"]
    assert "23 degrees" in judged[0].reason
    assert verdicts(downgrade_by_places(views, np.radians([11, -1, 1, 0]))) == ["ok"] * 4


def test_a_sheet_that_looks_up_is_not_ok():
    judged = downgrade_by_elevations([seen_from(elevation_deg=e) for e in (-7, -8, -9, 8)])
    assert verdicts(judged) == ["weak"] * 4
    assert "mirrored" in judged[0].reason
    assert verdicts(downgrade_by_elevations([seen_from(elevation_deg=-3)])) == ["ok"]


def test_a_view_far_from_its_label_is_not_ok_and_no_label_says_nothing():
    views = [seen_from(yaw_deg=y) for y in (20, 170, 170)]
    labels = [(0.0,), (0.0,), ()]
    assert verdicts(downgrade_by_labels(views, labels)) == ["ok", "weak", "ok"]


def test_views_that_turn_without_their_lock_are_not_ok():
    views = [seen_from() for _ in range(3)]
    assert verdicts(downgrade_by_locks(views, np.radians([1, 2, 9]))) == ["ok", "ok", "weak"]
    assert verdicts(downgrade_by_locks(views, np.radians([9, 2, 9]))) == ["weak"] * 3


def state(views: int = 3, contradiction: float = 0.0, elevation: float = 0.1) -> SheetState:
    return SheetState(True, contradiction, None, views, elevation)


@pytest.mark.parametrize("how", ["bent", "faces", "uncertain", "shape", "failed"])
def test_no_view_is_ok_where_the_sheet_is_not(how):
    views = [seen_from() for _ in range(3)]
    if how == "uncertain":
        views[:2] = [replace(view, verdict="ambiguous") for view in views[:2]]
    if how == "shape":
        views[:2] = [replace(view, coverage=0.9) for view in views[:2]]
    if how == "failed":
        views[0] = replace(views[0], verdict="failed")
    faces = 0.9 if how == "faces" else 0.0
    judged = downgrade_by_sheet(views, state(), faces, bent=how == "bent")
    assert judged[2].verdict == "weak"
    assert judged[2].reason
    assert verdicts(downgrade_by_sheet([seen_from()] * 3, state())) == ["ok"] * 3


@pytest.mark.parametrize("bent", [True, False])
def test_another_shape_is_no_reason_to_doubt_where_many_drawings_agree(bent):
    views = [replace(seen_from(), coverage=0.85) for _ in range(TELLING_VIEWS)]
    agreeing = state(TELLING_VIEWS)
    assert verdicts(downgrade_by_sheet(views, agreeing, bent=bent)) == ["ok"] * len(views)
    verdict, said = judge_sheet(views, agreeing)
    assert verdict == "ok"
    assert "15 %" in said
    steep = state(TELLING_VIEWS, elevation=math.radians(40))
    for other in (state(TELLING_VIEWS - 1), state(TELLING_VIEWS, 1.01 * CONFIRMING), steep):
        judged = downgrade_by_sheet(views, other, bent=bent)
        assert verdicts(judged) == ["weak"] * len(views)
        assert other.unconfirmed in judged[0].reason
