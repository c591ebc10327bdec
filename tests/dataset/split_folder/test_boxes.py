"""Boxes by hand: every way to write them reads alike, and what is no box is named."""

import json
from pathlib import Path

import pytest

from toonset.dataset.split_folder.boxes import check_boxes, read_boxes
from toonset.errors import SheetError

BOXES = ((12, 8, 120, 300), (140, 8, 118, 301))
SPLIT = {
    "schema": "toonset-split/1",
    "sheets": [{"name": "a.png"}],
    "views": [{"name": f"{i:03d}.png", "sheet": 0, "box": list(b)} for i, b in enumerate(BOXES)],
}
WRITTEN = {
    "lists": json.dumps(BOXES),
    "object": json.dumps({"boxes": BOXES}),
    "names": json.dumps([dict(zip(("x", "y", "width", "height"), b, strict=True)) for b in BOXES]),
    "short names": json.dumps({"boxes": [dict(zip("xywh", b, strict=True)) for b in BOXES]}),
    "split.json": json.dumps(SPLIT),
    "csv": "12,8,120,300\n140,8,118,301\n",
    "csv with a byte order mark": "\ufeffx,y,w,h\r\n12,8,120,300\r\n140,8,118,301\r\n",
    "csv of a spreadsheet": "name;h;w;x;y\nfront;300;120;12;8\n\nside;301;118;140;8\n",
    "tabs and a comment": "# mine\n12\t8\t120\t300\n140\t8\t118\t301",
    "fractions": "[[12.4, 8.9, 119.6, 299], [140, 8, 118, 301]]",  # outwards
}


@pytest.mark.parametrize("kind", WRITTEN)
def test_every_way_to_write_boxes_reads_alike(kind, tmp_path: Path):
    file = tmp_path / "boxes"
    file.write_text(WRITTEN[kind], encoding="utf-8")
    assert read_boxes(file) == (BOXES,)


def test_a_split_json_of_two_sheets_keeps_them_apart(tmp_path: Path):
    content = json.loads(json.dumps(SPLIT))
    content["sheets"].append({"name": "b.png"})
    content["views"][0]["sheet"] = 1
    (tmp_path / "split.json").write_text(json.dumps(content))
    assert read_boxes(tmp_path / "split.json") == (BOXES[1:], BOXES[:1])


BAD = {
    "[[1, 2, 3": "is no valid JSON",
    "[[1, 2, 3]]": "box 0: found [1, 2, 3], four numbers x, y, width, height are needed",
    '[[1, 2, "wide", 4]]': 'found [1, 2, "wide", 4], four numbers',
    "[[1, 2, true, 4]]": "four numbers",
    "[[1e999, 2, 3, 4]]": "is no valid JSON",
    "[[NaN, 2, 3, 4]]": "is no valid JSON",
    '{"boxes": [], "boxes": [[1, 2, 3, 4]]}': "is no valid JSON",
    "1,2,nan,4": "four numbers",
    "[[1, 2, 3, 4], [5, 6, 0, 8]]": "box 1: 0 x 8 px is empty; give it a width",
    "[[1, 2, -3, 4]]": "box 0: -3 x 4 px is empty",
    "[]": "0 boxes, 1 to 1000 are needed",
    "{}": "holds no list of boxes",
    '{"boxes": 3}': "holds no list of boxes",
    '{"views": [{"box": [1, 2, 3, 4], "sheet": 1}], "sheets": [{}]}': "belongs to no sheet",
    '{"views": [3], "sheets": [{}]}': "belongs to no sheet",
    '{"views": {}, "sheets": []}': '"views" and "sheets" must be lists',
    "x,y,w\n1,2,3": "the first line has no height",
    "x,y,w,h\n": "0 boxes",
    "1,2,3,4\n5,6,7\n": ":2: 3 cells, x,y,width,height are needed",
    "1,2,3,4\n5,6,7,eight\n": ':2: found ["5", "6", "7", "eight"], four numbers',
    "[" * 100_000: "is nested deeper than 64; write it flatter",
}


@pytest.mark.parametrize("text", BAD, ids=range(len(BAD)))
def test_what_is_no_box_is_named(text, tmp_path: Path):
    file = tmp_path / "boxes.txt"
    file.write_text(text)
    with pytest.raises(SheetError) as caught:
        read_boxes(file)
    assert str(caught.value).startswith(f"{file}:")
    assert BAD[text] in str(caught.value)


def test_a_picture_is_no_file_of_boxes(tmp_path: Path):
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n\xff")
    with pytest.raises(SheetError, match="is a PNG picture, no file of boxes; write JSON or CSV"):
        read_boxes(tmp_path / "a.png")


@pytest.mark.parametrize(
    ("boxes", "words"),
    [
        ([(0, 0, 10, 10), (90, 0, 11, 10)], r"box 1 \(x 90, y 0, 11 x 10 px\) leaves the sheet"),
        ([(-1, 0, 10, 10)], "which is 100 x 50 px"),
        ([(0, 41, 10, 10)], "box 0"),
        ([(5, 5, 10, 10), (0, 0, 1, 1), (5, 5, 10, 10)], "box 2 is the same as box 0"),
    ],
)
def test_boxes_that_the_sheet_does_not_have(boxes, words):
    with pytest.raises(SheetError, match=words):
        check_boxes(boxes, (100, 50), "--boxes")
    check_boxes([(0, 0, 100, 50), (99, 49, 1, 1)], (100, 50), "--boxes")  # up to its border
