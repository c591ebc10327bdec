"""Which correction drawings get: none, other cameras, or bends."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.nerf.prepare import balls
from toonset.nerf.fields.triplane import TriplaneField
from toonset.nerf.options import TrainOptions
from toonset.nerf.prepare.prepare import aligned
from toonset.nerf.train.fit_field import fit_field


def asked(drawn, **switches: bool) -> tuple[Any, Any, Any]:
    """Return the aligned scene, what is said of cameras, and of bends."""
    return aligned(drawn, **switches)


def test_bends_alone_where_they_explain_more() -> None:
    drawn, _ = balls.bent_sheet()
    scene, registration, unwarping = asked(drawn)
    assert unwarping.applied
    assert unwarping.gain_nats > registration.gain_nats > 0
    assert not registration.applied
    for before, after in zip(drawn.frames, scene.frames, strict=True):
        assert after.camera is before.camera


def test_cameras_follow_where_places_explain_enough() -> None:
    drawn, _, _ = balls.misplaced(0)
    scene, registration, _ = asked(drawn)
    assert registration.applied
    assert np.any(scene.frames[0].camera.center != drawn.frames[0].camera.center)
    assert registration.apart_px[1] < 0.5 * registration.apart_px[0]


def test_switches_are_heard_and_drawings_that_agree_stay() -> None:
    scene, registration, unwarping = asked(balls.sheet())
    assert scene is balls.sheet()
    assert registration.applied is unwarping.applied is False
    drawn, _ = balls.bent_sheet()
    assert asked(drawn, register=False, unwarp=False) == (drawn, None, None)
    scene, registration, unwarping = asked(drawn, unwarp=False)
    assert registration.applied
    assert unwarping is None
    assert np.any(scene.frames[0].camera.center != drawn.frames[0].camera.center)


def test_planes_are_smoother_where_drawings_were_bent_back() -> None:
    drawn, _ = balls.bent_sheet()
    variation = []
    for trusted in (False, True):
        options = TrainOptions(steps=30, register=not trusted, unwarp=not trusted)
        field = fit_field(drawn, options).result.field
        assert isinstance(field, TriplaneField)
        planes = field.planes.detach()
        variation.append(float(planes.diff(dim=0).abs().mean()))
    assert variation[0] < 0.5 * variation[1]
