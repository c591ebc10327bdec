"""R12: every verb twice, in new processes that differ in what must not matter: the same bytes."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from lab.audit.case import ROOT, Row, Tally
from lab.audit.judge import Ran
from lab.audit.material import FEW, Material

SECONDS = re.compile(rb" in [\d.]+ s\b")
TURN = ("--turntable", "2", "--size", "32", "--threads", "1")
LINES: tuple[tuple[str, ...], ...] = (
    ("mannequin", "--heads", "4", "-o", "m2.obj"),
    ("synth", "m.obj", "--views", "3", "--cell", "64", "--warp", "1", "-o", "synth2"),
    ("synth", "m.obj", "--condition", "artist", "--views", "3", "--cell", "64", "-o", "artist"),
    ("split", "sheet.png", "-o", "split2"),
    ("calibrate", "sheet.png", "--mesh", "m.obj", "-o", "bundle2"),
    ("palette", "bundle2"),
    ("recolor", "bundle2", "--recolor", "#cccccc=#00aa00", "-o", "recolored"),
    ("train", "bundle2", *FEW, "-o", "run2"),
    ("render", "run2", *TURN, "-o", "turn"),
    ("mesh", "run2", "--faces", "300", "--threads", "1", "-o", "figure.glb"),
    ("mesh", "run2", "--faces", "300", "--threads", "1", "-o", "figure.obj"),
    ("view", "run2", "-o", "figure.html"),
    ("evaluate", "run2", "--test", "bundle2", "-o", "evaluation"),
    ("consistency", "bundle2", "-o", "consistency"),
    ("export", "bundle2", "--to", "colmap", "-o", "colmap2"),
    *(
        ("export", "bundle2", "--to", to, "-o", to)
        for to in ("nerfstudio", "blender-synthetic", "blender", "gltf")
    ),
    ("import", "colmap2", "-o", "imported"),
    ("info", "bundle2", "--json"),
    ("check", "bundle2", "--json"),
)


@dataclass(frozen=True)
class World:
    """Surroundings of a process: its folder, cores and environment."""

    folder: str
    cores: int
    environment: dict[str, str]


KEPT = ("PATH", "TOONSET_CACHE")  # of this process' environment
HERE = {"PYTHONHASHSEED": "1", "LC_ALL": "C", "TZ": "UTC"}  # and no HOME
THERE = {"PYTHONHASHSEED": "42", "LC_ALL": "C.UTF-8", "TZ": "Asia/Kathmandu", "HOME": "/nowhere"}
WORLDS = (World("one", 1, HERE), World("another place", 2, THERE))


def row(material: Material) -> Row:
    """Take a sheet through all verbs in both worlds, and compare after each."""
    tally = Tally(material.work / "wrong")
    for world in WORLDS:
        (material.work / world.folder).mkdir()
        material.copy_all(material.work / world.folder, "m.obj", "m.landmarks.json", "sheet.png")
    told: set[str] = set()
    for line in LINES:
        ran = [run_in(world, line, material.work) for world in WORLDS]
        faults = [f"exit {one.code}: {one.err!r}" for one in ran if one.code not in (0, 3)]
        if SECONDS.sub(b"", ran[0].out) != SECONDS.sub(b"", ran[1].out):
            faults.append("prints something else")
        one, other = (contents(material.work / world.folder) for world in WORLDS)
        odd = {name for name in {*one, *other} if one.get(name) != other.get(name)} - told
        faults += [f"{name} differs" for name in sorted(odd)]
        told |= odd
        if "--json" not in line:
            shown = " ".join(line)
            tally.add(
                line[0], ran[1], faults, lambda shown=shown: f"toonset {shown}  # in two folders"
            )
    return tally.row()


def run_in(world: World, line: tuple[str, ...], work: Path) -> Ran:
    """Run a command as a new process in one of the worlds."""
    done = subprocess.run(
        [sys.executable, "-P", "-m", "toonset", *line],
        cwd=work / world.folder,
        env={name: os.environ[name] for name in KEPT}
        | world.environment
        | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        preexec_fn=lambda: os.sched_setaffinity(0, cores(world.cores)),
    )
    return Ran(done.returncode, done.stdout, done.stderr)


def cores(count: int) -> set[int]:
    """Return the first cores of this machine."""
    return set(sorted(os.sched_getaffinity(0))[:count])


def contents(folder: Path) -> dict[str, str]:
    """Return every file's hash, without the seconds that docs/formats.md excepts."""
    return {
        str(path.relative_to(folder)): sha256(compared(path)).hexdigest()
        for path in folder.rglob("*")
        if path.is_file()
    }


def compared(path: Path) -> bytes:
    """Return what of a file must be the same."""
    data = path.read_bytes()
    if path.name == "history.csv":
        head, *rows = [line.split(",") for line in data.decode().splitlines()]
        kept = [i for i, name in enumerate(head) if "second" not in name]
        return "\n".join(",".join(row[i] for i in kept) for row in (head, *rows)).encode()
    if path.name == "metrics.json":
        return json.dumps(json.loads(data) | {"seconds": None}).encode()
    return data
