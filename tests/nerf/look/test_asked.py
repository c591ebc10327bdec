"""Views ask the drawings beside them, each for its share."""

from __future__ import annotations

import numpy as np
import pytest

from tests.nerf.look.painted import camera_at, ring
from toonset.nerf.look.asked import flanking


def test_flanking_shares_are_linear_along_the_arc_and_whatever_the_elevation() -> None:
    cameras = ring()
    step = 2 * np.pi / 8
    for elevation in (0.0, 0.4):
        first, second, share = flanking(cameras, camera_at(0.25 * step, elevation))
        assert (first, second) == (0, 1)
        assert share == pytest.approx(0.75, abs=0.02)
    assert flanking(cameras, cameras[3])[0] == 3
    assert flanking(cameras, cameras[3])[2] == pytest.approx(1)
    assert flanking(cameras[:1], camera_at(1.0)) == (0, 0, 1.0)
