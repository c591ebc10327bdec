"""The calibration benchmark: figures that count what they say, fair conditions, a legible table."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from lab.bench.calib import measure as calib
from lab.bench.calib.figures import MeasuredSheet, ViewError, angle_between, sheet_records
from lab.bench.calib.measure import bench_calibration, named_directions, own_cache
from lab.bench.cases import cases
from lab.bench.cases.bodies import random_body
from lab.bench.cases.cases import CONDITIONS, CalibCase, calib_cases
from lab.bench.records.record import Record, Recorder
from toonset.calib.result import SEVERITY
from toonset.camera import Camera, rotation_from_angles
from toonset.view import View

RECORDER = Recorder("default", "drawn", 0)


def sheet(*views: tuple[float, float, str], sigma: float = 1.0) -> MeasuredSheet:
    """Return a sheet of (error, error modulo twin, verdict) in degrees; yaw errs as the view."""
    rad = math.radians
    found = [
        ViewError(rad(raw), rad(twin), what, rad(raw), rad(sigma)) for raw, twin, what in views
    ]
    return MeasuredSheet(tuple(found), "", 2.0, 2.0)


def by_metric(records: list[Record]) -> dict[str, Record]:
    found = {record.metric: record for record in records}
    assert len(found) == len(records)
    return found


# ---- figures


def test_figures_count_what_they_say() -> None:
    first = sheet((1, 1, "ok"), (4, 4, "weak"), (10, 10, "ok"))
    second = sheet((60, 2, "ok"), (170, 3, "ambiguous"), (40, 40, "failed"))
    found = by_metric(sheet_records([first, second], RECORDER))
    assert found["rotation error"].median == pytest.approx(25)
    assert found["rotation error modulo twin"].median == pytest.approx(3.5)
    assert found["within 5 deg"].value == pytest.approx(2 / 6)
    assert found["within 5 deg modulo twin"].value == pytest.approx(4 / 6)
    assert found["flipped views"].value == 2
    assert (found["wrong but ok"].value, found["wrong but ok"].n) == (1, 6)
    announced = found["wrong and announced"]
    assert announced.value == pytest.approx(2 / 3)
    assert (announced.n, announced.direction) == (3, "higher")
    assert [found[v].value * 6 for v in SEVERITY] == pytest.approx([3, 1, 1, 1])
    assert (found["seconds"].n, found["seconds"].median) == (2, 2.0)


def test_methods_can_be_paired_by_sheet() -> None:
    first = replace(sheet((1, 1, "ok"), (3, 2, "ok"), (9, 9, "ok")), case="first")
    second = replace(sheet((60, 2, "ok")), case="second", seconds=7.0)
    found = by_metric(sheet_records([first, second], RECORDER))
    assert found["rotation error"].by_case == pytest.approx({"first": 3, "second": 60})
    assert found["rotation error modulo twin"].by_case == pytest.approx({"first": 2, "second": 2})
    assert found["seconds"].by_case == {"first": 2, "second": 7}


def test_right_sigmas_have_unit_spread_and_far_views_do_not_count() -> None:
    rng = np.random.default_rng(0)
    errors = rng.normal(scale=2.0, size=400)
    views = [(float(e), abs(float(e)), "ok") for e in errors]
    for sigma, spread in ((2.0, 1.0), (0.5, 4.0)):
        measured = sheet(*views, (80, 80, "ok"), sigma=sigma)
        record = by_metric(sheet_records([measured], RECORDER))["yaw z-score"]
        assert record.n == 400
        assert record.value == pytest.approx(spread, rel=0.1)


def test_what_was_not_judged_has_no_verdicts_and_nothing_placed_has_no_errors() -> None:
    unjudged = replace(sheet((50, 50, "")), seconds=0.0)
    assert set(by_metric(sheet_records([unjudged], RECORDER))).isdisjoint(
        (*SEVERITY, "wrong but ok", "wrong and announced")
    )
    assert set(by_metric(sheet_records([sheet()], RECORDER))) == {"seconds", "CPU seconds"}
    assert "wrong and announced" not in by_metric(sheet_records([sheet((1, 1, "ok"))], RECORDER))


@pytest.mark.parametrize(("a", "b"), [(6.2, 0.1), (0.1, 6.2), (-9.0, 9.0), (1.0, 1.0)])
def test_differences_of_angles_are_the_short_way(a: float, b: float) -> None:
    off = angle_between(a, b)
    assert -math.pi <= off < math.pi
    np.testing.assert_allclose([math.cos(b + off), math.sin(b + off)], [math.cos(a), math.sin(a)])


def test_directions_are_named_to_the_nearest_eighth() -> None:
    named = named_directions(np.radians([-3.0, 22.0, 23.0, 181.0, 338.0, 350.0]))
    assert [round(math.degrees(yaw)) for (yaw,) in named] == [0, 0, 45, 180, 0, 0]


# ---- methods


def answer(rotations: np.ndarray) -> SimpleNamespace:
    """Return what of a calibration is measured."""
    sigmas = SimpleNamespace(yaw=0.1)
    cameras = [Camera(r, np.zeros(3), 1.0, np.zeros(2), (4, 4)) for r in rotations]
    views = [SimpleNamespace(camera=camera, verdict="ok", sigmas=sigmas) for camera in cameras]
    return SimpleNamespace(views=views)


def even_case(views: int = 4) -> CalibCase:
    turns = np.arange(views) * 2 * math.pi / views
    blank = View(np.full((4, 4, 4), 255, np.uint8), (0, 0, 4, 4), 0.0, "000.png")
    rotations = np.stack([rotation_from_angles(t, math.radians(5), 0) for t in turns])
    return CalibCase("even", "even", (blank,) * views, random_body(0), rotations)


def test_methods_get_their_labels_and_their_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    case, seen = even_case(), []

    def watched(views, mesh, options, known=None):
        seen.append((len(os.listdir(os.environ["TOONSET_CACHE"])), known))
        return answer(case.rotations)

    monkeypatch.setattr(calib, "find_cameras", watched)
    records = bench_calibration([case], 0, quick=True)
    (nominal,) = [r for r in records if r.unit == "deg"][:1]
    assert (nominal.method, nominal.n) == ("nominal angles", 4)
    assert nominal.p95 == pytest.approx(0, abs=1e-4)
    (plain, labelled, cold) = seen
    assert (plain[0], labelled[0], cold[0]) == (1, 1, 0)
    assert (plain[1], cold[1]) == (None, None)
    assert labelled[1].labels == named_directions(np.radians([0, 90, 180, 270]))
    for method in calib.QUICK:
        own = by_metric([r for r in records if r.method == method])
        assert own["within 5 deg"].value == own["ok"].value == 1


def test_the_users_cache_is_left_alone_whatever_happens(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("TOONSET_CACHE", str(tmp_path))
    inside = []

    def fail() -> None:
        with own_cache():
            inside.append(Path(os.environ["TOONSET_CACHE"]))
            (inside[0] / "file").write_bytes(b"x")
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert os.environ["TOONSET_CACHE"] == str(tmp_path)
    assert not inside[0].exists()
    monkeypatch.delenv("TOONSET_CACHE")
    with own_cache():
        pass
    assert "TOONSET_CACHE" not in os.environ


# ---- conditions


def test_another_body_has_the_drawn_sheet_and_a_mannequin_without_its_bag(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    few = {
        name: replace(c, options=replace(c.options, views=3, cell_px=120, supersample=1))
        for name, c in CONDITIONS.items()
    }
    monkeypatch.setattr(cases, "CONDITIONS", few)
    drawn, other, plain = (next(calib_cases(None, 3, 1, n)) for n in ("drawn", "other", "plain"))
    np.testing.assert_array_equal(drawn.rotations, other.rotations)
    for one, same in zip(drawn.views, other.views, strict=True):
        np.testing.assert_array_equal(one.rgba, same.rgba)
    assert "bag" in drawn.mesh.part_names
    for mesh in (other.mesh, plain.mesh):
        assert "bag" not in mesh.part_names
    assert other.mesh.height != drawn.mesh.height
    assert other.drawn is not None
    np.testing.assert_array_equal(other.drawn.vertices, drawn.mesh.vertices)
    assert next(calib_cases(None, 3, 1, "other")).mesh.height == other.mesh.height
    assert [case.name for case in calib_cases(None, 0, 2, "near 1")] == ["near 1"]
    assert not list(calib_cases(None, 0, 2, "far"))
