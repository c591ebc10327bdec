"""Blocky characters: their profiles are rectangles, and they look alike from behind."""

import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from tests.figures import boxes
from toonset.calib.find_cameras import find_cameras
from toonset.calib.fit.align import Fit
from toonset.calib.outline.occluding_contour import prepare_surface
from toonset.calib.outline.pose import Pose
from toonset.calib.search.candidates import (
    Candidates,
    level_twins,
    looks_alike_from_behind,
    turn_half,
)
from toonset.camera import rotation_distance, rotation_from_angles
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.mesh import Mesh

RED, BLUE, SKIN = (200, 40, 30), (40, 60, 180), (240, 190, 150)


@pytest.fixture(scope="module")
def stack() -> Mesh:
    head, trunk = ((1, 1, 1), (0, 1.5, 0)), ((1, 1, 1), (0, 0.5, 0))
    arms = [((0.4, 0.8, 0.4), (side * 0.7, 0.6, 0)) for side in (-1, 1)]
    return boxes(head, trunk, *arms, colors=(RED, BLUE, SKIN, SKIN))


def test_a_profile_that_is_a_rectangle_is_a_view(stack):
    options = SynthOptions(views=8, cell_px=200, outline_px=0)
    made = make_turnaround(stack, options, 0)
    found = split_picture(made.sheet)
    assert len(found.views) == 8
    assert not found.left_out


def test_a_patch_of_one_colour_is_none(stack):
    options = SynthOptions(views=4, cell_px=200, outline_px=0)
    sheet = make_turnaround(stack, options, 0).sheet
    rows = np.flatnonzero((sheet[..., :3] != sheet[0, 0, :3]).any(axis=(1, 2)))
    wide = np.concatenate([sheet, np.broadcast_to(sheet[:1, :1], (len(sheet), 140, 4))], axis=1)
    wide[rows[0] : rows[-1], -120:-40, :3] = RED
    found = split_picture(wide)
    assert len(found.views) == 4
    assert [patch.kind for patch in found.left_out] == ["swatch"]


def test_what_looks_alike_from_behind_is_ambiguous(stack):
    near = {"elevation_deg": 8, "distance_heights": 2.5}  # no mirror twins: this alone counts
    options = SynthOptions(views=5, cell_px=200, outline_px=0, **near)
    found = find_cameras(make_turnaround(stack, options, 0).views, stack)
    assert {view.verdict for view in found.views} == {"ambiguous"}


def test_only_bodies_without_front_look_alike_from_behind(stack):
    def seen(yaw: float) -> Pose:
        return Pose(rotation_from_angles(np.radians(yaw), np.radians(8), 0), np.zeros(2), 1.0)

    poses = [seen(yaw) for yaw in (0, 45, 90)]
    assert looks_alike_from_behind(prepare_surface(stack), poses)
    for body in (random_body(1, symmetric=True), random_body(2)):
        assert not looks_alike_from_behind(prepare_surface(body), poses)
    assert rotation_distance(turn_half(seen(30)).rotation, seen(210).rotation) < 1e-9


@pytest.mark.parametrize("from_behind", [True, False])
def test_differences_between_outlines_that_are_one_are_no_evidence(from_behind):
    surface = prepare_surface(random_body(2))  # its twins do not look alike
    pose = Pose(rotation_from_angles(np.radians(40), np.radians(8), 0), np.zeros(2), 1.0)
    fits = tuple(Fit(p, cost, 0.0, 1.0) for p, cost in [(pose, 1e-6), (turn_half(pose), 2e-6)])
    view = Candidates(fits, np.array([0.0, 3.0]))
    found = level_twins(view, surface, pose, always=False, from_behind=from_behind)
    assert found.energies.tolist() == [0.0, 0.0 if from_behind else 3.0]
