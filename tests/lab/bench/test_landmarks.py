"""The benchmark of clicked landmarks: clicks are what they are said to be, cameras are measured."""

import numpy as np
import pytest

from lab.bench.landmarks.measure import (
    ALONE,
    NAMED,
    PLACE,
    PNP,
    ROTATION,
    ClickCase,
    Clicks,
    click,
    click_cases,
    measure,
    measure_pnp,
    records_of,
)


@pytest.fixture(scope="module")
def case() -> ClickCase:
    return next(click_cases(None, 5, 1))


def test_clicks_are_as_far_off_as_they_are_said_to_be(case: ClickCase) -> None:
    clicks = Clicks(40, 0.01, 1)
    marks, wrong = click(case, clicks, 3)
    heights = [np.ptp(camera.project(case.mesh.vertices)[0][:, 1]) for camera in case.cameras]
    off = [
        np.linalg.norm(camera.project(own.world)[0] - own.pixels, axis=1) / height
        for own, camera, height in zip(marks, case.cameras, heights, strict=True)
    ]
    assert len(wrong) == len(case.views)
    assert all(off[view][pair] > 0.08 for view, pair in wrong)
    good = [d for i, own in enumerate(off) for j, d in enumerate(own) if (i, j) not in wrong]
    assert np.sqrt(np.mean(np.square(good)) / 2) == pytest.approx(0.01, rel=0.1)
    again, _ = click(case, clicks, 3)
    np.testing.assert_array_equal(marks[0].pixels, again[0].pixels)


def test_the_sheet_is_better_than_single_views_and_names_wrong_clicks(case: ClickCase) -> None:
    clicks = Clicks(8, 0.01, 1)
    alone, pnp = measure(case, clicks, 0, outlines=False), measure_pnp(case, clicks, 0)
    assert 2 * np.median(alone.rotation_deg) < np.median(pnp.rotation_deg)
    assert np.median(alone.place_px) < 10
    assert alone.named == alone.wrong == len(case.views)
    records = {record.metric: record for record in records_of([alone], ALONE, 0)}
    assert records[ROTATION].n == len(case.views)
    assert records[NAMED].value == 1
    assert PLACE not in {record.metric for record in records_of([pnp], PNP, 0)}
