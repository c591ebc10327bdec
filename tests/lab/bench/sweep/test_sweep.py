"""The sweep of named numbers: which there are, how they are changed, what that comes to."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from lab.bench.sweep.cases import Case
from lab.bench.sweep.measure import baseline, in_fork, measure
from lab.bench.sweep.numbers import Named, named_numbers, read_sources, uses_of
from lab.bench.sweep.outcomes import difference, palette_outcome, split_outcome
from lab.bench.sweep.patches import FixedError, changed, patch
from lab.bench.sweep.sheets import GROUNDS
from lab.bench.sweep.table import kept_in, table
from toonset.palette import colors

SOURCES = read_sources()
SHEET = GROUNDS["white coats"]()


def number(place: str, name: str) -> Named:
    own = [one for one in named_numbers(SOURCES, [place]) if one.name == name]
    assert len(own) == 1
    return own[0]


def test_numbers_are_found_with_all_that_uses_them() -> None:
    step = number("palette", "JUST_NOTICEABLE")
    uses = uses_of(step, SOURCES)
    assert (step.module, step.source) == ("toonset.palette.colors", "0.02")
    modules = {use.module: use for use in uses}
    assert "toonset.palette.paints.lost" in modules
    made = dict(modules["toonset.palette.paints.lost"].made)
    assert made["GROUP"] == "3 * JUST_NOTICEABLE"
    assert all(use.places for use in uses if use.made)


def test_what_is_fixed_at_import_is_told() -> None:
    most = number("palette", "MAX_COLORS")
    assert any(use.fixed for use in uses_of(most, SOURCES))  # the default of an option


@pytest.mark.parametrize(
    ("value", "half", "double"),
    [
        (4, 2, 8),
        (1, 0, 2),
        (200, 100, 228),
        (0.25, 0.125, 0.5),
        (0.9, 0.45, 0.95),
        (2.5, 1.25, 5.0),
        ((3, 0.1), (2, 0.05), (6, 0.2)),
        ({"a": 2, "b": "c"}, {"a": 1, "b": "c"}, {"a": 4, "b": "c"}),
    ],
)
def test_numbers_are_halved_and_doubled(value: object, half: object, double: object) -> None:
    assert changed(value, "half") == half
    assert changed(value, "double") == double


def test_what_holds_no_number_cannot_be_changed() -> None:
    for value in ("text", True, ("a",), None):
        with pytest.raises(FixedError):
            changed(value, "half")


def test_a_number_is_changed_wherever_it_is_bound() -> None:
    step = number("palette", "JUST_NOTICEABLE")

    def tried() -> tuple[float, float]:
        import toonset.palette.paints.lost as lost

        patch(step, uses_of(step, SOURCES), "double")
        return colors.JUST_NOTICEABLE, lost.GROUP

    assert in_fork(tried, 60) == pytest.approx((0.04, 0.12))
    assert colors.JUST_NOTICEABLE == 0.02


def test_what_changes_and_what_does_not_is_measured(tmp_path: Path) -> None:
    case = Case("white coats", partial(split_outcome, SHEET))
    least, most = number("dataset/split", "LEAST_FIGURE_PX"), number("dataset/split", "LISTED")
    places = {
        place for own in (least, most) for use in uses_of(own, SOURCES) for place in use.places
    }
    usual = baseline([case], frozenset(places))
    found = list(measure(least, SOURCES, usual))
    assert [(one.way, one.new, one.moved) for one in found] == [
        ("half", "4", {}),
        ("double", "16", {}),
    ]
    none, huge = measure(least, SOURCES, usual, extremes=True)
    assert (none.lost, huge.lost) == ([], ["white coats"])  # no figure is 8000 px high
    kept = kept_in(tmp_path / "sweep.jsonl")
    assert kept.lacks(least, large=False)
    kept.add(least, found, large=False)
    again = kept_in(tmp_path / "sweep.jsonl")
    assert not again.lacks(least, large=False)
    assert again.effect(least) == "idle"
    again.add(least, [none, huge], large=True)
    assert again.effect(least) == "still"
    other = Named(least.module, least.name, "9", least.line)
    assert again.lacks(other, large=False)
    assert "LEAST_FIGURE_PX = 8" in table([least], again)


def test_a_number_that_no_case_reaches_costs_nothing() -> None:
    case = Case("white coats", partial(split_outcome, SHEET))
    near = number("palette", "LEAST_STEP")
    found = list(measure(near, SOURCES, baseline([case], frozenset())))
    assert [(one.reached, one.ran, one.moved) for one in found] == [(0, 0, {})] * 2


def test_outcomes_differ_by_boxes_and_pixels() -> None:
    usual = split_outcome(SHEET)
    assert len(usual.boxes) == 4
    assert difference(usual, split_outcome(SHEET)) == {}
    moved = np.roll(SHEET, 5, axis=1)
    assert difference(usual, split_outcome(moved))["lost"] == "boxes"
    gone = SHEET.copy()
    gone[:, :140] = 255
    assert difference(usual, split_outcome(gone))["lost"] == "number"
    blank = np.full_like(SHEET, 255)
    assert difference(usual, split_outcome(blank))["lost"] == "error"
    drawing = np.zeros((60, 60, 4), np.uint8)
    drawing[10:50, 10:50] = (200, 30, 30, 255)
    other = np.where(drawing == 200, np.uint8(90), drawing)
    found = difference(palette_outcome((drawing,), ()), palette_outcome((other,), ()))
    assert found["lost"] == "paint"


def test_crashes_are_results() -> None:
    import os

    assert in_fork(partial(os._exit, 3), 60) == "the process ended"
