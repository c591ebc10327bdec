"""`toonset split`: what it writes and says, what it takes as input, and how it is corrected."""

import json
import shutil
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.cli.split_sheets import COLORS, COUNT, HIGH, PITCH, TOP, WIDE, drawn_sheet
from toonset.dataset.split.sheet import PictureOptions, split_picture
from toonset.dataset.split_folder.read import read_split
from toonset.dataset.split_folder.write import NAME, VERSION


@pytest.fixture
def sheet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a sheet of four figures in the current folder."""
    monkeypatch.chdir(tmp_path)
    drawn_sheet().save("sheet.png")
    return Path("sheet.png")


@pytest.fixture
def singles(sheet: Path) -> Path:
    """Return a folder of one file per view, and other things."""
    folder = Path("drawings")
    folder.mkdir()
    whole = Image.open(sheet)
    for number in range(COUNT):
        crop = whole.crop((PITCH * number, 0, PITCH * (number + 1), whole.height))
        crop.save(folder / f"view{8 + number}.png")  # view8, view9, view10, view11
    (folder / "notes.txt").write_text("mine")
    (folder / ".DS_Store").write_bytes(b"\0")
    return folder


def color_of(view: Path) -> tuple[int, int, int]:
    rgba = np.asarray(Image.open(view).convert("RGBA"))
    inside = rgba[(rgba[..., 3] == 255) & (rgba[..., :3].max(axis=2) > 30)]
    colors, counts = np.unique(inside, axis=0, return_counts=True)
    red, green, blue = colors[counts.argmax()][:3]
    return int(red), int(green), int(blue)


def colors_of(folder: Path) -> list[tuple[int, int, int]]:
    return [color_of(path) for path in sorted((folder / "images").iterdir())]


def test_a_sheet_becomes_a_folder_to_look_at(sheet: Path, toonset, snapshot):
    done = toonset("split", sheet, "--views", "front,3q,?,back")
    assert (done.code, done.out) == (0, "views\n")
    assert set(snapshot(Path("views"))) == {
        *("images", "split.json", "overlay.png"),
        *(f"images/{i:03d}.png" for i in range(COUNT)),
    }
    assert colors_of(Path("views")) == list(COLORS)
    lines = done.err.splitlines()
    assert lines[0] == f"sheet.png: {PITCH * COUNT} x 200 px, background #ffffff"
    assert all(f"{i:03d}.png  at" in lines[1 + i] for i in range(COUNT))
    assert lines[1].endswith("px  front")
    assert lines[-1] == "look at views/overlay.png"
    assert Image.open("views/overlay.png").width >= PITCH * COUNT


def test_split_json_says_where_everything_is_from(sheet: Path, toonset):
    done = toonset("split", sheet, "-o", "o", "--views", "front,3q,?,90", "--json", "--quiet")
    assert (done.code, done.err) == (0, "")
    content = json.loads(Path("o/split.json").read_text())
    assert content["schema"] == f"{NAME}/{VERSION}" == done.json["schema"]
    assert done.json["folder"] == "o"
    (source,) = content["sheets"]
    assert source["name"] == "sheet.png"
    assert source["sha256"] == sha256(sheet.read_bytes()).hexdigest()
    assert source["size_wh"] == list(Image.open(sheet).size)
    assert source["background"] == "#ffffff"
    assert [view["label"] for view in content["views"]] == ["front", "3q", None, "90"]
    for number, view in enumerate(content["views"]):
        x, y, width, height = view["crop"]
        crop = Image.open(Path("o/images") / view["name"])
        assert crop.size == (width, height)
        left, top = 25 + PITCH * number, TOP
        assert view["box"] == [left, top, WIDE + 1, HIGH + 1]  # PIL draws both corners
        assert x < left
        assert y < top
        assert x + width > left + WIDE + 1
        assert y + height > top + HIGH + 1
        assert view["line_width_px"] == pytest.approx(3, abs=0.5)


def test_the_same_sheet_gives_the_same_bytes(sheet: Path, toonset, snapshot):
    assert toonset("split", sheet, "-o", "a").code == toonset("split", sheet, "-o", "b").code == 0
    assert snapshot(Path("a")) == snapshot(Path("b"))


def test_a_doubt_is_exit_code_3_and_is_drawn(sheet: Path, toonset):
    shutil.copy(sheet, "other.png")
    done = toonset("split", sheet, "other.png")
    assert (done.code, done.out) == (3, "views\n")
    assert "look: other.png is a copy of sheet.png: is one of them another view?" in done.err
    assert len(read_split(Path("views"))[0].views) == 2 * COUNT


def test_dropped_views_go_and_the_others_are_numbered_anew(sheet: Path, toonset):
    done = toonset("split", sheet, "--drop", "0,2", "--views", "3q,back")
    assert done.code == 0
    assert colors_of(Path("views")) == [COLORS[1], COLORS[3]]
    found = read_split(Path("views"))[0]
    assert found.labels == ("3q", "back")
    assert [left.kind for left in found.sources[0].left_out] == ["dropped"] * 2
    assert "left out: 2 dropped" in done.err
    assert "numbered anew" in done.err


@pytest.mark.parametrize("text", ["1-3", "001, 2 3", "003.png;1-2"])
def test_numbers_to_drop_may_be_written_in_several_ways(text, sheet: Path, toonset):
    assert toonset("split", sheet, "--drop", text, "-q").code == 0
    assert colors_of(Path("views")) == [COLORS[0]]


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[PictureOptions]:
    """Return with which options sheets are split, while they are."""
    seen: list[PictureOptions] = []

    def spy(rgba, options):
        seen.append(options)
        return split_picture(rgba, PictureOptions())

    monkeypatch.setattr("toonset.dataset.split_folder.load.split_picture", spy)
    return seen


def test_what_is_typed_reaches_the_splitter(sheet: Path, toonset, asked):
    drawn_sheet(colors=COLORS[:2]).save("two.png")
    assert toonset("split", sheet, "two.png", "-o", "a", "--drop", "3").code == 0
    boxes = ("--boxes", "a/split.json")
    assert toonset("split", sheet, "two.png", "-o", "b", *boxes, "--background", "#fff").code == 0
    assert toonset("split", sheet, "-o", "c", "--grid", "4X1", "--background", "00ff10").code == 0
    found = read_split(Path("a"))[0]
    of_sheet = [
        tuple(v.figure_box for v, of in zip(found.views, found.source_of, strict=True) if of == n)
        for n in (0, 1)
    ]
    assert [len(boxes) for boxes in of_sheet] == [3, 2]
    assert asked == [
        *(PictureOptions(),) * 2,
        *(PictureOptions(boxes=of, background_rgb=(255, 255, 255)) for of in of_sheet),
        PictureOptions(grid=(4, 1), background_rgb=(0, 255, 16)),
    ]


@pytest.mark.parametrize("grid", [f"{COUNT}x1", f"{COUNT}x", f"{COUNT}"])
def test_a_strip_is_cut_by_its_grid(grid, sheet: Path, toonset):
    whole = Image.open(sheet)
    whole.paste("white", (PITCH, 0, 2 * PITCH, whole.height))  # an empty cell is no view
    whole.save("strip.png")
    assert toonset("split", "strip.png", "--grid", grid).code in (0, 3)
    assert colors_of(Path("views")) == [COLORS[0], COLORS[2], COLORS[3]]


def test_cells_that_do_not_divide_the_sheet_are_a_doubt(sheet: Path, toonset):
    done = toonset("split", sheet, "--grid", "3x1")
    assert done.code == 3
    assert "440 px wide, which 3 cells do not divide evenly: is it the right --grid?" in done.err


def test_a_known_background_is_used(sheet: Path, toonset):
    drawn_sheet("#a0b0c0").save("tinted.png")
    assert toonset("split", "tinted.png", "--background", "#A0B0C0").code == 0
    assert read_split(Path("views"))[0].sources[0].background == (0xA0, 0xB0, 0xC0)
    assert colors_of(Path("views")) == list(COLORS)


def test_a_folder_of_views_is_read_in_the_order_people_count(singles: Path, toonset):
    done = toonset("split", singles)
    assert done.code == 0
    assert colors_of(Path("views")) == list(COLORS)
    assert "drawings: no pictures, left out: notes.txt\n" in done.err
    assert ".DS_Store" not in done.err
    names = [source.name for source in read_split(Path("views"))[0].sources]
    assert names == ["view8.png", "view9.png", "view10.png", "view11.png"]


def test_files_and_folders_are_joined_in_the_order_given(singles: Path, toonset):
    drawn_sheet(colors=((90, 20, 120), (20, 90, 90))).save("two.png")
    done = toonset("split", "two.png", singles, "--drop", "0")
    assert done.code == 0
    assert colors_of(Path("views")) == [(20, 90, 90), *COLORS]
    assert [view.name for view in read_split(Path("views"))[0].views][-1] == "004.png"


def test_one_blank_file_of_many_is_refused_by_name(singles: Path, toonset, snapshot):
    Image.new("RGB", (110, 200), "white").save(singles / "view9.png")
    before = snapshot(Path())
    reason = toonset("split", singles, "-q").reason
    assert reason.startswith("drawings/view9.png: the sheet is blank")
    assert snapshot(Path()) == before


def test_a_corrected_folder_is_read_again(sheet: Path, toonset):
    assert toonset("split", sheet, "--views", "front,3q,side,back").code == 0
    Path("views/images/001.png").unlink()
    done = toonset("split", "views", "-o", "again")
    assert done.code == 3  # a changed folder is worth a look
    assert "look: views: images/001.png is gone: the view is left out" in done.err
    found, notes = read_split(Path("again"))
    assert notes == ()
    assert found.labels == ("front", "side", "back")
    assert [source.name for source in found.sources] == ["sheet.png"]
    assert toonset("split", "again/split.json", "-o", "third").code == 0
    assert colors_of(Path("third")) == [COLORS[0], COLORS[2], COLORS[3]]


def test_calibrate_takes_a_split_folder_with_its_labels(drawn: Path, toonset, tmp_path):
    views, out, mesh = tmp_path / "views", tmp_path / "b", drawn / "mannequin.obj"
    labels = "0,72,144,216,288"
    assert toonset("split", drawn / "sheet.png", "-o", views, "--views", labels).code in (0, 3)
    (views / "images" / "003.png").unlink()
    done = toonset("calibrate", views, "--mesh", mesh, "-o", out, "--json")
    assert done.code in (0, 3)
    assert "images/003.png is gone: the view is left out" in done.err
    assert done.json["options"]["views"] == "0,72,144,288"
    roles = [given["role"] for given in done.json["inputs"]]
    assert roles == ["split", *["view"] * 4, "mesh"]
    yaws = [view["camera"]["yaw_deg"] % 360 for view in done.json["views"]]
    off = [(a - b + 180) % 360 - 180 for a, b in zip(yaws, (0, 72, 144, 288), strict=True)]
    assert max(map(abs, off)) < 5


def test_a_corrected_split_json_cuts_anew(sheet: Path, toonset):
    assert toonset("split", sheet).code == 0
    content = json.loads(Path("views/split.json").read_text())
    del content["views"][1]
    Path("mine.json").write_text(json.dumps(content))
    assert toonset("split", sheet, "--boxes", "mine.json", "-o", "again").code in (0, 3)
    first, second = (read_split(Path(name))[0] for name in ("views", "again"))
    assert [v.box for v in second.views] == [first.views[i].box for i in (0, 2, 3)]
    for number, again in zip((0, 2, 3), second.views, strict=True):
        assert np.array_equal(first.views[number].mask, again.mask)
    content = json.loads(Path("again/split.json").read_text())
    assert content["options"] == {"boxes": "mine.json"}
