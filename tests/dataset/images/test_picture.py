"""Pictures: every way a file can be odd is handled rightly or refused by name."""

import io
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms, features

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


@pytest.fixture
def loaded(tmp_path: Path) -> Callable[[bytes], np.ndarray]:
    """Return what loads a file's bytes, whatever the file is called."""

    def load(data: bytes) -> np.ndarray:
        (tmp_path / "sheet.jpg").write_bytes(data)
        return load_rgba(tmp_path / "sheet.jpg")

    return load


@pytest.mark.parametrize("kind", ["PNG", "TIFF", "BMP"])
def test_lossless_pictures_come_back_exactly(kind: str, loaded) -> None:
    assert np.array_equal(loaded(bytes_of(Image.fromarray(RGB), kind)), OPAQUE)
    rgba = np.random.default_rng(2).integers(0, 256, (9, 7, 4), dtype=np.uint8)
    assert np.array_equal(loaded(encode_png(rgba)), rgba)


@pytest.mark.parametrize(("kind", "options"), [("JPEG", {"quality": 95}), ("WEBP", {})])
def test_lossy_pictures_come_back_nearly(kind: str, options: dict[str, int], loaded) -> None:
    rgb = drawing(64, 96)
    found = loaded(bytes_of(Image.fromarray(rgb), kind, **options))
    assert np.median(np.abs(found[..., :3].astype(int) - rgb)) <= 3


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


@pytest.mark.parametrize("kind", ["PNG", "GIF"])
def test_palette_with_transparent_entry(kind: str, loaded) -> None:
    image = Image.fromarray(RGB).convert("P", palette=Image.Palette.ADAPTIVE, colors=4)
    hidden = int(np.asarray(image)[0, 0])
    found = loaded(bytes_of(image, kind, transparency=hidden))
    assert np.array_equal(found[..., 3] == 0, np.asarray(image) == hidden)
    assert np.array_equal(found[found[..., 3] > 0, :3], RGB[found[..., 3] > 0])


def test_rgb_with_one_transparent_colour(loaded) -> None:
    found = loaded(bytes_of(Image.fromarray(RGB), "PNG", transparency=(255, 255, 255)))
    assert np.array_equal(found[..., 3] == 0, (RGB == 255).all(axis=2))


def test_grey_grey_alpha_and_one_bit(loaded) -> None:
    grey = np.arange(0, 96, dtype=np.uint8).reshape(8, 12) * 2
    both = Image.merge("LA", (Image.fromarray(grey), Image.fromarray(255 - grey)))
    for image, alpha in ((Image.fromarray(grey), np.full_like(grey, 255)), (both, 255 - grey)):
        assert np.array_equal(loaded(bytes_of(image, "PNG")), np.dstack([grey, grey, grey, alpha]))
    bits = grey > 90
    found = loaded(bytes_of(Image.fromarray(bits), "PNG"))
    assert np.array_equal(found[..., 1], bits * np.uint8(255))


@pytest.mark.parametrize("kind", ["PNG", "TIFF"])
def test_16_bit_grey_is_scaled_not_wrapped(kind: str, loaded) -> None:
    values = np.linspace(0, 65535, 96).astype(np.uint16).reshape(8, 12)
    found = loaded(bytes_of(Image.fromarray(values), kind))
    assert np.abs(found[..., 0] - values / 257).max() <= 0.5


@pytest.mark.parametrize(("color", "channels"), [(2, 3), (6, 4)])
def test_16_bit_colour_is_scaled_not_wrapped(color: int, channels: int, loaded) -> None:
    values = np.random.default_rng(1).integers(0, 65536, (8, 12, channels), dtype=np.uint16)
    raw = b"".join(b"\0" + row.astype(">u2").tobytes() for row in values)
    found = loaded(png(12, 8, 16, color, raw))
    assert np.abs(found[..., :channels] - values / 257.0).max() <= 1


def test_foreign_profile_is_converted_and_srgb_left_alone(loaded) -> None:
    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    plain = loaded(bytes_of(Image.fromarray(RGB), "PNG", icc_profile=srgb))
    assert np.array_equal(plain, OPAQUE)
    swapped = bytearray(srgb)  # a profile whose red and blue primaries are exchanged
    red, blue = swapped.index(b"rXYZ"), swapped.index(b"bXYZ")
    swapped[red : red + 4], swapped[blue : blue + 4] = b"bXYZ", b"rXYZ"
    found = loaded(bytes_of(Image.fromarray(RGB), "PNG", icc_profile=bytes(swapped)))
    assert np.abs(found[..., :3].astype(int) - RGB[..., ::-1]).max() <= 2


def test_colours_that_cicp_alone_names_are_converted(loaded) -> None:
    """Display P3 as Photoshop and Icon Composer write it; values of ICC's own P3 profile."""
    p3, srgb = (12, 13, 0, 1), (1, 13, 0, 1)
    raw = b"\x00" + bytes([201, 93, 60, 70, 136, 139])  # a row without filter
    header = struct.pack(">IIBBBBB", 2, 1, 8, 2, 0, 0, 0)

    def told(said: tuple[int, ...] | None) -> np.ndarray:
        extra = [] if said is None else [chunk(b"cICP", bytes(said))]
        parts = [chunk(b"IHDR", header), *extra, chunk(b"IDAT", zlib.compress(raw))]
        return loaded(b"\x89PNG\r\n\x1a\n" + b"".join(parts) + chunk(b"IEND", b""))

    np.testing.assert_allclose(
        told(p3)[0, :, :3].astype(int), [(217, 84, 48), (38, 138, 140)], atol=2
    )
    np.testing.assert_array_equal(told(srgb), told(None))
    with pytest.raises(PictureError, match="cICP chunk says colours of kind 9, 16"):
        told((9, 16, 0, 1))


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


def test_labels_need_their_colours_and_an_indexed_png(tmp_path: Path) -> None:
    with pytest.raises(PictureError, match="labels up to 3 and 3 colours"):
        encode_indexed_png(np.full((2, 2), 3, np.uint8), np.zeros((3, 3), np.uint8))
    (tmp_path / "a.png").write_bytes(encode_png(OPAQUE))
    with pytest.raises(PictureError, match="mode RGBA, an indexed PNG is needed"):
        load_indexed_png(tmp_path / "a.png")


def float_tiff() -> bytes:
    """Return a TIFF of RGB in 32-bit floats."""
    tags = [(256, 4, 1, 1), (257, 4, 1, 1), (258, 3, 1, 32), (259, 3, 1, 1), (262, 3, 1, 2)]
    tags += [(273, 4, 1, 200), (277, 3, 1, 3), (278, 4, 1, 1), (279, 4, 1, 12), (339, 3, 1, 3)]
    listed = b"".join(struct.pack("<HHII", *tag) for tag in tags)
    head = b"II*\0" + struct.pack("<IH", 8, len(tags)) + listed + bytes(4)
    return head.ljust(200, b"\0") + struct.pack("<fff", 0.1, 0.2, 0.3)


NOISE_PNG, NOISE_JPEG = bytes_of(noise(), "PNG"), bytes_of(noise(), "JPEG")
CMYK = Image.new("CMYK", (8, 8), (10, 20, 30, 0))
TRNS_16 = chunk(b"tRNS", struct.pack(">HHH", 60000, 5, 5))
BLUE = Image.new("RGB", (8, 8), "blue")
BAD_FILES = [
    (b"", r"is empty \(0 bytes\)"),
    (b"hello\n" * 20, "is text, no picture"),
    (bytes(range(256)), "of an unknown kind, no picture"),
    (b"v 0 0 0\n", "is text, no picture"),
    (b"glTF\2\0\0\0", "is a glTF mesh, no picture"),
    (b"PK\x03\x04" + bytes(40), "zip file is damaged or cut off"),
    (b"8BPS\0\1" + bytes(40), "Photoshop file is damaged or cut off"),
    (b"gimp xcf v011" + bytes(40), "is a GIMP file, no picture"),
    (b"CSFCHUNK" + bytes(40), "is a Clip Studio Paint file"),
    (b"SAI-CANVAS-TYPE0" + bytes(40), "is a PaintTool SAI 2 file"),
    (struct.pack("<IH122xIH60x", 200, 0xA5E0, 16, 0xF1FA), "is an Aseprite file"),
    (b"\xff\x0a" + bytes(40), "is a JPEG XL picture, which is not read; save it as PNG"),
    (b"\0\0\0\x0cJXL \r\n\x87\n" + bytes(40), "is a JPEG XL picture"),
    (b"v/1\x01" + bytes(40), "is an OpenEXR picture"),
    (bytes_of(noise(), "JPEG2000"), "is a JPEG 2000 picture"),
    (bytes_of(noise(), "TGA"), "is a TGA picture"),
    (b"\0\0\0\x18ftypisom" + bytes(20), "is a film"),
    (b"\0\0\0\x18ftypavif" + bytes(20), "an AVIF picture"),
    (float_tiff(), "is a TIFF picture of 32 bit or another kind that is not read"),
    (b'<?xml version="1.0"?><svg width="9">', "is an SVG drawing"),
    (b"\0\0\0\x18ftypheic" + bytes(20), "is a HEIC picture, which is not read; save it as PNG"),
    (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", "is a PostScript file"),
    (NOISE_PNG[: len(NOISE_PNG) // 2], "PNG file is damaged or cut off"),
    (NOISE_PNG[:20], "damaged or cut off"),
    (NOISE_PNG[:-12], "its end is missing"),
    (
        NOISE_PNG[:-40] + bytes([NOISE_PNG[-40] ^ 64]) + NOISE_PNG[-39:],
        "PNG file is damaged or cut off",
    ),
    (NOISE_JPEG[: len(NOISE_JPEG) // 2], "JPEG file is damaged or cut off"),
    (NOISE_JPEG[:10], "JPEG file is damaged or cut off"),
    (bytes_of(noise(), "GIF")[:1500], "damaged or cut off"),
    (bytes_of(noise(), "WEBP")[:500], "damaged or cut off|no picture"),
    (bytes_of(noise(), "BMP")[:500], "damaged or cut off"),
    (bytes_of(noise(), "TIFF")[:3000], "damaged or cut off"),
    (png(30_000, 30_000, 8, 2, bytes(1000)), "far more than 80 megapixels"),
    (png(13_000, 13_000, 8, 2, bytes(1000)), "far more than 80 megapixels"),
    (png(9_200, 9_200, 8, 2, bytes(1000)), "9200 x 9200 pixels, at most 80 megapixels"),
    (png(0, 0, 8, 2, b""), "damaged or cut off"),
    (bytes_of(CMYK, "JPEG"), "is CMYK without a colour profile"),
    (bytes_of(CMYK, "TIFF"), "is CMYK without a colour profile"),
    (bytes_of(Image.new("F", (8, 8)), "TIFF"), "pixels of kind F"),
    (bytes_of(Image.new("I", (8, 8)), "TIFF"), "pixels of kind I"),
    (bytes_of(Image.new("LAB", (8, 8)), "TIFF"), "pixels of kind LAB"),
    (png(2, 2, 16, 2, (b"\0" + bytes(12)) * 2, (TRNS_16,)), "16-bit PNG with a transparent colour"),
    *(
        (
            bytes_of(BLUE, kind, save_all=True, append_images=[Image.new("RGB", (8, 8), "red")]),
            f"animated or multi-page {kind}",
        )
        for kind in ("PNG", "GIF", "WEBP", "TIFF")
    ),
]


@pytest.mark.parametrize(("data", "fragment"), BAD_FILES, ids=range(len(BAD_FILES)))
def test_bad_files_are_refused_by_name(data: bytes, fragment: str, tmp_path: Path) -> None:
    file = tmp_path / "sheet.png"
    file.write_bytes(data)
    with pytest.raises(PictureError, match=fragment) as caught:
        load_rgba(file)
    assert str(caught.value).startswith(str(file))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.3, 0.6, 0.9, 0.99])
@pytest.mark.parametrize("kind", ["PNG", "JPEG", "GIF", "WEBP", "BMP", "TIFF"])
def test_no_cut_file_is_ever_read(kind: str, share: float, loaded) -> None:
    data = bytes_of(noise(), kind)
    with pytest.raises(PictureError):
        loaded(data[: int(len(data) * share)])


def test_places_that_are_no_files(tmp_path: Path) -> None:
    for name in ("dangling", "loop"):
        (tmp_path / name).symlink_to({"dangling": "gone"}.get(name, name))
    for path, words in (
        (tmp_path / "none.png", "no such file"),
        (tmp_path / "dangling", "no such file"),
        (tmp_path / "loop", "cannot be read"),
        (tmp_path, "is a folder, a picture file is needed"),
        (Path("/dev/null"), "is no regular file"),
        (tmp_path / ("x" * 300), "cannot be read"),
    ):
        with pytest.raises(PictureError, match=words):
            load_rgba(path)


def test_a_name_that_is_not_utf_8(tmp_path: Path) -> None:
    file = tmp_path / b"bl\xfcte.png".decode(errors="surrogateescape")
    file.write_bytes(encode_png(OPAQUE))
    assert np.array_equal(load_rgba(file), OPAQUE)


def test_a_tga_without_a_mark_is_known_by_its_name(tmp_path: Path) -> None:
    (tmp_path / "a.tga").write_bytes(bytes_of(noise(), "TGA")[:-26])
    with pytest.raises(PictureError, match="is a TGA picture, which is not read"):
        load_rgba(tmp_path / "a.tga")


@pytest.mark.skipif(not features.check("avif"), reason="this Pillow reads no AVIF")
def test_avif_is_read(loaded) -> None:
    flat = Image.new("RGBA", (16, 16), (200, 30, 40, 255))
    read = loaded(bytes_of(flat, "AVIF", quality=100))
    assert np.abs(read.astype(int) - (200, 30, 40, 255)).max() <= 3
