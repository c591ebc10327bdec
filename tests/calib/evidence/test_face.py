"""Laws of the face's evidence: symmetries, normalisation, and drawn heads that turn."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from toonset.calib.evidence.cylinder import read_sections
from toonset.calib.evidence.face import (
    NO_NECK,
    FaceEvidence,
    face_cues,
    face_log_likelihood,
    neck_height,
    read_faces,
)
from toonset.calib.evidence.texture import BROKEN
from toonset.view import View

TURN = np.arange(8) * np.pi / 4
HAIR, SKIN, SHIRT, INK = (96, 56, 38, 255), (242, 190, 150, 255), (60, 90, 170, 255), (20,) * 3
CENTRE, RADIUS = (100, 60), 40


def _figure(yaw: float) -> View:
    """Return a drawing: a ball with hair, a face in front of it, eyes, and a trunk."""
    rgba = np.zeros((260, 200, 4), np.uint8)
    cv2.rectangle(rgba, (60, 105), (140, 250), SHIRT, -1)
    cv2.rectangle(rgba, (88, 90), (112, 110), SKIN, -1)
    cv2.circle(rgba, CENTRE, RADIUS, HAIR, -1)
    columns, rows = np.meshgrid(np.arange(200), np.arange(260))
    across, down = (columns - CENTRE[0]) / RADIUS, (rows - CENTRE[1]) / RADIUS
    towards = np.sqrt(np.maximum(1 - across**2 - down**2, 0))
    ahead = np.cos(yaw) * towards - np.sin(yaw) * across  # 1 on the nose, -1 on the back
    head = across**2 + down**2 < 1
    rgba[head & (ahead > 0.55) & (down > -0.5)] = SKIN
    for side in (-0.45, 0.45):
        eye = yaw + side
        if np.cos(eye) > 0.2:
            x = round(CENTRE[0] - RADIUS * np.sin(eye) * 0.9)
            cv2.ellipse(rgba, (x, 60), (3, 5), 0, 0, 360, (*INK, 255), -1)
    return View(rgba, (0, 0, 200, 260), 0.0, "view")


def _sum(evidence: FaceEvidence, yaws: np.ndarray) -> float:
    at = [face_log_likelihood(evidence, i, np.array(yaw)) for i, yaw in enumerate(yaws)]
    assert all(np.ndim(one) == 0 for one in at)
    return float(np.sum(at))


def test_truth_beats_the_twin_and_half_a_turn_and_every_view_prefers_its_side() -> None:
    evidence = read_faces([_figure(yaw) for yaw in TURN])
    truth = _sum(evidence, TURN)
    for wrong in (np.pi - TURN, TURN + np.pi, -TURN):
        assert truth > _sum(evidence, wrong) + 3
    for index, yaw in enumerate(TURN):
        own, opposite = face_log_likelihood(evidence, index, np.array([yaw, yaw + np.pi]))
        assert own > opposite


def test_density_over_the_circle_is_one() -> None:
    evidence = FaceEvidence(np.array([[0.0, 0.0], [3.0, -2.0], [-40.0, 5.0], [2000.0, 0.0]]))
    yaws = np.linspace(-np.pi, np.pi, 100_000, endpoint=False)
    for index in range(4):
        log_likelihood = face_log_likelihood(evidence, index, yaws)
        assert np.exp(log_likelihood).mean() == pytest.approx(1, abs=1e-6)
        assert log_likelihood.min() >= np.log(BROKEN)


def test_mirrored_pictures_have_mirrored_yaws() -> None:
    views = [_figure(yaw) for yaw in TURN]
    flipped = [replace(view, rgba=view.rgba[:, ::-1].copy()) for view in views]
    expected = read_faces(views).natural * [1, -1]
    np.testing.assert_allclose(read_faces(flipped).natural, expected, atol=1e-4)


def test_order_of_views_is_of_no_account() -> None:
    views = [_figure(yaw) for yaw in TURN]
    order = np.random.default_rng(0).permutation(8)
    natural = read_faces([views[i] for i in order]).natural
    np.testing.assert_allclose(natural, read_faces(views).natural[order], atol=1e-12)


def test_a_lone_head_one_without_drawing_and_none_say_nothing() -> None:
    np.testing.assert_array_equal(face_cues([_figure(0.0)])[0], 0)
    rgba = np.zeros((260, 200, 4), np.uint8)
    cv2.rectangle(rgba, (60, 105), (140, 250), SHIRT, -1)
    cv2.circle(rgba, CENTRE, RADIUS, SHIRT, -1)
    evidence = read_faces([View(rgba, (0, 0, 200, 260), 0.0, "view")] * 4)
    yaws = np.linspace(0, 6, 50)
    np.testing.assert_allclose(face_log_likelihood(evidence, 2, yaws), 0, atol=1e-6)
    dot = View(np.full((2, 2, 4), 255, np.uint8), (0, 0, 2, 2), 0.0, "dot")
    np.testing.assert_allclose(read_faces([dot]).natural, 0, atol=1e-9)


def test_neck_is_found_below_the_head_and_a_box_has_none() -> None:
    figures = [read_sections(_figure(yaw), 160 / 231, 0.0, 160) for yaw in TURN]
    assert neck_height(figures) == pytest.approx((100 - 20) / 231, abs=0.03)
    rgba = np.full((160, 60, 4), 255, np.uint8)
    box = read_sections(View(rgba, (0, 0, 60, 160), 0.0, "box"), 1.0, 0.0, 160)
    assert neck_height([box]) == NO_NECK
