"""Rays of turning outlines: what is kept of unmoved pairs is what would be found anew."""

import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from toonset.calib.without_body.placing import Figures
from toonset.dataset.silhouettes.hull_rays import contradiction, cut_rays
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround

SEED, VIEWS = 7, 5


@pytest.fixture(scope="module")
def figures() -> Figures:
    made = make_turnaround(random_body(SEED), SynthOptions(views=VIEWS, cell_px=96), SEED)
    return Figures(split_picture(made.sheet).views)


@pytest.mark.parametrize("tilt", [0.0, 0.17])
@pytest.mark.parametrize("view", range(VIEWS))
def test_turning_one_view_is_cutting_all_rays_anew(figures, view, tilt):
    yaws = np.arange(VIEWS) * 2 * np.pi / VIEWS + 0.1
    turned = yaws + 0.7 * (np.arange(VIEWS) == view)
    kept = figures.rays(figures.cameras(yaws, tilt)).with_turned(
        view, figures.silhouettes[view].seen_by(figures.cameras(turned, tilt)[view])
    )
    anew = figures.rays(figures.cameras(turned, tilt))
    for one, other in zip(kept.inside, anew.inside, strict=True):
        np.testing.assert_array_equal(one, other)
    assert kept.contradiction() == anew.contradiction() > 0


@pytest.mark.parametrize("k", [0.0, 0.2])
def test_only_what_is_outside_counts(figures: Figures, k: float) -> None:
    cameras = figures.cameras(np.arange(VIEWS) * 1.1, 0.1, k)
    seen = [own.seen_by(c) for own, c in zip(figures.silhouettes, cameras, strict=True)]
    plain = [contradiction(cut_rays(seen, i)[1]) for i in range(VIEWS)]
    assert figures.contradiction(cameras) == np.sqrt(np.mean(plain))
