"""Working files: the picture of all layers together is read, capped and checked before it is."""

import builtins
import io
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from toonset.dataset.images.picture import load_rgba, picture_size
from toonset.errors import PictureError

SIZE = (12, 8)


def figure() -> np.ndarray:
    rgba = np.zeros((SIZE[1], SIZE[0], 4), np.uint8)
    rgba[2:6, 3:9] = (200, 30, 40, 255)
    return rgba


def png(rgba: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(rgba).save(buffer, "PNG")
    return buffer.getvalue()


def zipped(**members: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name.replace("_", "."), data)
    return buffer.getvalue()


@pytest.mark.parametrize("name", ["hero.kra", "hero.ora", "hero.png"])
def test_krita_and_openraster_files_are_their_merged_picture(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(zipped(mimetype=b"x", mergedimage_png=png(figure())))
    np.testing.assert_array_equal(load_rgba(tmp_path / name), figure())
    assert picture_size(tmp_path / name) == SIZE


KRITA = zipped(maindoc_xml=b"<DOC/>", mergedimage_png=png(figure()))
BAD_ZIPS = [
    (zipped(maindoc_xml=b"<DOC/>"), "is a Krita file without a picture of all its layers"),
    (zipped(stack_xml=b"<image/>"), "is an OpenRaster file without"),
    (zipped(Document_archive=b"x"), "is a Procreate file without"),
    (zipped(a_txt=b"x"), "is a zip archive without"),
    (zipped(mergedimage_png=b"hello"), "is text, no picture that can be read"),
    (KRITA[: len(KRITA) // 2], "damaged or cut off"),
    (KRITA[:40] + bytes(20) + KRITA[60:], "damaged or cut off|is a zip archive without"),
]


@pytest.mark.parametrize(("data", "words"), BAD_ZIPS, ids=range(len(BAD_ZIPS)))
def test_other_zips_are_refused_by_name(data: bytes, words: str, tmp_path: Path) -> None:
    (tmp_path / "a.kra").write_bytes(data)
    with pytest.raises(PictureError, match=words):
        load_rgba(tmp_path / "a.kra")


@pytest.mark.parametrize("announced", [None, 100])
def test_a_zip_bomb_is_not_unpacked(
    announced: int | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither one that says how large it is nor one that lies."""
    monkeypatch.setattr("toonset.dataset.images.zipped.MAX_BYTES", 10_000)
    data = zipped(mergedimage_png=bytes(1_000_000))
    if announced is not None:
        data = data.replace(struct.pack("<I", 1_000_000), struct.pack("<I", announced))
    (tmp_path / "a.ora").write_bytes(data)
    with pytest.raises(PictureError, match=r"unpacks to more than|damaged"):
        load_rgba(tmp_path / "a.ora")


# ---- Photoshop --------------------------------------------------------------------------------


def psd_header(
    width: int = 12, height: int = 8, depth: int = 8, mode: int = 3, version: int = 1
) -> bytes:
    return struct.pack(">4sH6xHIIHH", b"8BPS", version, 3, height, width, depth, mode)


def psd(rgb: np.ndarray) -> bytes:
    """Return a flat PSD of unpacked channels."""
    height, width = rgb.shape[:2]
    head = psd_header(width, height) + bytes(12)  # no palette, resources or layers
    return head + b"\0\0" + rgb.transpose(2, 0, 1).tobytes()


BAD_PSDS = [
    (b"8BPS\0\1" + bytes(10), "damaged or cut off"),
    (psd_header(30_000, 30_000), "30000 x 30000 pixels, at most 80 megapixels"),
    (psd_header(300_000, 300_000, version=2), "at most 80 megapixels"),
    (psd_header(0, 9), "damaged or cut off"),
    (psd_header(mode=9), "is a Lab Photoshop file"),
    (psd_header(mode=8), "is a duotone Photoshop file"),
    (psd_header(depth=32), "is a 32-bit Photoshop file"),
    (psd(figure()[..., :3])[:-9], "damaged or cut off"),
    (psd_header() + bytes(12) + b"\0\1" + bytes(20), "damaged or cut off"),
    (psd_header() + b"\xff" * 20, "damaged or cut off"),
]


@pytest.mark.parametrize(("data", "words"), BAD_PSDS, ids=range(len(BAD_PSDS)))
def test_photoshop_files_are_checked_from_their_header(
    data: bytes, words: str, tmp_path: Path
) -> None:
    (tmp_path / "a.psd").write_bytes(data)
    with pytest.raises(PictureError, match=words):
        load_rgba(tmp_path / "a.psd")


def test_photoshop_files_come_back(tmp_path: Path) -> None:
    pytest.importorskip("psd_tools")
    rgb = figure()[..., :3]
    (tmp_path / "a.psd").write_bytes(psd(rgb))
    np.testing.assert_array_equal(load_rgba(tmp_path / "a.psd")[..., :3], rgb)
    assert picture_size(tmp_path / "a.psd") == SIZE


def test_a_photoshop_file_with_transparency_comes_back(tmp_path: Path) -> None:
    psd_tools = pytest.importorskip("psd_tools")
    psd_tools.PSDImage.frompil(Image.fromarray(figure())).save(tmp_path / "a.psd")
    read = load_rgba(tmp_path / "a.psd")
    np.testing.assert_array_equal(read[..., 3], figure()[..., 3])
    np.testing.assert_array_equal(read[read[..., 3] > 0], figure()[read[..., 3] > 0])


def test_a_photoshop_file_without_a_merged_picture_is_refused(tmp_path: Path) -> None:
    psd_tools = pytest.importorskip("psd_tools")
    document = psd_tools.PSDImage.new("RGB", SIZE, color=255)
    document.create_pixel_layer(Image.fromarray(figure()), name="front")
    buffer = io.BytesIO()
    document.save(buffer)
    blank = bytearray(buffer.getvalue())
    at = len(blank) - blank_length(bytes(blank))
    blank[at:] = b"\0\0" + b"\xff" * (3 * SIZE[0] * SIZE[1])
    (tmp_path / "a.psd").write_bytes(bytes(blank))
    with pytest.raises(PictureError, match="Maximize compatibility"):
        load_rgba(tmp_path / "a.psd")


def blank_length(data: bytes) -> int:
    """Return the length of the merged picture, the last section of a PSD."""
    at = 26
    for _ in range(3):
        at += 4 + int.from_bytes(data[at : at + 4], "big")
    return len(data) - at


# ---- PDF --------------------------------------------------------------------------------------


def pdf(rgb: np.ndarray, page_wh: tuple[float, float], pages: int = 1) -> bytes:
    """Return a PDF whose pages are filled by a picture."""
    height, width = rgb.shape[:2]
    raw = zlib.compress(rgb.tobytes())
    draw = b"q %g 0 0 %g 0 0 cm /I Do Q" % page_wh
    picture = b"/Subtype/Image/ColorSpace/DeviceRGB/BitsPerComponent 8/Filter/FlateDecode"
    page = b"<</Type/Page/Parent 2 0 R/MediaBox[0 0 %g %g]" % page_wh
    objects = [
        b"<</Type/Catalog/Pages 2 0 R>>",
        b"<</Type/Pages/Kids[%s]/Count %d>>" % (b"3 0 R " * pages, pages),
        page + b"/Contents 4 0 R/Resources<</XObject<</I 5 0 R>>>>>>",
        b"<</Length %d>>stream\n%s\nendstream" % (len(draw), draw),
        b"<</Type/XObject%s/Width %d/Height %d/Length %d>>stream\n%s\nendstream"
        % (picture, width, height, len(raw), raw),
    ]
    body = b"".join(b"%d 0 obj\n%s\nendobj\n" % (n, one) for n, one in enumerate(objects, start=1))
    return b"%PDF-1.4\n" + body + b"trailer<</Root 1 0 R>>"


@pytest.mark.parametrize("page_wh", [(12, 8), (300, 200), (5.4, 3.6)])
def test_a_page_has_the_pixels_of_the_picture_that_fills_it(
    page_wh: tuple[float, float], tmp_path: Path
) -> None:
    pytest.importorskip("pypdfium2")
    rgb = np.random.default_rng(0).integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
    (tmp_path / "a.pdf").write_bytes(pdf(rgb, page_wh))
    np.testing.assert_array_equal(load_rgba(tmp_path / "a.pdf")[..., :3], rgb)


def test_pages_that_are_refused(tmp_path: Path) -> None:
    pytest.importorskip("pypdfium2")
    rgb = figure()[..., :3]
    for data, words in (
        (pdf(rgb, (12, 8), pages=2), "has 2 pages; save the page that is meant"),
        (pdf(rgb, (12, 8))[:60], "damaged or cut off"),
    ):
        (tmp_path / "a.pdf").write_bytes(data)
        with pytest.raises(PictureError, match=words):
            load_rgba(tmp_path / "a.pdf")
    (tmp_path / "a.pdf").write_bytes(pdf(rgb, (12, 8)))
    with pytest.raises(PictureError, match="megapixels are read"):
        load_rgba(tmp_path / "a.pdf", max_pixels=50)


# ---- without the packages ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("package", "data", "words"),
    [
        ("psd_tools", psd(figure()[..., :3]), r"pip install 'toonset\[psd\]'; or save it as PNG"),
        ("pypdfium2", pdf(figure()[..., :3], SIZE), r"pip install 'toonset\[pdf\]'; or save the"),
    ],
)
def test_a_missing_package_is_named(
    package: str, data: bytes, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real: Callable[..., Any] = builtins.__import__

    def without(name: str, *more: Any, **others: Any) -> Any:
        if name.split(".")[0] == package:
            raise ImportError(name)
        return real(name, *more, **others)

    monkeypatch.setattr(builtins, "__import__", without)
    (tmp_path / "a.png").write_bytes(data)
    with pytest.raises(PictureError, match=words) as caught:
        load_rgba(tmp_path / "a.png")
    assert "\n" not in str(caught.value)
