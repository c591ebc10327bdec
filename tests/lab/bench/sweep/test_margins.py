"""Ten numbers of which half or double loses a sheet: how far from what they are none is lost."""

from functools import partial

import pytest

from lab.bench.sweep.cases import cases_of
from lab.bench.sweep.measure import Baseline, baseline, in_fork, load
from lab.bench.sweep.numbers import Use, named_numbers, read_sources, uses_of
from lab.bench.sweep.outcomes import difference
from lab.bench.sweep.patches import patch

SOURCES = read_sources()
TOUCHING, HEADS, STROKES = "touching, ", "tinted, ", "ground strokes"
MARGINS = {  # times the number, down and up, and the sheets that a larger step loses
    "dataset.split.touching.cut.WORST": (0.6, 1.6, TOUCHING),
    "dataset.split.touching.selection.AS_LARGE": (0.6, 1.3, TOUCHING),
    "dataset.split.touching.selection.WEIGHTS": (0.6, 1.6, TOUCHING),
    "dataset.split.figures.blobs.RECTANGLE": (0.85, 1.6, TOUCHING),
    "dataset.split.ruled_lines.THICKEST_PX": (1.0, 1.6, "cells, "),
    "dataset.split.figures.grouping.STROKE": (0.6, 1.6, HEADS),
    "dataset.split.figures.shadows.STEEPEST": (0.6, 1.6, HEADS),
    "dataset.split.background.STEADY": (0.6, 1.6, STROKES),
    "palette.paints.blends.LEAST_FLAT": (0.6, 1.07, "cel of 2 tones"),
    "palette.paints.clusters.TOUCHING": (0.85, 1.03, "enlarged"),
}


NUMBERS = {f"{one.module}.{one.name}": one for one in named_numbers(SOURCES)}


def uses(place: str) -> list[Use]:
    return uses_of(NUMBERS[f"toonset.{place}"], SOURCES)


@pytest.fixture(scope="module")
def usual() -> Baseline:
    load(SOURCES)
    shown = tuple({cases for *_, cases in MARGINS.values()})
    cases = [case for case in cases_of(None, large=False) if case.name.startswith(shown)]
    places = {place for own in MARGINS for use in uses(own) for place in use.places}
    return baseline(cases, frozenset(places))


@pytest.mark.parametrize("place", MARGINS)
def test_no_sheet_is_lost_within_a_cliffs_margin(usual: Baseline, place: str) -> None:
    *factors, shown = MARGINS[place]
    own = uses(place)
    places = frozenset().union(*(use.places for use in own))
    reached = [
        number
        for number, case in enumerate(usual.cases)
        if case.name.startswith(shown) and usual.reached[number] & places
    ]
    assert reached

    def lost(factor: float) -> list[str]:
        patch(NUMBERS[f"toonset.{place}"], own, factor)
        return [
            usual.cases[n].name
            for n in reached
            if "lost" in difference(usual.outcomes[n], usual.cases[n].run())
        ]

    for factor in factors:
        assert in_fork(partial(lost, factor), 600) == []
