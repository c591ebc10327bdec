"""Laws of a run's verdict: lengths are what was moved, and every reason has its cause."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.hull.tolerance import HullEvidence
from toonset.nerf.options import TrainOptions
from toonset.nerf.prepare.prepare import Prepared
from toonset.nerf.prepare.registration import Registration
from toonset.nerf.prepare.symmetry import Symmetry
from toonset.nerf.prepare.unwarp import Unbending
from toonset.nerf.score.verdict import MOST_OFF, OK, WEAK, blended, off_of, verdict_of
from toonset.nerf.train.result import Step, Training

SIDE, HEIGHT = 120, 80
TURN = tuple(range(0, 360, 45))
DONE = (Step(1, 0.0, 0.0, 0.0, 0.0),) * TrainOptions().steps


def disc(
    right: float = 0.0, down: float = 0.0, side: int = SIDE, kept: float = 1.0, soft: float = 1.0
) -> np.ndarray:
    """Return a disc with an inner one, moved by pixels, as a straight RGBA picture."""
    v, u = np.mgrid[:side, :side] + 0.5
    away = np.hypot(u - side / 2 - right, v - side / 2 - down)
    edge, inner = (
        np.clip((r - away) / soft + 0.5, 0, 1)[..., None] for r in (HEIGHT / 2, HEIGHT / 4)
    )
    color = inner * [250, 200, 40] + (1 - inner) * [30, 60, 160]
    color = 255 - kept * (255 - color)
    return np.round(np.concatenate([color, 255 * edge], axis=-1)).astype(np.uint8)


def scene(*yaws_deg: float, rgba: np.ndarray | None = None) -> Scene:
    rgba = disc() if rgba is None else rgba
    size = (rgba.shape[1], rgba.shape[0])
    cameras = (Camera.looking_at(np.zeros(3), math.radians(y), 0.1, 4.0, size) for y in yaws_deg)
    named = zip(yaws_deg, cameras, strict=True)
    return Scene(tuple(Frame(f"{yaw:g}", camera, rgba) for yaw, camera in named), None, "turn")


def training(drawn: Scene, **changed: Any) -> Training:
    """Return a finished training without a field."""
    none = cast(Any, None)
    parts = (none, TrainOptions(), DONE, "steps", Prepared(drawn, None, None, None, None))
    return replace(Training(*parts, HullEvidence(0, ()), {}, {}), **changed)


def moved(found: Training, apart_px: float, *, applied: bool) -> Training:
    """Return the training with outlines that were, or still are, so far apart."""
    registration = Registration(applied, 5.0 if applied else -5.0, 1.0, (9.0, apart_px), ())
    if not applied:
        registration = replace(registration, apart_px=(apart_px, apart_px))
    return replace(found, prepared=replace(found.prepared, registration=registration))


def judged(found: Training, picture: np.ndarray | None = None) -> Any:
    count = len(found.prepared.scene.frames)
    return verdict_of(found, [disc() if picture is None else picture] * count)


# ---- lengths


@pytest.mark.parametrize(("right", "down"), [(1, 0), (0, 1), (-1, 0)])
def test_pictures_that_are_moved_by_a_pixel_are_off_by_a_pixel(right: int, down: int) -> None:
    off = off_of(scene(*TURN), [disc(right, down)] * 8, 0.0)
    assert off.pictures * HEIGHT == pytest.approx(1, rel=0.02)
    assert off.outlines == 0
    assert off.views["45"] == pytest.approx(off.pictures)


def test_the_farther_pictures_are_moved_the_more_they_are_off() -> None:
    found = [off_of(scene(0), [disc(right)], 0.0).pictures for right in (0, 0.25, 0.5, 1, 2, 4)]
    assert found[0] == 0
    assert all(less < more for less, more in itertools.pairwise(found))


def test_a_share_of_the_height_does_not_depend_on_contrast_room_or_size() -> None:
    first = off_of(scene(0), [disc(1)], 0.8)
    pale = off_of(scene(0, rgba=disc(kept=0.3)), [disc(1, kept=0.3)], 0.8)
    roomy = off_of(scene(0, rgba=disc(side=160)), [disc(1, side=160)], 0.8)
    twice = [np.kron(p, np.ones((2, 2, 1), np.uint8)) for p in (disc(), disc(1))]
    large = off_of(scene(0, rgba=twice[0]), [twice[1]], 1.6)
    assert first.outlines == pytest.approx(0.01)
    for other in (pale, roomy, large):
        assert other.both == pytest.approx(first.both, rel=0.03)


def test_a_drawing_that_is_blurred_or_empty_is_measured_too() -> None:
    nothing = np.zeros_like(disc())
    frames = scene(*TURN)
    off = off_of(
        replace(frames, frames=(*frames.frames, replace(frames.frames[0], rgba=nothing, name="x"))),
        [*[disc()] * 8, nothing],
        0.0,
    )
    assert off.both == 0
    assert "x" not in off.views
    soft = off_of(scene(0), [disc(soft=6)], 0.0)
    assert 0.2 < soft.pictures * HEIGHT < 2


# ---- verdicts


def test_what_agrees_is_ok() -> None:
    found = judged(training(scene(*TURN)))
    assert (found.verdict, found.reasons) == (OK, ())
    assert found.to_json()["off_height"]["views"]["0"] == 0


def test_outlines_that_no_shape_explains_count_where_nothing_could_be_mended() -> None:
    apart = 1.1 * MOST_OFF * HEIGHT
    (reason,) = judged(moved(training(scene(*TURN)), apart, applied=False)).reasons
    assert "toonset consistency" in reason
    (reason,) = judged(moved(training(scene(*TURN)), apart, applied=True)).reasons
    assert "toonset consistency" in reason
    assert judged(moved(training(scene(*TURN)), 0.5 * apart, applied=True)).verdict == OK


def test_a_reason_says_how_much_where_and_what_helps() -> None:
    drawn = scene(*TURN)
    pictures = [disc(1), *[disc(0.25)] * 7]
    found = verdict_of(training(drawn), pictures)
    assert found.verdict == WEAK
    assert f"{100 * found.off.both:.2f} % of the height apart" in found.reasons[0]
    assert ", most in 0; " in found.reasons[0]
    short = training(drawn, history=DONE[:20])
    (reason,) = verdict_of(short, pictures).reasons
    assert "these were 20 steps: train longer" in reason
    (reason,) = verdict_of(replace(short, stopped="the loss grew"), pictures).reasons
    assert "what one body cannot" in reason


def test_blends_are_named_where_there_are_many() -> None:
    drawn = scene(*TURN)
    labels = np.zeros((SIDE, SIDE), dtype=np.uint8)
    labels[::2] = 255
    lined = replace(drawn, frames=tuple(replace(f, labels=labels) for f in drawn.frames))
    assert blended(drawn) == 0
    assert blended(lined) == pytest.approx(0.5, abs=0.02)
    (reason,) = judged(training(lined), disc(1)).reasons
    assert "50 % of the figures' pixels are blends" in reason


@pytest.mark.parametrize(
    ("yaws", "said"),
    [
        ((0, 180), ["within 30 degrees of one line"]),
        ((0, 90, 180, 270), ["opposite drawings share an outline, which leaves 90 deg"]),
        ((0, 120, 240), ["no drawing in the 120 deg"] * 3),
        ((0, 72, 144, 216, 288), []),
    ],
)
def test_what_no_drawing_shows_makes_a_run_weak(yaws: tuple[float, ...], said: list[str]) -> None:
    found = judged(training(scene(*yaws)))
    assert found.verdict == (WEAK if said else OK)
    assert len(found.reasons) == len(said)
    assert all(part in reason for part, reason in zip(said, found.reasons, strict=True))


def test_an_undrawn_side_that_is_the_mirror_image_of_another_is_no_guess() -> None:
    half = scene(0, 45, 90, 135, 180)
    assert "no drawing in the 180 deg" in judged(training(half)).reasons[0]
    found = Symmetry((1.0,), 0.0, ("45", "90", "135"))
    assert judged(training(half, symmetry=found)).verdict == OK


def test_outlines_are_compared_where_every_step_that_would_is_switched_off() -> None:
    drawn = scene(*TURN)
    lifted = replace(drawn.frames[0], rgba=disc(0, 6))
    apart = Prepared(replace(drawn, frames=(lifted, *drawn.frames[1:])), None, None, None, None)
    assert Prepared(drawn, None, None, None, None).outlines_px < 0.5 < apart.outlines_px


# ---- whether drawings agree, which decides how much a field is smoothed


@pytest.mark.parametrize(("apart_px", "applied"), [(0.9, False), (0.03, True)])
def test_drawings_agree_as_they_are_or_once_cameras_follow_them(
    apart_px: float, applied: bool
) -> None:
    assert moved(training(scene(*TURN)), apart_px, applied=applied).prepared.agree


def test_drawings_that_were_bent_or_stay_apart_do_not_agree() -> None:
    assert not moved(training(scene(*TURN)), 0.5, applied=True).prepared.agree
    bends = Unbending(True, 5.0, 1.0, (9.0, 0.01), ())
    assert not Prepared(scene(*TURN), None, None, bends, None).agree
