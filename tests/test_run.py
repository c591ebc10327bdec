"""./run as a user types it, with a stand-in for the environment that it would set up."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("run", "bootstrap.lock", "requirements.lock", "pyproject.toml", "toonset/__init__.py")

HOLD_THE_LOCK = """
import fcntl, sys
with open(sys.argv[1], "w") as lock:
    fcntl.flock(lock, fcntl.LOCK_EX)
    print("held", flush=True)
    sys.stdin.readline()
"""

pytestmark = pytest.mark.skipif(os.name == "nt", reason="a POSIX shell is needed")


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout whose path has a space, with a ready environment in which toonset only logs."""
    root = tmp_path / "a b"
    for name in COPIED:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, root / name)
    python_that(root)
    stand_in(root, "exit 0")
    stamp = (root / name for name in COPIED[1:])
    data = b"".join(path.read_bytes() for path in stamp) + os.fsencode(root.resolve())
    checksum = subprocess.run(["cksum"], input=data, capture_output=True, check=True).stdout
    (root / ".venv/stamp").write_bytes(checksum)
    return root


def program(path: Path, body: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
    path.chmod(0o755)


def python_that(root: Path, behaviour: str = "") -> None:
    """Make the environment's Python a real one, after shell lines that may leave earlier."""
    real = shlex.quote(sys.executable)
    program(root / ".venv/bin/python", f'{behaviour}\nexec {real} "$@"')


def stand_in(root: Path, body: str) -> None:
    log = shlex.quote(str(root / "log"))
    program(root / ".venv/bin/toonset", f'{{ pwd -P; printf "[%s]" "$@"; echo; }} >>{log}\n{body}')


def run(
    root: Path, *words: str, cwd: Path | None = None, **variables: str
) -> subprocess.CompletedProcess[str]:
    environment = {"PATH": os.environ["PATH"], "LC_ALL": "C"} | variables  # and no HOME
    return subprocess.run(
        [str(root / "run"), *words],
        cwd=cwd or root,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def log_of(root: Path) -> list[str]:
    return (root / "log").read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("code", [0, 1, 2, 3, 130])
def test_a_verb_keeps_words_folder_and_exit_code(checkout: Path, tmp_path: Path, code: int) -> None:
    stand_in(checkout, f"echo out; echo err >&2; exit {code}")
    done = run(checkout, "calibrate", "my sheet.png", "--mesh", "*.obj", "", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (code, "out\n", "err\n")
    assert log_of(checkout) == [
        str(tmp_path.resolve()),
        "[calibrate][my sheet.png][--mesh][*.obj][]",
    ]


def test_it_works_through_a_link(checkout: Path, tmp_path: Path) -> None:
    link = tmp_path / "tool"
    link.symlink_to(checkout / "run")
    done = subprocess.run([str(link), "palette", "x"], cwd=tmp_path, check=False)
    assert done.returncode == 0
    assert log_of(checkout)[-1] == "[palette][x]"


def test_help_shows_its_own_commands_and_those_of_toonset(checkout: Path) -> None:
    done = run(checkout, "--help")
    assert done.returncode == 0
    assert "./run demo" in done.stdout
    assert "./run test [--all]" in done.stdout
    assert log_of(checkout)[-1] == "[--help]"


def test_demo_goes_on_after_an_uncertain_view(checkout: Path) -> None:
    stand_in(checkout, "case $1 in calibrate) exit 3 ;; esac")
    (checkout / "demo").mkdir()
    (checkout / "demo/old").touch()
    done = run(checkout, "demo", cwd=checkout.parent)
    assert done.returncode == 0, done.stderr
    assert [line.split("]")[0] for line in log_of(checkout)[1::2]] == [
        "[calibrate",
        "[palette",
        "[train",
        "[view",
        "[render",
    ]
    assert "$ ./run calibrate examples/sheet.png" in done.stdout
    assert "weak or ambiguous" in done.stderr
    assert not (checkout / "demo/old").exists()


@pytest.mark.parametrize(("verb", "code"), [("calibrate", 2), ("train", 1)])
def test_demo_stops_at_a_failure(checkout: Path, verb: str, code: int) -> None:
    stand_in(checkout, f"case $1 in {verb}) exit {code} ;; esac")
    done = run(checkout, "demo")
    assert done.returncode == code
    assert log_of(checkout)[-1].startswith(f"[{verb}]")
    assert "Look at" not in done.stdout


def test_an_unsuitable_python_is_refused_by_name(checkout: Path, tmp_path: Path) -> None:
    old = tmp_path / "python2"
    program(old, "exit 1")
    done = run(checkout, "calibrate", PYTHON=str(old))
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        f"run: PYTHON={old} does not run Python 3.11 to 3.13; choose another"
    ]
    assert not (checkout / "log").exists()


@pytest.mark.parametrize("system", ["MINGW64_NT-10.0-26100", "MSYS_NT-10.0", "CYGWIN_NT-10.0"])
def test_shells_on_windows_are_told_in_one_line(checkout: Path, tmp_path: Path, system: str):
    program(tmp_path / "tools" / "uname", f"echo {system}")
    path = f"{tmp_path / 'tools'}{os.pathsep}{os.environ['PATH']}"
    done = run(checkout, "calibrate", "x", PATH=path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"run: does not work in {system}; use Linux, or WSL on Windows\n"
    assert not (checkout / "log").exists()


def test_the_wheel_is_built_installed_and_tried_outside_of_the_tree(checkout: Path) -> None:
    make = 'case "$*" in *wheel.py*) mkdir -p "$3/env/bin" && cp "$0/../toonset" "$3/env/bin"'
    python_that(checkout, make.replace("$0/..", str(checkout / ".venv/bin")) + "; exit ;; esac")
    done = run(checkout, "wheel")
    assert done.returncode == 0, done.stderr
    places = set(log_of(checkout)[::2])
    assert len(places) == 1
    assert not Path(places.pop()).exists()  # a temporary one
    assert [line.split("]")[0] for line in log_of(checkout)[1::2]] == [
        *("[calibrate", "[palette", "[train", "[view", "[render")
    ]
    python_that(checkout, 'case "$*" in *wheel.py*) exit 4 ;; esac')
    assert run(checkout, "wheel").returncode == 4


def test_a_changed_lock_is_installed_and_a_failure_is_shown(checkout: Path) -> None:
    with (checkout / "requirements.lock").open("a", encoding="utf-8") as lock:
        lock.write("# changed\n")
    python_that(checkout, 'case " $* " in *" pip install "*) echo "no space"; exit 1 ;; esac')
    done = run(checkout, "calibrate", "x")
    assert done.returncode == 2
    assert "no space" in done.stderr
    assert "install.log" in done.stderr
    assert not (checkout / ".venv/stamp").exists()
    assert not (checkout / "log").exists()


def test_setting_up_tells_how_far_it_is(checkout: Path, tmp_path: Path) -> None:
    with (checkout / "requirements.lock").open("a", encoding="utf-8") as lock:
        lock.write("# changed\n")
    sleep = shlex.quote(shutil.which("sleep") or "")
    install = f"echo 'Downloading torch'; {sleep} 1; exit 0"
    python_that(checkout, f'case " $* " in *" pip install "*) {install} ;; esac')
    program(tmp_path / "tools" / "sleep", f"exec {sleep} 0.2")
    path = f"{tmp_path / 'tools'}{os.pathsep}{os.environ['PATH']}"
    done = run(checkout, "calibrate", "x", PATH=path)
    assert done.returncode == 0
    first, *told = done.stderr.splitlines()
    assert "setting up .venv" in first
    assert [line for line in told if re.fullmatch(r"run: \d+ s, \d+ MB  Downloading torch", line)]
    assert log_of(checkout)[-1] == "[calibrate][x]"


def test_a_python_without_ensurepip_gets_the_install_line(checkout: Path, tmp_path: Path) -> None:
    shutil.rmtree(checkout / ".venv")
    bare = tmp_path / "python3"
    program(
        bare, f'case "$*" in *ensurepip*) exit 1 ;; esac\nexec {shlex.quote(sys.executable)} "$@"'
    )
    done = run(checkout, "calibrate", PYTHON=str(bare))
    assert done.returncode == 2
    assert "apt-get install python3-venv" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_second_call_waits_for_the_one_that_sets_up(checkout: Path) -> None:
    stamp = (checkout / ".venv/stamp").rename(checkout / "stamp.kept")
    (checkout / ".venv/lock").touch()
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD_THE_LOCK, str(checkout / ".venv/lock")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert holder.stdout is not None
    assert holder.stdout.readline() == b"held\n"
    second = subprocess.Popen(
        [str(checkout / "run"), "palette"], cwd=checkout, stderr=subprocess.PIPE
    )
    assert second.stderr is not None
    assert b"waiting for another" in second.stderr.readline()
    stamp.rename(checkout / ".venv/stamp")  # the first call is done: nothing is left to install
    holder.communicate(b"\n", timeout=60)
    _, errors = second.communicate(timeout=60)
    assert (second.returncode, errors) == (0, b"")
    assert log_of(checkout)[-1] == "[palette]"


EVERY_CORE = "[-n][auto][--dist][loadfile][--no-loadscope-reorder]"


@pytest.mark.parametrize(
    ("words", "asked"),
    [
        (["test"], "[-P][-m][pytest][-m][not slow]" + EVERY_CORE),
        (["test", "--all"], "[-P][-m][pytest][-m][]" + EVERY_CORE),
        (["test", "-k", "a b", "--all", "-x"], f"[-P][-m][pytest][-m][]{EVERY_CORE}[-k][a b][-x]"),
    ],
)
def test_all_adds_the_slow_tests(checkout: Path, words: list[str], asked: str) -> None:
    python_that(checkout, 'case "$*" in -) exit 0 ;; *pytest*) printf "[%s]" "$@"; exit 5 ;; esac')
    done = run(checkout, *words, cwd=checkout.parent)
    assert (done.returncode, done.stdout) == (5, asked)


def test_lint_runs_every_tool_and_fails_if_one_does(checkout: Path) -> None:
    tsc = checkout / ".venv/tsc/node_modules/typescript/bin/tsc"
    tsc.parent.mkdir(parents=True)
    tsc.touch()
    python_that(checkout, 'case "$*" in *mypy) exit 1 ;; "-P -m "*) exit 0 ;; esac')
    done = run(checkout, "lint")
    assert done.returncode == 1
    assert done.stdout == "$ ruff check\n$ ruff format --check\n$ mypy\n$ pyright\n$ tsc\n"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="apt-get is Debian's")
@pytest.mark.parametrize(
    ("user", "code", "line"),
    [
        (0, 0, "run: installing system libraries"),
        (0, 1, "run: could not install them"),
        (1000, 0, "sudo apt-get install libegl1 libgl1 libgl1-mesa-dri"),
    ],
)
def test_drawing_libraries_are_installed_or_named(checkout, tmp_path, user, code, line):
    python_that(checkout, '[ "$*" != - ] || exit 1')
    tools = tmp_path / "tools"
    program(tools / "apt-get", f'echo "$*" >>{shlex.quote(str(tmp_path / "apt"))}; exit {code}')
    program(tools / "id", f"echo {user}")
    path = f"{tools}{os.pathsep}{os.environ['PATH']}"
    assert run(checkout, "calibrate", "x", PATH=path).stderr == ""  # needs no such library
    done = run(checkout, "synth", "m.obj", PATH=path)
    assert done.returncode == 0
    assert line in done.stderr
    assert (tmp_path / "apt").exists() == (user == 0)
    assert log_of(checkout)[-1] == "[synth][m.obj]"
