"""Other programs beside toonset: what they get, what they must write, how they fail."""

from __future__ import annotations

import json
import shlex
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.cases.cases import TrainCase
from bench.train.chart import draw_curves
from bench.train.measure import run_jobs, table_of
from bench.train.peers import PLACES, Peer, parse_peers, run_peer
from bench.train.plan import Scope, plan
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.errors import ToonsetError, UsageError

COPIES = """
import json, os, shutil, sys
data, test, out, loops = sys.argv[1:]
drawn = [f["file_path"] for f in json.load(open(f"{data}/transforms.json"))["frames"]]
for frame in json.load(open(test))["frames"]:
    assert not os.path.exists(os.path.join(os.path.dirname(test), frame["file_path"]))
    shutil.copy(f"{data}/{drawn[0]}", f"{out}/{frame['file_path']}")
total = sum(i * i for i in range(int(loops)))
"""
FLATTENS = """
import pathlib, sys
from PIL import Image
for path in pathlib.Path(sys.argv[1]).glob("*.png"):
    seen = Image.open(path).convert("RGBA")
    Image.alpha_composite(Image.new("RGBA", seen.size, "white"), seen).convert("RGB").save(path)
"""


def scene(count: int, side: int = 24) -> Scene:
    frames = []
    for i in range(count):
        camera = Camera.looking_at(np.zeros(3), i, 0.1, side / 3, (side, side), k=0.0)
        rgba = np.zeros((side, side, 4), np.uint8)
        rgba[6:18, 6:18] = (200, 40 * i, 40, 255)
        frames.append(Frame(f"{i:03d}.png", camera, rgba))
    return Scene(tuple(frames), None, "block")


@pytest.fixture
def copying(tmp_path: Path) -> str:
    """Return the command of a program that answers every camera with the first drawing."""
    script = tmp_path / "copy it.py"
    script.write_text(COPIES, encoding="utf-8")
    words = shlex.join([sys.executable, str(script)])
    return f"{words} {{data}} {{test}} {{out}} 10"


def test_a_peer_gets_drawings_and_bare_cameras_and_its_pictures_are_scored(copying: str) -> None:
    case = TrainCase("block-exact", "exact", scene(4), scene(2))
    peers = (Peer("copies", copying), Peer("fails", "echo one; echo no GPU >&2; exit 7"))
    jobs = plan([case], 3, "", Scope((), views=(4,)), peers)
    assert [(job.name, job.seed) for job in jobs] == [
        ("block-exact 24 px 4 views copies", 3),
        ("block-exact 24 px 4 views fails", 3),
    ]
    assert jobs[0].identity["peer"] == copying
    assert jobs[0].identity != replace(jobs[0], peer=Peer("copies", copying + " ")).identity
    copied, failed = (found for _, found in run_jobs(jobs))
    assert failed.note == "fails: ended with 7: no GPU"
    assert copied.cpu_seconds > 0
    assert copied.figures["psnr"] is not None
    assert 10 < copied.figures["psnr"] < 120  # right for one of the two views
    text = table_of([copied, failed])
    assert "copies" in text
    assert text.endswith("fails, seed 3: fails: ended with 7: no GPU")
    assert draw_curves([copied], "n", "svg").count(b"copies (n = 1)") == 1


def test_pictures_without_transparency_have_no_outline_to_compare(copying: str) -> None:
    flat = f"{sys.executable} -c {shlex.quote(FLATTENS)} {{out}}"
    peers = (Peer("cut out", copying), Peer("opaque", f"{copying} && {flat}"))
    case = TrainCase("block-exact", "exact", scene(4), scene(2))
    cut_out, opaque = (
        found for _, found in run_jobs(plan([case], 0, "", Scope((), views=(4,)), peers))
    )
    assert cut_out.figures["silhouette_iou"] == 1
    assert opaque.figures["silhouette_iou"] is None
    assert opaque.figures["psnr"] == cut_out.figures["psnr"]


def test_cpu_seconds_are_those_of_all_that_the_command_waits_for(copying: str) -> None:
    command = copying.removesuffix(" 10")
    little = run_peer(Peer("a", f"{command} 10"), scene(3), scene(2)).cpu_seconds
    more = f"{command} 10 && sh -c {shlex.quote(f'{command} 8000000')}"
    assert run_peer(Peer("a", more), scene(3), scene(2)).cpu_seconds > 2 * little


def test_what_is_missing_or_of_another_size_is_said(tmp_path: Path) -> None:
    with pytest.raises(ToonsetError, match=r"a: wrote no 000\.png; a picture per camera"):
        run_peer(Peer("a", "true {data} {test} {out}"), scene(3), scene(2))
    small = "cp {data}/000.png {out}/000.png; cp {data}/000.png {out}/001.png; true {test}"
    with pytest.raises(ToonsetError, match=r"000\.png is 16 x 16 px, 24 x 24 are needed"):
        run_peer(Peer("a", small), scene(3, side=16), scene(2))


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (["run it"], "no {data} in its command"),
        (["=x {data} {test} {out}"], "no name"),
        (["a=x {data} {out}"], "no {test} in its command"),
        (["a=x {data} {test} {out}"] * 2, "two are called 'a'"),
    ],
)
def test_a_peer_that_is_no_peer_is_refused(bench, texts: list[str], said: str) -> None:
    with pytest.raises(UsageError, match=r"--peer") as refused:
        parse_peers(texts)
    assert said in str(refused.value)
    flags = [word for text in texts for word in ("--peer", text)]
    assert said in bench("train", "--quick", *flags).reason


def test_toonset_runs_beside_them_by_the_same_contract() -> None:
    assert parse_peers(()) == ()
    itself, other = parse_peers(["a=x {data} {test} {out}"])
    assert other == Peer("a", "x {data} {test} {out}")
    assert all(place in itself.command for place in PLACES)


def test_peers_belong_to_training(bench) -> None:
    assert "--peer belongs to `train`" in bench("calib", "--peer", "a=x").reason


def test_the_folder_is_one_that_others_read(tmp_path: Path) -> None:
    seen = tmp_path / "seen.json"
    keeps = f"cp {{data}}/transforms.json {shlex.quote(str(seen))}"
    run = f"{keeps}; cp {{data}}/* {{out}}; true {{test}}"
    run_peer(Peer("a", run), scene(2), scene(2))
    frame = json.loads(seen.read_text())["frames"][1]
    assert {"file_path", "transform_matrix", "fl_x", "fl_y", "cx", "cy", "w", "h"} <= set(frame)
