"""Fuzzing of every reader (see lab/fuzz): its corpus is taken, and it finds what is wrong."""

import json
import os
import random
import signal
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from lab.fuzz.__main__ import CORPUS, ROOT, Bars, corpus, fuzz, inputs_of
from lab.fuzz.mutate import mutated, with_checksums
from lab.fuzz.targets import TARGETS, drawn

SECONDS = 60  # more than enough: the inputs are counted


@pytest.mark.parametrize("name", TARGETS)
def test_the_corpus_is_taken(name: str, tmp_path: Path) -> None:
    for data in corpus(name):
        TARGETS[name](data, tmp_path)


def test_the_corpus_is_small_and_has_all_targets() -> None:
    assert {folder.name for folder in CORPUS.iterdir()} == TARGETS.keys()
    assert sum(file.stat().st_size for file in CORPUS.rglob("*") if file.is_file()) <= 200_000


@pytest.mark.slow
@pytest.mark.parametrize("name", TARGETS)
def test_nothing_but_our_errors_comes_out(name: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "lab.fuzz", name],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]


def aco(swatches: int) -> bytes:
    swatch = bytes(10) + struct.pack(">I", 1) + bytes(2)
    return struct.pack(">HH", 2, swatches) + swatch * swatches


LARGE: dict[str, tuple[str, Callable[[], bytes]]] = {
    "swatches": ("aco", lambda: aco(65_500)),
    "boxes as CSV": ("boxes.csv", lambda: b"1,2,3,4\n" * 10**6),
    "keys, the last twice": (
        "boxes.json",
        lambda: b"{%s}" % b",".join(b'"%d":1' % i for i in (*range(600_000), 599_999)),
    ),
    "corrected views": (
        "corrections.json",
        lambda: json.dumps(
            {"version": 1, "views": [{"box": [i, 2, 3, 4]} for i in range(10**5)]}
        ).encode(),
    ),
}


@pytest.mark.parametrize("what", LARGE)
def test_large_files_cost_little(what: str) -> None:
    name, make = LARGE[what]
    data = make()
    assert fuzz(TARGETS[name], lambda number: data, SECONDS, most=1).findings == ()


def wrong(data: bytes, folder: Path) -> None:
    number = data[0]
    if number == 1:
        raise KeyError("of the test")
    if number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    while number == 3:
        pass
    if number == 4:
        bytearray(2**40)
    if number == 5:
        assert b"x" * 30 * 2**20


def say_what_is_found() -> None:
    """Print how many inputs of `wrong` were taken, and how those that were found ended."""
    bars = Bars(cpu_s=2, memory_mb=20)
    tried = fuzz(wrong, lambda number: bytes([number]), SECONDS, bars, most=7)
    print(json.dumps([tried.executions, {one.data[0]: one.how for one in tried.findings}]))


def test_what_is_found() -> None:
    """In a process of its own, as it is used: what else a worker holds must not count."""
    done = subprocess.run(
        [sys.executable, "-c", "from tests.lab import test_fuzz; test_fuzz.say_what_is_found()"],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    executions, found = json.loads(done.stdout)
    assert (executions, [*found]) == (7, [*"12345"]), found
    assert found["1"].startswith("KeyError at test_fuzz.py:")
    assert (found["2"], found["3"]) == ("died of SIGKILL", "died of SIGPROF")
    assert found["4"].startswith("MemoryError")
    assert "over" in found["5"]


def test_an_input_follows_from_seed_and_number() -> None:
    one, same, other = (inputs_of("obj", seed) for seed in (1, 1, 2))
    numbers = range(40)
    assert [*map(one, numbers)] == [*map(same, numbers)] != [*map(other, numbers)]
    assert [one(i) for i in range(len(corpus("obj")))] == [*corpus("obj")]


def test_any_bytes_are_a_small_sheet() -> None:
    lot = random.Random(1)
    for length in range(60):
        height, width, channels = drawn(lot.randbytes(length)).shape
        assert 24 <= width <= 96
        assert 24 <= height <= 96
        assert channels == 4


def test_changed_pictures_have_their_checksums() -> None:
    png = next(data for data in corpus("picture") if data.startswith(b"\x89PNG"))
    changed = {mutated([png], random.Random(i)) for i in range(100)}
    assert len(changed) > 50
    broken = png.replace(b"IDAT", b"IDAU")
    assert with_checksums(broken) != broken
    assert with_checksums(png) == png
