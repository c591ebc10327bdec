"""What foreign bytes reach first: every reader of files, and the splitter of sheets.

A target takes any bytes and a folder that is its own. It lets only `ToonsetError` pass; whatever
else comes out is a defect of the reader.
"""

from __future__ import annotations

import contextlib
import json
import struct
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from toonset.apps.batch.sheets import list_sheets
from toonset.cli.common.verb_stages import VERBS
from toonset.dataset.bundle.calibration_file import read_calibration
from toonset.dataset.bundle.transforms_read import read_cameras
from toonset.dataset.images.picture import decode_rgba, encode_png, picture_size
from toonset.dataset.importers.detect import read_import
from toonset.dataset.mannequin.landmark_file import read_landmarks
from toonset.dataset.mesh.load import load_mesh
from toonset.dataset.split.sheet import PictureOptions, split_picture
from toonset.dataset.split_folder.boxes import read_boxes
from toonset.dataset.split_folder.corrections import read_corrections
from toonset.dataset.split_folder.write import read_records
from toonset.dataset.view_dataset import ViewDataset
from toonset.errors import ToonsetError
from toonset.palette.formats.json import read_palette_json
from toonset.palette.formats.registry import names_tones, palette_names, parse_colors
from toonset.view import View

Target = Callable[[bytes, Path], None]
Reader = Callable[[Path], object]

SEPARATOR = b"\n=====\n"  # between the files of a target that reads several
SIDES = (24, 96)  # pixels of a drawn sheet
SHAPE = struct.Struct("<7B")  # kind, x, y, width, height, colour, alpha
MODEL = ("cameras", "images", "points3D", "rigs", "frames")
PICTURE = encode_png(np.full((96, 57, 4), 255, dtype=np.uint8))
VIEWS = tuple(
    View(np.full((96, 57, 4), 255, np.uint8), (60 * i, 0, 57, 96), 1.5, f"{i:03d}.png")
    for i in range(3)
)


def sheet(data: bytes, folder: Path) -> None:
    """Split the sheet that bytes draw."""
    columns = data[2] % 8 if len(data) > 2 else 0
    grid = (columns, 1 + data[2] // 128) if columns > 4 else None
    with contextlib.suppress(ToonsetError):
        split_picture(drawn(data), PictureOptions(grid=grid))


def drawn(data: bytes) -> np.ndarray:
    """Return RGBA of 24 to 96 px a side: size, grid, paper, then shapes of seven bytes each."""
    least, most = SIDES
    head = data[:6].ljust(6, b"\xff")
    width, height = (least + byte % (most - least + 1) for byte in head[:2])
    image = Image.new("RGBA", (width, height), _color(*head[4:6]))
    pen = ImageDraw.Draw(image)
    shapes = data[6 : len(data) - (len(data) - 6) % SHAPE.size] if len(data) > 6 else b""
    for kind, x, y, wide, high, color, alpha in SHAPE.iter_unpack(shapes):
        left, top = x % width, y % height
        box = (left, top, left + wide % width, top + high % height)
        draw = (pen.rectangle, pen.ellipse, pen.line)[kind % 3]
        draw(box, fill=_color(color, alpha))
    pixels = np.array(image)
    if head[3] % 8 == 7:  # a noisy scan
        noise = np.random.default_rng(head[3]).integers(-8, 9, (height, width, 3))
        pixels[..., :3] = np.clip(pixels[..., :3] + noise, 0, 255)
    return pixels


def _color(color: int, alpha: int) -> tuple[int, int, int, int]:
    """Return one of 256 colours, opaque three times of four."""
    red, green, blue = (color >> 5) * 36, (color >> 2 & 7) * 36, (color & 3) * 85
    return red, green, blue, 255 if alpha % 4 else alpha


def picture(data: bytes, folder: Path) -> None:
    """Decode a picture."""
    file = folder / "a.png"
    file.write_bytes(data)
    for read in (picture_size, lambda path: decode_rgba(data, path)):
        with contextlib.suppress(ToonsetError):
            read(file)


def file_of(name: str, *readers: Reader, beside: tuple[str, ...] = ()) -> Target:
    """Return a target that gives a file of that name to readers.

    Args:
        name: of the file in the target's folder.
        readers: of its path.
        beside: further files, as their names; separated by `SEPARATOR` in the bytes.
    """

    def take(data: bytes, folder: Path) -> None:
        parts = iter(data.split(SEPARATOR))
        for each in (name, *beside):
            _write(folder / each, next(parts, None))
        for view in VIEWS:
            _write(folder / "images" / view.name, PICTURE)
        for read in readers:
            with contextlib.suppress(ToonsetError):
                read(folder / name)

    return take


def _write(file: Path, data: bytes | None) -> None:
    file.parent.mkdir(exist_ok=True)
    if data is None:
        file.unlink(missing_ok=True)
    elif not (data is PICTURE and file.exists()):
        file.write_bytes(data)


def data_set(kind: str, name: str, listed: str) -> Target:
    """Return a target that reads a data set of one view, as a card lists it, with its picture."""
    files = [{"name": listed, "views": 1}]
    card = {"schema": "toonset-dataset/1", "format": kind, "splits": {"train": {"files": files}}}

    def read(path: Path) -> None:
        _write(path.with_name("card.json"), json.dumps(card).encode())
        ViewDataset(path.parent)[0]

    return file_of(name, read)


def in_folder(read: Reader) -> Reader:
    """Return a reader of a file's folder."""
    return lambda file: read(file.parent)


def _targets() -> Iterator[tuple[str, Target]]:
    yield "sheet", sheet
    yield "picture", picture
    for kind in ("gpl", "ase", "aco", "hex"):
        yield kind, file_of(f"a.{kind}", *COLORS)
    yield "palette.json", file_of("palette.json", *COLORS, read_palette_json)
    yield "transforms.json", file_of("transforms.json", read_cameras, in_folder(read_import))
    yield "toonset.json", file_of("toonset.json", in_folder(read_import))
    yield "calibration.json", file_of("calibration.json", read_calibration)
    yield "split.json", file_of("split.json", in_folder(read_records), read_boxes)
    for end in ("txt", "bin"):
        first, *others = (f"{name}.{end}" for name in MODEL)
        yield f"colmap.{end}", file_of(first, in_folder(read_import), beside=(*others,))
    yield "obj", file_of("a.obj", load_mesh, beside=("a.mtl",))
    for kind in ("glb", "gltf", "ply", "stl", "off"):
        yield kind, file_of(f"a.{kind}", load_mesh)
    for kind in ("json", "csv"):
        clicked = partial(read_landmarks, views=VIEWS, known={"nose": (0.0, 1.3, 0.3)})
        yield f"landmarks.{kind}", file_of(f"a.{kind}", clicked)
        yield f"boxes.{kind}", file_of(f"a.{kind}", read_boxes)
    yield "corrections.json", file_of("a.json", read_corrections)
    for kind in ("csv", "jsonl"):
        yield (
            f"manifest.{kind}",
            file_of(f"a.{kind}", lambda file: list_sheets([str(file)], {}, VERBS)),
        )
    yield "data.tar", data_set("webdataset", "a.tar", "a.tar")
    yield "data.parquet", data_set("parquet", "a.parquet", "a.parquet")
    yield "data.jsonl", data_set("folder", "metadata.jsonl", ".")


COLORS: tuple[Reader, ...] = (
    lambda file: parse_colors(str(file)),
    lambda file: names_tones(str(file)),
    lambda file: palette_names([str(file)]),
)
TARGETS: dict[str, Target] = dict(_targets())
