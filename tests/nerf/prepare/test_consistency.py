"""The report that names the drawing which is off."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from tests.nerf.prepare import balls
from toonset.errors import BundleError
from toonset.nerf.prepare.consistency import CELL, TEXT, consistency_of, consistency_picture


def test_report_of_a_perfect_sheet() -> None:
    found = consistency_of(balls.sheet())
    assert not found.registration.applied
    assert not found.unwarping.applied
    assert found.odd == ()
    for view in found.views:
        assert view.shift_px == (0.0, 0.0)
        assert view.bend_most_px == 0
        assert min(view.agreement) > 0.97
        assert max(view.unexplained) == 0


def test_report_names_the_drawing_with_a_part_of_its_own() -> None:
    frames = list(balls.sheet().frames)
    rgba = frames[3].rgba.copy()
    rgba[40:52, 70:90] = (200, 30, 30, 255)  # a bag that no other drawing shows
    frames[3] = replace(frames[3], rgba=rgba)
    found = consistency_of(replace(balls.sheet(), frames=tuple(frames)))
    assert "003.png" in found.odd
    assert found.heat_px[3][46, 85] > 3
    worst = max(found.views, key=lambda view: view.unexplained[0])
    assert worst.name == "003.png"
    picture = consistency_picture(found)
    assert picture.shape == (2 * (CELL + TEXT), 4 * CELL, 3)
    red = (picture[..., 0] > 200) & (picture[..., 1] < 120)
    cell = red[:CELL, 3 * CELL :]
    assert cell.sum() > 0.8 * red.sum() > 0
    json.dumps(found.to_json(), allow_nan=False)


def test_report_needs_three_drawings() -> None:
    with pytest.raises(BundleError, match=r"balls: 2 picture\(s\).*at least 3"):
        consistency_of(balls.sheet(2))
