"""The splitting benchmark: what counts as right, what as announced, and which sheets are used."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from lab.bench.messy.options import DIFFICULTIES
from lab.bench.split.cases import MIXED, Drawn, SplitCase, drawn_at, messy_cases, sheet_cases
from lab.bench.split.measure import bench_split
from lab.bench.split.methods import METHODS, Found, by_corner_color, by_toonset
from lab.bench.split.score import mask_iou, same_box, score
from toonset.dataset.images.picture import encode_png
from toonset.dataset.split.beside_views import LeftOut
from toonset.dataset.split.sheet import PictureOptions, Segmentation
from toonset.errors import BundleError, SheetError
from toonset.view import View

SIZE = (60, 40)  # of a block of paint


def block(x: int, y: int, width: int = SIZE[0], height: int = SIZE[1]) -> Drawn:
    return Drawn((x, y, width, height), np.full((height, width), 255, np.uint8))


FIGURES = (block(10, 10), block(100, 10), block(10, 80))


def case(figures: tuple[Drawn, ...] = FIGURES) -> SplitCase:
    """Return blue blocks on white."""
    rgba = np.full((140, 200, 4), 255, np.uint8)
    for x, y, w, h in (figure.box for figure in figures):
        rgba[y : y + h, x : x + w, :2] = 40
    return SplitCase("blocks", "plain", rgba, figures)


def found(*figures: Drawn, warned: bool = False, left_out: tuple[Drawn, ...] = ()) -> Found:
    return Found(figures, warned, tuple(figure.box for figure in left_out), 0.5)


# ---- scores


def test_right_figures_are_right_and_each_fault_has_its_name() -> None:
    a, b, c = FIGURES
    result = score(case(), found(*FIGURES))
    assert (result.fault, result.ious, result.announced) == ("", (1.0, 1.0, 1.0), False)
    assert result.megapixels == pytest.approx(0.028)
    assert score(case(), found(a, b)).fault == "number"
    assert score(case(), found(a, b, c, block(150, 100, 10, 10))).fault == "number"
    assert score(case(), found(b, a, c)).fault == "order"
    assert score(case(), found(a, b, block(10, 80, 60, 46))).fault == "boxes"


FAINT = np.pad(np.full((40, 40), 255, np.uint8), 10, constant_values=40)  # a rim of 10 px


@pytest.mark.parametrize(
    ("one", "other", "right"),
    [
        (block(10, 10), block(12, 8), True),  # 2 px off on all sides
        (block(10, 10), block(13, 10), False),
        (block(10, 10), block(10, 10, 63, 40), False),
        (block(0, 0, 400, 400), block(0, 4, 400, 400), True),  # a small share of a large box
        (block(0, 0, 400, 400), block(0, 7, 400, 400), False),
        (drawn_at(FAINT, 0, 0), block(10, 10, 40, 40), True),  # faint rims may be in or out
        (drawn_at(FAINT, 0, 0), block(0, 0, 60, 60), True),
        (drawn_at(FAINT, 0, 0), block(5, 5, 50, 50), False),
    ],
)
def test_boxes_may_be_two_pixels_off(one: Drawn, other: Drawn, right: bool) -> None:
    assert same_box(one, other) is right


def test_a_wrong_sheet_is_announced_by_a_warning_or_by_showing_what_was_left_out() -> None:
    a, b, c = FIGURES
    assert not score(case(), found(a, b)).announced
    assert score(case(), found(a, b, warned=True)).announced
    assert score(case(), found(a, b, left_out=(c,))).announced
    assert not score(case(), found(a, left_out=(c,))).announced  # b is nowhere
    assert not score(case(), found(a, b, left_out=(block(10, 80, 20, 40),))).announced
    assert not score(case(), found(b, a, c)).announced  # nothing is missed, but swapped
    assert not score(case(), found(a, b, c, warned=True)).announced  # right: a false alarm


def test_mask_iou_counts_pixels() -> None:
    assert mask_iou(block(0, 0, 10, 10), block(5, 0, 10, 10)) == pytest.approx(50 / 150)
    assert mask_iou(block(0, 0, 10, 10), block(50, 0, 10, 10)) == 0
    half_empty = block(0, 0, 10, 10)
    half_empty.alpha[:, :5] = 100
    assert mask_iou(block(0, 0, 10, 10), half_empty) == pytest.approx(0.5)


# ---- methods


def test_the_corner_colour_finds_blocks_in_reading_order_and_reads_alpha() -> None:
    speck = block(150, 120, 6, 6)
    result = by_corner_color(case((*FIGURES, speck)).rgba)
    assert [figure.box for figure in result.figures] == [figure.box for figure in FIGURES]
    assert not result.warned
    rgba = np.zeros((50, 80, 4), np.uint8)
    rgba[5:45, 10:70] = (0, 0, 0, 255)  # as black as the empty ground
    assert [figure.box for figure in by_corner_color(rgba).figures] == [(10, 5, 60, 40)]
    assert by_corner_color(np.full((20, 20, 4), 255, np.uint8)).figures == ()


def test_our_views_keep_their_place_and_a_refusal_is_a_warning(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rgba = np.zeros((48, 68, 4), np.uint8)
    rgba[4:44, 4:64] = 255
    view = View(rgba, (6, 6, 68, 48), 0.0, "000.png")
    sheet = Segmentation((view,), None, 1.0, ("look at this",), (LeftOut((1, 2, 3, 4), "speck"),))
    monkeypatch.setattr("lab.bench.split.methods.split_picture", lambda *_: sheet)
    result = by_toonset(rgba)
    assert [figure.box for figure in result.figures] == [(10, 10, 60, 40)]
    assert (result.warned, result.left_out) == (True, ((1, 2, 3, 4),))

    def refuse(rgba: np.ndarray, options: PictureOptions) -> Segmentation:
        raise SheetError("blank")

    monkeypatch.setattr("lab.bench.split.methods.split_picture", refuse)
    refused = by_toonset(rgba)
    assert (refused.warned, refused.figures) == (True, ())


def test_records_count_what_they_say(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter([found(*FIGURES, warned=True), found(*FIGURES[:2]), found(warned=True)])
    monkeypatch.setitem(METHODS, "default", lambda rgba: next(answers))
    result = bench_split([case(), case(), case()], 3)
    ours = {r.metric: r for r in result.records if r.method == "default"}
    assert ours["exactly right"].value == pytest.approx(1 / 3)
    assert ours["wrong and announced"].value == pytest.approx(1 / 2)
    assert ours["right but warned"].value == 1.0
    assert (ours["mask IoU"].n, ours["mask IoU"].median) == (9, 1.0)
    assert ours["mask IoU at least 0.95"].value == pytest.approx(5 / 9)
    assert (ours["seconds"].median, ours["seconds"].seed) == (0.5, 3)
    assert len(result.wrong) == 2
    theirs = {r.metric: r for r in result.records if r.method == "corner colour"}
    assert theirs["exactly right"].value == 1.0
    assert "wrong and announced" not in theirs
    assert "corner colour" in result.text


# ---- cases


def test_there_are_sheets_of_every_difficulty_and_mixtures(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, tuple[str, ...]]] = []

    class Made:
        rgba, boxes, alphas, what = np.zeros((4, 4, 4), np.uint8), (), (), ("plain",)

    def make(seed: int, difficulties: tuple[str, ...]) -> type[Made]:
        asked.append((seed, difficulties))
        return Made

    monkeypatch.setattr("lab.bench.split.cases.make_messy_sheet", make)
    groups = [made.group for made in messy_cases(0, 2)]
    assert set(groups) == {*DIFFICULTIES, MIXED}
    assert groups.count("jpeg") == 2
    assert groups.count(MIXED) == 30
    assert len({seed for seed, _ in asked}) == len(asked)
    assert len(list(messy_cases(0, 2, "jpeg 1"))) == 1


@pytest.fixture
def rendered(tmp_path: Path) -> Path:
    place = tmp_path / "cat-exact"
    (place / "views").mkdir(parents=True)
    (place / "sheet.png").write_bytes(encode_png(case().rgba))
    boxes = []
    for i, figure in enumerate(FIGURES):
        x, y, w, h = figure.box
        cell = np.zeros((100, 100, 4), np.uint8)
        cell[20 : 20 + h, 30 : 30 + w] = 255
        (place / "views" / f"{i:03d}.png").write_bytes(encode_png(cell))
        boxes.append({"sheet_x": x - 30, "sheet_y": y - 20, "w": 100, "h": 100})
    (place / "gt.json").write_text(json.dumps({"boxes": boxes}))
    return tmp_path


def test_rendered_sheets_have_the_boxes_of_what_their_cells_show(rendered: Path) -> None:
    (made,) = sheet_cases(rendered)
    assert [figure.box for figure in made.figures] == [figure.box for figure in FIGURES]
    with pytest.raises(BundleError, match="dog"):
        list(sheet_cases(rendered, "dog"))


def test_the_command_writes_records_and_a_picture_of_wrong_sheets(
    bench, rendered, tmp_path, monkeypatch
):
    monkeypatch.setitem(METHODS, "default", lambda rgba: found(*FIGURES[:1]))
    out = tmp_path / "out"
    done = bench("split", "--cases", rendered, "-o", out, "--quiet")
    assert done.code == 0, done
    assert "rendered sheets" in done.out
    names = {f"chart-rendered-sheets.{form}" for form in ("png", "svg", "csv")}
    assert {p.name for p in out.iterdir()} == {*names, "records.json", "report.html", "wrong.png"}
    records = json.loads((out / "records.json").read_text())
    assert {record["method"] for record in records} == set(METHODS)
    again = ("split", "--cases", rendered, "-o", out, "--force", "--only", "dog")
    assert "'dog'" in bench(*again).reason
