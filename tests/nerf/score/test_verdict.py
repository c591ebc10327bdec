"""Laws of a run's verdict: it is its worst drawing's, and every reason has its cause."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.hull.tolerance import HullEvidence
from toonset.nerf.options import USUAL_STEPS, TrainOptions
from toonset.nerf.prepare.prepare import Prepared
from toonset.nerf.prepare.registration import Registration
from toonset.nerf.prepare.symmetry import Symmetry
from toonset.nerf.prepare.unwarp import Unwarping
from toonset.nerf.score import verdict
from toonset.nerf.score.between import BetweenView
from toonset.nerf.score.left_out import LeftOut
from toonset.nerf.score.verdict import MOST_OFF, OK, WEAK, Verdict, blended, judged, verdict_of
from toonset.nerf.train.result import Step, Training

SIDE, HEIGHT = 120, 80
TURN = tuple(range(0, 360, 45))
DONE = (Step(1, 0.0, 0.0, 0.0, 0.0),) * USUAL_STEPS


def disc() -> np.ndarray:
    """Return a disc with an inner one as a straight RGBA picture."""
    v, u = np.mgrid[:SIDE, :SIDE] + 0.5
    away = np.hypot(u - SIDE / 2, v - SIDE / 2)
    edge, inner = (np.clip(r - away + 0.5, 0, 1)[..., None] for r in (HEIGHT / 2, HEIGHT / 4))
    color = inner * [250, 200, 40] + (1 - inner) * [30, 60, 160]
    return np.round(np.concatenate([color, 255 * edge], axis=-1)).astype(np.uint8)


def scene(*yaws_deg: float) -> Scene:
    size, rgba = (SIDE, SIDE), disc()
    cameras = (Camera.looking_at(np.zeros(3), math.radians(y), 0.1, 4.0, size) for y in yaws_deg)
    named = zip(yaws_deg, cameras, strict=True)
    return Scene(tuple(Frame(f"{yaw:g}", camera, rgba) for yaw, camera in named), None, "turn")


def training(drawn: Scene, **changed: Any) -> Training:
    """Return a finished training; of its field there is no more than that it has drawings."""
    field = cast(Any, SimpleNamespace(drawings=object()))
    parts = (field, TrainOptions(), DONE, "steps", Prepared(drawn, drawn, None, None, None, None))
    return replace(Training(*parts, HullEvidence(0, ()), {}, {}), **changed)


def moved(found: Training, apart_px: float, *, applied: bool) -> Training:
    """Return the training with outlines that were, or still are, so far apart."""
    registration = Registration(applied, 5.0 if applied else -5.0, 1.0, (9.0, apart_px), ())
    if not applied:
        registration = replace(registration, apart_px=(apart_px, apart_px))
    return replace(found, prepared=replace(found.prepared, registration=registration))


def view(name: str, off: float) -> LeftOut:
    return LeftOut(name, ("a.png", "b.png"), off, 0.12, "upper left", "dark red")


@pytest.fixture
def whole(monkeypatch) -> Callable[[Training], Verdict]:
    """Return the verdict of a training whose drawings predict each other."""
    torn = BetweenView(math.radians(-68), (0, 1), 20.0, 8.0, 99.0, 50.0, 90, 2, 0, 0.25, 0.0, 0.5)
    monkeypatch.setattr(verdict, "left_out", lambda *_: [view("0", 0.0)])
    monkeypatch.setattr(verdict, "views_between", lambda _: (torn,))
    return lambda found: verdict_of(found, found.prepared.scene, cast(Any, "baked"))


# ---- verdicts


def test_what_agrees_is_ok_and_what_shows_nothing_is_weak(whole) -> None:
    found = whole(training(scene(*TURN)))
    assert (found.verdict, found.reasons) == (OK, ())
    assert found.to_json()["off_height"] == {"worst": 0, "bound": MOST_OFF, "views": {"0": 0}}
    (told,) = found.to_json()["between"]
    assert (told["yaw_deg"], told["apart"], told["fragments"]) == (292.0, 0.25, 90)  # torn, but ok
    blank = training(scene(*TURN), result=cast(Any, SimpleNamespace(drawings=None)))
    empty = verdict_of(blank, blank.prepared.scene)
    assert empty.verdict == WEAK
    assert "shows no figure" in empty.reasons[0]


def test_a_run_is_as_weak_as_its_worst_drawing() -> None:
    done = training(scene(*TURN))
    views = [view(name, 0.9 * MOST_OFF) for name in "abcd"]
    assert judged(views, done) == ""
    assert judged([], done) == ""
    said = judged([*views, view("odd", 1.1 * MOST_OFF)], done)
    assert said.startswith("odd is not what its side looks like by a.png and b.png: off by ")
    assert (
        f"off by {110 * MOST_OFF:.1f} % of the height, where up to {100 * MOST_OFF:.1f} %" in said
    )
    assert "12 % of the figure differs, most at the upper left, in the dark red; " in said
    assert "toonset consistency" in said
    odd = [*views, view("odd", 3 * MOST_OFF)]  # what helps goes by the cause
    assert "look at odd's camera, pose, side and colours" in judged(odd, done)
    short = replace(done, history=DONE[:20])
    assert "these were 20 steps: train longer" in judged(odd, short)
    assert "train longer" not in judged(odd, replace(short, stopped="the loss grew"))


def test_blends_are_named_where_there_are_many() -> None:
    drawn = scene(*TURN)
    labels = np.zeros((SIDE, SIDE), dtype=np.uint8)
    labels[::2] = 255
    lined = replace(drawn, frames=tuple(replace(f, labels=labels) for f in drawn.frames))
    assert blended(drawn) == 0
    assert blended(lined) == pytest.approx(0.5, abs=0.02)
    said = judged([view(name, 2 * MOST_OFF) for name in "abcd"], training(lined))
    assert "50 % of the figures' pixels are blends" in said


@pytest.mark.parametrize(
    ("yaws", "said"),
    [
        ((0, 180), ["within 30 degrees of one line"]),
        ((0, 90, 180, 270), ["opposite drawings share an outline, which leaves 90 deg"]),
        ((0, 120, 240), ["no drawing in the 120 deg"] * 3),
        ((0, 72, 144, 216, 288), []),
    ],
)
def test_what_no_drawing_shows_makes_a_run_weak(
    whole, yaws: tuple[float, ...], said: list[str]
) -> None:
    found = whole(training(scene(*yaws)))
    assert found.verdict == (WEAK if said else OK)
    assert len(found.reasons) == len(said)
    assert all(part in reason for part, reason in zip(said, found.reasons, strict=True))


def test_an_undrawn_side_that_is_the_mirror_image_of_another_is_no_guess(whole) -> None:
    half = scene(0, 45, 90, 135, 180)
    assert "no drawing in the 180 deg" in whole(training(half)).reasons[0]
    found = Symmetry("auto", (1.0,), 0.0, ("45", "90", "135"))
    assert whole(training(half, symmetry=found)).verdict == OK


# ---- whether drawings agree, which decides how much a field is smoothed


@pytest.mark.parametrize(
    ("apart_px", "applied", "agree"), [(0.9, False, True), (0.03, True, True), (0.5, True, False)]
)
def test_drawings_agree_as_they_are_or_once_cameras_follow_them(
    apart_px: float, applied: bool, agree: bool
) -> None:
    assert moved(training(scene(*TURN)), apart_px, applied=applied).prepared.agree is agree
    bends = Unwarping(True, 5.0, 1.0, (9.0, 0.01), ())
    assert not Prepared(scene(*TURN), scene(*TURN), None, bends).agree
