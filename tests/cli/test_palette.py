"""`toonset palette` as a function: what it writes, into what, and what it refuses."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from toonset.camera import Camera
from toonset.cli.common.output import DetailPrinter, Printer
from toonset.cli.common.palette_text import palette_lines
from toonset.cli.palette import palette as palette_verb
from toonset.cli.palette import recolor as recolor_verb
from toonset.cli.split import split as split_verb
from toonset.dataset.bundle.read_scene import read_scene
from toonset.dataset.bundle.transforms import transforms_dict
from toonset.dataset.images.picture import encode_png, load_indexed_png, load_rgba
from toonset.errors import OutputError, ToonsetError
from toonset.palette.options import PaletteOptions
from toonset.palette.palette import Evidence, Palette, PaletteColor
from toonset.write import write_bytes, write_json

palette = partial(palette_verb, printer=DetailPrinter())
recolor, split = (partial(verb, printer=Printer()) for verb in (recolor_verb, split_verb))
RED, BLUE = (200, 30, 40), (20, 60, 180)


def figure() -> np.ndarray:
    """Return a red and blue figure, 40 x 60, with alpha."""
    rgba = np.zeros((60, 40, 4), dtype=np.uint8)
    rgba[5:55, 10:30] = (*RED, 255)
    rgba[40:55, 10:30] = (*BLUE, 255)
    return rgba


def make_bundle(folder: Path) -> Path:
    middle = np.zeros(3)
    cameras = [
        (f"images/{i:03d}.png", Camera.looking_at(middle, float(i), 0.1, 20.0, (40, 60)))
        for i in range(2)
    ]
    write_json(folder / "transforms.json", transforms_dict(cameras, 2.0, 1.0))
    for name, _ in cameras:
        write_bytes(folder / name, encode_png(figure()))
    return folder


def tree(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def test_a_bundle_gets_its_palette_and_labels(tmp_path, monkeypatch, capsys):
    make_bundle(tmp_path / "bundle")
    monkeypatch.chdir(tmp_path)
    palette()
    shown = capsys.readouterr().out.splitlines()
    colors = ["#c81e28   70.0 %  red", "#143cb4   30.0 %  blue"]
    assert shown == [*colors, "bundle: look at palette.png; next: toonset train bundle"]
    palette(printer=DetailPrinter(verbose=True))
    shown = capsys.readouterr().out.splitlines()
    assert shown[:2] == colors
    assert shown[2].startswith("shares are of all the character's pixels; rule: at least 5 % of")
    assert shown[3].startswith("2 colours describe 4,096 pixels in the fewest bits")
    assert shown[4].startswith("bundle: look at")
    scene = read_scene(tmp_path / "bundle")
    assert scene.palette is not None
    assert scene.palette.tolist() == [list(RED), list(BLUE)]
    for frame in scene.frames:
        assert frame.labels is not None
        assert np.array_equal(frame.labels == 255, frame.rgba[..., 3] == 0)
        assert np.array_equal(frame.labels == 1, (frame.rgba[..., :3] == BLUE).all(axis=2))


def test_a_second_run_replaces_the_first_by_the_same_bytes(tmp_path: Path, snapshot) -> None:
    bundle = make_bundle(tmp_path / "b")
    palette([bundle])
    before = snapshot(bundle)
    palette([bundle])
    assert snapshot(bundle) == before
    palette([bundle], options=PaletteOptions(colors="#00ff00"))
    assert snapshot(bundle).keys() == before.keys()
    content = json.loads((bundle / "palette.json").read_text())
    assert [color["hex"] for color in content["colors"]] == ["#00ff00"]
    assert set(np.unique(load_indexed_png(bundle / "labels" / "000.png"))) == {0, 255}


@pytest.mark.parametrize("name", ["labels", "contours", "tones", "coverage"])
def test_what_others_put_among_maps_is_never_taken_away(tmp_path: Path, name: str, snapshot):
    bundle = make_bundle(tmp_path / "b")
    (bundle / name).mkdir()
    (bundle / name / "person_seg.json").write_text("mine")
    before = snapshot(bundle)
    with pytest.raises(OutputError, match=r"holds 'person_seg\.json', which this command does not"):
        palette([bundle])
    assert snapshot(bundle) == before


def test_pictures_go_into_a_folder_of_their_own(tmp_path, capsys):
    opaque = np.full((60, 40, 4), 255, dtype=np.uint8)
    opaque[figure()[..., 3] > 0] = figure()[figure()[..., 3] > 0]
    write_bytes(tmp_path / "front.png", encode_png(opaque))  # on white: the ground is cut away
    write_bytes(tmp_path / "back.png", encode_png(figure()))
    out = tmp_path / "colours"
    palette(
        [tmp_path / "front.png", tmp_path / "back.png"],
        out=out,
        printer=DetailPrinter(as_json=True),
    )
    result = json.loads(capsys.readouterr().out)
    assert [color["hex"] for color in result["colors"]] == ["#c81e28", "#143cb4"]
    assert tree(out) == {
        *("contours", "contours/000.png", "contours/001.png"),
        *("coverage", "coverage/000.png", "coverage/001.png"),
        *("labels", "labels/000.png", "labels/001.png"),
        *(f"palette.{extension}" for extension in ("ase", "gpl", "hex", "json", "png")),
    }
    assert (load_indexed_png(out / "labels" / "000.png")[0] == 255).all()
    with pytest.raises(ToonsetError, match="exists already; pass --force"):
        palette([tmp_path / "front.png"], out=out)
    palette([tmp_path / "front.png"], out=out, force=True)
    assert "labels/001.png" not in tree(out)


def test_what_is_dropped_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bundle = make_bundle(tmp_path / "b")
    palette([bundle], PaletteOptions(min_share=0.5))
    said = capsys.readouterr().out
    assert "left out by the rule: #143cb4 blue (--keep '#143cb4' keeps one)\n" in said
    palette([bundle], PaletteOptions(min_share=0.5), printer=DetailPrinter(verbose=True))
    lines = capsys.readouterr().out.splitlines()
    assert "rule: at least 50 % of the character's pixels" in lines[1]
    assert lines[2].startswith("left out")
    assert lines[3].startswith("#143cb4   30.0 %  blue  0.")


def test_the_number_of_colours_is_explained_without_empty_figures() -> None:
    red = PaletteColor(RED, 1.0, "red")
    said = [
        palette_lines(Palette((red,), "r", evidence=Evidence(*evidence)), verbose=True)[-1]
        for evidence in [(8, 233.4, 14.2), (8, 0.3, 14.2), (1, 98274.0, 87.0)]
    ]
    for number, colors in zip(("8", "8", "1"), said, strict=True):
        assert colors.startswith(f"{number} colour")
    assert "7 would take 233 bits more, 9 would take 14 bits more" in said[0]
    assert "7 would do nearly as well, a close call, 9 would take 14 bits more" in said[1]
    assert "0 would" not in said[2]


@pytest.mark.parametrize(
    ("arguments", "options", "fragment"),
    [
        (["none.png"], {}, "none.png: no such file; check the name of the picture"),
        (["empty"], {}, "empty: is a folder without pictures; name a sheet, or its"),
        (["bundle", "front.png"], {}, "a bundle stands alone"),
        (["text.png"], {}, "is text, no picture that can be read"),
        (["bundle"], {"colors": "red"}, "^--colors: red: neither colours such as '#aabbcc"),
        (["bundle"], {"keep": "xx"}, "^--keep: xx: neither colours such as"),
        (["bundle"], {"keep": "#"}, "^--keep: colours: '#' is no colour"),
        (["bundle"], {"keep": "#ffff00"}, "^--keep: #ffff00: no such colour was found"),
        (["bundle"], {"min_share": 7.0}, "^--min-share: 7 is no share"),
        (["bundle"], {"out": Path("/proc/nowhere/x")}, "not writable|cannot be written"),
        (["outside"], {}, "lies outside of the folder"),
    ],
)
def test_mistakes_write_nothing(arguments, options, fragment, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make_bundle(Path("bundle"))
    Path("empty").mkdir()
    Path("text.png").write_text("hello")
    write_bytes(Path("front.png"), encode_png(figure()))
    outside = transforms_dict(
        [("../front.png", Camera.looking_at(np.zeros(3), 0.0, 0.0, 20.0, (40, 60)))], 2.0, 1.0
    )
    write_json(Path("outside/transforms.json"), outside)
    before = tree(tmp_path)
    places, out = [Path(one) for one in arguments], options.pop("out", None)
    with pytest.raises(ToonsetError, match=fragment):
        palette(places, PaletteOptions(**options), out=out)
    assert tree(tmp_path) == before


def outlined() -> np.ndarray:
    """Return a red and blue figure with a black outline of 3 px, 120 x 80."""
    rgba = np.zeros((120, 80, 4), dtype=np.uint8)
    rgba[10:110, 10:70] = (0, 0, 0, 255)
    rgba[13:107, 13:67] = (*RED, 255)
    rgba[70:107, 13:67] = (*BLUE, 255)
    return rgba


def test_lines_can_be_left_out_of_palette_and_labels(tmp_path: Path) -> None:
    write_bytes(tmp_path / "a.png", encode_png(outlined()))
    for contour in (True, False):
        palette(
            [tmp_path / "a.png"],
            options=PaletteOptions(contour=contour),
            out=tmp_path / "out",
            force=True,
        )
        content = json.loads((tmp_path / "out" / "palette.json").read_text())
        assert ("#000000" in [color["hex"] for color in content["colors"]]) == contour
        assert content["contour"]["hex"] == "#000000"
        assert content["contour"]["cloth"] < 0.01
        line = load_indexed_png(tmp_path / "out" / "labels" / "000.png")[11, 20:60]
        assert ((line != 255) == contour).all()


def test_folders_of_pictures_and_of_split_are_read(tmp_path: Path) -> None:
    sheet = np.concatenate([outlined(), outlined()[:, ::-1]], axis=1)
    write_bytes(tmp_path / "sheet.png", encode_png(sheet))
    split([tmp_path / "sheet.png"], out=tmp_path / "views")
    (tmp_path / "views" / "split.json").rename(tmp_path / "split.json")
    palette([tmp_path / "views"], out=tmp_path / "plain")
    (tmp_path / "split.json").rename(tmp_path / "views" / "split.json")
    palette([tmp_path / "views"], out=tmp_path / "split")
    for name in ("plain", "split"):
        assert sorted(path.name for path in (tmp_path / name / "labels").iterdir()) == [
            "000.png",
            "001.png",
        ]
    read = [(tmp_path / name / "palette.json").read_bytes() for name in ("plain", "split")]
    assert read[0].replace(b'"title": "views"', b'"title": "sheet"') == read[1]  # the split knows


def test_a_left_out_colour_can_be_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rgba = outlined()
    rgba[20:24, 30:36, :3] = (250, 220, 50)
    write_bytes(tmp_path / "a.png", encode_png(rgba))
    palette([tmp_path / "a.png"], out=tmp_path / "without", printer=DetailPrinter(verbose=True))
    shown = capsys.readouterr().out
    assert "picture 0 at (30, 20), 6 x 4 px" in shown
    palette([tmp_path / "a.png"], options=PaletteOptions(keep="#fadc32"), out=tmp_path / "with")
    content = json.loads((tmp_path / "with" / "palette.json").read_text())
    assert "#fadc32" in [color["hex"] for color in content["colors"]]


STUDIO = "GIMP Palette\nName: Studio\n#\n200 30 40\tHair base\n20 60 180\tCoat\n9 9 9\tUntitled\n"


def test_names_and_title_of_a_given_palette_are_kept(tmp_path: Path) -> None:
    bundle = make_bundle(tmp_path / "b")
    (tmp_path / "n.gpl").write_text(STUDIO)
    palette([bundle], PaletteOptions(colors=str(tmp_path / "n.gpl")))
    written = json.loads((bundle / "palette.json").read_text())
    assert written["title"] == "Studio"
    assert [color["name"] for color in written["colors"]] == ["Hair base", "Coat", "black"]
    lines = (bundle / "palette.gpl").read_text().splitlines()
    assert lines[1] == "Name: Studio"
    assert [line.partition("\t")[2] for line in lines[4:]] == ["Hair base", "Coat", "black"]
    ase = (bundle / "palette.ase").read_bytes()
    assert all(name.encode("utf-16-be") in ase for name in ("Studio", "Hair base", "Coat"))
    for end in ("json", "ase", "gpl"):  # and again, from what was written
        again = tmp_path / end
        palette([bundle], PaletteOptions(colors=str(bundle / f"palette.{end}")), out=again)
        assert json.loads((again / "palette.json").read_text()) == written
    recolor(["hair base=#00ff00"], [bundle], tmp_path / "green")
    recolor(["red=#00ff00"], [bundle], tmp_path / "too")
    new = load_rgba(tmp_path / "green" / "000.png")
    assert ((new == (0, 255, 0, 255)).all(axis=2) == (figure()[..., :3] == RED).all(axis=2)).all()
    assert np.array_equal(load_rgba(tmp_path / "too" / "000.png"), new)
    with pytest.raises(ToonsetError, match=r"#c81e28 \(Hair base\), #143cb4 \(Coat\)"):
        recolor(["hat=#00ff00"], [bundle], tmp_path / "no")


def test_a_palette_is_called_as_its_sheet_or_folder(tmp_path: Path, toonset) -> None:
    bundle = make_bundle(tmp_path / "knight")
    palette([bundle])
    assert "Name: knight\n" in (bundle / "palette.gpl").read_text()
    for name in ("girl.png", "back.png"):
        write_bytes(tmp_path / "sheets" / name, encode_png(figure()))
    girl, both = tmp_path / "sheets" / "girl.png", tmp_path / "sheets"
    for given, title in ((girl, "girl"), (both, "sheets")):
        out = tmp_path / f"colours of {title}"
        palette([given], out=out)
        assert f"Name: {title}\n" in (out / "palette.gpl").read_text()
        palette([given], out=out, force=True, options=PaletteOptions(colors="#c81e28,#143cb4"))
        assert json.loads((out / "palette.json").read_text())["title"] == title
    split([girl], out=tmp_path / "views")
    palette([tmp_path / "views"], out=tmp_path / "split")
    assert "Name: girl\n" in (tmp_path / "split" / "palette.gpl").read_text()
    made = toonset("calibrate", girl, "--mesh", "none", "-o", tmp_path / "b", "-q")
    assert made.code in (0, 3)  # one view is never sure
    palette([tmp_path / "b"])
    assert "Name: girl\n" in (tmp_path / "b" / "palette.gpl").read_text()


def test_drawings_are_written_in_other_colours(tmp_path: Path) -> None:
    bundle = make_bundle(tmp_path / "b")
    palette([bundle])
    recolor(["red=#00ff00"], [bundle], tmp_path / "new")
    assert tree(tmp_path / "new") == {"000.png", "001.png"}
    new = load_rgba(tmp_path / "new" / "000.png")
    red = (figure()[..., :3] == RED).all(axis=2)
    assert (new[red] == (0, 255, 0, 255)).all()
    assert np.array_equal(new[~red], figure()[~red])
    found = sorted((bundle / "images").iterdir())
    recolor(["red=#00ff00"], found, tmp_path / "found", printer=Printer(as_json=True))
    assert np.array_equal(load_rgba(tmp_path / "found" / "000.png"), new)


@pytest.mark.parametrize("name", ["images", "labels", "contours"])
def test_other_colours_never_replace_what_they_are_made_of(tmp_path, name: str, snapshot) -> None:
    bundle = make_bundle(tmp_path / "b")
    palette([bundle])
    before = snapshot(bundle)
    for place in (bundle, bundle / "transforms.json"):
        with pytest.raises(ToonsetError, match="--force would delete it"):
            recolor(["red=#00ff00"], [place], bundle / name, force=True)
    assert snapshot(bundle) == before


def test_nothing_is_written_where_colours_cannot_be_changed(tmp_path: Path) -> None:
    bundle = make_bundle(tmp_path / "b")

    def refused(words: str, *recoloured: str) -> None:
        with pytest.raises(ToonsetError, match=words):
            recolor([*recoloured], [bundle], tmp_path / "new")

    refused(r"has no palette\.json; run `toonset palette` first", "red=#00ff00")
    palette([bundle])
    refused("the palette has #c81e28", "green=#00ff00")
    refused("OLD=NEW is needed", "red")
    (bundle / "labels" / "001.png").unlink()
    refused(r"labels/001\.png: is missing", "red=#00ff00")
    assert not (tmp_path / "new").exists()


def test_corrections_are_applied_to_palette_and_labels(tmp_path: Path, toonset) -> None:
    """Loose pictures are sheets of their own: a stroke's box lies in the whole picture."""
    write_bytes(tmp_path / "sheet.png", encode_png(figure()))
    path = tmp_path / "corrections.json"
    stroke = {"box": [8, 4, 24, 52], "color": "#1e3cb4", "radius": 3, "points": [[20.5, 10.5]]}
    names = {"#143cb4": "trousers"}
    path.write_text(json.dumps({"version": 1, "palette": {"names": names, "strokes": [stroke]}}))
    out = tmp_path / "out"
    refused = toonset("palette", tmp_path / "sheet.png", "--corrections", path, "-o", out)
    assert "palette.strokes.0.color: #1e3cb4 is no colour of the palette" in refused.reason
    assert not out.exists()
    stroke["color"] = "#143cb4"
    path.write_text(json.dumps({"version": 1, "palette": {"names": names, "strokes": [stroke]}}))
    done = toonset("palette", tmp_path / "sheet.png", "--corrections", path, "-o", out, "--json")
    assert [color["name"] for color in done.json["colors"]] == ["red", "trousers"]
    labels = load_indexed_png(out / "labels" / "000.png")
    assert (labels[8:13, 18:23] == 1).all()
    assert (labels[5:37, 10:30] == 1).sum() < 60


def test_a_corrections_file_without_colours_changes_no_byte(tmp_path, toonset, snapshot) -> None:
    write_bytes(tmp_path / "sheet.png", encode_png(figure()))
    path = tmp_path / "corrections.json"
    path.write_text('{"version": 1}')
    for name, more in {"a": (), "b": ("--corrections", path)}.items():
        assert toonset("palette", tmp_path / "sheet.png", *more, "-o", tmp_path / name).code == 0
    assert snapshot(tmp_path / "a") == snapshot(tmp_path / "b")
