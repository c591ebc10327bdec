"""The look bench: what is left out is left out, and its pages of the sweeps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lab.bench.look.cases import DRAWN, LookCase, drawn_case, look_cases
from lab.bench.look.measure import (
    COLUMNS,
    FIELD,
    LOOKS,
    LookResult,
    Recipe,
    bench_look,
    panels_of,
    records_of,
)
from lab.bench.look.picture import look_sheet
from lab.bench.records.chart import charts_of
from lab.bench.records.record import DEFAULT, methods_table
from lab.bench.stability import fields
from lab.bench.stability.pages import PAGES
from lab.bench.stability.trials import UNJUDGED
from toonset.errors import BundleError
from toonset.nerf.options import TrainOptions
from toonset.nerf.score.evaluation_picture import TILE_PX

PAGE = {page.name: page for page in PAGES}


# ---- cases and looks


def test_a_folder_without_cases_and_a_name_that_fits_none(tmp_path: Path, bench) -> None:
    with pytest.raises(BundleError, match="holds no case"):
        list(look_cases(tmp_path, 0, 1))
    assert (
        "no case's name contains 'nobody'"
        in bench("look", "--only", "nobody", "-o", tmp_path / "out").reason
    )


@pytest.fixture(scope="module")
def short() -> Iterator[list[LookResult]]:
    """Return the looks of a small sheet after a short training."""
    known = dict(LOOKS)
    quick = TrainOptions(steps=30, field="triplane")
    for name, look in known.items():
        own = look.recipe.options
        options = replace(quick, mannequin=own.mannequin)
        LOOKS[name] = replace(look, recipe=Recipe(options, look.recipe.paint))
    case, made = drawn_case(0, replace(DRAWN, cell_px=80, outline_px=1.2, views=6))
    case = replace(case, train=replace(case.train, mannequin=made.mesh))
    turn = replace(case.test, frames=case.test.frames[:3])
    case = replace(case, turn=turn, test=replace(case.test, frames=case.test.frames[:3]))
    yield bench_look([case], 5)
    LOOKS.update(known)


def test_every_look_is_another(short: list[LookResult]) -> None:
    assert [one.look for one in short] == list(LOOKS)
    shown = {one.look: np.stack(one.pictures) for one in short}
    names = list(shown)
    for i, name in enumerate(names):
        for other in names[i + 1 :]:
            assert (shown[name] != shown[other]).any(), (name, other)
    by_name = {one.look: one for one in short}
    for one in short:
        for figure in ("flip", "dirt", "sharpness", "ink_f1", "label_miou_shift", "psnr_blocks"):
            assert one.figures[figure] is not None, (one.look, figure)
        assert one.figures["flicker"] is not None
        assert one.cpu_seconds > 0
    drawn, field = by_name[DEFAULT].figures, by_name[FIELD].figures
    assert drawn["dirt"] < field["dirt"]  # type: ignore[operator]


def test_looks_are_records_a_table_a_chart_and_pictures(short: list[LookResult]) -> None:
    records = records_of(short, 5)
    found = {(record.method, record.metric): record for record in records}
    assert found[DEFAULT, "FLIP"].by_case == {"body 0": short[0].figures["flip"]}
    assert {record.seed for record in records} == {5}
    lines = methods_table(records, COLUMNS).splitlines()
    assert lines[0] == "drawn"
    assert [line[:24].strip() for line in lines[2:]] == list(LOOKS)
    (chart,) = charts_of("look", records, "seed 5")
    assert chart.lower_is_better
    assert chart.headline.startswith(f"default: FLIP {short[0].figures['flip']:#.3g} in ")
    assert {point.method for point in chart.points} == set(LOOKS)
    panels = panels_of(records)
    assert len(panels) == 7
    assert all(list(panel.series) == list(LOOKS) for panel in panels)
    assert look_sheet(short).shape[1] == TILE_PX * (len(LOOKS) + 1)


# ---- the sweeps


def test_a_look_page_fails_where_the_field_is_better(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fields, "SHEET", replace(DRAWN, cell_px=60, outline_px=1, views=4))
    flips = {DEFAULT: 0.08, FIELD: 0.1}

    def told(cases: Sequence[LookCase], seed: int, looks: Sequence[str]) -> list[LookResult]:
        (case,) = cases
        pictures = tuple(frame.rgba for frame in case.test.frames)
        return [
            LookResult(case, name, seed, {"flip": flips[name]}, 1.0, pictures) for name in looks
        ]

    monkeypatch.setattr(fields, "bench_look", told)
    page = PAGE["look warp"]
    ((fine,), picture) = fields.try_look(lambda: page.draw(2, 0), 0)
    assert (fine.value, fine.voice) == (pytest.approx(80), UNJUDGED)
    assert fine.words == "FLIP 0.0800, of the field 0.1000"
    assert picture.startswith(b"\x89PNG")
    flips[DEFAULT] = 0.11
    ((worse,), _) = fields.try_look(lambda: page.draw(1, 0), 0)
    assert worse.value == pytest.approx(110)
    assert fine.value < page.kind.fine < page.kind.failed < worse.value
