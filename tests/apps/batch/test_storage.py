"""Sheets and results behind URLs."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import fsspec
import pytest

from tests.apps.batch import stand_in
from tests.apps.batch.stand_in import STAND_IN, run_one
from toonset.apps.batch import job
from toonset.apps.batch.job import Job
from toonset.apps.batch.sheets import list_sheets
from toonset.apps.batch.storage import content_hash, fetch, find, looks, push
from toonset.errors import ToonsetError


@pytest.fixture
def memory() -> Iterator[fsspec.AbstractFileSystem]:
    files = fsspec.filesystem("memory")
    files.store.clear()
    yield files
    files.store.clear()


@pytest.fixture
def stands_in(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Let stages take no time."""
    monkeypatch.setattr(job, "_pictures", lambda home: {})
    monkeypatch.setattr(stand_in, "count_in", tmp_path / "runs")


def test_sheets_are_found_behind_a_pattern(memory: fsspec.AbstractFileSystem) -> None:
    for name in ("b.png", "a.png", "notes.txt"):
        memory.pipe_file(f"/library/{name}", b"picture")
    assert find("memory://library/*.png") == ["memory:///library/a.png", "memory:///library/b.png"]
    entries = list_sheets(["memory://library/*.png"], {}, STAND_IN)
    assert [(entry.name, *entry.sheets) for entry in entries] == [
        ("a", "memory:///library/a.png"),
        ("b", "memory:///library/b.png"),
    ]


@pytest.mark.parametrize("scheme", ["memory", "file"])
def test_what_is_put_there_comes_back(
    scheme: str, tmp_path: Path, memory: fsspec.AbstractFileSystem
) -> None:
    url = f"{scheme}://{tmp_path}/there/s"
    home = tmp_path / "s"
    (home / "bundle" / "images").mkdir(parents=True)
    (home / "bundle" / "images" / "000.png").write_bytes(b"1")
    (home / "calibrate.json").write_text("{}")
    (home / ".batch.lock").touch()
    push(home, url, ("calibrate.json",))
    got = fetch(url, tmp_path / "back")
    found = sorted(p.relative_to(got).as_posix() for p in got.rglob("*") if p.is_file())
    assert found == ["bundle/images/000.png", "calibrate.json"]
    (home / "bundle" / "images" / "000.png").unlink()
    (home / "bundle" / "images" / "001.png").write_bytes(b"2")
    push(home, url, ("calibrate.json",))
    got = fetch(url, tmp_path / "again")
    assert [p.name for p in (got / "bundle" / "images").iterdir()] == ["001.png"]


def test_what_says_that_all_is_there_comes_last(
    tmp_path: Path, memory: fsspec.AbstractFileSystem, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "s").mkdir()
    for name in ("calibrate.json", "a.png", "z.png"):
        (tmp_path / "s" / name).write_text(name)
    push(tmp_path / "s", "memory://there/s", ("calibrate.json",))
    put = []

    def cut_short(self: object, file: str, path: str, **_: object) -> None:
        put.append(path.rsplit("/", 1)[-1])
        if len(put) == 2:
            raise ConnectionError("gone")

    monkeypatch.setattr(type(memory), "put_file", cut_short)
    with pytest.raises(ToonsetError, match=r"memory://there/s: cannot be reached \(gone\)"):
        push(tmp_path / "s", "memory://there/s", ("calibrate.json",))
    assert put == ["a.png", "z.png"]
    assert not memory.exists("/there/s/calibrate.json")


def test_hashes_tell_files_and_folders_apart(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "x").write_text("1")
    one = content_hash(str(tmp_path / "a"))
    (tmp_path / "a" / "x").rename(tmp_path / "a" / "y")
    two = content_hash(str(tmp_path / "a"))
    assert len({one, two, content_hash(str(tmp_path / "a" / "y"))}) == 3
    assert looks(str(tmp_path / "none")) is None


def test_a_changed_object_looks_different(memory: fsspec.AbstractFileSystem) -> None:
    memory.pipe_file("/a.png", b"one")
    first = content_hash("memory://a.png")
    memory.pipe_file("/a.png", b"three")
    assert content_hash("memory://a.png") != first
    assert looks("memory://b.png") is None


@pytest.mark.parametrize(
    "place", ["nothing://x/y.png", "s3://bucket/none.png", "memory://none/at/all.png"]
)
def test_what_cannot_be_reached_is_told_in_a_line(place: str, tmp_path: Path) -> None:
    with pytest.raises(ToonsetError) as caught:
        fetch(place, tmp_path)
    assert str(caught.value).startswith(f"{place}: ")
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    "text",
    [
        b"mtllib the body.mtl # colours\n",
        b"\xef\xbb\xbfmtllib the body.mtl\r",
        "mtllib the body.mtl\n".encode("utf-16"),
        b"v 0 0 0\nmtllib \\\nthe body.mtl\n",
    ],
)
def test_a_mesh_is_what_it_is_read_with(
    text: bytes, tmp_path: Path, memory: fsspec.AbstractFileSystem
) -> None:
    files = {"m.obj": text, "the body.mtl": b"newmtl a\n\tmap_Kd -s 1 1 1 a/t.png\nmap_Kd \x1f\n"}
    files["a/t.png"] = b"1"
    for name, data in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(data)
        memory.pipe_file(f"/in/{name}", data)
    fetch("memory://in/m.obj", tmp_path / "back")
    back = {p.relative_to(tmp_path / "back").as_posix() for p in (tmp_path / "back").rglob("*.*")}
    assert back == {*files}
    places = (str(tmp_path / "m.obj"), "memory://in/m.obj")
    before = [(looks(place), content_hash(place)) for place in places]
    assert before == [(looks(place), content_hash(place)) for place in places]
    (tmp_path / "a" / "t.png").write_bytes(b"2")
    memory.pipe_file("/in/a/t.png", b"2")
    after = [(looks(place), content_hash(place)) for place in places]
    assert all(
        a != b
        for old, new in zip(before, after, strict=True)
        for a, b in zip(old, new, strict=True)
    )


def test_a_stage_whose_input_cannot_be_reached_is_the_one_that_fails(
    tmp_path: Path, memory: fsspec.AbstractFileSystem, stands_in: None
) -> None:
    memory.pipe_file("/in/a.txt", b"ok")
    words = {"palette": ("--keep=memory://none",), "export": ("--format", "nerf")}
    keys = {"calibrate": "k1", "palette": "k2", "export": "k3"}
    one = Job("a", ("memory://in/a.txt",), words, keys, str(tmp_path / "a"))
    done = run_one(one)
    assert [row.state for row in done.rows] == ["done", "failed", "done"]
    assert "memory://none: cannot be reached" in done.rows[1].error
    shutil.rmtree(tmp_path / "a" / "bundle")  # what is made of it is made again, as it was
    made = (tmp_path / "a" / "export" / "made.json").read_bytes()
    run_one(one)
    assert (tmp_path / "a" / "export" / "made.json").read_bytes() == made
    assert b"nerf" in made
    assert not (tmp_path / "a" / ".scratch").exists()


def test_a_sheet_and_its_results_behind_urls(
    tmp_path: Path, memory: fsspec.AbstractFileSystem, stands_in: None
) -> None:
    memory.pipe_file("/in/a.txt", b"ok")
    keys = {"calibrate": "k1", "palette": "k2"}
    one = Job("a", ("memory://in/a.txt",), {}, keys, str(tmp_path / "a"), "memory://out")
    first = run_one(one)
    assert first.kind == "done", first
    assert json.loads(memory.cat_file("/out/a/calibrate.json"))["key"] == "k1"
    assert memory.exists("/out/a/bundle/palette.json")
    memory.rm_file("/in/a.txt")
    assert run_one(one).rows == first.rows  # as its stamps say
    assert (tmp_path / "runs").read_text().splitlines() == ["a calibrate", "a palette"]
    assert not list((tmp_path / "a").rglob("*.json"))


def test_a_sheet_may_be_called_as_a_folder_of_ours(
    tmp_path: Path, memory: fsspec.AbstractFileSystem, stands_in: None
) -> None:
    memory.pipe_file("/in/a.txt", b"ok")
    for name in ("inputs", "results"):
        home, keys = str(tmp_path / name), {"calibrate": "k1"}
        assert run_one(Job(name, ("memory://in/a.txt",), {}, keys, home, "memory://out")).rows
        found = sorted(memory.find(f"/out/{name}"))
        assert [place.removeprefix(f"/out/{name}/") for place in found] == [
            "bundle/transforms.json",
            "calibrate.json",
        ]
