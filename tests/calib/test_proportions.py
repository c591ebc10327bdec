"""A mannequin that stands a little otherwise than the character, or is built a little otherwise."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from lab.bench.stability.bodies import with_arms_raised, with_head_grown
from toonset.calib import pipeline
from toonset.calib.find_cameras import find_cameras
from toonset.calib.fit.model_selection import BIC_MARGIN, PROPORTIONS, QUICK_TEST_MARGIN, ModelTest
from toonset.calib.pipeline import SAME_BODY_COVERAGE
from toonset.calib.result import Calibration
from toonset.camera import rotation_distance
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround

OPTIONS = SynthOptions(views=5, cell_px=200, outline_px=0, elevation_deg=8, yaw_jitter_deg=8)


def bending(found: Calibration) -> ModelTest:
    (model_test,) = (
        model_test for model_test in found.model.tried if model_test.name == PROPORTIONS
    )
    return model_test


def errors(found: Calibration, made: Turnaround) -> np.ndarray:
    pairs = zip(found.views, made.cameras, strict=True)
    return np.degrees([rotation_distance(v.camera.rotation, c.rotation) for v, c in pairs])


def test_arms_that_hardly_show_in_the_outlines_are_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    body = random_body(3005)
    made = make_turnaround(with_arms_raised(body, math.radians(8)), OPTIONS, 3005)
    found = find_cameras(made.views, body)
    assert bending(found).is_proven
    assert found.model.bends_mannequin
    assert errors(found, made).max() < 5.5
    monkeypatch.setattr(pipeline, "QUICK_TEST_MARGIN", np.inf)
    rigid = find_cameras(made.views, body)
    assert not rigid.model.bends_mannequin
    assert np.median([view.coverage for view in rigid.views]) > SAME_BODY_COVERAGE
    assert errors(found, made).max() < 0.6 * errors(rigid, made).max()
    assert found.views[0].sigmas.yaw > rigid.views[0].sigmas.yaw  # another body is less certain


def test_what_another_shape_looks_like_is_no_perspective() -> None:
    """Lower arms look like a distance per view, until the mannequin is known to be another."""
    body = random_body(3007)
    made = make_turnaround(
        with_arms_raised(body, math.radians(-10)), replace(OPTIONS, views=8), 3007
    )
    found = find_cameras(made.views, body)
    assert bending(found).is_proven
    assert not found.model.is_perspective
    assert errors(found, made).max() < 5


def test_a_larger_head_is_seen() -> None:
    body = random_body(3004)
    drawn = with_head_grown(body, 0.1)
    made = make_turnaround(drawn, OPTIONS, 3004)
    found = find_cameras(made.views, body)
    assert bending(found).is_proven

    def head_over_height(vertices: np.ndarray) -> float:
        up = vertices[:, 1] - vertices[:, 1].min()
        return float(np.ptp(vertices[up > 0.88 * up.max(), 0]) / up.max())

    own, wanted = head_over_height(body.vertices), head_over_height(drawn.vertices)
    assert head_over_height(found.mannequin) == pytest.approx(wanted, rel=0.02)
    assert own < 0.97 * wanted


@pytest.mark.parametrize(("views", "seed"), [(5, 12), (3, 1000)])
def test_drawing_error_bends_no_mannequin(views: int, seed: int) -> None:
    drawn = replace(OPTIONS, views=views, outline_px=2, warp_percent=1.5)
    made = make_turnaround(random_body(seed), drawn, seed)
    found = find_cameras(made.views, made.mesh)
    assert bending(found).margin == QUICK_TEST_MARGIN
    assert not bending(found).is_proven
    assert bending(found).bic_gain > BIC_MARGIN  # strong evidence by itself
    assert np.ptp(found.mannequin, axis=0) == pytest.approx(np.ptp(made.mesh.vertices, axis=0))


def test_two_drawings_whose_outlines_meet_prove_no_other_body() -> None:
    body = random_body(3004)
    made = make_turnaround(with_arms_raised(body, math.radians(8)), replace(OPTIONS, views=2), 3004)
    found = find_cameras(made.views, body)
    assert PROPORTIONS not in {model_test.name for model_test in found.model.tried}
