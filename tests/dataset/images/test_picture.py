"""Pictures: every way a file can be odd is handled rightly or refused by name."""

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms

from toonset.dataset.images.picture import (
    encode_indexed_png,
    encode_png,
    load_indexed_png,
    load_rgba,
    picture_size,
)
from toonset.errors import PictureError


def drawing(height: int = 8, width: int = 12) -> np.ndarray:
    """Return a picture whose four quadrants differ, so that turns and mirrors show."""
    rgb = np.zeros((height, width, 3), dtype=np.uint8)
    rgb[: height // 2, : width // 2] = (200, 30, 40)
    rgb[: height // 2, width // 2 :] = (20, 130, 40)
    rgb[height // 2 :, : width // 2] = (255, 255, 255)
    rgb[height // 2 :, width // 2 :] = (10, 20, 230)
    return rgb


def bytes_of(image: Image.Image, kind: str, **options: object) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, kind, **options)
    return buffer.getvalue()


def noise(size: int = 64) -> Image.Image:
    return Image.fromarray(np.random.default_rng(0).integers(0, 255, (size, size, 3), np.uint8))


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(
    width: int, height: int, bits: int, color: int, raw: bytes, extra: tuple[bytes, ...] = ()
) -> bytes:
    header = struct.pack(">IIBBBBB", width, height, bits, color, 0, 0, 0)
    parts = [chunk(b"IHDR", header), *extra, chunk(b"IDAT", zlib.compress(raw))]
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts) + chunk(b"IEND", b"")


RGB = drawing()
OPAQUE = np.dstack([RGB, np.full(RGB.shape[:2], 255, dtype=np.uint8)])
LOSSLESS = ("PNG", "TIFF", "BMP")


@pytest.mark.parametrize("kind", LOSSLESS)
def test_lossless_pictures_come_back_exactly(kind: str, tmp_path: Path) -> None:
    file = tmp_path / "a"
    file.write_bytes(bytes_of(Image.fromarray(RGB), kind))
    assert np.array_equal(load_rgba(file), OPAQUE)


@pytest.mark.parametrize(("kind", "options"), [("JPEG", {"quality": 95}), ("WEBP", {})])
def test_lossy_pictures_come_back_nearly(
    kind: str, options: dict[str, int], tmp_path: Path
) -> None:
    rgb = drawing(64, 96)
    file = tmp_path / "a"
    file.write_bytes(bytes_of(Image.fromarray(rgb), kind, **options))
    difference = np.abs(load_rgba(file)[..., :3].astype(int) - rgb)
    assert np.median(difference) <= 3


def test_format_is_told_by_content_not_by_name(tmp_path: Path) -> None:
    file = tmp_path / "sheet.jpg"
    file.write_bytes(encode_png(OPAQUE))
    assert np.array_equal(load_rgba(file), OPAQUE)


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "WEBP"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_orientation_is_applied(kind: str, orientation: int, tmp_path: Path) -> None:
    upright = Image.fromarray(drawing(32, 48))
    undo = {  # stored pixels such that applying the orientation gives the upright picture
        1: None,
        2: Image.Transpose.FLIP_LEFT_RIGHT,
        3: Image.Transpose.ROTATE_180,
        4: Image.Transpose.FLIP_TOP_BOTTOM,
        5: Image.Transpose.TRANSPOSE,
        6: Image.Transpose.ROTATE_90,
        7: Image.Transpose.TRANSVERSE,
        8: Image.Transpose.ROTATE_270,
    }[orientation]
    stored = upright if undo is None else upright.transpose(undo)
    exif = Image.Exif()
    exif[0x0112] = orientation
    file = tmp_path / "a"
    file.write_bytes(bytes_of(stored, kind, exif=exif, quality=98))
    found = load_rgba(file)
    assert picture_size(file) == (48, 32)
    assert found.shape == (32, 48, 4)
    corners = found[[4, 4, -5, -5], [4, -5, 4, -5], :3].astype(int)
    expected = drawing(32, 48)[[4, 4, -5, -5], [4, -5, 4, -5]].astype(int)
    assert np.abs(corners - expected).max() < 12


def test_palette_with_transparent_entry(tmp_path: Path) -> None:
    image = Image.fromarray(RGB).convert("P", palette=Image.Palette.ADAPTIVE, colors=4)
    hidden = int(np.asarray(image)[0, 0])
    file = tmp_path / "a.png"
    file.write_bytes(bytes_of(image, "PNG", transparency=hidden))
    found = load_rgba(file)
    assert np.array_equal(found[..., 3] == 0, np.asarray(image) == hidden)
    assert np.array_equal(found[found[..., 3] > 0, :3], RGB[found[..., 3] > 0])


def test_gif_keeps_its_transparency(tmp_path: Path) -> None:
    image = Image.fromarray(RGB).convert("P", palette=Image.Palette.ADAPTIVE, colors=4)
    file = tmp_path / "a.gif"
    file.write_bytes(bytes_of(image, "GIF", transparency=int(np.asarray(image)[0, 0])))
    assert np.array_equal(
        load_rgba(file)[..., 3] == 0, np.asarray(image) == np.asarray(image)[0, 0]
    )


def test_rgb_with_one_transparent_colour(tmp_path: Path) -> None:
    file = tmp_path / "a.png"
    file.write_bytes(bytes_of(Image.fromarray(RGB), "PNG", transparency=(255, 255, 255)))
    assert np.array_equal(load_rgba(file)[..., 3] == 0, (RGB == 255).all(axis=2))


def test_grey_grey_alpha_and_one_bit(tmp_path: Path) -> None:
    grey = np.arange(0, 96, dtype=np.uint8).reshape(8, 12) * 2
    file = tmp_path / "a.png"
    file.write_bytes(bytes_of(Image.fromarray(grey), "PNG"))
    assert np.array_equal(load_rgba(file), np.dstack([grey, grey, grey, np.full_like(grey, 255)]))
    both = Image.merge("LA", (Image.fromarray(grey), Image.fromarray(255 - grey)))
    file.write_bytes(bytes_of(both, "PNG"))
    assert np.array_equal(load_rgba(file), np.dstack([grey, grey, grey, 255 - grey]))
    bits = grey > 90
    file.write_bytes(bytes_of(Image.fromarray(bits), "PNG"))
    assert np.array_equal(load_rgba(file)[..., 1], bits * np.uint8(255))


def test_16_bit_grey_is_scaled_not_wrapped(tmp_path: Path) -> None:
    values = np.linspace(0, 65535, 96).astype(np.uint16).reshape(8, 12)
    for kind in ("PNG", "TIFF"):
        file = tmp_path / "a"
        file.write_bytes(bytes_of(Image.fromarray(values), kind))
        assert np.abs(load_rgba(file)[..., 0] - values / 257).max() <= 0.5


@pytest.mark.parametrize("color", [2, 6])
def test_16_bit_colour_is_scaled_not_wrapped(color: int, tmp_path: Path) -> None:
    channels = {2: 3, 6: 4}[color]
    values = np.random.default_rng(1).integers(0, 65536, (8, 12, channels), dtype=np.uint16)
    raw = b"".join(b"\0" + row.astype(">u2").tobytes() for row in values)
    file = tmp_path / "a.png"
    file.write_bytes(png(12, 8, 16, color, raw))
    assert np.abs(load_rgba(file)[..., :channels] - values / 257.0).max() <= 1


def test_foreign_profile_is_converted_and_srgb_left_alone(tmp_path: Path) -> None:
    file = tmp_path / "a.png"
    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    file.write_bytes(bytes_of(Image.fromarray(RGB), "PNG", icc_profile=srgb))
    assert np.array_equal(load_rgba(file), OPAQUE)
    swapped = bytearray(srgb)  # a profile whose red and blue primaries are exchanged
    red, blue = swapped.index(b"rXYZ"), swapped.index(b"bXYZ")
    swapped[red : red + 4], swapped[blue : blue + 4] = b"bXYZ", b"rXYZ"
    file.write_bytes(bytes_of(Image.fromarray(RGB), "PNG", icc_profile=bytes(swapped)))
    assert np.abs(load_rgba(file)[..., :3].astype(int) - RGB[..., ::-1]).max() <= 2


def test_encoded_pictures_come_back(tmp_path: Path) -> None:
    rgba = np.random.default_rng(2).integers(0, 256, (9, 7, 4), dtype=np.uint8)
    file = tmp_path / "a.png"
    file.write_bytes(encode_png(rgba))
    assert np.array_equal(load_rgba(file), rgba)


@pytest.mark.parametrize("colors", [1, 3, 255])
def test_labels_come_back_and_carry_their_palette(colors: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(colors)
    palette = rng.integers(0, 256, (colors, 3), dtype=np.uint8)
    labels = rng.integers(0, colors, (9, 7), dtype=np.uint8)
    labels[2:4, 3] = 255
    file = tmp_path / "a.png"
    file.write_bytes(encode_indexed_png(labels, palette))
    assert np.array_equal(load_indexed_png(file), labels)
    shown = load_rgba(file)
    assert np.array_equal(shown[..., 3] == 0, labels == 255)
    assert np.array_equal(shown[labels != 255, :3], palette[labels[labels != 255]])


def test_labels_without_a_colour_are_refused() -> None:
    with pytest.raises(PictureError, match="labels up to 3 and 3 colours"):
        encode_indexed_png(np.full((2, 2), 3, np.uint8), np.zeros((3, 3), np.uint8))


def test_labels_need_an_indexed_png(tmp_path: Path) -> None:
    file = tmp_path / "a.png"
    file.write_bytes(encode_png(OPAQUE))
    with pytest.raises(PictureError, match="mode RGBA, an indexed PNG is needed"):
        load_indexed_png(file)


def bomb(side: int) -> bytes:
    return png(side, side, 8, 2, bytes(1000))


def flipped_bit(data: bytes) -> bytes:
    return data[:-40] + bytes([data[-40] ^ 64]) + data[-39:]


NOISE_PNG, NOISE_JPEG = bytes_of(noise(), "PNG"), bytes_of(noise(), "JPEG")
CMYK = Image.new("CMYK", (8, 8), (10, 20, 30, 0))
FRAMES = [Image.new("RGB", (8, 8), color) for color in ("red", "blue")]
TRNS_16 = chunk(b"tRNS", struct.pack(">HHH", 60000, 5, 5))
BAD_FILES = {
    "empty": (b"", r"is empty \(0 bytes\)"),
    "text": (b"hello\n" * 20, "is text, no picture"),
    "binary": (bytes(range(256)), "of an unknown kind, no picture"),
    "obj": (b"v 0 0 0\n", "is text, no picture"),
    "glb": (b"glTF\2\0\0\0", "is a glTF mesh, no picture"),
    "zip": (b"PK\x03\x04" + bytes(40), "is a zip archive"),
    "psd": (b"8BPS\0\1" + bytes(40), "is a Photoshop file"),
    "pdf": (b"%PDF-1.4\n", "is a PDF"),
    "svg": (b'<?xml version="1.0"?><svg width="9">', "is an SVG drawing"),
    "heic": (b"\0\0\0\x18ftypheic" + bytes(20), "HEIC or AVIF"),
    "eps": (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", "is a PostScript file"),
    "png cut": (NOISE_PNG[: len(NOISE_PNG) // 2], "PNG file is damaged or cut off"),
    "png cut in header": (NOISE_PNG[:20], "damaged or cut off"),
    "png without end": (NOISE_PNG[:-12], "its end is missing"),
    "png crc": (flipped_bit(NOISE_PNG), "PNG file is damaged or cut off"),
    "jpeg cut": (NOISE_JPEG[: len(NOISE_JPEG) // 2], "JPEG file is damaged or cut off"),
    "jpeg cut in header": (NOISE_JPEG[:10], "JPEG file is damaged or cut off"),
    "gif cut": (bytes_of(noise(), "GIF")[:1500], "damaged or cut off"),
    "webp cut": (bytes_of(noise(), "WEBP")[:500], "damaged or cut off|no picture"),
    "bmp cut": (bytes_of(noise(), "BMP")[:500], "damaged or cut off"),
    "tiff cut": (bytes_of(noise(), "TIFF")[:3000], "damaged or cut off"),
    "30k bomb": (bomb(30_000), "far more than 80 megapixels"),
    "13k bomb": (bomb(13_000), "far more than 80 megapixels"),
    "9k bomb": (bomb(9_200), "9200 x 9200 pixels, at most 80 megapixels"),
    "no size": (png(0, 0, 8, 2, b""), "damaged or cut off"),
    "cmyk jpeg": (bytes_of(CMYK, "JPEG"), "is CMYK without a colour profile"),
    "cmyk tiff": (bytes_of(CMYK, "TIFF"), "is CMYK without a colour profile"),
    "float tiff": (bytes_of(Image.new("F", (8, 8)), "TIFF"), "pixels of kind F"),
    "32 bit tiff": (bytes_of(Image.new("I", (8, 8)), "TIFF"), "pixels of kind I"),
    "lab tiff": (bytes_of(Image.new("LAB", (8, 8)), "TIFF"), "pixels of kind LAB"),
    "16 bit with transparent colour": (
        png(2, 2, 16, 2, (b"\0" + bytes(12)) * 2, (TRNS_16,)),
        "16-bit PNG with a transparent colour",
    ),
    "apng": (
        bytes_of(FRAMES[0], "PNG", save_all=True, append_images=FRAMES[1:]),
        "animated or multi-page PNG",
    ),
    "gif": (
        bytes_of(FRAMES[0], "GIF", save_all=True, append_images=FRAMES[1:]),
        "animated or multi-page GIF",
    ),
    "webp": (
        bytes_of(FRAMES[0], "WEBP", save_all=True, append_images=FRAMES[1:]),
        "animated or multi-page WEBP",
    ),
    "tiff pages": (
        bytes_of(FRAMES[0], "TIFF", save_all=True, append_images=FRAMES[1:]),
        "animated or multi-page TIFF",
    ),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_files_are_refused_by_name(case: str, tmp_path: Path) -> None:
    data, fragment = BAD_FILES[case]
    file = tmp_path / "sheet.png"
    file.write_bytes(data)
    with pytest.raises(PictureError, match=fragment) as caught:
        load_rgba(file)
    assert str(caught.value).startswith(str(file))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.3, 0.6, 0.9, 0.99])
@pytest.mark.parametrize("kind", ["PNG", "JPEG", "GIF", "WEBP", "BMP", "TIFF"])
def test_no_cut_file_is_ever_read(kind: str, share: float, tmp_path: Path) -> None:
    data = bytes_of(noise(), kind)
    file = tmp_path / "a"
    file.write_bytes(data[: int(len(data) * share)])
    with pytest.raises(PictureError):
        load_rgba(file)


def test_places_that_are_no_files(tmp_path: Path) -> None:
    with pytest.raises(PictureError, match="no such file"):
        load_rgba(tmp_path / "none.png")
    with pytest.raises(PictureError, match="is a folder, a picture file is needed"):
        load_rgba(tmp_path)
    with pytest.raises(PictureError, match="is no regular file"):
        load_rgba(Path("/dev/null"))
    with pytest.raises(PictureError, match="cannot be read"):
        load_rgba(tmp_path / ("x" * 300))


def test_a_name_that_is_not_utf_8(tmp_path: Path) -> None:
    file = tmp_path / b"bl\xfcte.png".decode(errors="surrogateescape")
    file.write_bytes(encode_png(OPAQUE))
    assert np.array_equal(load_rgba(file), OPAQUE)
