"""Shadows are left out, grey shoes stay, and neither grain nor JPEG changes that."""

import pytest

from lab.bench.messy.options import MessyOptions
from lab.bench.messy.sheet import make_messy_sheet
from lab.bench.split.cases import Drawn, SplitCase
from lab.bench.split.methods import by_toonset
from lab.bench.split.score import mask_iou, score
from toonset.dataset.split.sheet import split_picture


def fault(seed: int, *what: str) -> str:
    sheet = make_messy_sheet(seed, what)
    figures = tuple(Drawn(box, alpha) for box, alpha in zip(sheet.boxes, sheet.alphas, strict=True))
    return score(SplitCase("case", "group", sheet.rgba, figures), by_toonset(sheet.rgba)).fault


@pytest.mark.parametrize("seed", [5001, 5016])
def test_soft_shadows_of_any_strength_are_left_out(seed: int) -> None:
    assert fault(seed, "shadows") == ""
    remarks = split_picture(make_messy_sheet(seed, ("shadows",)).rgba).remarks
    assert "shadows on the ground were left out" in remarks


@pytest.mark.parametrize("kind", ["paper", "jpeg"])
@pytest.mark.parametrize("seed", [5000, 5011])
def test_grey_shoes_within_an_outline_and_brown_trousers_are_none(seed: int, kind: str) -> None:
    assert fault(seed, kind) == ""


def test_a_caption_that_a_shadow_reaches_is_no_part() -> None:
    assert fault(5008, "one", "swatches", "shadows") == ""


def test_a_patch_of_a_shadows_tone_that_the_figure_surrounds_stays() -> None:
    options = MessyOptions((80, 260), most_figures=4)
    sheet = make_messy_sheet(7007, ("shadows", "tinted", "jpeg"), options)
    first = split_picture(sheet.rgba).views[0]
    drawn = Drawn(sheet.boxes[0], sheet.alphas[0])
    found = Drawn(first.box, first.rgba[..., 3])
    assert mask_iou(drawn, found) > 0.85  # 0.75 without it
