"""corrections.json: what it may say, which view it means, and what it does to a split."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image, ImageDraw
from pydantic import TypeAdapter

from lab.bench.messy.sheet import make_messy_sheet
from toonset.dataset.split_folder.corrected import Given, match_boxes, overlap
from toonset.dataset.split_folder.corrections import (
    Corrections,
    parse_corrections,
    read_corrections,
)
from toonset.dataset.split_folder.load import split_sheet
from toonset.dataset.split_folder.options import SheetOptions
from toonset.errors import SheetError, ToonsetError, UsageError
from toonset.read import MAX_DEPTH

FULL: dict[str, Any] = {
    "version": 1,
    "sheet": {"name": "sheet.png", "sha256": "0" * 64, "size": [360, 200]},
    "background": "#ffffff",
    "boxes": [[12, 8, 40, 80]],
    "views": [
        {"box": [12, 8, 40, 80], "label": "front", "exclude": True},
        {
            "box": [60, 8, 40, 80],
            "camera": {
                "yaw": 30.0,
                "elevation": 5.0,
                "roll": 1.0,
                "scale": 31.2,
                "middle": [72.0, 58.0],
            },
            "lock": True,
            "landmarks": [{"world": [0.0, 1.2, 0.3], "pixel": [71.0, 40.0]}],
        },
    ],
    "palette": {
        "keep": ["#aabbcc"],
        "drop": ["#010203"],
        "merge": [["#020202", "#030303"]],
        "split": [{"color": "#040404", "into": ["#050505", "#060606"]}],
        "names": {"#aabbcc": "skin"},
        "strokes": [
            {"box": [60, 8, 40, 80], "color": "#aabbcc", "radius": 6.0, "points": [[70.0, 20.0]]}
        ],
    },
}
VIEW = {"box": [12, 8, 40, 80]}
CAMERA = {"yaw": 0, "scale": 10, "middle": [20, 20]}


def written(folder: Path, **content: Any) -> Path:
    path = folder / "corrections.json"
    path.write_text(json.dumps({"version": 1, **content}))
    return path


def test_what_is_written_is_read_again():
    found = parse_corrections(json.dumps(FULL).encode(), "file")
    said = TypeAdapter(Corrections).dump_python(found, mode="json", exclude_defaults=True)
    assert {"version": 1, **said} == FULL
    assert parse_corrections(b'\xef\xbb\xbf{"version": 1}', "file") == Corrections()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"boxs": []}, "unknown key 'boxs'"),
        ({"views": [{"bxo": [1, 2, 3, 4]}]}, "unknown key 'views.0.bxo'"),
        ({"version": 2}, "states version 2, this toonset reads"),
        ({"version": True}, "states version True"),
        ({"version": None}, "states no version"),
        ({"sheet": {"name": "a", "sha256": "12"}}, "sheet.sha256: String should match"),
        ({"background": "blue"}, "background: 'blue' is no colour; write it as #rrggbb"),
        ({"boxes": [[1, 2, 3]]}, "boxes.0: four numbers x, y, width, height are needed"),
        ({"boxes": [[1, 2, 0, 3]]}, "boxes.0: 0 x 3 px is empty"),
        ({"boxes": [[1, 2, True, 3]]}, "boxes.0: four numbers"),
        ({"group": 0}, "group: Input should be greater than or equal to 1"),
        ({"outfit": "AB"}, "outfit: String should match"),
        ({"boxes": [[1, 2, 3, 4]], "group": 2}, "boxes and group both say which figures count"),
        ({"boxes": [[1, 2, 3, 4]], "outfit": "B"}, "boxes and outfit both say"),
        ({"views": {}}, "views: Input should be a valid array"),
        ({"views": [{}]}, "views.0.box: is missing"),
        ({"views": [VIEW, VIEW]}, "views.1.box: is that of views.0; merge them"),
        ({"views": [{**VIEW, "exclude": 1}]}, "views.0.exclude: Input should be a valid boolean"),
        ({"views": [{**VIEW, "label": "frnt"}]}, "views.0.label: 'frnt' is no direction; did you"),
        ({"views": [{**VIEW, "label": "front,side"}]}, "views.0.label: several directions"),
        ({"views": [{**VIEW, "label": "x" * 10_000}]}, "views.0.label: 'xxxx"),
        ({"views": [{**VIEW, "lock": True}]}, "views.0.lock: there is no one yaw to keep"),
        ({"views": [{**VIEW, "lock": True, "label": "side"}]}, "views.0.lock: there is no one"),
        ({"views": [{**VIEW, "camera": {**CAMERA, "scale": 0}}]}, "views.0.camera.scale: Input"),
        ({"views": [{**VIEW, "camera": {**CAMERA, "elevation": 95}}]}, "camera.elevation: Input"),
        ({"views": [{**VIEW, "landmarks": [{"world": [0, 1]}]}]}, "views.0.landmarks.0"),
        ({"palette": {"drop": ["red"]}}, "palette.drop.0: 'red' is no colour"),
        ({"palette": {"merge": [["#000000"]]}}, "palette.merge.0: "),
        ({"palette": {"names": {"#00000": "x"}}}, "palette.names.#00000: '#00000' is no colour"),
        ({"palette": {"names": {"#000000": "x" * 10_000}}}, "at most 200 characters"),
        ({"palette": {"names": {"#000000": "\u202e"}}}, "a name needs a letter"),
        ({"palette": {"strokes": [{"box": [1, 2, 3, 4], "color": "#000000"}]}}, "strokes.0.points"),
    ],
)
def test_what_cannot_be_meant_is_named_with_its_key(content, words):
    with pytest.raises(SheetError) as refused:
        parse_corrections(json.dumps({"version": 1, **content}).encode(), "file.json")
    reason = str(refused.value)
    assert reason.startswith("file.json: ")
    assert words in reason
    assert len(reason) < 300
    assert reason.isprintable()


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "is empty (0 bytes)"),
        (b"nope", "is no valid JSON"),
        (b"[]", "states no version"),
        (b'{"version": 1, "version": 1}', "the key 'version' is there twice"),
        (b'{"version": 1, "views": [NaN]}', "is nan, a finite number is needed"),
        (b'{"version": ' + b"[" * 2 * MAX_DEPTH + b"]" * 2 * MAX_DEPTH + b"}", "nested deeper"),
        (b" " * (9 * 2**20), "9.0 MB, at most 8 MB is read"),
        (b"\x89PNG\r\n\x1a\n\xff", "is no UTF-8"),
    ],
)
def test_a_file_that_is_none(data, words, tmp_path: Path):
    path = tmp_path / "corrections.json"
    path.write_bytes(data)
    with pytest.raises(SheetError, match=r"corrections\.json: ") as refused:
        read_corrections(path)
    assert words in str(refused.value)


BOX = st.tuples(*[st.integers(0, 60)] * 2, *[st.integers(1, 60)] * 2)


@given(a=BOX, b=BOX)
def test_overlap_is_symmetric_and_one_for_the_same_box_only(a, b):
    assert 0 <= overlap(a, b) == overlap(b, a) <= 1
    assert (overlap(a, b) == 1) == (a == b)


@given(found=st.lists(BOX, max_size=5), wanted=st.lists(BOX, max_size=5))
def test_each_box_is_matched_once_to_at_least_half(found, wanted):
    pairs = match_boxes([[box] for box in found], wanted)
    assert len(set(pairs.values())) == len(pairs)
    for i, j in pairs.items():
        assert overlap(found[i], wanted[j]) >= 0.5
    for i in set(range(len(found))) - set(pairs):  # nobody is left who could be paired
        for j in set(range(len(wanted))) - set(pairs.values()):
            assert overlap(found[i], wanted[j]) < 0.5


def test_the_best_pair_comes_first():
    assert match_boxes([[(0, 0, 10, 10)], [(2, 0, 10, 10)]], [(2, 0, 10, 10)]) == {1: 0}


SIZE, PITCH, COUNT = (360, 200), 115, 3


@pytest.fixture
def sheet(tmp_path: Path) -> Path:
    """Return a sheet of three figures on white paper."""
    image = Image.new("RGB", SIZE, "white")
    pen = ImageDraw.Draw(image)
    for number in range(COUNT):
        left = 25 + PITCH * number
        pen.ellipse((left, 20, left + 50, 80), (200, 60, 40), "black", 3)
        pen.rectangle((left + 5, 75, left + 45, 170), (40, 120, 200), "black", 3)
    path = tmp_path / "sheet.png"
    image.save(path)
    return path


def test_no_content_changes_nothing(sheet: Path, tmp_path):
    plain = split_sheet(sheet)
    same = split_sheet(sheet, corrections=written(tmp_path))
    assert same.notes == plain.notes
    for one, two in zip(plain.views, same.views, strict=True):
        np.testing.assert_array_equal(one.rgba, two.rgba)
        assert (one.box, one.name, one.label) == (two.box, two.name, two.label)


def test_views_are_labelled_excluded_and_numbered_anew(sheet: Path, tmp_path):
    boxes = [view.figure_box for view in split_sheet(sheet).views]
    moved = [[x + 3, y - 2, w, h + 5] for x, y, w, h in boxes]  # as another split might have them
    views = [{"box": moved[2], "label": "back"}, {"box": moved[0], "exclude": True}]
    lost = {"box": [0, 180, 9, 9], "label": "side"}
    found = split_sheet(sheet, corrections=written(tmp_path, views=[*views, lost]))
    assert [(view.name, view.label) for view in found.views] == [
        ("000.png", ""),
        ("001.png", "back"),
    ]
    assert [view.figure_box for view in found.views] == boxes[1:]
    assert found.notes == (
        "corrections.json: views.2, box [0, 180, 9, 9], is no figure of this split: ignored",
    )


def test_boxes_by_hand_may_be_generous(sheet: Path, tmp_path):
    boxes = [[PITCH * 2, 0, 130, 200], [0, 0, PITCH, 200]]
    views = [{"box": boxes[1], "label": "front"}]
    path = written(tmp_path, boxes=boxes, views=views, background="#ffffff")
    assert [view.label for view in split_sheet(sheet, corrections=path).views] == ["", "front"]


@pytest.mark.parametrize(
    ("content", "options", "words"),
    [
        ({"boxes": [[300, 0, 70, 90]]}, {}, "boxes: box 0 (x 300, y 0, 70 x 90 px) leaves the"),
        ({"boxes": [[0, 0, 100, 190]] * 2}, {}, "boxes: box 1 is the same as box 0"),
        ({"views": [{"box": [-5, 0, 9, 9]}]}, {}, "views: box 0 (x -5, y 0, 9 x 9 px) leaves the"),
        ({"boxes": [[0, 0, 100, 190]]}, {"grid": "3x1"}, "boxes and --grid say the same thing"),
        ({"boxes": [[0, 0, 100, 190]]}, {"group": 2}, "boxes and --group say the same thing"),
        ({"group": 1}, {"group": 2}, "group and --group say the same thing"),
        ({"outfit": "A"}, {"boxes": "boxes.csv"}, "outfit and --boxes say the same thing"),
        ({"background": "#ffffff"}, {"background": "white"}, "background and --background say"),
        ({"views": [{**VIEW, "exclude": True}]}, {"drop": "0"}, "views.exclude and --drop say"),
        ({"views": [{**VIEW, "label": "front"}]}, {"labels": "?,?,?"}, "views.label and --views"),
    ],
)
def test_what_the_sheet_or_an_option_speaks_against(content, options, words, sheet, tmp_path):
    with pytest.raises((SheetError, UsageError)) as refused:
        split_sheet(sheet, SheetOptions(**options), corrections=written(tmp_path, **content))
    assert "corrections.json: " in str(refused.value)
    assert words in str(refused.value)


def test_a_group_and_an_outfit_are_taken_as_the_options_take_them(tmp_path: Path) -> None:
    sheet = tmp_path / "poses.png"
    Image.fromarray(make_messy_sheet(4100, ("poses",)).rgba).save(sheet)
    poses = split_sheet(sheet, SheetOptions(group=2)).views
    found = split_sheet(sheet, corrections=written(tmp_path, group=2)).views
    assert [view.box for view in found] == [view.box for view in poses]
    with pytest.raises(SheetError, match="there is no such group: the sheet has 2"):
        split_sheet(sheet, corrections=written(tmp_path, group=3))


def test_boxes_of_an_option_stay_beside_a_background_by_hand(sheet: Path, tmp_path):
    boxes = tmp_path / "boxes.csv"
    boxes.write_text("0,0,115,200\n")
    path = written(tmp_path, background="#ffffff")
    assert len(split_sheet(sheet, SheetOptions(boxes=boxes), corrections=path).views) == 1


def test_not_all_views_may_be_excluded(sheet: Path, tmp_path):
    views = [{"box": view.box, "exclude": True} for view in split_sheet(sheet).views]
    with pytest.raises(SheetError, match=r"views\.exclude leaves no view; keep at least one"):
        split_sheet(sheet, corrections=written(tmp_path, views=views))


def test_another_sheet_is_refused_and_a_changed_one_noted(sheet: Path, tmp_path):
    other = {"name": "other.png", "sha256": "1" * 64, "size": [100, 100]}
    with pytest.raises(
        SheetError, match=r"'other\.png', 100 x 100 px, not of sheet\.png, 360 x 200"
    ):
        split_sheet(sheet, corrections=written(tmp_path, sheet=other))
    changed = split_sheet(sheet, corrections=written(tmp_path, sheet={**other, "size": [*SIZE]}))
    assert changed.notes == ("corrections.json: sheet.png has changed since it was corrected",)


def test_of_several_sheets_the_one_of_that_name_is_meant(sheet: Path, tmp_path):
    second = tmp_path / "second.png"
    Image.open(sheet).transpose(Image.Transpose.FLIP_LEFT_RIGHT).save(second)
    box = split_sheet(second).views[0].box
    views = [{"box": box, "label": "front", "camera": CAMERA}]
    path = written(tmp_path, views=views, sheet={"name": "second.png"})
    found = split_sheet([sheet, second], corrections=path)
    assert [view.label for view in found.views] == ["", "", "", "front", "", ""]
    said = Given.of(path).of_views(found.views)
    assert [entry is not None for entry in said] == [False] * 3 + [True] + [False] * 2
    with pytest.raises(SheetError, match="name the one that was corrected"):
        split_sheet([sheet, second], corrections=written(tmp_path, views=views))


def test_a_split_folder_takes_what_is_said_of_views_but_no_boxes(sheet: Path, toonset, tmp_path):
    toonset("split", sheet, "-o", tmp_path / "views", "-q")
    box = split_sheet(sheet).views[1].box
    path = written(tmp_path, views=[{"box": box, "label": "90"}])
    found = split_sheet(tmp_path / "views", corrections=path)
    assert [view.label for view in found.views] == ["", "90", ""]
    with pytest.raises(ToonsetError, match="is cut already"):
        split_sheet(tmp_path / "views", corrections=written(tmp_path, boxes=[box]))


def test_a_placed_camera_goes_before_words():
    entry = {"box": [1, 2, 3, 4], "label": "side", "camera": {**CAMERA, "yaw": -90}}
    found = parse_corrections(json.dumps({"version": 1, "views": [entry]}).encode(), "file")
    np.testing.assert_allclose(np.degrees(found.views[0].yaws), [270])
