"""Bad input: one clear line on stderr, exit code 2, nothing written."""

from __future__ import annotations

import os
import shutil
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from toonset.dataset.mesh.load import load_mesh

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")  # numpy's are no clear line

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
PLY = "ply\nformat {kind} 1.0\nelement vertex {count}\n" + "".join(
    f"property float {axis}\n" for axis in "xyz"
)
PLY_FACES = "element face 1\nproperty list uchar int vertex_indices\n"


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def bomb(path: Path, _: Image.Image) -> None:
    header = struct.pack(">IIBBBBB", 30_000, 30_000, 8, 6, 0, 0, 0)
    parts = [chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(b"\0" * 99)), chunk(b"IEND", b"")]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))


def cut(kind: str) -> Callable[[Path, Image.Image], None]:
    def write(path: Path, sheet: Image.Image) -> None:
        sheet.save(path, kind)
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])

    return write


def text(content: str) -> Callable[[Path, Image.Image], int]:
    return lambda path, _: path.write_text(content)


def plain(mode: str, color: Any) -> Callable[[Path, Image.Image], None]:
    return lambda path, _: Image.new(mode, (300, 120), color).save(path)


def noise(path: Path, _: Image.Image) -> None:
    values = np.random.default_rng(0).integers(0, 255, (120, 300, 3), np.uint8)
    Image.fromarray(values).save(path)


# file name -> (how to make it, what the line must say)
BAD_PICTURES: dict[str, tuple[Callable[[Path, Image.Image], Any], str]] = {
    "missing.png": (lambda path, _: None, "no such file; check the name"),
    "dangling.png": (lambda path, _: path.symlink_to("gone.png"), "no such file; check the name"),
    "loop.png": (lambda path, _: path.symlink_to(path.name), "cannot be read"),
    "folder.png": (lambda path, _: path.mkdir(), "is a folder without pictures; name a sheet"),
    "pipe.png": (lambda path, _: os.mkfifo(path), "no regular file; a picture file is needed"),
    "empty.png": (text(""), "is empty (0 bytes); export the picture again"),
    "cut.png": (cut("PNG"), "PNG file is damaged or cut off"),
    "cut.jpg": (cut("JPEG"), "JPEG file is damaged or cut off"),
    "bomb.png": (bomb, "its header announces far more than 80 megapixels"),
    "text.png": (text("not a picture"), "is text, no picture that can be read; save it as PNG"),
    "sheet.svg": (text("<svg xmlns='http://www.w3.org/2000/svg'/>"), "an SVG drawing, no picture"),
    "sheet.kra": (lambda path, _: path.write_bytes(b"PK\x03\x04" + b"\0" * 99), "a zip archive"),
    "cmyk.jpg": (lambda path, s: s.convert("CMYK").save(path), "is CMYK without a colour profile"),
    "cmyk.tif": (lambda path, s: s.convert("CMYK").save(path), "is CMYK without a colour profile"),
    "animated.gif": (
        lambda path, s: s.save(path, save_all=True, append_images=[s.rotate(180)]),
        "is an animated or multi-page GIF; save the frame",
    ),
    "animated.png": (
        lambda path, s: s.save(path, save_all=True, append_images=[s.rotate(180)]),
        "is an animated or multi-page PNG; save the frame",
    ),
    "blank.png": (plain("RGB", "white"), "the sheet is blank (all #ffffff)"),
    "clear.png": (plain("RGBA", (0, 0, 0, 0)), "the sheet is blank (all transparent)"),
    "one.png": (
        lambda path, _: Image.new("RGB", (1, 1), "red").save(path),
        "the sheet is blank (all #ff0000)",
    ),
    "noise.png": (noise, "the background is not one colour"),
    "e\x1b[31mvil\n.png": (lambda path, _: None, "e?[31mvil .png: no such file"),
}


@pytest.mark.parametrize("verb", ["calibrate", "split"])
@pytest.mark.parametrize("name", BAD_PICTURES)
def test_a_bad_sheet(name, verb, drawn: Path, toonset, snapshot, tmp_path, monkeypatch):
    make, words = BAD_PICTURES[name]
    make(tmp_path / name, Image.open(drawn / "sheet.png").convert("RGB"))
    monkeypatch.chdir(tmp_path)
    before = snapshot(tmp_path)
    mesh = ["--mesh", drawn / "mannequin.obj"] if verb == "calibrate" else []
    reason = toonset(verb, name, *mesh).reason
    assert words in reason
    assert reason.startswith(" ".join(name.replace("\x1b", "?").split()))
    assert snapshot(tmp_path) == before


def exif_turned(sheet: Image.Image, path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6  # shown after a quarter turn clockwise
    sheet.transpose(Image.Transpose.ROTATE_90).save(path, exif=exif)


def sixteen_bit(sheet: Image.Image, path: Path) -> None:
    rows = np.asarray(sheet).astype(">u2") * 257
    raw = b"".join(b"\0" + row.tobytes() for row in rows)
    header = struct.pack(">IIBBBBB", *sheet.size, 16, 2, 0, 0, 0)
    parts = [chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(raw)), chunk(b"IEND", b"")]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))


ODD_PICTURES: dict[str, Callable[[Image.Image, Path], Any]] = {
    "indexed.png": lambda sheet, path: sheet.quantize(256).save(path),
    "opaque alpha.png": lambda sheet, path: sheet.convert("RGBA").save(path),
    "turned.tif": exif_turned,
    "turned.png": exif_turned,
    "16 bit.png": sixteen_bit,
    "still.gif": lambda sheet, path: sheet.quantize(256).save(path),
    "a PNG named.jpg": lambda sheet, path: sheet.save(path, "PNG"),
}


@pytest.fixture(scope="module")
def single(drawn: Path, toonset, tmp_path_factory) -> tuple[Image.Image, Path]:
    """Return a figure in 60 colours, so that an indexed file holds it exactly, and its bundle."""
    folder = tmp_path_factory.mktemp("single")
    figure = Image.open(drawn / "single.png").convert("RGB").quantize(60).convert("RGB")
    figure.save(folder / "single.png")
    mesh = drawn / "mannequin.obj"
    done = toonset("calibrate", folder / "single.png", "--mesh", mesh, "-o", folder / "b", "-q")
    assert done.code == 3
    return figure, folder / "b"


@pytest.mark.parametrize("name", ODD_PICTURES)
def test_an_odd_sheet_gives_the_plain_ones_bundle(name, drawn, single, toonset, tmp_path):
    figure, bundle = single
    ODD_PICTURES[name](figure, tmp_path / name)
    mesh = drawn / "mannequin.obj"
    done = toonset("calibrate", tmp_path / name, "--mesh", mesh, "-o", tmp_path / "b", "-q")
    assert done.code == 3
    assert done.err.startswith("sheet: weak (a single drawing")  # nothing about the file
    assert done.err.count("\n") == 1
    for file in ("images/000.png", "transforms.json", "overlay.png"):
        assert (tmp_path / "b" / file).read_bytes() == (bundle / file).read_bytes(), file


BAD_MESHES: dict[str, tuple[str | bytes, str]] = {
    "points.obj": (TRIANGLE, "3 vertices and no faces; export"),
    "cloud.ply": (
        PLY.format(kind="ascii", count=3) + "end_header\n0 0 0\n1 0 0\n0 1 0\n",
        "vertices and no faces",
    ),
    "nan.obj": (TRIANGLE.replace("v 1", "v nan") + "f 1 2 3\n", "1 of 3 vertices are NaN or inf"),
    "inf.obj": (TRIANGLE.replace("v 1", "v inf") + "f 1 2 3\n", "1 of 3 vertices are NaN or inf"),
    "index.obj": (TRIANGLE + "f 1 2 9\n", "the file is damaged, export it again"),
    "line.obj": ("v 0 0 0\nv 0 1 0\nv 0 2 0\nf 1 2 3\n", "every face is a line or a point"),
    "lying.obj": ("v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n", "turn the mannequin upright"),
    "mesh.zip": (b"PK\x03\x04" + b"\0" * 99, "is a zip archive"),
    "zip.obj": (b"PK\x03\x04" + b"\0" * 99, "is a zip archive"),
    "huge.ply": (
        PLY.format(kind="binary_little_endian", count=2_000_000_000) + PLY_FACES + "end_header\n",
        "announces 2,000,000,000 vertices",
    ),
    "huge.stl": (
        b"\0" * 80 + struct.pack("<I", 2_000_000_000) + b"\0" * 50,
        "announces 2,000,000,000 faces",
    ),
    "empty.obj": ("", "is empty (0 bytes); export the mesh again"),
    "picture.png": (b"\x89PNG\r\n\x1a\n", "is a PNG picture, no mesh that can be read; export"),
    "figure.fbx": (b"Kaydara FBX Binary  \0", "is an FBX file, no mesh that can be read; export"),
}


@pytest.mark.parametrize("name", BAD_MESHES)
def test_a_bad_mesh(name, drawn: Path, toonset, snapshot, tmp_path, monkeypatch):
    data, words = BAD_MESHES[name]
    (tmp_path / name).write_bytes(data if isinstance(data, bytes) else data.encode())
    monkeypatch.chdir(tmp_path)
    before = snapshot(tmp_path)
    reason = toonset("calibrate", drawn / "sheet.png", "--mesh", name).reason
    assert reason.startswith(f"{name}: ")
    assert words in reason
    assert snapshot(tmp_path) == before


# ---- the same as processes


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["calibrate", "none.png", "--mesh", "mannequin.obj"], "none.png: no such file"),
        (["calibrate", "sheet.png", "--mesh", "sheet.png"], "sheet.png: is a PNG picture, no mesh"),
        (["split", "none.png"], "none.png: no such file; check the name of the picture"),
        (["split", "mannequin.obj"], "mannequin.obj: is text, no picture that can be read"),
        (["split", "sheet.png", "--boxes", "mannequin.obj"], "mannequin.obj: "),
        (["split", "sheet.png", "--drop", "9"], "--drop: there is no view 9"),
        (["palette"], "bundle"),
        (["train", "."], "holds no transforms.json; run `toonset calibrate` first"),
        (["render", ".", "--turntable", "2", "-o", "x"], "config.json: does not exist"),
        (["evaluate", ".", "--test", "."], "config.json: does not exist"),
        (["synth", "none.obj", "-o", "x"], "none.obj: no such file"),
    ],
)
def test_as_a_process(arguments, words, drawn: Path, shell, snapshot, tmp_path):
    work = Path(shutil.copytree(drawn, tmp_path / "work"))
    before = snapshot(work)
    assert words in shell(*arguments, cwd=work).reason
    assert snapshot(work) == before


def test_the_mannequin_is_fine(drawn: Path):
    """Every refusal above has another cause than the mannequin."""
    assert len(load_mesh(drawn / "mannequin.obj").faces) > 1000
