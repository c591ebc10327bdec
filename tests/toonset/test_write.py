"""Atomic writing: the old content or all of the new, never something between."""

import errno
import os

import pytest

from toonset import write
from toonset.errors import OutputError
from toonset.write import check_new_folder, exchange_folders, new_folder, write_bytes, write_json


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
    from pathlib import Path

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
