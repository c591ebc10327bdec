"""Which sheets a batch has, and what of a manifest is refused before anything runs."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image

from toonset.apps.batch.given import clean_name
from toonset.apps.batch.sheets import list_sheets
from toonset.apps.batch.stages import Entry
from toonset.cli.common.verb_stages import VERBS
from toonset.errors import ToonsetError

Refused = Callable[..., str]


@pytest.fixture
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("ann.png", "bob.png", "sub/cat.png", "sub/deep/dan.png"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        Image.new("RGB", (8, 8)).save(tmp_path / name)
    (tmp_path / "body.obj").write_text("v 0 0 0\n")
    (tmp_path / "notes.txt").write_text("x")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def names(*places: object) -> list[str]:
    return [entry.name for entry in list_sheets([str(place) for place in places], {}, VERBS)]


def one(manifest: Path, words: dict[str, tuple[str, ...]] | None = None) -> Entry:
    (entry,) = list_sheets([str(manifest)], words or {}, VERBS)
    return entry


def manifest(folder: Path, text: str, name: str = "sheets.csv") -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def reason(*places: object, root: Path | None = None, **words: tuple[str, ...]) -> str:
    with pytest.raises(ToonsetError) as caught:
        list_sheets([str(place) for place in places], words, VERBS, root)
    text = str(caught.value)
    assert text.isprintable()
    return text


def test_a_folder_means_its_pictures_and_a_pattern_what_it_matches(library: Path) -> None:
    assert names(library) == ["ann", "bob"]
    assert names("*.png") == ["ann", "bob"]
    assert names("**/*.png") == ["ann", "bob", "sub-cat", "sub-deep-dan"]
    assert names("sub/**/*.png") == ["cat", "deep-dan"]
    assert names("bob.png", "sub") == ["bob", "cat"]


def test_a_pattern_takes_a_folder_or_what_is_in_it(library: Path) -> None:
    assert names("**/*") == ["ann", "bob", "sub-cat", "sub-deep-dan"]
    assert names("*") == ["ann", "bob", "sub"]


def test_names_with_dots_keep_what_is_before_the_last(library: Path) -> None:
    for name in ("eve.v1.png", "eve.v2.png"):
        Image.new("RGB", (8, 8)).save(library / name)
    assert names("eve*.png") == ["eve_v1", "eve_v2"]
    assert one(manifest(library, "sheet\neve.v1.png\n")).name == "eve_v1"


def test_what_a_folder_holds_besides_is_told(library: Path) -> None:
    manifest(library, "sheet\nann.png\n")
    said: list[str] = []
    list_sheets([str(library)], {}, VERBS, say=said.append)
    assert said == [
        f"{library}/sheets.csv: is not used; to use a manifest, name it in place of its folder",
        f"{library}: no pictures, left out: body.obj, notes.txt",
        f"{library}: folders in it are not read (sub); '{library}/**/*.png' takes theirs, too",
    ]


def test_drawings_that_a_folder_leaves_out_are_named_before_the_rest(library: Path) -> None:
    for name in ("scan.heic", "hero.psd", "Thumbs.db", "page.clip", "a.txt", "b.txt"):
        (library / name).write_text("x")
    said: list[str] = []
    assert len(list_sheets([str(library)], {}, VERBS, say=said.append)) == 2
    assert said[:3] == [
        f"{library}: working files, left out: hero.psd; name one itself to read it",
        f"{library}: of kinds that are not read, left out: page.clip, scan.heic; save them as PNG",
        f"{library}: no pictures, left out: a.txt, b.txt, body.obj and 2 more",
    ]
    assert names("hero.psd") == names("*.psd") == ["hero"]
    assert names("**/*") == ["ann", "bob", "sub-cat", "sub-deep-dan"]


def test_a_drawing_that_is_saved_twice_is_one_sheet(library: Path) -> None:
    for name in ("ann.jpg", "ann.webp", "ann.psd"):
        (library / name).write_text("x")
    for places in (["."], ["ann.jpg", "bob.png", "ann.webp", "ann.png"]):
        said: list[str] = []
        entries = list_sheets(places, {}, VERBS, say=said.append)
        assert [entry.name for entry in entries] == ["ann", "bob"]
        assert entries[0].sheets == (str(library / "ann.png"),)
        twins = [line for line in said if "the same sheet" in line]
        assert [line.split(":")[0] for line in twins] == ["ann.jpg", "ann.webp"]
        assert twins[0].endswith(
            "left out, ann.png beside it is the same sheet by its name; rename one if it is not"
        )
    assert names("ann.webp", "ann.jpg", "ann.psd") == ["ann"]


def test_twins_are_only_those_of_one_folder_that_no_manifest_names(library: Path) -> None:
    (library / "sub" / "ann.jpg").write_text("x")
    (library / "ann.jpg").write_text("x")
    assert "two sheets are called 'ann'" in reason("ann.png", "sub/ann.jpg")
    assert "two sheets are called 'ann'" in reason(manifest(library, "sheet\nann.png\nann.jpg\n"))


def test_a_pattern_finds_no_results_of_the_batch(library: Path) -> None:
    (library / "out" / "sheets").mkdir(parents=True)
    Image.new("RGB", (8, 8)).save("out/sheets/overlay.png")
    found = list_sheets(["**/*.png"], {}, VERBS, out=Path("out"))
    assert [entry.name for entry in found] == ["ann", "bob", "sub-cat", "sub-deep-dan"]


def test_order_does_not_depend_on_how_sheets_are_named(library: Path) -> None:
    assert list_sheets(["bob.png", "ann.png"], {}, VERBS) == list_sheets(["."], {}, VERBS)


def test_a_split_folder_is_one_sheet(library: Path) -> None:
    (library / "sub" / "split.json").write_text("{}")
    assert names("sub") == ["sub"]


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("ann", "ann"),
        ("Anna's sheet (1)", "Anna_s_sheet_1"),
        ("<img src=x>", "img_src_x"),
        ("=1+2", "1_2"),
        ("-rf", "rf"),
        ("a.b", "a_b"),
        ("e\u0301t\u00e9", "\u00e9t\u00e9"),
    ],
)
def test_texts_become_names_that_mean_nothing_elsewhere(text: str, name: str) -> None:
    assert clean_name(text) == name


def test_manifest_says_more_of_a_sheet(library: Path) -> None:
    entry = one(
        manifest(
            library,
            "sheet,name,mesh,views,calibrate_options,train_options,character,license,source\n"
            'ann.png;bob.png,one,body.obj,"front,back",--group 3,--steps 40,Ann,CC0-1.0,here\n',
        ),
        {"calibrate": ("--grid", "2x1")},
    )
    assert entry.sheets == (str(library / "ann.png"), str(library / "bob.png"))
    mesh = f"--mesh={library / 'body.obj'}"
    assert entry.words["calibrate"] == ("--grid", "2x1", "--group", "3", mesh, "--views=front,back")
    assert entry.words["train"] == ("--steps", "40")
    assert (entry.character, entry.license, entry.source) == ("Ann", "CC0-1.0", "here")


def test_jsonl_says_the_same_as_csv(library: Path) -> None:
    table = manifest(library, "sheet,mesh,character\nann.png,body.obj,Ann\n")
    line = json.dumps({"sheet": ["ann.png"], "mesh": "body.obj", "character": "Ann"})
    assert one(table) == one(manifest(library, f"{line}\n\n", "sheets.jsonl"))


def test_paths_are_relative_to_the_manifest(library: Path) -> None:
    inside = manifest(library / "sub", "sheet\ncat.png\n")
    assert one(inside).sheets == (str(library / "sub" / "cat.png"),)


def test_files_of_options_are_found_from_there_too(library: Path) -> None:
    (library / "sub" / "boxes.json").write_text("[]")
    inside = manifest(library / "sub", "sheet,calibrate_options\ncat.png,--boxes boxes.json\n")
    boxes = str(library / "sub" / "boxes.json")
    assert one(inside).words["calibrate"] == ("--boxes", boxes)


def test_options_for_all_are_found_from_the_current_folder(library: Path) -> None:
    words = {"calibrate": ("--mesh=body.obj", "--views", "front")}
    (entry,) = list_sheets(["ann.png"], words, VERBS)
    assert entry.words["calibrate"] == (f"--mesh={library / 'body.obj'}", "--views", "front")


def test_no_body_is_no_file(library: Path) -> None:
    (entry,) = list_sheets(["ann.png"], {"calibrate": ("--mesh", "none")}, VERBS)
    assert entry.words["calibrate"] == ("--mesh", "none")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sheet\nann.png\nmissing.png\n", "line 3: "),
        ("sheet\nann.png\nsub/../ann.png\n", "two sheets are called 'ann'"),
        ("sheet,name\nann.png,x\nbob.png,X\n", "'X' differs by case only from 'x'"),
        ("sheet\n../ann.png\n", "lies outside of"),
        ("sheet\n/etc/passwd\n", "lies outside of"),
        ("sheet,mesh\nann.png,/etc/passwd\n", "lies outside of"),
        ("sheet,calibrate_options\nann.png,--init=../x\n", "lies outside of"),
        ("sheet,colour\nann.png,red\n", "line 1: 'colour' is no column of a manifest"),
        ("sheet;name\nann.png;x\n", "line 1: has ';' between cells; save it with ','"),
        ("sheet\nfile:///etc/passwd\n", "is a file here; name its path"),
        ("sheet,mesh\nann.png,file:///etc/passwd\n", "is a file here; name its path"),
        ("sheet,licence\nann.png,CC0\n", "did you mean 'license'"),
        ("name\nann\n", "names no sheet"),
        ("sheet\n", "no sheets there"),
        ("", "is empty"),
        ("sheet,name\nann.png,a/b\n", "'a/b' is no name"),
        ("sheet,name\nann.png,<img src=x>\n", "is no name"),
        ("sheet,name\nann.png,=cmd\n", "'=cmd' is no name"),
        ("sheet,name\nann.png,$(ls)\n", "is no name"),
        ("sheet,name\nann.png,-rf\n", "'-rf' is no name"),
        ("sheet,name\nann.png,..\n", "'..' is no name"),
        ("sheet,name\nann.png,a.b\n", "'a.b' is no name"),
        (f"sheet,name\nann.png,{'a' * 101}\n", "longer than 100 bytes"),
        ("sheet,sheet\nann.png,bob.png\n", "two columns 'sheet'"),
        ("sheet\nann.png,bob.png\n", "more cells than columns"),
        ('sheet\n"ann.png\n', "is no CSV"),
        ("sheet,train_options\nann.png,--stepz 3\n", "line 2: No such option: --stepz"),
        ("sheet,train_options\nann.png,--steps many\n", "line 2: Invalid value for '--steps'"),
        ("sheet,train_options\nann.png,--out x\n", "--out is set by toonset batch"),
        ("sheet,train_options\nann.png,'--steps\n", "close the quote"),
        ("sheet,palette_options\nann.png,other.png\n", "reads the sheet's own"),
    ],
)
def test_what_a_manifest_must_not_say(library: Path, text: str, said: str) -> None:
    assert said in reason(manifest(library, text))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[1]\n", "line 1: is no JSON object"),
        ('{"sheet": "ann.png"\n', "line 1: "),
        ('{"sheet": 3}\n', "'sheet' is no text"),
        ('{"sheet": "ann.png", "colour": "red"}\n', "line 1: 'colour' is no column"),
        ('{"sheet": "ann.png", "name": ["a"]}\n', "'name' is no text"),
        ('{"sheet": "ann.png"}\n{"sheet": "ann.png", "sheet": "bob.png"}\n', "line 2: "),
    ],
)
def test_what_a_jsonl_manifest_must_not_say(library: Path, text: str, said: str) -> None:
    assert said in reason(manifest(library, text, "sheets.jsonl"))


def test_a_link_does_not_lead_out_of_the_manifests_folder(library: Path) -> None:
    os.symlink(library / "ann.png", library / "sub" / "link.png")
    inside = manifest(library / "sub", "sheet\nlink.png\n")
    assert "lies outside of" in reason(inside)
    place = str(manifest(library / "sub", "sheet\nsub/link.png\n"))
    (entry,) = list_sheets([place], {}, VERBS, library)
    assert entry.name == "link"


def test_names_that_are_no_text_are_told(library: Path) -> None:
    Path(os.fsdecode(b"x\xff.png")).touch()
    assert "its name is no UTF-8; rename it" in reason("*.png")


def test_places_without_sheets_are_told(library: Path) -> None:
    assert "no such file" in reason("gone.png")
    assert "no sheets there" in reason("sub/*.jpg")
    (library / "empty").mkdir()
    assert "no sheets there" in reason("empty")


def test_sheets_of_two_places_with_one_name_are_told(library: Path) -> None:
    assert "two sheets are called 'ann'" in reason("ann.png", "ann.png")
    Image.new("RGB", (8, 8)).save("sub/ann.png")
    assert "name one differently" in reason("ann.png", "sub")
