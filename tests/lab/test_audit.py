"""The audit of reliability: what it calls wrong, and that nothing is (see lab/audit)."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from lab.audit.case import Row, Tally, quoted
from lab.audit.judge import Ran, faults_of, finite, left_behind

ROOT = Path(__file__).resolve().parents[2]
LEAST = {  # runs per row
    **{"R1": 318, "R2": 118, "R3": 1052, "R3m": 1100, "R4": 645, "R9": 113},
    **{"R12": 14, "R14": 39, "R15": 56, "R15t": 244, "soak": 2},
}


@pytest.mark.slow
def test_nothing_of_the_audit_is_wrong() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "lab.audit", *LEAST],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
    rows = {line.split()[0]: line for line in done.stdout.splitlines()[1:] if line[:1] != " "}
    assert rows.keys() == LEAST.keys()
    for name, least in LEAST.items():
        tried = int(rows[name][27:33])
        assert tried >= least, rows[name]


REFUSAL = b"toonset: s.png: is empty (0 bytes); export the picture again\n"


@pytest.mark.parametrize(
    ("ran", "fault"),
    [
        (Ran(0, b"", b""), None),
        (Ran(3, b"done\n", b"sheet: weak\n"), None),
        (Ran(2, b"", REFUSAL), None),
        (Ran(2, b"", b"2 views\n" + REFUSAL), None),
        (Ran(2, b"", b"toonset: No such option: --x; see `toonset split -h`\n"), None),
        (Ran(1, b"", b"Traceback (most recent call last):\nKeyError: 1\n"), "exit 1: KeyError: 1"),
        (Ran(-11, b"", b""), "died of SIGSEGV"),
        (Ran(2, b"", b""), "0 lines instead of one"),
        (Ran(2, b"", REFUSAL * 2), "2 lines instead of one"),
        (Ran(2, b"", b"toonset: s.png: is blank; a drawing is needed\n"), "what to do"),
        (Ran(0, b"", REFUSAL), "exit 0, but"),
        (Ran(0, b"a\x1b[31mb\n", b""), "raw control characters"),
        (Ran(0, b"", b"x.py:3: RuntimeWarning: divide by zero\n"), "a library's warning"),
        (Ran(0, b"", b"", peak_mb=1600), "1600 MB"),
        (Ran(0, b"", b"", cpu_s=21), "21 CPU s"),
    ],
)
def test_what_is_wrong_with_an_end(ran: Ran, fault: str | None) -> None:
    found = faults_of(ran, "split")
    assert [fault in one for one in found] == [True] if fault else found == []


@pytest.mark.parametrize(
    ("name", "code", "fault"),
    [
        ("o/x.png", 0, None),
        ("o/.lock", 0, "left"),
        ("x.png", 0, "outside of the output"),
        ("o/x.png", 2, "refused, but wrote"),
    ],
)
def test_what_is_left_behind(name: str, code: int, fault: str | None, tmp_path: Path) -> None:
    (tmp_path / "o").mkdir()
    (tmp_path / name).touch()
    found = left_behind(tmp_path, {"o"}, ("o",), Ran(code, b"", b""))
    assert fault in found[0] if fault else found == []


@pytest.mark.parametrize(
    ("name", "text", "good"),
    [
        ("a.json", '{"nan": 1.5}', True),
        ("a.json", '{"x": [1, NaN]}', False),
        ("a.csv", "banana,info\n1,2\n", True),
        ("a.csv", "step,loss\n1,nan\n", False),
        ("a.obj", "v 0 -inf 1\n", False),
    ],
)
def test_numbers_that_are_none(name: str, text: str, good: bool, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    assert finite(tmp_path / name) == good


def test_a_row_counts_and_tells(tmp_path: Path, capsys) -> None:
    tally = Tally(tmp_path)
    tally.add("good", Ran(0, b"", b"", 5.0, 2.0), [], lambda: "")
    tally.add("b\x1bad", Ran(1, b"", b"", 7.0, 1.0), ["x", "y"], lambda: "toonset split")
    assert tally.row() == Row(2, ("b?ad: x; y\n        toonset split",), 7.0, 2.0, "good")


def test_a_word_as_bash_reads_it() -> None:
    for word in ("plain", "a b", "'$(x)`", "line\nbreak", "n\udcff", "\x1b[31m"):
        said = subprocess.run(["bash", "-c", f"printf %s {quoted(word)}"], capture_output=True)
        assert said.stdout == os.fsencode(word)
        assert quoted(word).isprintable()
