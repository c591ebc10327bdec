"""The bench of views between drawings: the truth's world, and its table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lab.bench.between.__main__ import table
from lab.bench.between.sheets import Similarity, similarity
from toonset.camera import Camera

TRUE = [
    Camera.looking_at(np.array([0, 0.5, 0]), yaw, 0.05, 240.0, (300, 300), k=0.1)
    for yaw in (0.0, 0.8, 1.6, 3.1)
]
WORLD = Similarity(Rotation.from_euler("y", 20, degrees=True).as_matrix(), 1.7, np.arange(3) / 9)


def test_the_truths_cameras_are_moved_to_the_world_that_was_found() -> None:
    found = [WORLD.into(camera) for camera in TRUE]
    point = np.array([0.1, 0.4, -0.2])
    for camera, own in zip(TRUE, found, strict=True):
        seen = camera.project(WORLD.scale * WORLD.rotation @ point + WORLD.shift)[0]
        np.testing.assert_allclose(own.project(point)[0], seen, atol=1e-9)
    known = similarity(found, TRUE)
    np.testing.assert_allclose(known.rotation, WORLD.rotation, atol=1e-4)
    np.testing.assert_allclose(known.shift, WORLD.shift, atol=1e-3)
    assert known.scale == pytest.approx(WORLD.scale, rel=1e-3)


def test_one_camera_that_is_wrong_does_not_turn_the_world() -> None:
    found = [WORLD.into(camera) for camera in TRUE]
    turned = found[1].rotation @ Rotation.from_euler("y", 12, degrees=True).as_matrix()
    found[1] = replace(found[1], rotation=turned)
    known = similarity(found, TRUE)
    apart = Rotation.from_matrix(known.rotation @ WORLD.rotation.T).magnitude()
    assert np.degrees(apart) < 3


def test_a_table_has_a_line_a_sheet_and_leaves_out_what_is_not_known() -> None:
    found = table({"a": {"seen: x": 1.0}, "b": {"seen: x": 3.0, "true: y": float("nan")}})
    first, second = found.split("true\n")
    assert [line.split() for line in first.splitlines()[2:6]] == [
        ["a", "1.000"],
        ["b", "3.000"],
        ["median", "2.000"],
        ["p95", "2.900"],
    ]
    assert second.splitlines()[1].split() == ["b", "-"]
