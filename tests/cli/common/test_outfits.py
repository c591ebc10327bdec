"""`--outfit all`: a folder for every row of a sheet that shows the same directions again."""

import json
from pathlib import Path

import pytest
from PIL import Image

from lab.bench.messy.sheet import make_messy_sheet
from tests.cli.split_sheets import drawn_sheet
from toonset.dataset.images.picture import encode_png
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.split_folder.load import split_sheet
from toonset.dataset.split_folder.options import SheetOptions
from toonset.errors import SheetError, UsageError

LABELS = "front,side,back"


@pytest.fixture(scope="module")
def drawings() -> dict[str, bytes]:
    """Return sheets by name; `sheet` and `touching` have two outfits of three views."""
    kinds = {"sheet": ("outfits",), "touching": ("outfits", "touching"), "turning": ("rows",)}
    return {name: encode_png(make_messy_sheet(6211, kind).rgba) for name, kind in kinds.items()}


@pytest.fixture
def sheet(drawings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the sheet with outfits in the current folder."""
    monkeypatch.chdir(tmp_path)
    Path("sheet.png").write_bytes(drawings["sheet"])
    return Path("sheet.png")


def test_each_outfit_is_split_as_it_is_alone(sheet: Path, toonset, snapshot, monkeypatch):
    cuts = []

    def counted(rgba, options):
        cuts.append(options)
        return split_picture(rgba, options)

    monkeypatch.setattr("toonset.dataset.split_folder.load.split_picture", counted)
    done = toonset("split", sheet, "--outfit", "all", "--views", LABELS, "-o", "views")
    assert (done.code, done.out) == (0, "views/A\nviews/B\n")
    assert len(cuts) == 2
    for letter in "AB":
        alone = ("--outfit", letter, "-o", f"alone/{letter}")
        assert toonset("split", sheet, "--views", LABELS, *alone).code == 0
        assert f"outfit {letter}: look at views/{letter}/overlay.png\n" in done.err
    assert snapshot(Path("views")) == snapshot(Path("alone"))
    again = toonset("split", "views/B", "-o", "again", "-q", "--json")
    assert [view["label"] for view in again.json["views"]] == LABELS.split(",")


def test_each_outfit_is_calibrated_as_it_is_alone(sheet: Path, toonset, snapshot):
    typed = ("--mesh", "none", "--front", "0", "--json", "-q")
    done = toonset("calibrate", sheet, *typed, "--outfit", "all")
    assert done.code == 3
    assert list(done.json) == ["outfits"]
    alone = toonset("calibrate", sheet, *typed, "--outfit", "b", "-o", "alone")
    told = {"bundle": "bundle/B", "seconds": done.json["outfits"]["B"]["seconds"]}
    assert done.json["outfits"]["B"] == alone.json | told
    assert snapshot(Path("bundle/B")) == snapshot(Path("alone"))
    assert {path.name for path in Path("bundle").iterdir()} == {"A", "B"}
    lines = done.err.splitlines()
    assert [line[:17] for line in lines] == ["outfit A: sheet: ", "outfit B: sheet: "]
    assert lines[1].removeprefix("outfit B: ") == alone.err.strip()
    assert toonset("info", "bundle/A").code == 0


@pytest.mark.parametrize(("outfit", "told"), [((), True), (("--outfit", "A"), False)])
def test_calibrating_all_rows_as_one_body_is_told(sheet: Path, toonset, outfit, told: bool):
    done = toonset("calibrate", sheet, "--mesh", "none", *outfit)
    assert ("rows A to B show the same directions and are taken for one body" in done.err) == told


def test_a_doubt_names_its_outfit(sheet: Path, toonset):
    picture = Image.open(sheet)
    picture.crop((60, 0, picture.width - 41, picture.height)).save("cut.png")
    done = toonset("split", "cut.png", "--outfit", "ALL", "--json", "-q")
    assert done.code == 3
    assert {name: one["folder"] for name, one in done.json["outfits"].items()} == {
        "A": "views/A",
        "B": "views/B",
    }
    for letter in "AB":
        assert f"outfit {letter}: look: cut.png: only 65 % of the sheet's border" in done.err


def test_a_sheet_names_its_outfits(sheet: Path, drawings):
    found = split_sheet(sheet)
    assert found.outfits == ("A", "B")
    (remark,) = (text for text in found.split.sources[0].remarks if "--outfit" in text)
    assert remark.endswith("take one with --outfit A to B, or each with --outfit all")
    Path("turning.png").write_bytes(drawings["turning"])
    assert split_sheet("turning.png").outfits == ()
    assert split_sheet([sheet, "turning.png"]).outfits == ()
    with pytest.raises(SheetError, match="--outfit: 'all' is no row; write a letter"):
        split_sheet(sheet, SheetOptions(outfit="all"))


def test_outfits_whose_figures_touch_are_found(sheet: Path, drawings, toonset):
    sheet.write_bytes(drawings["touching"])
    assert (
        split_sheet(sheet, SheetOptions(outfit="A")).outfits == ()
    )  # those of row B are not cut apart
    done = toonset("split", sheet, "--outfit", "all", "-q", "--json")
    assert [len(one["views"]) for one in done.json["outfits"].values()] == [3, 3]


@pytest.mark.parametrize("verb", ["split", "calibrate"])
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["one.png"], "--outfit all: one.png shows one row of 4 figures; leave --outfit out"),
        (["turning.png"], "the rows of turning.png (6 and 4 figures) do not show the same direct"),
        (["sheet.png", "one.png"], "--outfit all takes the rows of one sheet, 2 are given"),
        (["folder"], "--outfit all takes the rows of one sheet, 2 are given; give one"),
        (["done"], "--outfit: done is cut already; give the sheet that it was cut from"),
        (["sheet.png", "--grid", "3x2"], "--grid and --outfit both say which figures count"),
        (["sheet.png", "--boxes", "b.csv"], "--boxes and --outfit both say which figures count"),
        (["sheet.png", "--drop", "1"], "--drop speaks of the views of one row; take rows one by"),
        (["sheet.png", "--views", "front,back"], "--views: 2 labels for 3 views"),
        (["sheet.png", "--group", "9"], "there is no such group"),
        (["none.png"], "none.png: no such file"),
    ],
)
def test_a_mistake_is_one_line(verb, arguments, words, sheet, drawings, toonset, snapshot):
    Path("turning.png").write_bytes(drawings["turning"])
    drawn_sheet().save("one.png")
    for name in ("folder/one.png", "folder/two.png"):
        Path(name).parent.mkdir(exist_ok=True)
        drawn_sheet().save(name)
    if "done" in arguments:
        assert toonset("split", sheet, "--outfit", "A", "-o", "done").code == 0
    before = snapshot(Path())
    assert words in toonset(verb, *arguments, "--outfit", "all").reason
    assert snapshot(Path()) == before


@pytest.mark.parametrize("option", ["--corrections", "--landmarks", "--init"])
def test_what_speaks_of_one_row_is_refused(option, sheet, toonset, snapshot):
    Path("said.json").write_text(json.dumps({"version": 1}))
    before = snapshot(Path())
    done = toonset("calibrate", sheet, "--outfit", "all", option, "said.json")
    assert f"{option} speaks of the views of one row" in done.reason
    assert snapshot(Path()) == before


def test_all_outfits_are_written_or_none(sheet: Path, toonset, snapshot, monkeypatch):
    from toonset.calib.calibrate import calibrate

    typed = ("calibrate", sheet, "--mesh", "none", "--outfit", "all", "-q")
    assert toonset(*typed).code == 3
    assert "bundle: exists already; pass --force" in toonset(*typed).reason
    before, runs = snapshot(Path()), []

    def second_fails(*arguments, **options):
        runs.append(arguments)
        if len(runs) == 2:
            raise UsageError("the second fails")
        return calibrate(*arguments, **options)

    monkeypatch.setattr("toonset.calib.calibrate.calibrate", second_fails)
    assert toonset(*typed, "--force").reason == "outfit B: the second fails"
    assert snapshot(Path()) == before


def test_a_full_disk_leaves_earlier_outfits(sheet: Path, toonset, snapshot, monkeypatch):
    from toonset.dataset.split_folder import write

    typed = ("split", sheet, "--outfit", "all", "-q")
    assert toonset(*typed).code == 0
    before, kept = snapshot(Path()), write.write_json

    def full(path: Path, content: object) -> None:
        if path.parent.name.startswith(".B."):
            raise OSError(28, "No space left on device")
        kept(path, content)

    monkeypatch.setattr(write, "write_json", full)
    assert "No space left on device" in toonset(*typed, "--force").reason
    assert snapshot(Path()) == before


def test_force_replaces_outfits_and_nothing_else(sheet: Path, toonset, snapshot):
    typed = ("split", sheet, "--outfit", "all", "-q")
    assert toonset(*typed).code == 0
    whole = snapshot(Path("views"))
    assert toonset("split", sheet, "--outfit", "A", "-o", "views/C", "-q").code == 0
    assert "views: exists already; pass --force to replace it" in toonset(*typed).reason
    assert toonset(*typed, "--force").code == 0
    assert snapshot(Path("views")) == whole
    assert "views: holds 'A'" in toonset("split", sheet, "--force").reason
    for name, words in (("views/notes.txt", "views: holds"), ("views/A/notes.txt", "views/A: ho")):
        Path(name).write_text("mine")
        before = snapshot(Path())
        assert words in toonset(*typed, "--force").reason
        assert snapshot(Path()) == before
        Path(name).unlink()


def test_a_batch_takes_one_outfit_of_a_sheet(sheet: Path, toonset):
    done = toonset("batch", sheet, "-o", "out", "--with", "calibrate --outfit all")
    assert "calibrate: --outfit: 'all' is no row; write a letter" in done.reason
