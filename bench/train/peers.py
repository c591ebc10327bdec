"""Other programs in the training bench: the same folder, the same cameras, CPU seconds alike.

A peer is a shell command in which these stand for paths:

    {data}   a folder with transforms.json and RGBA pictures: what is trained on
    {test}   a transforms.json of the held-out cameras, without pictures
    {out}    a folder that is there; the command writes a picture per held-out camera into it, named
             as the file of its frame, of the frame's size; what is not opaque is seen over white,
             and a picture that is opaque all over has no outline to compare

Its CPU seconds are those of the shell and of all that it has waited for, user and system, imports
and rendering included, as the system counts them. Toonset's own command runs beside it as a peer.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from toonset.dataset.bundle.scene import Scene
from toonset.dataset.bundle.transforms import transforms_dict
from toonset.dataset.images.picture import encode_png, load_rgba
from toonset.dataset.silhouettes.mask import mask_of
from toonset.errors import ToonsetError, UsageError
from toonset.nerf.render.layers import Picture
from toonset.write import write_bytes, write_json

PLACES = ("{data}", "{test}", "{out}")
LAST_WORDS = 200  # characters of what a failed command said last


@dataclass(frozen=True)
class Peer:
    """Another program: its name, and the command that trains and renders."""

    name: str
    command: str


@dataclass(frozen=True, eq=False)
class PeerRun:
    """What a command made: a picture per held-out view, and what it took."""

    pictures: tuple[Picture, ...]
    seconds: float
    cpu_seconds: float


def toonset_itself() -> Peer:
    """Return toonset's command as a peer, with default settings in one thread."""
    program = f"{shlex.quote(sys.executable)} -m toonset"
    train = f"{program} train {{data}} -o {{out}}/run --threads 1 --quiet"
    shown = f"{program} render {{out}}/run --cameras {{test}} -o {{out}}/views --layer rgb --quiet"
    return Peer("toonset, as a command", f"{train} && {shown} && mv {{out}}/views/* {{out}}/")


def parse_peers(texts: Sequence[str]) -> tuple[Peer, ...]:
    """Return the peers that NAME=COMMAND name, toonset's own command before them; none without.

    Raises:
        UsageError: a text has no name, or its command no {data}, {test} and {out}; or two have one
            name.
    """
    peers = [toonset_itself()] if texts else []
    for text in texts:
        name, _, command = (part.strip() for part in text.partition("="))
        lacking = [place for place in PLACES if place not in command]
        if not name or lacking:
            said = "no name" if not name else f"no {lacking[0]} in its command"
            raise UsageError(
                f"--peer {text!r}: {said}; write 'NAME=COMMAND' with {', '.join(PLACES)}"
            )
        if name in [peer.name for peer in peers]:
            raise UsageError(f"--peer: two are called {name!r}; give each a name of its own")
        peers.append(Peer(name, command))
    return tuple(peers)


def run_peer(peer: Peer, train: Scene, test: Scene) -> PeerRun:
    """Return what a peer makes of a scene.

    Raises:
        ToonsetError: the command fails, or a picture is missing or of another size.
    """
    with TemporaryDirectory(prefix="peer-") as folder:
        place = Path(folder)
        out = place / "out"
        out.mkdir()
        write_scene(place / "data", train)
        write_scene(place / "test", test, pictures=False)
        paths = dict(
            zip(PLACES, (place / "data", place / "test/transforms.json", out), strict=True)
        )
        command = peer.command
        for word, path in paths.items():
            command = command.replace(word, shlex.quote(str(path)))
        began = time.perf_counter()
        cpu_seconds = _run(peer, command, place)
        seconds = time.perf_counter() - began
        names = [(frame.name, frame.rgba.shape) for frame in test.frames]
        pictures = tuple(_picture(peer, out / name, shape) for name, shape in names)
    return PeerRun(pictures, seconds, cpu_seconds)


def write_scene(folder: Path, scene: Scene, *, pictures: bool = True) -> None:
    """Write a scene as a folder that NeRF programs read; without pictures: its cameras alone."""
    extents = [
        np.ptp(np.flatnonzero(mask_of(frame.rgba).any(axis=1))) / frame.camera.scale
        for frame in scene.frames
        if mask_of(frame.rgba).any()
    ]
    height = float(max(extents, default=1.0))
    cameras = [(frame.name, frame.camera) for frame in scene.frames]
    write_json(folder / "transforms.json", transforms_dict(cameras, height, height))
    for frame in scene.frames if pictures else ():
        write_bytes(folder / frame.name, encode_png(frame.rgba))


def _run(peer: Peer, command: str, place: Path) -> float:
    """Return the CPU seconds of a shell command and all that it waits for."""
    said = place / "said"
    with said.open("wb") as log:
        child = subprocess.Popen(
            ["sh", "-c", command], cwd=place, stdin=subprocess.DEVNULL, stdout=log, stderr=log
        )
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        lines = said.read_text(errors="replace").strip().splitlines()
        words = "".join(c for c in (lines or ["nothing said"])[-1] if c.isprintable())
        raise ToonsetError(f"{peer.name}: ended with {child.returncode}: {words[:LAST_WORDS]}")
    return used.ru_utime + used.ru_stime


def _picture(peer: Peer, path: Path, shape: tuple[int, ...]) -> Picture:
    if not path.is_file():
        raise ToonsetError(f"{peer.name}: wrote no {path.name}; a picture per camera is needed")
    found = load_rgba(path)
    if found.shape != shape:
        sizes = [f"{width} x {height}" for height, width in (found.shape[:2], shape[:2])]
        raise ToonsetError(f"{peer.name}: {path.name} is {sizes[0]} px, {sizes[1]} are needed")
    return found
