"""Outputs are held by one process at a time, and nothing of others is cleared away or moved."""

import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import PIPE

import pytest

from toonset import lock
from toonset.errors import OutputError
from toonset.lock import command, hold, set_of, settle
from toonset.write import (
    check_new_file,
    check_new_folder,
    check_output,
    new_files,
    new_folder,
    write_bytes,
)

HOLD = "import sys; from pathlib import Path; from toonset.lock import hold\n"
HOLD += "with hold(Path(sys.argv[1])):\n    print('held', flush=True)\n    sys.stdin.read()\n"


@contextmanager
def held_by_another(path: Path) -> Iterator[None]:
    """Hold an output in another process."""
    line = [sys.executable, "-P", "-c", HOLD, str(path)]
    with subprocess.Popen(line, stdin=PIPE, stdout=PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield
        process.communicate("")


def test_folders_that_come_between_do_not_hide_a_lock(tmp_path: Path) -> None:
    out = tmp_path / "new" / "out"
    with command():
        check_new_folder(out)  # held from above: new/ is not there
        with new_folder(out):
            line = [sys.executable, "-P", "-c", HOLD, str(out)]
            done = subprocess.run(line, input="", capture_output=True, text=True, check=False)
    assert "is in use by another toonset" in done.stderr
    assert out.is_dir()


def test_who_claimed_a_place_is_refused_if_another_was_faster_below(tmp_path: Path) -> None:
    out = tmp_path / "new" / "out"
    with command():
        check_new_folder(out)
        (tmp_path / "new").mkdir()
        with (
            held_by_another(out),
            pytest.raises(OutputError, match="is in use by another toonset"),
            new_folder(out),
        ):
            pass


def test_who_is_refused_reads_the_name_that_was_given(tmp_path: Path) -> None:
    with (
        held_by_another(tmp_path / "hero"),
        command(),
        pytest.raises(OutputError, match=r"hero\.v2\.obj: is in use by another toonset"),
    ):
        check_new_file(tmp_path / "hero.v2.obj")


def test_a_folder_that_another_took_away_does_not_come_as_half_of_it(tmp_path: Path) -> None:
    def write_both() -> None:
        with new_folder(tmp_path / "out") as folder:
            write_bytes(folder / "a", b"")
            shutil.rmtree(folder)
            write_bytes(folder / "b", b"")

    with pytest.raises(OutputError, match="another program has removed it meanwhile"):
        write_both()
    assert list(tmp_path.iterdir()) == []


def test_without_locks_what_another_may_be_writing_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lock, "fcntl", None)
    (tmp_path / ".out.abcd1234.tmp").mkdir()
    with hold(tmp_path / "out"):
        pass
    assert (tmp_path / ".out.abcd1234.tmp").is_dir()


def test_a_lock_that_is_another_ones_by_now_stays(tmp_path: Path) -> None:
    with hold(tmp_path / "out"):
        (tmp_path / ".out.lock").unlink()
        (tmp_path / ".out.lock").write_text("")  # as after an exchange of folders
    assert (tmp_path / ".out.lock").exists()


@pytest.mark.parametrize(
    ("planted", "theirs"),
    [
        (".sheet.new/labels/x", "labels/thesis.txt"),
        (".sheet.new/sheet/x", "sheet/thesis.txt"),
        (".sheet.new/.gone", "sheet/thesis.txt"),
        (".sheet.new/sheet.png", "sheet.png/thesis.txt"),
        (".palette.new/palette/x", "palette/thesis.txt"),
    ],
)
def test_a_planted_folder_takes_no_folder_away(planted: str, theirs: str, tmp_path: Path) -> None:
    for name in (planted, theirs):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("sheet")
    with pytest.raises(OutputError, match="which no toonset wrote; remove it"):
        settle(tmp_path / f"{planted[1:].split('.')[0]}.png")
    assert (tmp_path / theirs).read_text() == "sheet"


@pytest.mark.parametrize("kind", ["link", "large", "folder"])
def test_a_planted_list_of_names_is_not_read(kind: str, tmp_path: Path) -> None:
    gone = tmp_path / ".sheet.new" / ".gone"
    gone.parent.mkdir()
    if kind == "link":
        gone.symlink_to("/dev/zero")
    elif kind == "large":
        gone.write_text("x\n" * 10**5)
    else:
        gone.mkdir()
    with pytest.raises(OutputError, match=r"\.gone: was written by no toonset; remove its folder"):
        settle(tmp_path / "sheet.png")


def test_a_signal_waits_until_files_have_moved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = lock.move_into_place

    def hit(folder: Path) -> None:
        signal.raise_signal(signal.SIGTERM)
        real(folder)

    def end(number: int, _: object) -> None:
        raise SystemExit(128 + number)

    monkeypatch.setattr(lock, "move_into_place", hit)
    before = signal.signal(signal.SIGTERM, end)
    try:
        with (
            pytest.raises(SystemExit, match="143"),
            new_files(tmp_path / "a.obj", force=True) as new,
        ):
            write_bytes(new / "a.obj", b"")
        assert signal.getsignal(signal.SIGTERM) is end
    finally:
        signal.signal(signal.SIGTERM, before)
    assert [path.name for path in tmp_path.iterdir()] == ["a.obj"]


def test_what_killed_ones_left_inside_is_not_in_the_way(tmp_path: Path) -> None:
    out = tmp_path / "out"
    for name in ("a", ".palette.new/palette.json", ".palette.lock", ".run.lock"):
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_text("")
    with pytest.raises(OutputError, match=r"holds 'palette\.json', which this command"):
        check_output(out, [], ["a"], force=True)
    check_output(out, [], ["a", "palette.*"], force=True)
    assert sorted(path.name for path in out.iterdir()) == ["a", "palette.json"]


def test_a_folder_that_is_written_into_is_not_replaced(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    with (
        held_by_another(out / "run"),
        pytest.raises(OutputError, match=r"run: is in use by another toonset"),
    ):
        check_output(out, [], ["run"], force=True)
    check_output(out, [], ["run"], force=True)


def test_a_link_and_the_current_folder_are_refused_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with pytest.raises(OutputError, match="link: is a link, a folder is needed"):
        check_new_folder(tmp_path / "link")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "link").unlink()
    with pytest.raises(OutputError, match="holds the current folder"):
        check_output(Path(), [], ["a"], force=True)


@pytest.mark.parametrize(
    ("name", "held"),
    [
        *(("a.obj", "a"), ("a.b.obj", "a"), (".a.obj", ".a"), ("a .b.obj", "a_"), ("..obj", "_")),
        *(("...", "_"), ("a b.glb", "a_b"), ("a_b.mtl", "a_b")),
    ],
)
def test_files_that_go_together_have_one_name(name: str, held: str, tmp_path: Path) -> None:
    assert set_of(tmp_path / name) == tmp_path / held
