"""Streams that are closed or full, names that are no text, signals: no traceback, nothing left."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

SPLIT = f"{sys.executable} -m toonset split sheet.png -o out"
ESCAPE = "\x1b"


def in_shell(command, folder, **environment):
    return subprocess.run(
        ["sh", "-c", command],
        cwd=folder,
        env=os.environ | {"PYTHONUNBUFFERED": ""} | environment,  # "": what is printed is kept
        capture_output=True,
        text=True,
        errors="surrogateescape",
        timeout=120,
    )


def heard(number):
    """Return what lets a new process hear a signal that `nohup` or a background job ignores."""
    return partial(signal.signal, number, signal.SIG_DFL)


@pytest.fixture
def folder(drawn, tmp_path):
    (tmp_path / "sheet.png").write_bytes((drawn / "single.png").read_bytes())
    return tmp_path


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
@pytest.mark.parametrize(
    ("command", "code", "err"),
    [
        (
            f"{SPLIT} > /dev/full",
            2,
            "toonset: standard output: No space left on device; free or choose another place\n",
        ),
        (f"{SPLIT} 2> /dev/full", 0, ""),
        (f"{SPLIT} >&- -q", 0, ""),
        (f"{SPLIT} 2>&-", 0, ""),
        (f"{SPLIT} -q 2>&1 | true", 0, ""),
        (
            f"ulimit -v 400000; {SPLIT}",
            2,
            "toonset: 409 MB of address space are too few; raise the limit: ulimit -v\n",
        ),
        (
            f"ulimit -v 1500000; {sys.executable} -m toonset train bundle",
            2,
            "failed to map segment from shared object); raise the limit: ulimit -v\n",
        ),
        (
            f"mkdir gone && cd gone && rmdir ../gone && {SPLIT}",
            2,
            "toonset: the current folder has been deleted; change to another one\n",
        ),
    ],
)
def test_streams_and_folders_that_are_not_there(folder, command, code, err):
    done = in_shell(command, folder)
    assert done.returncode == code, done
    assert err == "" or done.stderr.endswith(err)
    assert "Traceback" not in done.stderr


def test_a_name_that_the_output_cannot_show(folder):
    done = in_shell(f"{SPLIT}-$(printf '\\377é')", folder, PYTHONIOENCODING="ascii:strict")
    assert (done.returncode, done.stdout) == (0, "out-?\\xe9\n")
    assert [path for path in os.listdir(os.fsencode(folder)) if path.startswith(b"out-\xff")]


@pytest.mark.parametrize("name", [b"n\xff.png", b"a\x1b[31mb.png"])
@pytest.mark.parametrize("verb", ["split", "palette", "calibrate"])
def test_any_file_name_is_read_and_none_reaches_the_terminal_raw(
    verb, name, drawn, toonset, tmp_path
):
    sheet, out = tmp_path / os.fsdecode(name), tmp_path / os.fsdecode(b"to " + name)
    sheet.write_bytes((drawn / "sheet.png").read_bytes())
    more = ["--mesh", drawn / "mannequin.obj"] if verb == "calibrate" else []
    found = [toonset(verb, sheet, *more, "-o", out), toonset("info", out)]
    if verb != "palette":
        found.append(toonset("check", out))
    for done in found:
        assert done.code in (0, 2, 3), done
        assert "Traceback" not in done.err
        assert all(line.isprintable() for line in (done.out + done.err).splitlines()), done


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_a_verb_with_its_code_and_leaves_nothing(number, folder, run):
    command = ["render", str(run), "--turntable", "500", "-o", "turn"]
    program = [sys.executable, "-m", "toonset", *command]
    pipes = {"stderr": subprocess.PIPE, "text": True, "preexec_fn": heard(number)}
    with subprocess.Popen(program, cwd=folder, **pipes) as process:
        assert process.stderr is not None
        assert process.stderr.readline()  # it has begun to draw
        process.send_signal(number)
        err = process.stderr.read()
    assert process.returncode == 128 + number
    assert err.endswith(f"toonset: ended by {number.name}\n")
    assert sorted(path.name for path in folder.iterdir()) == ["run", "sheet.png"]


def run_verb(verb, number, folder):
    """Run a verb that a signal ends as a program; return what it printed."""
    script = (
        f"import typer\nfrom toonset.cli.main import run\n{verb}"
        "program = typer.Typer()\nprogram.command()(verb)\nrun(program, 'toonset')"
    )
    pipes = {"capture_output": True, "text": True, "preexec_fn": heard(number)}
    done = subprocess.run([sys.executable, "-c", script], cwd=folder, **pipes)
    said = {signal.SIGTERM: "ended by SIGTERM", signal.SIGINT: "interrupted"}
    assert (done.returncode, done.stderr) == (128 + number, f"toonset: {said[number]}\n")
    return done.stdout


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_that_trimesh_would_swallow_is_heard_after_it(number, folder):
    swallow = (
        f"import signal\ntry: signal.raise_signal({int(number)})\nexcept BaseException: pass\n"
    )
    (folder / "trimesh.py").write_text(swallow)
    verb = "def verb():\n import time, trimesh\n print('loaded', flush=True)\n time.sleep(10)\n"
    assert run_verb(verb, number, folder) == "loaded\n"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_while_a_class_is_made_ends_a_verb_with_its_code(number, folder):
    ends = f"def end(*_): import signal; signal.raise_signal({int(number)})\n"
    verb = "def verb(): type('Holder', (), {'sign': type('Sign', (), {'__set_name__': end})()})\n"
    assert run_verb(ends + verb, number, folder) == ""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_that_an_import_wraps_ends_a_verb_with_its_code(number, folder):
    wraps = (  # as pybind11 does, and pycolmap what pybind11 raises
        f"import signal\ntry:\n try: signal.raise_signal({int(number)})\n"
        " except BaseException as error: raise ImportError('cannot load') from error\n"
        "except ImportError as error: raise RuntimeError('cannot load') from error\n"
    )
    (folder / "wrapping.py").write_text(wraps)
    assert run_verb("def verb(): import wrapping\n", number, folder) == ""


def test_a_key_pressed_while_modules_load_ends_without_a_word(folder):
    (folder / "typer.py").write_text("import signal; signal.raise_signal(signal.SIGINT)")
    program = [sys.executable, "-c", "from toonset.__main__ import main; main()"]
    pipes = {"capture_output": True, "text": True, "preexec_fn": heard(signal.SIGINT)}
    done = subprocess.run(program, cwd=folder, **pipes)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")


def test_a_signal_in_a_finalizer_is_not_lost() -> None:
    script = (
        "import os, signal, time\n"
        "from toonset.cli.main import _end_by_signals\n"
        "_end_by_signals()\n"
        "class Final:\n"
        "    def __del__(self):\n"
        "        os.kill(os.getpid(), signal.SIGTERM)\n"
        "        time.sleep(0.01)\n"
        "Final()\n"
        "time.sleep(10)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, timeout=60)
    assert done.returncode == 143
    assert done.stderr == b""
