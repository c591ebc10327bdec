"""What an earlier fit has found in the same drawings changes nothing of the next."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from toonset.calib.calibrate import calibrate
from toonset.calib.options import Hints
from toonset.calib.result import Calibration
from toonset.calib.verdict.report import calibration_dict
from toonset.calib.without_body.cues import Cues
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.options import Body
from toonset.view import View


@pytest.fixture(scope="module")
def views() -> list[View]:
    options = SynthOptions(views=5, cell_px=64, outline_px=0)
    return list(split_picture(make_turnaround(random_body(3), options, 3).sheet).views)


@pytest.fixture(scope="module")
def cues(views: list[View]) -> Cues:
    cues = Cues(views)
    calibrate(views, Body.NONE, cues=cues)
    return cues


def told(found: Calibration) -> dict[str, Any]:
    """Return all that a calibration says, but how long it took."""
    return json.loads(json.dumps(calibration_dict(replace(found, seconds={}))))


def test_what_was_found_before_changes_nothing(views: list[View], cues: Cues) -> None:
    again = [replace(view) for view in views]  # of the same pixels
    hints = Hints(labels="?,left,?,?,?")
    known = told(calibrate(again, Body.NONE, hints, cues=cues))
    assert known == told(calibrate(views, Body.NONE, hints))


def test_other_drawings_are_looked_at_anew(views: list[View], cues: Cues) -> None:
    mirrored = [replace(view, rgba=np.ascontiguousarray(view.rgba[:, ::-1])) for view in views]
    assert not cues.are_of(mirrored)
    hints = Hints(labels="front,?,?,?,?")
    known = told(calibrate(mirrored, Body.NONE, hints, cues=cues))
    assert known == told(calibrate(mirrored, Body.NONE, hints))
