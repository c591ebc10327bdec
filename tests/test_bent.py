"""A mannequin that stands a little otherwise than the character, or is built a little otherwise."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from toonset.bench.stability_bodies import with_arms_raised, with_head_grown
from toonset.calib import problem
from toonset.calib.calibrate import calibrate
from toonset.calib.ladder import GLANCE_MARGIN, PROPORTIONS, Rung
from toonset.calib.result import Calibration
from toonset.camera import rotation_distance
from toonset.dataset.bodies import random_body
from toonset.dataset.synth_options import SynthOptions
from toonset.dataset.synthetic import Turnaround, make_turnaround

OPTIONS = SynthOptions(views=5, cell_px=200, outline_px=0, elevation_deg=8, yaw_jitter_deg=8)


def bending(found: Calibration) -> Rung:
    (rung,) = (rung for rung in found.model.rungs if rung.name == PROPORTIONS)
    return rung


def errors(found: Calibration, made: Turnaround) -> np.ndarray:
    pairs = zip(found.views, made.cameras, strict=True)
    return np.degrees([rotation_distance(v.camera.rotation, c.rotation) for v, c in pairs])


def test_arms_that_hardly_show_in_the_outlines_are_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    body = random_body(3005)
    made = make_turnaround(with_arms_raised(body, math.radians(8)), OPTIONS, 3005)
    found = calibrate(made.views, body)
    assert bending(found).is_proven
    assert found.model.bends_mannequin
    monkeypatch.setattr(problem, "GLANCE_MARGIN", np.inf)
    rigid = calibrate(made.views, body)
    assert not rigid.model.bends_mannequin
    assert min(view.coverage for view in rigid.views) > 0.96
    assert np.median(errors(found, made)) < 0.6 * np.median(errors(rigid, made))
    assert found.views[0].sigmas.yaw > rigid.views[0].sigmas.yaw  # another body is less certain


def test_a_larger_head_is_seen() -> None:
    body = random_body(3004)
    made = make_turnaround(with_head_grown(body, 0.1), OPTIONS, 3004)
    found = calibrate(made.views, body)
    assert bending(found).is_proven
    assert errors(found, made).max() < 3
    grown = np.ptp(found.mannequin[:, 0]) / np.ptp(body.vertices[:, 0])
    assert grown == pytest.approx(1, abs=0.06)  # the arms stay


@pytest.mark.parametrize("views", [3, 5])
def test_drawing_error_bends_no_mannequin(views: int) -> None:
    drawn = replace(OPTIONS, views=views, outline_px=2, warp_percent=1.2)
    made = make_turnaround(random_body(1006), drawn, 1006)
    found = calibrate(made.views, made.mesh)
    assert bending(found).margin == GLANCE_MARGIN
    assert not bending(found).is_proven
    assert np.ptp(found.mannequin, axis=0) == pytest.approx(np.ptp(made.mesh.vertices, axis=0))


def test_two_drawings_do_not_say_how_a_mannequin_is_built() -> None:
    body = random_body(3004)
    made = make_turnaround(with_arms_raised(body, math.radians(8)), replace(OPTIONS, views=2), 3004)
    found = calibrate(made.views, body)
    assert PROPORTIONS not in {rung.name for rung in found.model.rungs}
