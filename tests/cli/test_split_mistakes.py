"""`toonset split`: every mistake is one line that names it, and nothing is written."""

import shutil
from pathlib import Path

import pytest

from tests.cli.split_sheets import COLORS, drawn_sheet


@pytest.fixture(scope="module")
def prepared(toonset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a sheet, what was split from it, and things that are broken."""
    here = tmp_path_factory.mktemp("prepared")
    drawn_sheet().save(here / "sheet.png")
    drawn_sheet(colors=COLORS[:2]).save(here / "copy.png")
    for name in ("empty", "bundle", "broken"):
        (here / name).mkdir()
    (here / "bundle" / "transforms.json").write_text("{}")
    (here / "broken" / "split.json").write_text("{")
    (here / "far.csv").write_text("x,y,w,h\n0,0,60,160\n400,0,60,160\n")
    (here / "flat.csv").write_text("10,10,60,0\n")
    assert toonset("split", here / "sheet.png", "-o", here / "done", "-q").code == 0
    shutil.copytree(here / "done", here / "torn")
    (here / "torn" / "split.json").unlink()
    return here


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["sheet.png", "--drop", "4"], "--drop: there is no view 4; the 4 views are numbered from"),
        (["sheet.png", "--drop", "0-3"], "--drop: leaves none of 4 views; keep at least one"),
        (["sheet.png", "--drop", "first"], "--drop: 'first' is no number of a view; write them"),
        (["sheet.png", "--drop", "3-1"], "--drop: '3-1' ends before it starts; write 1-3"),
        (["sheet.png", "--background", "whit"], "--background: 'whit' is no colour; write '#rr"),
        (["sheet.png", "--grid", "8by1"], "--grid: '8by1' is no grid of 1 to 1000 cells; write"),
        (["sheet.png", "--grid", "0x1"], "--grid: '0x1' is no grid"),
        (["sheet.png", "--grid", "x8"], "--grid: 'x8' is no grid"),
        (["sheet.png", "--views", "front,3q"], "--views: 2 labels for 4 views"),
        (
            ["sheet.png", "--drop", "0", "--views", "front,3q,side,back"],
            "--views: 4 labels for 3 views (--drop left 3 of 4); give one per kept view",
        ),
        (["sheet.png", "--views", "front,3q,sde,back"], "'sde' is no direction; did you mean"),
        (["sheet.png", "--boxes", "none.json"], "none.json: no such file; check the name of the"),
        (["sheet.png", "--boxes", "far.csv"], "--boxes: box 1 (x 400, y 0, 60 x 160 px) leaves"),
        (["sheet.png", "--boxes", "flat.csv"], "flat.csv:1: 60 x 0 px is empty"),
        (["sheet.png", "--boxes", "sheet.png"], "sheet.png: is a PNG picture, no file of boxes"),
        (["sheet.png", "copy.png", "--boxes", "far.csv"], "has boxes of 1 sheet(s), 2 are given"),
        (["sheet.png", "sheet.png"], "sheet.png: is given twice; name every drawing once"),
        (["sheet.png", "./sheet.png"], "sheet.png: is given twice"),
        (["sheet.png", "none.png"], "none.png: no such file"),
        (["empty"], "empty: is a folder without pictures; name a sheet, or its folder"),
        (["bundle"], "bundle: holds transforms.json, so it is no folder of sheets; give bundle/im"),
        (["torn"], "torn: holds overlay.png and images/ as a split folder does, but no split.json"),
        (["done", "--grid", "4x1"], "--grid: done is cut already; give the sheet that it was cut"),
        (["broken"], "broken/split.json: is no valid JSON"),
        (["sheet.png", "-o", "sheet.png"], "sheet.png: is a file, a folder is needed"),
        (["sheet.png", "-o", "done"], "done: exists already; pass --force to replace it"),
        (["done", "-o", "done", "--force"], "done: holds done, --force would delete it"),
        (["sheet.png", "-o", "empty/..", "--force"], "which this command does not write"),
    ],
)
def test_a_mistake_is_one_line(
    arguments, words, prepared, toonset, snapshot, tmp_path, monkeypatch
):
    monkeypatch.chdir(shutil.copytree(prepared, tmp_path / "here"))
    before = snapshot(Path())
    assert words in toonset("split", *arguments).reason
    assert snapshot(Path()) == before
