"""Read the merged picture of Photoshop files (.psd, .psb) with psd-tools, an optional package.

Source: Adobe, "Photoshop File Formats Specification", File Header Section; psd-tools (MIT).
"""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from toonset.dataset.images.layers import Layer
from toonset.errors import PictureError, as_text, one_line

MAGIC = b"8BPS"
HEADER = struct.Struct(">4sH6xHIIHH")  # magic, version, channels, height, width, depth, mode
READ_MODES = (0, 1, 2, 3, 4)  # bitmap, grey, indexed, RGB, CMYK
OTHER_MODES = {7: "multichannel", 8: "duotone", 9: "Lab"}
RAW, PACKED_ROWS = 0, 1  # packings of the merged picture
INSTALL = "pip install 'toonset[psd]'"


def open_photoshop(data: bytes, path: Path, max_pixels: int) -> Image.Image:
    """Return the picture of all layers together as the file stores it, its profile in `info`.

    Args:
        data: of the file.
        path: for messages.
        max_pixels: a header that announces more is refused before anything is unpacked.

    Raises:
        PictureError: psd-tools is missing; the file is damaged, too large, has no merged picture,
            or its colours cannot be told (32 bit, Lab, duotone, multichannel).
    """
    width, height = _checked_size(data, path, max_pixels)
    if not _is_whole(data):
        raise _damaged(path)
    document = _document(data, path)
    if not document.has_preview():
        raise _not_merged(path)
    try:
        image = document.topil(apply_icc=False)
    except Exception as error:  # decoders raise almost anything on damaged bytes
        raise _damaged(path) from error
    if image is None or image.size != (width, height):
        raise _damaged(path)
    if len(document) and _is_blank(image):
        raise _not_merged(path)
    return _with_profile(image, document)


def photoshop_layers(data: bytes, path: Path) -> tuple[Layer, ...]:
    """Return the visible layers and groups at the top of a Photoshop file, lowest first.

    Args:
        data: of a file that `open_photoshop` has read.
        path: for messages.

    Raises:
        PictureError: as `open_photoshop`.
    """
    layers = []
    for layer in _document(data, path):
        left, top, right, bottom = layer.bbox
        if layer.is_visible() and right > left and bottom > top:
            name = as_text(one_line(layer.name))
            layers.append(Layer(name, (left, top, right - left, bottom - top)))
    return tuple(layers)


def _checked_size(data: bytes, path: Path, max_pixels: int) -> tuple[int, int]:
    if len(data) < HEADER.size:
        raise _damaged(path)
    _, _, _, height, width, depth, mode = HEADER.unpack_from(data)
    if width * height > max_pixels:
        raise PictureError(
            f"{path}: {width} x {height} pixels, at most {max_pixels / 1e6:g} megapixels are "
            "read; scale the picture down"
        )
    if 0 in (width, height):
        raise _damaged(path)
    if mode not in READ_MODES or depth > 16:
        kind = OTHER_MODES.get(mode, f"{depth}-bit")
        raise PictureError(
            f"{path}: is a {kind} Photoshop file, which is not supported; convert it to RGB of 8 "
            "bits, or save it as PNG"
        )
    return width, height


def _is_whole(data: bytes) -> bool:
    """Return whether the merged picture, which ends the file, is all there; psd-tools pads it."""
    _, version, channels, height, width, depth, _ = HEADER.unpack_from(data)
    wide = version == 2  # PSB
    at = HEADER.size
    for size in (4, 4, 8 if wide else 4):  # colour mode, resources, layers
        at += size + int.from_bytes(data[at : at + size], "big")
    packing = int.from_bytes(data[at : at + 2], "big")
    at += 2
    if packing == RAW:
        return at + channels * height * ((width * depth + 7) // 8) <= len(data)
    if packing == PACKED_ROWS:
        counts = data[at : at + channels * height * (4 if wide else 2)]
        if len(counts) < channels * height * (4 if wide else 2):
            return False
        rows = np.frombuffer(counts, ">u4" if wide else ">u2")
        return at + len(counts) + int(rows.sum(dtype=np.int64)) <= len(data)
    return at < len(data)  # deflated: its reader tells


def _document(data: bytes, path: Path) -> Any:
    try:
        from psd_tools import PSDImage
    except ImportError as error:
        raise PictureError(
            f"{path}: is a Photoshop file, which needs psd-tools: {INSTALL}; or save it as PNG"
        ) from error
    try:
        return PSDImage.open(io.BytesIO(data))
    except Exception as error:  # its reader raises almost anything on damaged bytes
        raise _damaged(path) from error


def _with_profile(image: Image.Image, document: Any) -> Image.Image:
    """Return the picture with the file's colour profile where Pillow's readers put it."""
    from psd_tools.constants import Resource

    profile = document.image_resources.get_data(Resource.ICC_PROFILE)
    if profile:
        image.info["icc_profile"] = bytes(profile)
    return image


def _is_blank(image: Image.Image) -> bool:
    """Return whether a picture is one colour throughout, as programs write that merge nothing."""
    extrema: Any = image.convert("RGBA").getextrema()
    return all(low == high for low, high in extrema)


def _not_merged(path: Path) -> PictureError:
    return PictureError(
        f"{path}: holds no picture of all its layers together; save it with 'Maximize "
        "compatibility' on, or as PNG"
    )


def _damaged(path: Path) -> PictureError:
    return PictureError(
        f"{path}: the Photoshop file is damaged or cut off; save or download it again"
    )
