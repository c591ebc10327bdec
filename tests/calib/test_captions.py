"""Captions choose between what drawings leave open, and never make a wrong camera ok."""

from dataclasses import replace

import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from toonset.calib.calibrate import calibrate
from toonset.calib.captions import weigh_captions
from toonset.calib.options import Hints, VerdictThresholds
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.split_folder.view_labels import parse_labels
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround

SHOWN = ("front", "3q", "side", "3q-back", "back")
LIMITS = VerdictThresholds()


@pytest.fixture(scope="module")
def sheet():
    options = SynthOptions(views=5, cell_px=220, outline_px=0, elevation_deg=8)
    made = make_turnaround(random_body(11, symmetric=False), options, 11)
    views = split_picture(made.sheet).views
    yaws = np.degrees([camera.angles[0] for camera in made.cameras])
    return made.mesh, views, ",".join(f"{yaw:.0f}" for yaw in yaws)


@pytest.fixture(scope="module")
def found(sheet):
    mesh, views, _ = sheet
    return calibrate(views, mesh)


def with_verdicts(found, *verdicts):
    views = [replace(view, verdict=v) for view, v in zip(found.views, verdicts, strict=True)]
    return replace(found, views=tuple(views), verdict=max(verdicts, key=("ok", "ambiguous").index))


def cameras(found):
    return [view.camera for view in found.views]


def verdicts(found):
    return [view.verdict for view in found.views]


def turned(found, number):
    """Return a calibration with one camera where the view that faces it has its own."""
    views = list(found.views)
    yaw = views[number].camera.angles[0]
    facing = min(found.views, key=lambda view: np.cos(view.camera.angles[0] - yaw))
    views[number] = replace(views[number], camera=facing.camera)
    return replace(found, views=tuple(views))


def refuse():
    raise AssertionError("captions are not asked where the drawings are sure")


def test_captions_that_agree_change_nothing(sheet, found):
    labels = parse_labels(sheet[2], 5)
    assert found.is_certain
    assert weigh_captions(found, labels, refuse, LIMITS) is found


def test_captions_that_contradict_sure_drawings_only_doubt_them(sheet, found):
    words = sheet[2].split(",")
    words[0], words[4] = words[4], words[0]
    weighed = weigh_captions(found, parse_labels(",".join(words), 5), refuse, LIMITS)
    assert cameras(weighed) == cameras(found)
    assert verdicts(weighed) == ["weak", "ok", "ok", "ok", "weak"]
    assert weighed.verdict == "weak"
    assert "000.png, 004.png: their caption" in weighed.reason


def test_what_drawings_leave_open_captions_choose_but_do_not_confirm(sheet, found):
    labels = parse_labels(sheet[2], 5)
    opened = with_verdicts(turned(found, 4), "ok", "ok", "ok", "ok", "ambiguous")
    weighed = weigh_captions(opened, labels, lambda: found, LIMITS)
    assert cameras(weighed) == cameras(found)
    assert verdicts(weighed) == ["ok", "ok", "ok", "ok", "weak"]
    assert "004.png: its direction rests on its caption" in weighed.reason


def test_captions_do_not_move_what_drawings_are_sure_of(sheet, found):
    opened = with_verdicts(found, "ok", "ambiguous", "ok", "ok", "ok")
    words = sheet[2].split(",")
    words[0], words[4] = words[4], words[0]
    swapped = turned(turned(found, 0), 4)
    weighed = weigh_captions(opened, parse_labels(",".join(words), 5), lambda: swapped, LIMITS)
    assert cameras(weighed) == cameras(found)
    assert verdicts(weighed) == ["weak", "ambiguous", "ok", "ok", "weak"]


def test_what_a_person_says_replaces_captions(sheet):
    views = [replace(v, caption=c) for v, c in zip(sheet[1], SHOWN, strict=True)]
    assert Hints().captions_of(views) == ",".join(SHOWN)
    assert Hints().captions_of([replace(views[0], caption=""), *views[1:]])[:2] == "?,"
    assert Hints().captions_of(sheet[1]) == ""
    assert Hints(labels="back,?,?,?,front").captions_of(views) == ""
    assert Hints().captions_of([replace(views[0], label="back"), *views[1:]]) == ""
    assert Hints(landmarks="points.json").captions_of(views) == ""
    assert Hints(init="bundle").captions_of(views) == ""
    assert Hints(corrections="corrections.json").captions_of(views) == ""


def test_a_calibration_records_the_captions_it_weighed(sheet, found):
    mesh, views, _ = sheet
    captioned = [replace(view, caption=c) for view, c in zip(views, SHOWN, strict=True)]
    weighed = calibrate(captioned, mesh)
    assert weighed.origin["options"]["captions"] == ",".join(SHOWN)
    assert weighed.origin["options"]["views"] is None
    assert "captions" not in found.origin["options"]
