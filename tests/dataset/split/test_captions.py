"""Captions: which words name a direction, which figure they belong to, and the reader."""

import sys
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from toonset.dataset.images.picture import encode_png
from toonset.dataset.split import captions
from toonset.dataset.split.captions import Text, caption_labels, label_of, with_captions
from toonset.dataset.split.sheet import PictureOptions, split_picture
from toonset.dataset.split_folder.load import split_sheet
from toonset.dataset.split_folder.options import SheetOptions
from toonset.dataset.split_folder.overlay import draw_sheet
from toonset.dataset.split_folder.read import read_split
from toonset.dataset.split_folder.view_labels import NAMES
from toonset.dataset.split_folder.write import write_split

SAID = {
    "front": "FRONT|Front view|01 FRONT|FR0NT|Front side|Vorne|Vorderansicht|Vorderansich|de face"
    "|Frente|正面|正视图|前|まえ|정면|앞면|\uff26\uff32\uff2f\uff2e\uff34",
    "3q": "3/4|3/4 VIEW|¾|\uff13\uff0f\uff14|LEFT 3/4|Three-Quarter|front left|Dreiviertel"
    "|Trois-quarts|Tres cuartos|四分之三|斜め前|半侧面|3/4側面|반측면",
    "side": "SIDE|Profile|LEFT|right|left side|Seite|CÔTÉ|profil|Perfil|側面|侧视图|正侧面|横向き"
    "|左側面|옆면",
    "back": "BACK|Rear view|Rückseite|Ruckansicht|de dos|Arrière|Espalda|Atrás|背面|后面|後ろ|뒷면",
    "3q-back": "BACK 3/4|back left|vue de 3/4 dos|斜め後ろ",
    "": "Light|night|weite|front pocket|back hair|front/back|left, right|Mikey|12|view||前髪|!",
}
BOXES = [(10, 40, 50, 200), (110, 40, 30, 200), (200, 40, 60, 200)]


@pytest.mark.parametrize("label", SAID)
def test_a_text_names_one_direction_and_nothing_besides(label):
    assert {text: label_of(text) for text in SAID[label].split("|")} == dict.fromkeys(
        SAID[label].split("|"), label
    )
    assert label in NAMES


def written(words, y, boxes=BOXES, height=12):
    """Return a text in the middle under or over every figure."""
    return [
        Text(word, (x + width / 2 - 20, y, 40, height))
        for word, (x, _, width, _) in zip(words, boxes, strict=True)
    ]


@pytest.mark.parametrize("y", [8, 250])
def test_a_caption_stands_under_or_over_its_figure(y):
    assert caption_labels(written(("FRONT", "hat", "BACK"), y), BOXES) == ("front", "", "back")
    assert caption_labels(written(("FRONT", "SIDE", "BACK"), 120), BOXES) == ("", "", "")  # on it
    assert caption_labels(written(("FRONT", "SIDE", "BACK"), 330), BOXES) == ("", "", "")  # far


def test_lines_of_one_caption_are_read_together():
    texts = written(("BACK", "FRONT", "SIDE"), 245) + written(("3/4", "BACK", "view"), 262)
    assert caption_labels(texts, BOXES) == ("3q-back", "", "side")


@pytest.mark.parametrize("under", [True, False])
def test_captions_between_two_rows_belong_to_one_side(under):
    second = [(x, y + 260, width, height) for x, y, width, height in BOXES]
    rows = BOXES + second
    at = (246, 506) if under else (22, 282)
    first, then = ("FRONT", "SIDE", "BACK"), ("3/4", "BACK", "SIDE")
    texts = written(first, at[0]) + written(then, at[1])
    assert caption_labels(texts, rows) == ("front", "side", "back", "3q", "back", "side")


def sheet_of_three():
    """Return a sheet with three figures and a word under each."""
    rgb = np.full((320, 420, 3), 255, np.uint8)
    for x, color in ((70, (200, 30, 40)), (200, (20, 60, 180)), (330, (30, 120, 60))):
        cv2.ellipse(rgb, (x, 150), (36, 100), 0, 0, 360, color, -1)
        cv2.putText(rgb, "WORD", (x - 30, 285), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (0, 0, 0), 2)
    return np.dstack([rgb, np.full((320, 420), 255, np.uint8)])


class StandIn:
    """Reads what it is told to, at the three places, in RapidOCR's form."""

    said = ("FRONT", "SIDE", "BACK")
    sure = 0.99
    top, columns = 268, (70, 200, 330)
    pages = 0

    def __init__(self, params):
        assert params["Global.log_level"] == "critical"

    def __call__(self, bgr):
        type(self).pages += 1
        assert bgr.dtype == np.uint8
        assert bgr.shape[2] == 3
        if not self.said:
            return None
        by = bgr.shape[1] / 420
        top = self.top
        corners = np.array([[-30, top], [30, top], [30, top + 20], [-30, top + 20]], float)
        boxes = np.stack([corners + np.array([x, 0]) for x in self.columns]) * by
        return SimpleNamespace(boxes=boxes, txts=self.said, scores=(self.sure,) * 3)


@pytest.fixture
def reader(monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", SimpleNamespace())
    monkeypatch.setitem(sys.modules, "rapidocr", SimpleNamespace(RapidOCR=StandIn))
    monkeypatch.setattr(StandIn, "pages", 0)
    captions._reader.cache_clear()
    yield StandIn
    captions._reader.cache_clear()


@pytest.fixture
def no_reader(monkeypatch):
    monkeypatch.setitem(sys.modules, "rapidocr", None)
    captions._reader.cache_clear()
    yield
    captions._reader.cache_clear()


def read(rgba, options=None):
    return with_captions(rgba, split_picture(rgba, options))


def test_captions_are_read_and_said(reader):
    found = read(sheet_of_three())
    assert [view.caption for view in found.views] == ["front", "side", "back"]
    assert "captions were read: front, side, back; --views says otherwise" in found.remarks


def test_a_large_sheet_is_read_smaller(reader):
    rgba = cv2.resize(sheet_of_three(), None, fx=8, fy=8, interpolation=cv2.INTER_CUBIC)
    assert [view.caption for view in read(rgba).views] == ["front", "side", "back"]


def test_boxes_given_by_hand_have_captions(reader):
    boxes = PictureOptions(boxes=((30, 45, 80, 210), (160, 45, 80, 210), (290, 45, 80, 210)))
    assert [view.caption for view in read(sheet_of_three(), boxes).views] == [
        "front",
        "side",
        "back",
    ]


def test_two_fronts_in_a_row_count_for_nothing(reader, monkeypatch):
    monkeypatch.setattr(reader, "said", ("FRONT", "SIDE", "FRONT"))
    found = read(sheet_of_three())
    assert {view.caption for view in found.views} == {""}
    assert any("contradict each other" in remark for remark in found.remarks)


@pytest.mark.parametrize(("said", "sure"), [((), 1.0), (("FRONT", "SIDE", "BACK"), 0.6)])
def test_what_is_not_surely_read_changes_nothing(reader, monkeypatch, said, sure):
    monkeypatch.setattr(reader, "said", said)
    monkeypatch.setattr(reader, "sure", sure)
    found = split_picture(sheet_of_three())
    assert with_captions(sheet_of_three(), found) is found
    assert reader.pages == 1


def test_a_sheet_without_anything_beside_its_figures_is_not_read(reader):
    rgba = sheet_of_three()
    rgba[262:] = 255
    read(rgba)
    assert reader.pages == 0


def test_without_a_reader_nothing_changes(no_reader):
    found = split_picture(sheet_of_three())
    assert with_captions(sheet_of_three(), found) is found


def test_a_split_folder_keeps_captions_and_labels_replace_them(reader, tmp_path):
    file = tmp_path / "sheet.png"
    file.write_bytes(encode_png(sheet_of_three()))
    sheet = split_sheet(file)
    assert sheet.split.labels == ("front", "side", "back")
    write_split(tmp_path / "views", sheet.split, draw_sheet(sheet), sheet.options)
    again, _ = read_split(tmp_path / "views")
    assert [(view.label, view.caption) for view in again.views] == [
        ("", "front"),
        ("", "side"),
        ("", "back"),
    ]
    typed = split_sheet(file, SheetOptions(labels="back,?,front"))
    assert [(view.label, view.caption) for view in typed.views] == [
        ("back", ""),
        ("", ""),
        ("front", ""),
    ]


def two_rows(tmp_path):
    """Return a sheet with three large figures, and three small ones with a word under each."""
    rgb = np.full((320, 420, 3), 255, np.uint8)
    for x, color in ((70, (200, 30, 40)), (200, (20, 60, 180)), (330, (30, 120, 60))):
        cv2.ellipse(rgb, (x, 80), (30, 68), 0, 0, 360, color, -1)
        cv2.ellipse(rgb, (x, 220), (20, 42), 0, 0, 360, color, -1)
        cv2.putText(rgb, "WORD", (x - 30, 285), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (0, 0, 0), 2)
    file = tmp_path / "two_rows.png"
    file.write_bytes(encode_png(np.dstack([rgb, np.full((320, 420), 255, np.uint8)])))
    return file


def test_the_group_with_captions_is_taken(reader, tmp_path):
    sheet = split_sheet(two_rows(tmp_path))
    assert sheet.split.labels == ("front", "side", "back")
    assert [view.figure_box[3] for view in sheet.views] == [85] * 3
    assert "group 2 was taken: its figures have captions" in sheet.split.sources[0].remarks


def test_what_a_person_takes_stays(reader, tmp_path):
    sheet = split_sheet(two_rows(tmp_path), SheetOptions(group=1))
    assert [view.figure_box[3] for view in sheet.views] == [137] * 3


def test_one_caption_takes_no_group(reader, monkeypatch, tmp_path):
    monkeypatch.setattr(reader, "said", ("FRONT", "Bob", "Ann"))
    assert [view.figure_box[3] for view in split_sheet(two_rows(tmp_path)).views] == [137] * 3


SWATCHES = ((217, 84, 48), (38, 138, 140), (46, 58, 104))


def sheet_with_swatches():
    """Return a sheet with three figures and a square of paint under each; a word under those."""
    rgba = np.pad(sheet_of_three()[:265], ((0, 120), (0, 0), (0, 0)), constant_values=255)
    for x, color in zip((70, 200, 330), SWATCHES, strict=True):
        rgba[290:330, x - 42 : x + 42, :3] = color
    return rgba


@pytest.mark.parametrize(
    ("said", "colors", "remarks"),
    [
        (("#D85530", "#268A8C", "#2e3a68"), ((216, 85, 48), *SWATCHES[1:]), []),
        (("D85530", "skin", "#2E3A6B"), ((216, 85, 48), SWATCHES[1], (46, 58, 107)), []),
        (("Hair #D8S53O", "facade", "decade"), ((216, 85, 48), *SWATCHES[1:]), []),
        (
            ("#268A8C", "#268A8C", "#2e3a68"),
            SWATCHES,
            ["the sheet says #268a8c beside a swatch of #d95430: the swatch counts"],
        ),
    ],
)
def test_swatches_have_the_colours_that_are_written_beside_them(
    reader, monkeypatch, said, colors, remarks
):
    monkeypatch.setattr(StandIn, "said", said)
    monkeypatch.setattr(StandIn, "top", 336)
    found = read(sheet_with_swatches())
    assert tuple(one.color for one in found.swatches) == colors
    assert [line for line in found.remarks if "swatch of" in line] == remarks
    assert not any(view.caption for view in found.views)


def test_codes_that_are_wider_than_their_swatches_find_them(reader, monkeypatch):
    rgba = np.pad(sheet_of_three()[:265], ((0, 120), (0, 0), (0, 0)), constant_values=255)
    for at, color in enumerate(SWATCHES):
        rgba[290:330, 150 + 40 * at : 190 + 40 * at, :3] = color
    codes = ((216, 85, 48), (39, 138, 140), (46, 58, 106))
    monkeypatch.setattr(StandIn, "said", tuple(f"#{r:02x}{g:02x}{b:02x}" for r, g, b in codes))
    monkeypatch.setattr(StandIn, "top", 334)
    monkeypatch.setattr(StandIn, "columns", (170, 210, 250))
    found = read(rgba)
    assert tuple(one.color for one in found.swatches) == codes
    assert not any("swatch of" in line for line in found.remarks)
