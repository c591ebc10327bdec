"""A limb that one drawing holds in a pose of its own gets a body for views near that drawing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from tests.nerf.ellipsoids import Parts, first_hit
from tests.nerf.sections.test_shape import BODY, FRONT, LEFT, drawn
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame
from toonset.nerf.sections.own_limbs import OwnLimbs, own_limbs

OUT = ((0.95, 0.75, 0.0), (0.5, 0.12, 0.12))  # an arm held out sideways, as in the front drawing
DOWN = ((0.7, 0.0, 0.0), (0.12, 0.5, 0.12))  # the same arm, hanging
VOXEL, COUNT = 0.05, 60
LOW = np.full(3, -1.5)


def found(frames: Sequence[Frame], field: Parts) -> list[OwnLimbs | None]:
    """Return what drawings show otherwise than a field of ellipsoids."""
    inside = np.zeros((COUNT,) * 3, np.float32)
    at = np.stack(np.meshgrid(*[LOW[0] + VOXEL * (np.arange(COUNT) + 0.5)] * 3, indexing="ij"), -1)
    for middle, axes in field:
        inside[(((at - middle) / axes) ** 2).sum(axis=-1) < 1] = 1

    def shows(camera: Camera) -> np.ndarray:
        return first_hit(camera, field)[0] >= 0

    return own_limbs(frames, inside, LOW, VOXEL, shows)


@pytest.fixture(scope="module")
def posed() -> list[OwnLimbs | None]:
    """Return what a front with its arm out and a side say of a field whose arm hangs."""
    return found([drawn(FRONT, [BODY, OUT]), drawn(LEFT, [BODY, DOWN])], [BODY, DOWN])


def test_an_arm_in_another_pose_gets_a_body_where_it_was_drawn(
    posed: list[OwnLimbs | None],
) -> None:
    front = posed[0]
    assert front is not None
    assert front.mesh is not None
    low, high = front.mesh.vertices.min(axis=0), front.mesh.vertices.max(axis=0)
    assert high[0] == pytest.approx(1.45, abs=0.1)
    assert (low[1], high[1]) == pytest.approx((0.63, 0.87), abs=0.1)
    assert np.abs(front.mesh.vertices[:, 2]).max() < 0.35  # where the side drawing has a body


def test_the_fields_arm_is_denied_where_the_drawing_has_none(posed: list[OwnLimbs | None]) -> None:
    front = posed[0]
    assert front is not None
    hanging = first_hit(drawn(FRONT, [BODY]).camera, [DOWN])[0] >= 0
    shown = drawn(FRONT, [BODY, OUT]).rgba[..., 3] > 127
    assert (front.denied & hanging & ~shown).sum() > 0.8 * (hanging & ~shown).sum()
    assert not (front.denied & shown).any()


def test_drawings_that_the_field_agrees_with_have_no_limbs_of_their_own(
    posed: list[OwnLimbs | None],
) -> None:
    side = posed[1]
    assert side is not None
    assert side.mesh is None
    assert not side.denied.any()


def test_the_hands_errors_are_no_pose() -> None:
    wider = (DOWN[0], (0.15, 0.5, 0.15))
    (front, _) = found([drawn(FRONT, [BODY, wider]), drawn(LEFT, [BODY, wider])], [BODY, DOWN])
    assert front is not None
    assert front.mesh is None
    assert not front.denied.any()


def test_mirror_images_have_none() -> None:
    frames = [drawn(FRONT, [BODY, DOWN]), replace(drawn(LEFT, [BODY, OUT]), mirrored=True)]
    assert found(frames, [BODY, DOWN])[1] is None
