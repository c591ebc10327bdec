"""`toonset view`: what it writes, and what it refuses before it works."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.nerf.bodies import Hand, body, sheet
from toonset.cli.main import main
from toonset.dataset.bundle.transforms import transforms_dict
from toonset.dataset.images.picture import encode_png
from toonset.dataset.mesh.load import save_obj
from toonset.write import write_bytes, write_json

HOSTILE = "a</script><script>x='1'"


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    """Return a bundle of four drawings with a mannequin, under a name that means harm."""
    folder = tmp_path / HOSTILE.replace("/", "\N{FRACTION SLASH}")
    frames = sheet(body(), Hand(), views=4).frames
    for frame in frames:
        write_bytes(folder / "images" / frame.name, encode_png(frame.rgba))
    named = [(f"images/{frame.name}", frame.camera) for frame in frames]
    write_json(folder / "transforms.json", transforms_dict(named, 2.0, 1.0))
    write_bytes(folder / "mannequin.obj", save_obj(body()))
    return folder


def view(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    monkeypatch.setattr("sys.argv", ["toonset", "view", *map(str, words)])
    try:
        main()
    except SystemExit as left:
        return int(left.code or 0)
    return 0


@pytest.mark.parametrize("body_there", [True, False])
def test_a_bundle_becomes_one_quiet_file(
    bundle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body_there: bool
) -> None:
    if not body_there:
        (bundle / "mannequin.obj").unlink()
    page = tmp_path / "page.html"
    assert view(monkeypatch, bundle, "-o", page) == 0
    text = page.read_text(encoding="utf-8")
    assert len(re.findall("<script", text)) == 3  # numbers, pictures, the modules
    assert "<title>a&lt;" in text
    assert view(monkeypatch, bundle, "-o", page, "--force", "--title", "<i>my\ntitle</i>") == 0
    assert "<title>&lt;i&gt;my title&lt;/i&gt;</title>" in page.read_text(encoding="utf-8")
    assert not re.search(r"""(src|href)=["']?(https?:)?//""", text)
    (policy,) = re.findall("""<meta http-equiv=.*content="([^"]*)""", text)
    assert policy.startswith("default-src 'none'")
    assert "unsafe" not in policy


def test_what_cannot_be_written_is_refused_first(
    bundle: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    there = tmp_path / "there.html"
    there.write_text("mine")
    cases = [
        ([bundle, "-o", tmp_path / "page.png"], "ends in .html"),
        ([bundle, "-o", there], "exists already; pass --force"),
        ([bundle, "-o", there / "page.html"], "is a file"),
        ([bundle, "-o", tmp_path / "x.html", "--size", "4"], "--size"),
        ([tmp_path / "nothing", "-o", tmp_path / "x.html"], "no such file"),
        ([tmp_path / "nothing", "-o", there], "no such file; check the name of the run or bundle"),
    ]
    for words, said in cases:
        assert view(monkeypatch, *words) == 2
        assert said in capsys.readouterr().err
    assert there.read_text() == "mine"
    assert not (tmp_path / "x.html").exists()
