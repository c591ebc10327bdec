"""Outlines that mirror each other: opposite views do, and so do a symmetric body's."""

import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from toonset.calib.evidence.mirrored_outlines import mirrored_log_likelihood, read_mirrored_outlines
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.view import View

EIGHT = np.arange(8) * np.pi / 4


@pytest.fixture(scope="module", params=[2, 5])
def views(request: pytest.FixtureRequest) -> list[View]:
    body = random_body(request.param, symmetric=True)
    options = SynthOptions(views=8, cell_px=96, outline_px=0)
    return list(make_turnaround(body, options, 0).views)


def test_opposite_views_and_mirrored_yaws_are_the_most_alike(views: list[View]) -> None:
    found = read_mirrored_outlines(views)
    yaws = EIGHT[found.first], EIGHT[found.second]
    twin = np.isclose(np.cos(yaws[0] + yaws[1]), np.where(found.mirrored, 1, -1))
    opposite = np.isclose(np.cos(yaws[0] - yaws[1]), np.where(found.mirrored, -1, 1))
    alike = twin | opposite
    assert found.log_apart[alike].max() < np.median(found.log_apart[~alike])


@pytest.mark.parametrize("chosen", [[0, 2, 4], [0, 1, 2, 4], [0, 6, 2, 4], [2, 0, 4]])
def test_the_axis_is_told_and_what_cannot_be_is_not(views: list[View], chosen: list[int]) -> None:
    yaws = EIGHT[chosen]
    outlines = read_mirrored_outlines([views[i] for i in chosen])
    alike = np.stack([yaws, yaws + np.pi, -yaws, np.pi - yaws])
    likely = mirrored_log_likelihood(outlines, alike)
    np.testing.assert_allclose(likely, likely[0], atol=1e-9)
    turned = mirrored_log_likelihood(outlines, np.stack([yaws, yaws + np.pi / 2]))
    assert turned[0] > turned[1] + 2


def test_size_and_place_on_the_sheet_do_not_count(views: list[View]) -> None:
    some = [views[i] for i in (0, 2, 4)]
    large = [view.resized((2 * view.rgba.shape[1], 2 * view.rgba.shape[0])) for view in some]
    small, big = (read_mirrored_outlines(own).log_apart for own in (some, large))
    np.testing.assert_allclose(small, big, atol=0.25)
