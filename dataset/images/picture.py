"""Decode and encode pictures in one safe way.

Of working files (Krita, OpenRaster, Photoshop, a PDF's page) it is the picture of all layers
together: see `zipped`, `photoshop` and `pdf` beside this file. Flat pictures are decoded by Pillow
behind an allow-list of formats; the size is capped from the header before anything is decoded. The
format is recognised by content, so a PNG named `.jpg` reads fine and a text file named `.png` does
not. What could be misread is converted properly (`toonset.dataset.images.pixel_modes`) or refused
by name. A PNG's gAMA chunk is ignored, as paint programs do.
"""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import UInt8, UInt16
from PIL import Image, ImageOps, UnidentifiedImageError, features

from toonset.dataset.images import pdf, photoshop, zipped
from toonset.dataset.images.pixel_modes import rgba_of, said_of
from toonset.errors import PictureError
from toonset.palette.pixels.labels import UNLABELLED
from toonset.read import UNKNOWN, describe, read_whole

FLAT = ("PNG", "JPEG", "WEBP", "TIFF", "BMP", "GIF")
FORMATS = (*FLAT, "AVIF") if features.check("avif") else FLAT
MAX_PIXELS = 80_000_000  # 16,384 x 4,096 and a margin; beyond 89 million Pillow suspects a bomb
ORIENTATION_TAG = 0x0112  # EXIF; values 5 to 8 swap width and height
COMPRESSION = 4  # of 0 to 9: as small as 6 on noisy pictures and a quarter faster
PNG_END = b"IEND\xaeB`\x82"


def load_rgba(
    path: str | Path, max_pixels: int = MAX_PIXELS
) -> UInt8[np.ndarray, "height width 4"]:
    """Return a picture as sRGB with straight alpha, upright, 8 bit per channel.

    Args:
        path: a PNG, JPEG, WebP, AVIF, TIFF, BMP or GIF file with one frame, a Krita, OpenRaster
            or Photoshop file, or a PDF with one page.
        max_pixels: a header that announces more is refused before decoding.

    Raises:
        PictureError: the file is missing, unreadable, damaged, cut off, too large, animated, or
            of a kind whose colours cannot be told (CMYK without a profile, 32 bit, Lab), or needs
            a package that is not installed.
    """
    path = Path(path)
    return decode_rgba(read_whole(path, "picture", PictureError), path, max_pixels)


def decode_rgba(
    data: bytes, path: Path, max_pixels: int = MAX_PIXELS
) -> UInt8[np.ndarray, "height width 4"]:
    """Return `load_rgba` of bytes that came from `path` (a mesh's texture, for one).

    Raises:
        PictureError: as `load_rgba`.
    """
    data = _flat(data, path)
    with _opened(data, path, max_pixels) as image:
        image.load()
        ImageOps.exif_transpose(image, in_place=True)
        return rgba_of(image, path, said_of(data))


def picture_size(path: Path, max_pixels: int = MAX_PIXELS) -> tuple[int, int]:
    """Return upright width and height of a picture without decoding it.

    Raises:
        PictureError: as `load_rgba`, as far as the header tells.
    """
    data = _flat(read_whole(path, "picture", PictureError), path)
    with _opened(data, path, max_pixels) as image:
        width, height = image.size
        turned = image.getexif().get(ORIENTATION_TAG) in (5, 6, 7, 8)
        return (height, width) if turned else (width, height)


def load_indexed_png(path: Path, max_pixels: int = MAX_PIXELS) -> UInt8[np.ndarray, "height width"]:
    """Return the palette indices of an indexed PNG, as `encode_indexed_png` writes it.

    Raises:
        PictureError: as `load_rgba`, or the picture has no palette.
    """
    return decode_indexed_png(read_whole(path, "picture", PictureError), path, max_pixels)


def decode_indexed_png(
    data: bytes, path: Path, max_pixels: int = MAX_PIXELS
) -> UInt8[np.ndarray, "height width"]:
    """Return `load_indexed_png` of bytes that came from `path`.

    Raises:
        PictureError: as `load_indexed_png`.
    """
    with _opened(data, path, max_pixels) as image:
        if image.format != "PNG" or image.mode != "P":
            raise PictureError(
                f"{path}: is a {image.format} of mode {image.mode}, an indexed PNG is needed; "
                "write the labels again with `toonset palette`"
            )
        image.load()
        return np.asarray(image).astype(np.uint8)


def encode_png(rgba: UInt8[np.ndarray, "height width channels"]) -> bytes:
    """Return an RGBA (or RGB) picture as PNG bytes."""
    buffer = io.BytesIO()
    image = Image.fromarray(np.ascontiguousarray(rgba))
    image.save(buffer, "PNG", compress_level=COMPRESSION)
    return buffer.getvalue()


def encode_jpeg(rgba: UInt8[np.ndarray, "height width channels"], quality: int) -> bytes:
    """Return an opaque picture as JPEG bytes, colours at half resolution as usual."""
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(rgba[..., :3])).save(buffer, "JPEG", quality=quality)
    return buffer.getvalue()


def encode_grey_png(
    values: UInt8[np.ndarray, "height width"] | UInt16[np.ndarray, "height width"],
) -> bytes:
    """Return a grey PNG of as many bits: a contour map, depth."""
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(values)).save(buffer, "PNG")
    return buffer.getvalue()


def encode_indexed_png(
    labels: UInt8[np.ndarray, "height width"], palette: UInt8[np.ndarray, "colors 3"]
) -> bytes:
    """Return labels as an indexed PNG whose palette is `palette`; index 255 is transparent.

    Raises:
        PictureError: more than 255 colours, or a label that has no colour and is not 255.
    """
    used = labels[labels != UNLABELLED]
    if len(palette) > UNLABELLED or (used.size and int(used.max()) >= len(palette)):
        raise PictureError(
            f"labels up to {int(used.max(initial=0))} and {len(palette)} colours; at most 255 "
            "colours fit an indexed PNG, and every label but 255 needs one"
        )
    table = np.zeros((256, 3), dtype=np.uint8)
    table[: len(palette)] = palette
    image = Image.fromarray(np.ascontiguousarray(labels, dtype=np.uint8))
    image.putpalette(table.tobytes())  # turns the grey picture into an indexed one
    buffer = io.BytesIO()
    image.save(buffer, "PNG", transparency=UNLABELLED)
    return buffer.getvalue()


def _flat(data: bytes, path: Path) -> bytes:
    """Return a picture file's bytes: of a zip those of the picture of all layers in it."""
    return zipped.merged_png(data, path) if data.startswith(zipped.MAGIC) else data


@contextlib.contextmanager
def _opened(data: bytes, path: Path, max_pixels: int) -> Iterator[Image.Image]:
    """Yield the lazily opened picture; whatever Pillow raises inside becomes a PictureError."""
    try:
        if data.startswith(photoshop.MAGIC):
            yield photoshop.open_photoshop(data, path, max_pixels)
            return
        if data.startswith(pdf.MAGIC):
            yield pdf.open_page(data, path, max_pixels)
            return
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # odd metadata is not a reason to refuse or to print
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(data), formats=FORMATS) as image:
                _check(image, data, path, max_pixels)
                yield image
    except PictureError:
        raise
    except UnidentifiedImageError as error:
        raise PictureError(_not_a_picture(data, path)) from error
    except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        raise PictureError(
            f"{path}: its header announces far more than {max_pixels / 1e6:g} megapixels, the "
            "most that is read; scale the picture down"
        ) from error
    except Exception as error:  # decoders raise almost anything on damaged bytes
        raise PictureError(
            f"{path}: the {_format_of(data)} file is damaged or cut off "
            f"({_first_words(error)}); export or download it again"
        ) from error


def _check(image: Image.Image, data: bytes, path: Path, max_pixels: int) -> None:
    width, height = image.size
    if width * height > max_pixels:
        raise PictureError(
            f"{path}: {width} x {height} pixels, at most {max_pixels / 1e6:g} megapixels are "
            "read; scale the picture down"
        )
    # a phone's MPO is a JPEG with a preview behind it: the first picture is the picture
    if image.format != "MPO" and getattr(image, "is_animated", False):
        raise PictureError(
            f"{path}: is an animated or multi-page {image.format}; save the frame that is meant "
            "as a PNG"
        )
    if image.format == "PNG" and PNG_END not in data:
        raise PictureError(
            f"{path}: the PNG file is damaged or cut off (its end is missing); export or "
            "download it again"
        )


def _not_a_picture(data: bytes, path: Path) -> str:
    kind = describe(data)
    if kind == UNKNOWN and path.suffix.lower() == ".tga":  # its first version has no mark
        kind = "a TGA picture"
    if not kind.endswith(" picture"):
        return f"{path}: is {kind}, no picture that can be read; save it as PNG"
    if kind == "a TIFF picture" and _lists_tags(data):  # Pillow knows TIFFs by their pixels
        return f"{path}: is a TIFF picture of 32 bit or another kind that is not read; save as PNG"
    if kind.split()[-2] in ("PNG", "JPEG", "GIF", "TIFF", "AVIF"):
        return f"{path}: starts like {kind} but is damaged or cut off; export or download it again"
    return f"{path}: is {kind}, which is not read; save it as PNG"


def _lists_tags(data: bytes) -> bool:
    """Return whether a TIFF's first list of tags lies inside of the file."""
    order: Literal["little", "big"] = "little" if data.startswith(b"II") else "big"
    place = int.from_bytes(data[4:8], order)
    count = int.from_bytes(data[place : place + 2], order)  # of 12 bytes each
    return place + 2 + 12 * count + 4 <= len(data)


def _format_of(data: bytes) -> str:
    kind = describe(data)
    return kind.split()[1] if kind.endswith(" picture") and kind.startswith("a ") else "picture"


def _first_words(error: Exception) -> str:
    words = " ".join(str(error).split()) or type(error).__name__
    return words[:80]
