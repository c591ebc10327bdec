"""Atomic writing: the old content or all of the new, never something between."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from toonset import write
from toonset.errors import OutputError
from toonset.lock import claim, command, hold, settle
from toonset.read import read_whole
from toonset.write import (
    check_new_folder,
    exchange_folders,
    new_files,
    new_folder,
    write_bytes,
    write_json,
)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_write_replaces_and_leaves_nothing_else(tmp_path):
    file = tmp_path / "deep" / "a.json"
    write_json(file, {"a": 1})
    write_json(file, {"a": 2})
    assert file.read_text() == '{\n  "a": 2\n}\n'
    assert names(file.parent) == ["a.json"]


def test_full_disk_keeps_the_old_file(tmp_path, monkeypatch):
    file = tmp_path / "a.bin"
    write_bytes(file, b"old")

    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match=r"a\.bin: cannot be written \(No space left on device\)"):
        write_bytes(file, b"new")
    assert file.read_bytes() == b"old"
    assert names(tmp_path) == ["a.bin"]


def test_a_full_device_is_one_clear_error():
    with pytest.raises(OutputError, match="cannot be written"):
        write_bytes(Path("/dev/full/x"), b"data")


def test_a_folder_appears_whole_or_not_at_all(tmp_path):
    target = tmp_path / "out"

    def fail_half_way():
        with new_folder(target) as temporary:
            (temporary / "a").write_text("1")
            raise RuntimeError("half way")

    with pytest.raises(RuntimeError, match="half way"):
        fail_half_way()
    assert names(tmp_path) == []
    with new_folder(target) as temporary:
        (temporary / "a").write_text("1")
        assert not target.exists()
    assert names(target) == ["a"]
    assert names(tmp_path) == ["out"]


def test_an_existing_folder_needs_force_and_is_replaced_whole(tmp_path):
    target = tmp_path / "out"
    target.mkdir()  # one with nothing in it is no result
    with new_folder(target) as temporary:
        (temporary / "old").write_text("1")
    with pytest.raises(OutputError, match="exists already; pass --force"), new_folder(target):
        pass
    with new_folder(target, force=True) as temporary:
        (temporary / "new").write_text("2")
    assert names(target) == ["new"]
    assert names(tmp_path) == ["out"]


def test_a_file_in_the_way_is_refused(tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(OutputError, match="is a file, a folder is needed"):
        check_new_folder(tmp_path / "out", force=True)
    with pytest.raises(OutputError, match="is a file, not a folder"):
        check_new_folder(tmp_path / "out" / "deeper")


def test_two_folders_change_places(tmp_path, monkeypatch):
    one, other = tmp_path / "one", tmp_path / "other"
    for folder in (one, other):
        folder.mkdir()
        (folder / folder.name).write_text("")
    exchange_folders(one, other)
    assert (one / "other").is_file()
    monkeypatch.setattr(write, "_exchanged", lambda new, path: False)  # as where no system call is
    exchange_folders(one, other)
    assert (one / "one").is_file()
    assert (other / "other").is_file()
    assert sorted(place.name for place in tmp_path.iterdir()) == ["one", "other"]
    with pytest.raises(OutputError):
        exchange_folders(tmp_path / "nothing", one)
    assert (one / "one").is_file()


@pytest.fixture
def holder(tmp_path):
    """Hold tmp_path/out in another process, half of a new folder written, until it is killed."""
    code = (
        "import sys, time; from pathlib import Path; from toonset.write import new_folder\n"
        "with new_folder(Path(sys.argv[1]), force=True) as folder:\n"
        "    (folder / 'half').write_text('')\n    print('held', flush=True)\n    time.sleep(600)\n"
    )
    arguments = [sys.executable, "-P", "-c", code, str(tmp_path / "out")]
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_place_is_written_by_one_process_at_a_time(tmp_path, holder):
    with (
        pytest.raises(OutputError, match="in use by another toonset"),
        new_folder(tmp_path / "out"),
    ):
        pass
    with command(), pytest.raises(OutputError, match="in use by another toonset"):
        check_new_folder(tmp_path / "out")
    with new_folder(tmp_path / "other") as folder:
        (folder / "a").write_text("")
    holder.kill()
    holder.wait()
    assert len(names(tmp_path)) == 3  # its half of a folder and its lock lie there still
    with new_folder(tmp_path / "out") as folder:
        (folder / "a").write_text("")
    assert names(tmp_path) == ["other", "out"]


def test_a_claim_lasts_as_long_as_the_command_and_may_be_repeated(tmp_path):
    claim(tmp_path / "out")
    assert names(tmp_path) == []
    with command():
        check_new_folder(tmp_path / "out")
        with new_folder(tmp_path / "out") as folder:
            (folder / "a").write_text("")
        assert names(tmp_path) == [".out.lock", "out"]
    assert names(tmp_path) == ["out"]


def test_a_folder_within_a_new_one_leaves_no_lock_there(tmp_path):
    with command(), new_folder(tmp_path / "out") as outer:
        with new_folder(outer / "a") as inner:
            (inner / "file").write_text("")
        assert names(outer) == ["a"]
    assert names(tmp_path / "out") == ["a"]


def test_a_new_place_deeper_down_leaves_no_lock_above(tmp_path):
    with command():
        check_new_folder(tmp_path / "a" / "b" / "out")
        assert names(tmp_path) == [".a~b~out.lock"]
        with new_folder(tmp_path / "a" / "b" / "out") as folder:
            (folder / "a").write_text("")
    assert names(tmp_path) == ["a"]
    assert names(tmp_path / "a" / "b") == ["out"]


def test_the_root_of_all_folders_is_refused_as_any_other():
    with pytest.raises(OutputError, match="exists already"):
        check_new_folder(Path("/"))


def test_a_folder_that_another_made_meanwhile_stays(tmp_path):
    def write_late():
        with new_folder(tmp_path / "out") as folder:
            (folder / "a").write_text("mine")
            (tmp_path / "out").mkdir()
            (tmp_path / "out" / "a").write_text("theirs")

    with pytest.raises(OutputError, match="another program has made it meanwhile"):
        write_late()
    assert (tmp_path / "out" / "a").read_text() == "theirs"
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize("failing", [1, 2])
def test_where_folders_cannot_be_exchanged_a_failed_rename_keeps_the_old_one(
    tmp_path, monkeypatch, failing
):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old").write_text("")
    real, calls = os.replace, []

    def replace(*places):
        calls.append(places)
        if len(calls) == failing:
            raise OSError(errno.EIO, "Input/output error")
        real(*places)

    def write_new():
        with new_folder(tmp_path / "out", force=True) as folder:
            (folder / "new").mkdir()
            monkeypatch.setattr(write, "_exchanged", lambda new, path: False)
            monkeypatch.setattr(os, "replace", replace)

    with pytest.raises(OutputError, match="Input/output error"):
        write_new()
    assert names(tmp_path / "out") == ["old"]
    assert len(names(tmp_path)) <= 1 + (failing == 1)  # an empty hidden folder, swept next time
    monkeypatch.undo()
    with hold(tmp_path / "out"):
        pass
    assert names(tmp_path) == ["out"]


def test_an_output_that_was_put_aside_comes_back_and_others_are_left_alone(tmp_path):
    (tmp_path / ".out.abcd1234.old").mkdir()
    (tmp_path / ".out.abcd1234.old" / "a").write_text("old")
    for name in (".out.more.abcd1234.tmp", ".out.tmp", ".other.abcd1234.tmp", "out.abcd1234.tmp"):
        (tmp_path / name).mkdir()
    (tmp_path / ".out.abcd5678.tmp").write_text("half")
    before = names(tmp_path)
    with hold(tmp_path / "out"):
        assert (tmp_path / "out" / "a").read_text() == "old"
    gone = {".out.abcd1234.old", ".out.abcd5678.tmp"}
    assert names(tmp_path) == sorted({*before, "out"} - gone)


def test_a_place_without_locks_is_written_all_the_same(tmp_path, monkeypatch):
    monkeypatch.setattr("toonset.lock.fcntl", None)
    with new_folder(tmp_path / "out") as folder:
        (folder / "a").write_text("")
    assert names(tmp_path) == ["out"]


def test_files_come_together_and_those_of_before_go(tmp_path):
    (tmp_path / "labels").mkdir()
    (tmp_path / "labels" / "old.png").write_text("")
    for name in ("palette.json", "other.json"):
        (tmp_path / name).write_text("old")
    (tmp_path / "tones").mkdir()
    with new_files(tmp_path / "palette.json", ["tones", "coverage"], force=True) as folder:
        write_bytes(folder / "labels" / "new.png", b"")
        write_bytes(folder / "palette.json", b"new")
    assert names(tmp_path) == ["labels", "other.json", "palette.json"]
    assert names(tmp_path / "labels") == ["new.png"]
    assert (tmp_path / "palette.json").read_text() == "new"


def test_without_force_files_come_only_where_all_names_are_free(tmp_path):
    (tmp_path / "a.mtl").write_text("theirs")

    def write_both():
        with new_files(tmp_path / "a.obj", force=False) as folder:
            write_bytes(folder / "a.obj", b"mine")
            write_bytes(folder / "a.mtl", b"mine")

    with pytest.raises(OutputError, match=r"a\.mtl: another program has made it meanwhile"):
        write_both()
    assert names(tmp_path) == ["a.mtl"]
    assert (tmp_path / "a.mtl").read_text() == "theirs"


@pytest.fixture
def decided(tmp_path, monkeypatch):
    """Return the folder of files that a process was killed over before it moved any of them."""
    monkeypatch.setattr("toonset.lock.move_into_place", lambda folder: None)
    (tmp_path / "tones").mkdir()
    with new_files(tmp_path / "palette.json", ["tones"], force=True) as folder:
        write_bytes(folder / "palette.json", b"{}")
    monkeypatch.undo()
    return tmp_path / ".palette.new"


def test_who_reads_a_place_finishes_what_was_decided_there(decided):
    assert read_whole(decided.parent / "palette.json", "palette", OutputError) == b"{}"
    assert names(decided.parent) == ["palette.json"]


@pytest.mark.parametrize(
    "name", ["transforms.json", "images", "..", "palette.link", ".gone", ".before"]
)
def test_a_folder_from_elsewhere_moves_nothing_else(decided, name):
    if name == "..":  # what is to go: a place above
        (decided / ".gone").write_text("../" * 3)
    elif name == ".gone":
        (decided / ".gone").write_text("transforms.json")
    elif name in ("palette.link", ".before"):
        (decided / name).symlink_to("/")
    else:
        (decided / name).write_text("foreign")
    with pytest.raises(OutputError, match="which no toonset wrote; remove it"):
        settle(decided.parent / "palette.json")
    assert names(decided.parent) == [".palette.new", "tones"]


def test_what_cannot_be_finished_is_told(decided, monkeypatch):
    def fail(*_):
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OutputError, match="cannot be put in place"):
        settle(decided.parent / "palette.json")
