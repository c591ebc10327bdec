"""Mutated bundles: read as they are or refused in one clear line; nothing crashes, hangs or leaks.

Every mutation spoils one file of a whole bundle. All readers then look at it, and must agree with
`toonset check`: what it calls clean is read, what a reader refuses it has named.
"""

import contextlib
import json
import os
import random
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from toonset.dataset.bundle.check import bundle_problems
from toonset.dataset.bundle.read_scene import read_scene
from toonset.dataset.bundle.summary import summarise
from toonset.errors import ToonsetError

JSON_FILES = ("transforms.json", "calibration.json", "palette.json")
MAPS = ("images", "labels", "contours")
PICTURES = (*(f"{folder}/{i:03d}.png" for folder in MAPS for i in range(3)), "overlay.png")
OTHERS = ("mannequin.obj", "palette.gpl")
HANG_S = 30

VALUES: tuple[Any, ...] = (
    *(None, True, -1, 0, 0.5, 1e-320, -1e308, 1e308, 2**62, 2**70, 10**400, 255, 256, 1e9),
    *("", "x", "NaN", "..", "/etc/passwd", "a\0b", "\ud800", "\x1b[31mred", "a\nb", "é" * 300),
    *("images/000.png", "images/../images/001.png", "../outside/canary.png", "C:\\x.png", "~"),
    *([], {}, [[]], [1, 2, 3], [[1, 0, 0], [0, 1, 0], [0, 0, 1]], {"a": {"b": []}}),
    *(float("nan"), float("inf"), [float("-inf")] * 3, [0.0] * 20_000),
)
TEXTS = (
    *(b"", b" ", b"{", b"[]", b"null", b"{}", b"1e400", b"NaN", b'"x"', b"\xff\xfe{\0}\0", b"\0"),
    *(b"[" * 100_000, b'{"a":' * 50_000, b"[" * 500 + b"]" * 500, b"9" * 100_000, b"// {}\n{}"),
    *(b'{"frames": [' + b"{}," * 20_000 + b"{}]}", b'{"schema": "toonset-palette/1"}'),
)
SCHEMAS = (
    *("toonset-{}/0", "toonset-{}/99", "toonset-{}/1.5", "toonset-{}/-1", "toonset-{}/1/2", "{}"),
    *("toonset-{}", "toonset-{}/1e3", "Toonset-{}/1", "toonset-{}/٣", "toonset-other/1", 1, ["1"]),
)
MODES = ("1", "L", "LA", "P", "RGB", "RGBA", "I", "I;16", "F", "CMYK")


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the path of everything inside."""
    items: Any = ()
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, list):
        items = enumerate(value)
    for key, inner in items:
        yield (*path, key)
        yield from places(inner, (*path, key))


def mutate_json(content: Any, rng: random.Random) -> bytes:
    """Return a JSON text with one thing changed."""
    *inner, key = rng.choice(list(places(content)))
    parent = content
    for step in inner:
        parent = parent[step]
    kind = rng.randrange(9)
    if kind == 0:
        del parent[key]
    elif kind == 1 and isinstance(parent, dict):
        parent[f"{key}_extra"] = rng.choice(VALUES)
    elif kind == 2 and isinstance(parent, list):
        parent.insert(key, parent[key])
    elif kind == 3 and isinstance(parent[key], list):
        parent[key].reverse()
    elif kind == 4 and isinstance(parent[key], float | int):
        parent[key] += rng.choice((1e-9, 1e-4, 0.1, -3, 1e6))
    elif kind == 5:  # the same key twice
        text = json.dumps(content)
        name = json.dumps(str(key)) + ":"
        return text.replace(name, f"{name} 1, {name}", 1).encode()
    elif kind == 6 and isinstance(parent[key], list):
        parent[key] = parent[key] * rng.choice((2, 50))
    else:
        parent[key] = rng.choice(VALUES)
    return json.dumps(content).encode()


def mutate_bytes(data: bytes, rng: random.Random) -> bytes:
    """Return bytes cut off, flipped, repeated, overwritten or wrapped."""
    kind, at = rng.randrange(7), rng.randrange(max(len(data), 1))
    if kind == 0:
        return data[:at]
    if kind == 1:
        return b"\xef\xbb\xbf" * rng.randrange(1, 3) + data
    if kind == 2:
        return data + data[at:]
    if kind == 3:
        return data[:at] + bytes(rng.randrange(256) for _ in range(8)) + data[at + 8 :]
    flipped = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 5, 50))):
        flipped[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return bytes(flipped)


def spoil_json(place: Path, rng: random.Random) -> None:
    file = place / rng.choice(JSON_FILES)
    data = file.read_bytes()
    kind = rng.randrange(10)
    if kind < 6:
        file.write_bytes(mutate_json(json.loads(data), rng))
    elif kind == 6:
        file.write_bytes(mutate_bytes(data, rng))
    elif kind == 7:
        file.write_bytes(rng.choice(TEXTS))
    elif kind == 8:
        schema = rng.choice(SCHEMAS)
        schema = schema.format(file.stem) if isinstance(schema, str) else schema
        file.write_bytes(json.dumps({**json.loads(data), "schema": schema}).encode())
    else:
        file.write_bytes(data.decode().encode(rng.choice(("utf-16", "utf-32", "utf-7"))))


def spoil_rotation(place: Path, rng: random.Random) -> None:
    """Bend, mirror, scale or shear a camera by much or by next to nothing."""
    name = rng.choice(JSON_FILES[:2])
    content = json.loads((place / name).read_text())
    if name == "transforms.json":
        camera = rng.choice(content["frames"])
        rows = rng.choice((camera["transform_matrix"], camera["toonset"]["rotation"]))
    else:
        view = rng.choice(content["views"])
        rows = view[rng.choice(("camera", "twin"))]["camera_from_world_rotation"]
    i, j = rng.randrange(3), rng.randrange(3)
    change = rng.choice((1e-12, 1e-7, 1e-3, 0.1, -2.0, 1e30, 1e300))
    if rng.random() < 0.3:
        rows[i] = [-x for x in rows[i]]
    else:
        rows[i][j] += change
    (place / name).write_text(json.dumps(content))


def spoil_picture(place: Path, rng: random.Random) -> None:
    file = place / rng.choice(PICTURES)
    kind = rng.randrange(6)
    if kind < 2:
        file.write_bytes(mutate_bytes(file.read_bytes(), rng))
    elif kind == 2:  # another picture's bytes
        shutil.copy(place / rng.choice(PICTURES), file.with_suffix(".new"))
        file.with_suffix(".new").replace(file)
    elif kind == 3:
        size = rng.choice(((20, 24), (24, 20), (1, 1), (21, 24)))
        picture = Image.fromarray(np.full(size[::-1], 200, np.uint8))
        mode = rng.choice(MODES)
        how = "TIFF" if mode in ("I", "F", "CMYK") else "PNG"
        through = "I" if mode == "I;16" else "L" if mode in ("I", "F") else "RGB"
        picture.convert(through).convert(mode).save(file, how)
    elif kind == 4:  # a label or a coverage from another world
        values = np.full((24, 20), rng.randrange(256), np.uint8)
        picture = Image.fromarray(values)
        if rng.random() < 0.7:
            picture.putpalette(bytes(rng.randrange(256) for _ in range(768)))
        picture.save(file, "PNG")
    else:  # a header that promises far more
        data = bytearray(file.read_bytes())
        data[16:24] = rng.choice((b"\0\1\0\0\0\1\0\0", b"\xff" * 8, b"\0" * 8, b"\0\0\0\1\0\0\0\1"))
        file.write_bytes(bytes(data))


def spoil_other(place: Path, rng: random.Random) -> None:
    file = place / rng.choice(OTHERS)
    lines = (b"v nan 0 0", b"f 1 2 9999999", b"f 0 0 0", b"v 1e400 0 0", b"300 0 0 x", b"\0", b"-1")
    data = mutate_bytes(file.read_bytes(), rng)
    if rng.random() < 0.5:
        data = file.read_bytes() + rng.choice(lines) + b"\n"
    file.write_bytes(data)


def spoil_place(place: Path, rng: random.Random) -> None:
    """Put a link, a folder, a pipe, nothing, or a twin by case where a file or folder belongs."""
    names = (*JSON_FILES, *PICTURES, *OTHERS, *MAPS)
    file = place / rng.choice(names)
    kind = rng.randrange(9)
    if kind == 8:
        twin = file.parent / file.name.swapcase()
        if file.is_file():
            shutil.copy(file, twin)
        return
    shutil.rmtree(file) if file.is_dir() else file.unlink()
    targets = (file, place / "nothing", place.parent / "outside", Path("/dev/zero"), place)
    if kind == 0:
        file.mkdir()
    elif kind == 1:
        os.mkfifo(file)
    elif kind == 2:
        file.write_bytes(b"")
    elif kind < 7:
        file.symlink_to(targets[kind - 3])


SPOILERS: tuple[tuple[Callable[[Path, random.Random], None], int], ...] = (
    (spoil_json, 14),
    (spoil_picture, 5),
    (spoil_place, 4),
    (spoil_rotation, 2),
    (spoil_other, 2),
)


def tree(root: Path) -> list[tuple[str, int, int]]:
    """Return every path below with what changes when it is written to."""
    stats = ((path, path.lstat()) for path in sorted(root.rglob("*")))
    return [(str(path), stat.st_size, stat.st_mtime_ns) for path, stat in stats]


def refusal(read: Callable[..., object], *arguments: object) -> str | None:
    """Return how a reader refuses, None where it reads."""
    try:
        read(*arguments)
    except ToonsetError as error:
        return str(error)
    return None


@contextlib.contextmanager
def no_hang() -> Iterator[None]:
    def stop(*_: object) -> None:
        raise AssertionError(f"still reading after {HANG_S} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(HANG_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def look(place: Path) -> tuple[list[str], list[str]]:
    """Return the problems that `check` lists, and the refusals of all readers."""
    try:
        problems = [f"{problem.where}: {problem.what}" for problem in bundle_problems(place)]
    except ToonsetError as error:
        problems = [str(error)]
    refusals = [refusal(read_scene, place), refusal(summarise, place)]
    return problems, [said for said in refusals if said]


def check_mutation(place: Path, number: int) -> bool:
    """Spoil a bundle, let everything look at it, and return whether it is still clean."""
    rng = random.Random(number)
    functions, weights = zip(*SPOILERS, strict=True)
    rng.choices(functions, weights)[0](place, rng)
    before = tree(place.parent)
    with no_hang():
        problems, refusals = look(place)
    assert tree(place.parent) == before, "a reader has written"
    assert all(line.isprintable() and len(line) < 1000 for line in (*problems, *refusals))
    assert all(str(place) in line for line in refusals), refusals
    assert not refusals or problems, refusals
    return not problems


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    """Return a folder beside the bundles, which nothing may touch."""
    folder = tmp_path / "outside"
    folder.mkdir()
    (folder / "canary.png").write_bytes(b"mine")
    return folder


def run_mutations(small_bundle: Path, tmp_path: Path, numbers: range) -> int:
    """Return how many of the mutations left a clean bundle."""
    clean = 0
    for number in numbers:
        place = Path(shutil.copytree(small_bundle, tmp_path / f"b{number}"))
        try:
            clean += check_mutation(place, number)
        except Exception as error:
            raise AssertionError(f"mutation {number}: {error!r}") from error
        shutil.rmtree(place)
    return clean


@pytest.mark.usefixtures("outside")
@pytest.mark.parametrize(
    ("first", "count"), [(0, 600), pytest.param(100_000, 10_000, marks=pytest.mark.slow)]
)
def test_mutated_bundles_are_refused_in_one_line_or_read(small_bundle, tmp_path, first, count):
    clean = run_mutations(small_bundle, tmp_path, range(first, first + count))
    assert 0.02 * count < clean < 0.5 * count  # the mutations bite, and not everything is refused


def test_verbs_refuse_mutated_bundles_in_one_line(small_bundle, outside, toonset, snapshot):
    kept = snapshot(outside)
    for number in range(50_000, 50_020):
        place = Path(shutil.copytree(small_bundle, outside.parent / "bundle"))
        rng = random.Random(number)
        rng.choices(*zip(*SPOILERS, strict=True))[0](place, rng)
        before = tree(place)
        for verb in ("info", "check"):
            done = toonset(verb, place)
            assert done.code in (0, 2), (number, verb, done)
            assert (done.out == "") == bool(done.err), (number, verb, done)
            assert not done.err or done.reason
            assert all(line.isprintable() for line in done.out.splitlines()), (number, verb)
        assert tree(place) == before, number
        done = toonset("palette", place, "--quiet")
        assert done.code == 0 or done.reason, number
        assert snapshot(outside) == kept, number
        shutil.rmtree(place)
