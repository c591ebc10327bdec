"""Cameras as a person corrected them: what moves, what stays, and what the verdict says of it."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from toonset.calib.calibrate import calibrate
from toonset.calib.options import Hints
from toonset.calib.result import Calibration
from toonset.camera import Camera, rotation_distance
from toonset.dataset.images.picture import encode_png
from toonset.dataset.split_folder.load import split_sheet
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.errors import LandmarkError, UsageError
from toonset.mesh import Mesh
from toonset.options import Body

OPTIONS = SynthOptions(views=4, cell_px=160, outline_px=0, elevation_deg=8)
WRONG_DEG = 12.0  # far enough to be seen, near enough to be dragged


class Drawn:
    """A sheet with its truth, and calibrations of it."""

    def __init__(self, folder: Path) -> None:
        """Draw it."""
        self.truth: Turnaround = make_turnaround(random_body(11, symmetric=False), OPTIONS, 11)
        self.path = folder / "sheet.png"
        self.path.write_bytes(encode_png(self.truth.sheet))
        self.plain = split_sheet(self.path)

    def found(
        self, *views: dict[str, Any], mesh: Mesh | Body | None = None, **other: Any
    ) -> Calibration:
        """Return the calibration with what is said of views."""
        path = self.path.with_name("corrections.json")
        path.write_text(json.dumps({"version": 1, "views": views}))
        sheet = split_sheet(self.path, corrections=path)
        body = self.truth.mesh if mesh is None else mesh
        return calibrate(sheet.views, body, Hints(corrections=path, **other))

    def entry(self, number: int, turn_deg: float = 0.0, **more: Any) -> dict[str, Any]:
        """Return what a person says who puts a view's camera at its true place, or off it."""
        camera, box = self.truth.cameras[number], self.plain.views[number].figure_box
        yaw, elevation, roll = np.degrees(camera.angles).tolist()
        middle = [box[0] + box[2] / 2, box[1] + box[3] / 2]
        placed = {"yaw": yaw + turn_deg, "elevation": elevation, "roll": roll}
        return {"box": box, "camera": {**placed, "scale": camera.scale, "middle": middle}, **more}


@pytest.fixture(scope="module")
def drawn(tmp_path_factory) -> Drawn:
    return Drawn(tmp_path_factory.mktemp("drawn"))


@pytest.fixture(scope="module")
def plain(drawn: Drawn):
    return calibrate(drawn.plain.views, drawn.truth.mesh)


def off_deg(found, cameras) -> list[float]:
    pairs = zip(found.views, cameras, strict=True)
    return [np.degrees(rotation_distance(v.camera.rotation, c.rotation)) for v, c in pairs]


def same_camera(one: Camera, two: Camera) -> bool:
    alike = np.array_equal(one.rotation, two.rotation) and np.array_equal(one.center, two.center)
    return alike and (one.scale, one.k) == (two.scale, two.k)


def test_no_content_changes_nothing_bit_for_bit(drawn: Drawn, plain):
    found = drawn.found()
    for one, two in zip(found.views, plain.views, strict=True):
        assert same_camera(one.camera, two.camera)
        np.testing.assert_array_equal(one.covariance, two.covariance)
        assert (one.verdict, one.reason, one.p_flip) == (two.verdict, two.reason, two.p_flip)
    roles = [file["role"] for file in found.origin["inputs"]]
    assert roles == ["sheet", "corrections"]
    assert found.origin["inputs"][0] == plain.origin["inputs"][0]


def test_a_locked_camera_stays_and_the_verdict_says_if_outlines_do_not(drawn: Drawn, plain):
    right = drawn.found(drawn.entry(1, lock=True))
    np.testing.assert_allclose(
        right.views[1].camera.angles[:2], drawn.truth.cameras[1].angles[:2], atol=1e-4
    )
    assert max(off_deg(right, drawn.truth.cameras)) < 2
    assert right.views[1].verdict == "ok"
    wrong = drawn.found(drawn.entry(1, WRONG_DEG, lock=True))
    turned = wrong.views[1].camera.angles[0] - drawn.truth.cameras[1].angles[0]
    assert np.degrees(turned) == pytest.approx(WRONG_DEG, abs=0.01)
    assert wrong.views[1].verdict == "weak"
    assert "is what is locked right?" in wrong.views[1].reason
    others = [i for i in range(len(plain.views)) if i != 1]
    moved = off_deg(wrong, [view.camera for view in plain.views])
    assert max(moved[i] for i in others) < 4


def test_a_dragged_camera_is_refitted_in_its_basin(drawn: Drawn, plain):
    found = drawn.found(drawn.entry(2, WRONG_DEG))
    assert max(off_deg(found, [view.camera for view in plain.views])) < 0.5
    flipped = drawn.found(drawn.entry(1, 180.0))  # seen from the other side
    yaw = np.degrees(flipped.views[1].camera.angles[0] - drawn.truth.cameras[1].angles[0])
    assert abs((yaw + 180) % 360 - 180) > 90
    assert flipped.views[1].verdict != "ok"


def landmarks(drawn: Drawn, number: int, count: int) -> list[dict[str, Any]]:
    camera, view = drawn.truth.cameras[number], drawn.plain.views[number]
    points = drawn.truth.mesh.vertices
    ways = np.random.default_rng(1).normal(size=(count, 3))
    chosen = points[[int((points @ way).argmax()) for way in ways]]
    cell = camera.project(chosen)[0]
    # the truth's camera is of a cell; the crop's shows the same outline
    inside = camera.project(points)[0]
    corner = np.array(view.figure_box[:2]) - np.floor(inside.min(axis=0))
    pairs = zip(chosen, cell + corner, strict=True)
    return [{"world": world.tolist(), "pixel": pixel.tolist()} for world, pixel in pairs]


@pytest.mark.parametrize("count", [2, 5])
def test_clicked_points_help_however_few(count, drawn: Drawn):
    entry = {"box": drawn.plain.views[0].figure_box, "landmarks": landmarks(drawn, 0, count)}
    found = drawn.found(entry)
    assert max(off_deg(found, drawn.truth.cameras)) < 2
    assert len(found.landmarks) == (count >= 3)


def test_what_contradicts_is_refused(drawn: Drawn):
    box = drawn.plain.views[0].figure_box
    label = {"box": box, "label": "front"}
    with pytest.raises(UsageError, match=r"views\.label and --views say the same thing"):
        drawn.found(label, labels="front,?,?,?")
    clicked = {"box": box, "landmarks": [{"world": [0, 0, 0], "pixel": [1e5, 0]}]}
    with pytest.raises(LandmarkError, match=r"landmarks\.0: .* lies outside of the view"):
        drawn.found(clicked)
    clicked["landmarks"] = landmarks(drawn, 0, 4)
    with pytest.raises(UsageError, match="landmarks need a mannequin; drop them or --mesh none"):
        drawn.found(clicked, mesh=Body.NONE)
    path = drawn.path.with_name("corrections.json")
    with pytest.raises(UsageError, match="--corrections does nothing beside --landmarks-only"):
        Hints(landmarks=path, landmarks_only=True, corrections=path).check()


def test_without_a_body_a_lock_keeps_its_yaw(drawn: Drawn):
    entry = {"box": drawn.plain.views[1].figure_box, "label": "100", "lock": True}
    found = drawn.found(entry, mesh=Body.NONE)
    assert np.degrees(found.views[1].camera.angles[0]) == pytest.approx(100, abs=0.01)
    assert replace(found, drawings=()).mesh is None
