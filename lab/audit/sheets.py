"""R1: sheets that are broken, strange or hostile, through split, palette and calibrate."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from lab.audit.case import Case, Row, run_cases
from lab.audit.material import Material

Make = Callable[[Path], object]
VERBS = {"split": ("-o", "o"), "palette": ("-o", "o"), "calibrate": ("--mesh", "m.obj", "-o", "o")}
LARGE = (8900, 8870)  # 79 megapixels; 80 are read at most
NAMES = (
    *("n\udcff.png", "a\x1b[31mb.png", "new\nline.png", "-dash.png", '"; import os.png'),
    *("u" * 251 + ".png", "日本.png", "%s%n.png", "..png", " .png", "a\u202eb.png", "<script>.png"),
    "'$(x)`.png",
)  # fmt: skip


def row(material: Material) -> Row:
    """Run all three verbs on every file."""
    return run_cases(cases(material), material.work)


def cases(material: Material) -> Iterator[Case]:
    """Yield each file with each verb."""
    sheet = Image.open(material.root / "sheet.png").convert("RGB")
    rng = np.random.default_rng(material.seed)
    files = [*pictures(sheet, rng), *containers(sheet), *broken(material, rng), *places(material)]
    files += [(name, partial(material.copy, "sheet.png")) for name in NAMES]
    for name, make in files:
        for verb, options in VERBS.items():

            def prepare(folder: Path, name: str = name, make: Make = make) -> None:
                material.copy_all(folder, "m.obj")
                make(folder / name)

            given = f"./{name}" if name.startswith("-") else name
            yield Case(f"{verb} {name}", (verb, given, *options), prepare)


def saved(picture: Image.Image, **options: Any) -> Make:
    return lambda path: picture.save(path, **options)


def written(data: bytes) -> Make:
    return lambda path: path.write_bytes(data)


def flat(size: tuple[int, int], color: str = "white") -> Make:
    return lambda path: Image.new("RGB", size, color).save(path)


def pictures(sheet: Image.Image, rng: np.random.Generator) -> Iterator[tuple[str, Make]]:
    """Yield sizes, colours and what is drawn: too little, too much, nothing."""
    for size in ((1, 1), (1, 500), (500, 1), (2, 2), (3, 3), (16, 16), (5000, 3), LARGE):
        yield f"flat-{size[0]}x{size[1]}.png", flat(size)
    for color in ("black", "red", "#fefefe"):
        yield f"all-{color.strip('#')}.png", flat((300, 200), color)
    for dots in (1, 2, 5, 100):
        dusty = Image.new("RGB", (600, 300), "white")
        for x, y in rng.integers(0, 300, (dots, 2)).tolist():
            dusty.putpixel((x, y), (0, 0, 0))
        yield f"dust-{dots}.png", saved(dusty)
    for shape in ((64, 64, 3), (200, 300, 3), (120, 160, 4), (90, 90)):
        noise = Image.fromarray(rng.integers(0, 256, shape, dtype=np.uint8))
        yield f"noise-{'x'.join(map(str, shape))}.png", saved(noise)
    for count in (1, 2, 8):
        boxes = np.full((120, 60 * count, 3), 255, np.uint8)
        for i in range(count):
            boxes[10:110, 60 * i + 10 : 60 * i + 50] = (200, 30, 20)
        yield f"boxes-{count}.png", saved(Image.fromarray(boxes))
    stripes = np.full((200, 300, 3), 255, np.uint8)
    stripes[::2] = 0
    yield "stripes.png", saved(Image.fromarray(stripes))
    for name, color in (
        ("clear", (0, 0, 0, 0)),
        ("faint", (200, 0, 0, 1)),
        ("half", (0, 9, 0, 128)),
    ):
        yield f"{name}.png", saved(Image.new("RGBA", (200, 100), color))
    yield "upscaled.png", saved(sheet.resize((sheet.width * 6, sheet.height * 6)))
    yield "tiny.png", saved(sheet.resize((sheet.width // 8, sheet.height // 8)))
    yield "wide.png", saved(sheet.resize((sheet.width * 10, sheet.height // 4)))
    yield "upside-down.png", saved(sheet.transpose(Image.Transpose.FLIP_TOP_BOTTOM))
    yield "negative.png", saved(sheet.point(lambda level: 255 - level))
    yield "cropped.png", saved(sheet.crop((30, 20, sheet.width - 40, sheet.height - 30)))


def containers(sheet: Image.Image) -> Iterator[tuple[str, Make]]:
    """Yield modes, depths and file formats, well-formed ones."""
    for mode in ("1", "L", "LA", "P", "RGBA", "I;16", "I", "CMYK", "F", "YCbCr", "HSV", "LAB"):
        suffix = "png" if mode in ("1", "L", "LA", "P", "RGBA", "I;16") else "tif"
        source = sheet.convert("L") if mode in ("I;16", "I", "F") else sheet
        save = sheet.convert("RGB") if mode == "HSV" else source.convert(mode)
        yield f"mode-{mode.replace(';', '-')}.{suffix}", saved(save)
    for suffix in ("jpg", "webp", "bmp", "tif", "gif", "ppm", "tga", "ico", "jp2", "avif", "pcx"):
        yield f"format.{suffix}", saved(sheet)
    for quality in (1, 30):
        yield f"quality-{quality}.jpg", saved(sheet, quality=quality)
    yield "progressive.jpg", saved(sheet, progressive=True)
    yield "cmyk.jpg", saved(sheet.convert("CMYK"))
    yield "lossless.webp", saved(sheet, lossless=True)
    yield "lzw.tif", saved(sheet, compression="tiff_lzw")
    turned = Image.Exif()
    for orientation in (3, 6, 8, 99):
        turned[0x0112] = orientation
        yield f"exif-{orientation}.jpg", saved(sheet, exif=turned.tobytes())
    frames = [sheet.rotate(180)]
    for suffix in ("gif", "png", "webp", "tif"):
        yield f"animated.{suffix}", saved(sheet, save_all=True, append_images=frames)
    yield "named-jpg.jpg", saved(sheet, format="PNG")
    yield "named-png.png", saved(sheet, format="JPEG")
    yield "no-extension", saved(sheet, format="PNG")
    yield "clear-palette.png", saved(sheet.convert("P"), transparency=0)


def png(width: int, height: int, depth: int = 8, kind: int = 2, data: bytes = b"") -> bytes:
    """Return a PNG that declares a size, whatever its data holds."""

    def chunk(name: bytes, body: bytes) -> bytes:
        return (
            struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        )

    head = struct.pack(">IIBBBBB", width, height, depth, kind, 0, 0, 0)
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(data, 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in parts)


def broken(material: Material, rng: np.random.Generator) -> Iterator[tuple[str, Make]]:
    """Yield files that are cut, flipped, lie about their size, or are something else."""
    whole = (material.root / "sheet.png").read_bytes()
    yield "empty.png", written(b"")
    for share in (0.001, 0.01, 0.1, 0.5, 0.9, 0.999):
        yield f"cut-{share}.png", written(whole[: max(1, int(share * len(whole)))])
    for i in range(8):
        flipped = bytearray(whole)
        flipped[rng.integers(8, len(whole))] ^= 1 << int(rng.integers(8))
        yield f"flip-{i}.png", written(bytes(flipped))
    yield "longer.png", written(whole + b"x" * 1000)
    for width, height in ((70_000_000, 1), (1, 70_000_000), (2**31 - 1, 2**31 - 1), (0, 5), (9, 9)):
        yield f"bomb-{width}x{height}.png", written(png(width, height))
    yield "bomb-zeros.png", written(png(8900, 8900, data=bytes(8900 * 8900 * 3)))
    yield "bomb-inflates.png", written(png(10, 10, data=bytes(300_000_000)))
    yield "depth-16.png", written(png(40, 40, 16, 2, (b"\0" + bytes(240)) * 40))
    yield "no-palette.png", written(png(40, 40, 8, 3, (b"\0" + bytes(40)) * 40))
    for name, data in (("text", b"hello\n"), ("zip", b"PK\x03\x04abcd"), ("nul", bytes(9999))):
        yield f"{name}.png", written(data)
    yield "svg.svg", written(b"<svg xmlns='http://www.w3.org/2000/svg'/>")


def places(material: Material) -> Iterator[tuple[str, Make]]:
    """Yield what is no regular file, or one that must not be read."""
    yield "missing.png", lambda path: None
    yield "folder.png", lambda path: path.mkdir()
    yield "fifo.png", lambda path: os.mkfifo(path)
    yield "zero.png", lambda path: path.symlink_to("/dev/zero")
    yield "link.png", lambda path: path.symlink_to(material.root / "sheet.png")
    yield "loop.png", lambda path: path.symlink_to(path)
    yield "dangling.png", lambda path: path.symlink_to("nothing")

    def unreadable(path: Path) -> None:
        material.copy("sheet.png", path)
        path.chmod(0)

    yield "unreadable.png", unreadable
