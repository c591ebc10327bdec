"""From where a page shows a figure."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from toonset.camera import Camera
from toonset.nerf.layered_views.ring import ring_through


def cameras(*angles: Sequence[float]) -> list[Camera]:
    """Return cameras at yaws, elevations and rolls in degrees."""
    return [
        Camera.looking_at(
            np.zeros(3),
            math.radians(one[0]),
            math.radians(one[1]),
            1.0,
            (9, 9),
            math.radians(one[2] if len(one) > 2 else 0.0),
        )
        for one in angles
    ]


def test_even_drawings_are_met_by_even_steps_from_the_front() -> None:
    ring = ring_through(cameras(*((yaw, 6) for yaw in range(0, 360, 45))))
    assert ring.own == list(range(0, 72, 9))
    np.testing.assert_allclose(np.degrees(ring.angles[:, 0]), np.arange(72) * 5, atol=1e-9)
    np.testing.assert_allclose(np.degrees(ring.angles[:, 1]), 6)
    assert (ring.start, ring.elevations) == (0, [pytest.approx(6)])
    assert sum(ring.layered) == 24
    assert all(ring.layered[i] for i in ring.own)


def test_uneven_leaning_drawings_and_twins_each_have_their_very_view() -> None:
    drawn = cameras((2, 3), (48, 9, 4), (48.2, 5), (171, 3), (-88, 4))
    ring = ring_through(drawn)
    for camera, own in zip(drawn, ring.own, strict=True):
        yaw, elevation, roll = ring.angles[own]
        seen = Camera.looking_at(np.zeros(3), yaw, elevation, 1.0, (9, 9), roll)
        np.testing.assert_allclose(seen.rotation, camera.rotation, atol=1e-9)
        assert ring.layered[own]
    assert ring.level == [0] * 72 + [-1]  # of twins one is on the ring
    assert math.degrees(ring.angles[ring.start][0]) == pytest.approx(2)


@pytest.mark.parametrize(("high", "rings"), [(0, 1), (2, 1), (3, 2)])
def test_three_drawings_from_above_carry_a_ring(high: int, rings: int) -> None:
    level = [(yaw, 0) for yaw in (0, 90, 180, -90)]
    above = [(120 * i, 40) for i in range(high)]
    ring = ring_through(cameras(*level, *above), 12)
    assert len(ring.elevations) == rings
    assert ring.level.count(-1) == (high if rings == 1 else 0)
    assert ring.elevations[-1] == pytest.approx(40 if rings == 2 else 0)
    below = ring_through(cameras(*level, *((yaw, -40) for yaw, _ in above)), 12)
    assert below.elevations[0] == pytest.approx(-40 if rings == 2 else 0)
    assert below.start == (12 if rings == 2 else 0)  # the sheet's own ring comes first


def test_without_drawings_views_are_even() -> None:
    ring = ring_through([], 8)
    np.testing.assert_allclose(np.degrees(ring.angles[:, 0]), np.arange(8) * 45)
    assert (ring.own, ring.elevations) == ([], [0.0])
