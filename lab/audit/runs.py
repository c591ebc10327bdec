"""R4: run folders that were cut, flipped, swapped or filled with what no training writes.

A run's files carry no hashes (docs/decisions.md), so a flip that leaves a valid file is a run of
its own: what is wanted is that it is refused or rendered, never that something breaks or runs. How
many flips changed a picture unseen is said below the row. What is cut off must be refused.
"""

from __future__ import annotations

import json
import random
import struct
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path

from lab.audit.case import Case, Row, Tally, run_forked, try_case
from lab.audit.documents import ODD, TURN, ZERO, Change, dotted, linked, places_of, put, writes
from lab.audit.judge import REFUSED, Ran
from lab.audit.material import Material

READ = ("config.json", "model.safetensors", "drawings.safetensors", "drawings.png", "paint.png")
CUTS, TYPED = 144, 190
CANARY = "canary"
PICKLE = b"cposix\nsystem\n(S'touch " + CANARY.encode() + b"'\ntR."


def row(material: Material) -> Row:
    """Render every tampered run, look at some, and compare with the untouched one."""
    lot = random.Random(material.seed)
    tally = Tally(material.work / "wrong")
    whole = rendered(material)
    unseen = 0
    for number, (name, change, must_refuse) in enumerate(tampered(material, lot)):
        shown: list[dict[str, bytes]] = []

        def make(folder: Path, change: Change = change) -> None:
            change(material.copy("run", folder / "r"))

        def judge(folder: Path, ran: Ran, must_refuse: bool = must_refuse) -> Iterable[str]:
            if ran.code != REFUSED:
                shown.append(pictures(folder / "o"))  # noqa: B023
                if must_refuse:
                    yield "rendered a broken file"
            if (folder / CANARY).exists():
                yield "a pickle ran"

        try_case(Case(f"{name}: render", TURN, make, judge=judge), material.work, tally)
        unseen += shown not in ([], [whole])
        if number % 2 and not must_refuse:
            look = ("check", "info")[number % 4 // 2]
            try_case(Case(f"{name}: {look}", (look, "r"), make), material.work, tally)
    return tally.row(f"{unseen} runs were rendered, and not as before: valid files of other values")


def rendered(material: Material) -> dict[str, bytes]:
    """Return the pictures of the untouched run."""
    folder = material.work / "untouched"
    folder.mkdir()
    material.copy("run", folder / "r")
    ran = run_forked(Case("untouched", TURN), folder)
    assert ran.code == 0, ran
    return pictures(folder / "o")


def pictures(folder: Path) -> dict[str, bytes]:
    """Return the files of a rendering."""
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.*"))}


def tampered(material: Material, lot: random.Random) -> Iterator[tuple[str, Change, bool]]:
    """Yield names, changes of a run folder, and whether the run must be refused."""
    wholes = {name: (material.root / "run" / name).read_bytes() for name in READ}

    def at(name: str, change: Change) -> Change:
        return lambda run: change(run / name)

    for i in range(CUTS):
        name = READ[i % len(READ)]
        whole = wholes[name]
        cut = lot.randrange(len(whole.rstrip()))
        yield f"{name} cut at {cut}", at(name, put(whole[:cut])), True
        place, bit = lot.randrange(len(whole)), lot.randrange(8)
        flipped = whole[:place] + bytes([whole[place] ^ 1 << bit]) + whole[place + 1 :]
        yield f"{name} flipped at {place}.{bit}", at(name, put(flipped)), False
    for name, other in zip(READ, (*READ[1:], READ[0]), strict=True):
        for what, data in (("pickle", PICKLE), ("zip", b"PK\x03\x04"), ("nothing", b"")):
            yield f"{name} is a {what}", at(name, put(data)), True
        yield f"{name} is {other}", at(name, put(wholes[other])), False
        yield f"{name} is gone", at(name, Path.unlink), True
        yield f"{name} is endless", at(name, partial(linked, target=ZERO)), True
        yield f"{name} is longer", at(name, put(wholes[name] + PICKLE)), False
    for file in ("model.safetensors", "drawings.safetensors"):
        for name, data in headers(wholes[file], lot):
            yield f"{file} {name}", at(file, put(data)), False
    config = wholes["config.json"]
    places = [*places_of(json.loads(config)["field"])]
    for i in range(TYPED):
        place, odd = ("field", *places[i % len(places)]), ODD[i % len(ODD)]
        odd = lot.choice((0, -1, 1e-300, 1e9, 1e300, 2**40, 512)) if i % 3 == 0 else odd
        change = at("config.json", writes(config, place, [odd]))
        yield f"{dotted(place)}={json.dumps(odd)[:16]}", change, False


def headers(whole: bytes, lot: random.Random) -> Iterator[tuple[str, bytes]]:
    """Yield a safetensors file with a header that lies, or with tensors that are not finite."""
    size = struct.unpack("<Q", whole[:8])[0]
    header, data = json.loads(whole[8 : 8 + size]), whole[8 + size :]
    for number in (0, 2**63, size - 1, size + 8):
        yield f"header of {number}", struct.pack("<Q", number) + whole[8:]
    for key in [key for key in header if key != "__metadata__"]:
        one = header[key]
        for part, value in (("shape", [-1]), ("dtype", "I64"), ("data_offsets", [0, 2**60])):
            text = json.dumps(header | {key: one | {part: value}}).encode()
            yield f"{key} {part} {value}", struct.pack("<Q", len(text)) + text + data
        low, high = one["data_offsets"]
        if one["dtype"] in ("F16", "F32") and high > low:
            at = 8 + size + low + 4 * lot.randrange((high - low) // 4)
            yield f"{key} not finite", whole[:at] + b"\xff" * 4 + whole[at + 4 :]
