"""A split folder is read back as it was written, and as a person has corrected it."""

import json
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw

from toonset.dataset.images.folder import natural_key, picture_files
from toonset.dataset.images.picture import encode_png
from toonset.dataset.silhouettes.line_width import contour_width_px
from toonset.dataset.split.beside_views import LeftOut
from toonset.dataset.split.sheet import Segmentation
from toonset.dataset.split_folder.boxes import read_boxes
from toonset.dataset.split_folder.checks import odd_files
from toonset.dataset.split_folder.read import read_split
from toonset.dataset.split_folder.views import Split, join_splits, split_of_sheet, without
from toonset.dataset.split_folder.write import read_records, write_split
from toonset.errors import BundleError, PictureError, SheetError
from toonset.view import View

COLORS = ((200, 60, 40), (40, 120, 200), (60, 160, 70), (220, 180, 40))
OVERLAY = np.zeros((4, 4, 3), np.uint8)


def figure(color: tuple[int, int, int], line: int = 3, paper: object = (0, 0, 0, 0)) -> np.ndarray:
    image = Image.new("RGBA", (60, 100), paper)  # type: ignore[arg-type]
    pen = ImageDraw.Draw(image)
    pen.ellipse((15, 5, 45, 40), (*color, 255), "black", line)
    pen.rectangle((12, 38, 48, 94), (*color, 255), "black", line)
    return np.array(image)


def cut() -> Split:
    views, labels = [], ("front", "", "back", "90")
    for number, color in enumerate(COLORS):
        rgba, box = figure(color), (10 + 70 * number, 5, 60, 100)
        view = View(rgba, box, contour_width_px(rgba), f"{number:03d}.png")
        views.append(replace(view, label=labels[number]))
    left = (LeftOut((1, 2, 30, 4), "text"),)
    sheet = Segmentation(tuple(views), (255, 255, 255), 1.0, ("two figures touch",), left)
    return split_of_sheet("sheet.png", b"the file", (300, 110), sheet)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_split(tmp_path / "views", cut(), OVERLAY, {"drop": "4"})
    return tmp_path / "views"


def assert_same(a: Split, b: Split) -> None:
    assert (a.sources, a.source_of, a.labels) == (b.sources, b.source_of, b.labels)
    for one, two in zip(a.views, b.views, strict=True):
        assert (one.name, one.box) == (two.name, two.box)
        assert one.line_width_px == pytest.approx(two.line_width_px, abs=1e-3)
        assert np.array_equal(one.rgba, two.rgba)


def test_a_folder_is_read_back_as_it_was_written_wherever_it_lies(folder: Path, tmp_path: Path):
    found, notes = read_split(folder.rename(tmp_path / "elsewhere"))
    assert_same(found, cut())
    assert notes == ()
    assert found.labels == ("front", "", "back", "90")
    for record in read_records(tmp_path / "elsewhere")[1]:
        data = (tmp_path / "elsewhere" / "images" / record.name).read_bytes()
        assert record.sha256 == sha256(data).hexdigest()


def test_writing_twice_gives_the_same_bytes(folder: Path, tmp_path: Path, snapshot):
    write_split(tmp_path / "again", read_split(folder)[0], OVERLAY, {"drop": "4"})
    assert snapshot(tmp_path / "again") == snapshot(folder)


def test_a_deleted_picture_leaves_its_view_out(folder: Path):
    (folder / "images" / "001.png").unlink()
    found, notes = read_split(folder)
    assert_same(found, replace(without(cut(), frozenset({1})), sources=cut().sources))
    assert len(notes) == 1
    assert "images/001.png is gone: the view is left out" in notes[0]


def test_renamed_pictures_keep_their_boxes_and_change_places(folder: Path):
    images = folder / "images"
    (images / "000.png").rename(images / "kept")
    (images / "003.png").rename(images / "000.png")
    (images / "kept").rename(images / "view10.png")
    (images / "002.png").rename(images / "view9.png")
    found, notes = read_split(folder)
    before, order = cut(), [3, 1, 2, 0]
    assert [view.box for view in found.views] == [before.views[i].box for i in order]
    assert [view.name for view in found.views] == ["000.png", "001.png", "002.png", "003.png"]
    assert found.labels == tuple(before.labels[i] for i in order)
    assert len(notes) == 3
    assert any("images/view10.png was 000.png" in note for note in notes)


@pytest.mark.parametrize("paper", [(0, 0, 0, 0), (255, 255, 255, 255)])
def test_a_repainted_picture_keeps_its_place_and_its_line_is_measured(folder: Path, paper):
    painted = figure(COLORS[1], line=5, paper=paper)
    Image.fromarray(painted).save(folder / "images" / "001.png")
    found, notes = read_split(folder)
    view, before = found.views[1], cut().views[1]
    assert view.box == before.box
    assert view.rgba.shape == before.rgba.shape
    assert view.line_width_px > before.line_width_px + 1
    assert not view.mask[0].any()  # white paper is no figure
    assert np.array_equal(view.mask, figure(COLORS[1], line=5)[..., 3] > 0)
    assert "images/001.png was repainted: its line width is now" in notes[0]


def test_a_picture_of_another_size_is_a_sheet_of_its_own(folder: Path):
    larger = np.pad(figure(COLORS[2]), ((0, 20), (0, 0), (0, 0)))
    Image.fromarray(larger).save(folder / "images" / "002.png")
    found, notes = read_split(folder)
    assert found.views[2].box == (0, 0, 60, 120)
    assert found.source_of == (0, 0, 1, 0)
    assert found.sources[1].name == "images/002.png"
    assert found.labels[2] == "back"  # the name is still known
    assert "is not from the sheet: its place is unknown (60 x 120 px)" in notes[0]


def test_a_new_picture_is_a_view(folder: Path):
    Image.fromarray(figure((9, 9, 9))).save(folder / "images" / "000b.png")
    found, notes = read_split(folder)
    assert found.source_of == (0, 1, 0, 0, 0)
    assert found.labels == ("front", "", "", "back", "90")
    assert [view.name for view in found.views] == [f"{i:03d}.png" for i in range(5)]
    assert len(notes) == 1


def test_desktop_files_are_ignored_and_others_named(folder: Path):
    (folder / "images" / ".DS_Store").write_bytes(b"x")
    (folder / "images" / "notes.txt").write_text("x")
    found, notes = read_split(folder)
    assert_same(found, cut())
    assert [note.split(": ", 1)[1] for note in notes] == [
        "images/notes.txt is no picture: left out"
    ]


def test_twins_are_told_by_their_names(tmp_path: Path):
    views = cut().views
    twins = replace(cut(), views=(views[0], replace(views[1], rgba=views[0].rgba), *views[2:]))
    write_split(tmp_path / "views", twins, OVERLAY, {})
    found, notes = read_split(tmp_path / "views")
    assert [view.box for view in found.views] == [view.box for view in views]
    assert notes == ()


def edited(change: Callable[[dict[str, Any]], object]) -> Callable[[Path], object]:
    def edit(folder: Path) -> None:
        content = json.loads((folder / "split.json").read_text())
        change(content)
        (folder / "split.json").write_text(json.dumps(content))

    return edit


def link_out(folder: Path) -> None:
    outside = folder.parent / "secret.png"
    outside.write_bytes(encode_png(figure(COLORS[0])))
    (folder / "images" / "009.png").symlink_to(outside)


def test_a_split_json_out_of_the_folder_is_refused(folder: Path):
    (folder / "split.json").rename(folder.parent / "split.json")
    (folder / "split.json").symlink_to(folder.parent / "split.json")
    with pytest.raises(BundleError, match=r"split.json: is a link out of the folder"):
        read_split(folder)


PAIR = np.hstack([figure(color, paper="white") for color in COLORS[:2]])
BROKEN: dict[str, tuple[Callable[[Path], object], str]] = {
    "no json": (lambda f: (f / "split.json").write_text("{"), "is no valid JSON"),
    "deep json": (lambda f: (f / "split.json").write_text("[" * 10**5), "is nested deeper than 64"),
    "bytes": (lambda f: (f / "split.json").write_bytes(b"\xff\xfe\xff"), "is no valid JSON"),
    "empty": (lambda f: (f / "split.json").write_text(""), "is empty"),
    "list": (lambda f: (f / "split.json").write_text("[]"), "split.json: "),
    "version": (edited(lambda c: c.update(schema="toonset-split/2")), "toonset-split/1"),
    "no views": (edited(lambda c: c.pop("views")), "field views"),
    "box of three": (edited(lambda c: c["views"][0]["box"].pop()), "field views.0.box"),
    "box of text": (edited(lambda c: c["views"][0].update(box=["1", 2, 3, 4])), "views.0.box.0"),
    "huge box": (edited(lambda c: c["views"][0].update(box=[1, 2, 3, 10**9])), "views.0.box.3"),
    "negative line": (edited(lambda c: c["views"][1].update(line_width_px=-1)), "line_width_px"),
    "two labels": (edited(lambda c: c["views"][1].update(label="front,back")), "views.1.label"),
    "no sheet": (edited(lambda c: c["views"][3].update(sheet=1)), "003.png is of sheet 1, but"),
    "moved box": (
        edited(lambda c: c["views"][2].update(crop=[10, 5, 61, 100])),
        "002.png: its crop is 61 x 100 px, its picture 60 x 100; correct it, or cut the sheet anew",
    ),
    "no images": (
        lambda f: (f / "images").rename(f / "pictures"),
        "has no folder images; split the sheet again",
    ),
    "no pictures": (
        lambda f: [path.unlink() for path in (f / "images").iterdir()],
        "images: holds no picture; split the sheet again",
    ),
    "no picture": (
        lambda f: (f / "images" / "001.png").write_text("x"),
        "001.png: is text, no picture that can be read",
    ),
    "blank": (
        lambda f: Image.new("RGBA", (60, 100)).save(f / "images" / "001.png"),
        "001.png: shows nothing opaque; paint the figure, or delete the file",
    ),
    "white": (
        lambda f: Image.new("RGB", (60, 100), "white").save(f / "images" / "001.png"),
        "001.png: the sheet is blank",
    ),
    "two figures": (
        lambda f: Image.fromarray(PAIR).save(f / "images" / "001.png"),
        "001.png: shows 2 figures, one is needed",
    ),
    "link": (link_out, "009.png: is a link that leads out of"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_what_cannot_be_read_is_named(what, folder: Path):
    change, words = BROKEN[what]
    change(folder)
    with pytest.raises((SheetError, PictureError)) as caught:
        read_split(folder)
    assert words in str(caught.value)
    assert str(caught.value).startswith(str(folder))


def test_what_a_later_version_adds_is_read_over(folder: Path):
    edited(lambda c: c.update(comment="mine") or c["views"][0].update(colour="red"))(folder)
    assert_same(read_split(folder)[0], cut())


def test_dropping_numbers_anew_and_keeps_a_record():
    kept = without(cut(), frozenset({0, 2}))
    assert [view.name for view in kept.views] == ["000.png", "001.png"]
    assert [view.box for view in kept.views] == [cut().views[i].box for i in (1, 3)]
    assert kept.labels == ("", "90")
    dropped = [left.box for left in kept.sources[0].left_out if left.kind == "dropped"]
    assert dropped == [cut().views[i].figure_box for i in (0, 2)]


def test_joined_sheets_number_through():
    one, two = cut(), without(cut(), frozenset({0}))
    both = join_splits([one, two])
    assert [view.name for view in both.views] == [f"{i:03d}.png" for i in range(7)]
    assert both.source_of == (0,) * 4 + (1,) * 3
    assert both.labels == (*one.labels, *two.labels)
    assert both.sources == one.sources + two.sources


def single(name: str, height: int, digest: str) -> Split:
    rgba = np.full((height, 20, 4), 255, np.uint8)
    sheet = Segmentation((View(rgba, (0, 0, 20, height), 0.0, "000.png"),), None, 1.0, ())
    return split_of_sheet(name, digest.encode(), (20, height), sheet)


def test_odd_files_are_named():
    views = [single(f"{n}.png", 100, f"{n}") for n in range(3)]
    assert odd_files(join_splits(views)) == ()
    copy = odd_files(join_splits([*views, single("copy.png", 100, "1")]))
    assert copy == ("copy.png is a copy of 1.png: is one of them another view?",)
    for height in (160, 50):
        (line,) = odd_files(join_splits([*views, single("h.png", height, "h")]))
        said = f"{height} px high, most views are 100: is it drawn at another scale?"
        assert line == f"h.png: {said}"
    sheet = odd_files(join_splits([*views, cut()]))
    assert sheet == ("sheet.png shows 4 figures, the others one: is it a sheet of the same views?",)
    assert (
        odd_files(join_splits([cut(), replace(cut(), sources=single("b", 9, "b").sources)])) == ()
    )


def test_pictures_of_a_folder_come_in_the_order_people_count(tmp_path: Path):
    names = ["View10.png", "view2.PNG", "view1.jpg", "a.webp", "view02.png", "10.gif", "9.bmp"]
    for name in (*names, ".hidden.png", "notes.txt", "sub"):
        (tmp_path / name).write_bytes(b"")
    pictures, others = picture_files(tmp_path)
    assert [path.name for path in pictures] == [
        *("9.bmp", "10.gif", "a.webp", "view1.jpg"),
        *("view02.png", "view2.PNG", "View10.png"),
    ]
    assert others == ("notes.txt", "sub")


def test_natural_keys_of_any_names_compare():
    names = ["", "1", "a1", "1a", "a", "1.10.2", "1.9", "²", "٣", "view", "ä2"]
    assert sorted(sorted(names), key=natural_key) == sorted(reversed(names), key=natural_key)


def mutated(rng: np.random.Generator, data: bytes) -> bytes:
    """Return a file with some bytes changed, moved, removed or repeated."""
    changed = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        start = int(rng.integers(len(changed) + 1))
        end = start + int(rng.integers(1, 12))
        swap = rng.choice([b'"', b"9" * 400, b"-1", b"null", b"[]", b"{}", b"\xff", b"1e999", b""])
        changed[start:end] = rng.choice([bytes(swap), bytes(changed[end : 2 * end])])
    return bytes(changed)


@pytest.mark.parametrize("name", ["split.json", "images/001.png", "boxes.json"])
def test_harmed_files_are_read_or_refused_with_one_line(name, folder: Path):
    boxes = json.dumps({"boxes": [list(view.box) for view in cut().views]})
    (folder / "boxes.json").write_text(boxes)
    whole = (folder / name).read_bytes()
    rng = np.random.default_rng(4)
    reasons = []
    for _ in range(300):
        (folder / name).write_bytes(mutated(rng, whole))
        try:
            read_boxes(folder / name) if name == "boxes.json" else read_split(folder)
        except (SheetError, PictureError) as error:
            reasons.append(str(error))
    assert len(reasons) > 100
    assert all(reason.startswith(str(folder)) for reason in reasons)
