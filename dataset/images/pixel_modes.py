"""Convert any decoded picture to 8-bit sRGB with straight alpha, or refuse it by name."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageCms

from toonset.errors import PictureError
from toonset.palette.colors import LINEAR_OF_LEVEL, srgb_from_linear

PLAIN_MODES = ("1", "L", "LA", "P", "PA", "RGB", "RGBA", "RGBa", "La", "RGBX", "YCbCr")
GREY_16_MODES = ("I;16", "I;16L", "I;16B", "I;16N")
ROWS = 64  # of a picture, copied at once
PNG_START = b"\x89PNG\r\n\x1a\n"
SRGB_SAID, P3_SAID = (1, 13), (12, 13)  # primaries and curve by ITU-T H.273
# Linear light; source: CSS Color 4 (W3C), sample code, lin_P3 to XYZ to lin_sRGB
SRGB_FROM_P3 = np.array(
    [[1.2249402, -0.2249402, 0], [-0.0420570, 1.0420570, 0], [-0.0196376, -0.0786361, 1.0982736]]
)
SRGB_TOLERANCE = 2  # levels: a profile that moves no colour further is sRGB itself


def said_of(data: bytes) -> tuple[int, int] | None:
    """Return the primaries and the curve that a PNG's cICP chunk says; None without one.

    Source: PNG (W3C, third edition), 11.3.2.6; numbers of ITU-T H.273.
    """
    at = len(PNG_START)
    while data.startswith(PNG_START) and at + 8 <= len(data):
        size, kind = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + 8]
        if kind == b"cICP" and size == 4:
            return data[at + 8], data[at + 9]
        if kind == b"IDAT":
            return None
        at += 12 + size
    return None


def rgba_of(
    image: Image.Image, path: Path, said: tuple[int, int] | None = None
) -> UInt8[np.ndarray, "height width 4"]:
    """Return the pixels of a loaded picture as sRGB with straight alpha.

    16-bit channels are scaled to 8 bits (never wrapped), palettes and transparent colours are
    resolved, an embedded colour profile is converted to sRGB.

    Args:
        image: loaded.
        path: for messages.
        said: the colours that a cICP chunk names, which goes before a profile; see `said_of`.

    Raises:
        PictureError: a mode or profile whose colours cannot be told.
    """
    profile = image.info.get("icc_profile")
    if said == SRGB_SAID:
        profile = None
    elif said is not None:
        return _p3(image, said, path)
    if image.mode in GREY_16_MODES:
        image = _grey_8(image)
    if image.mode == "CMYK":
        return _cmyk(image, profile, path)
    if image.mode not in PLAIN_MODES:
        raise PictureError(
            f"{path}: has pixels of kind {image.mode} (32 bit, Lab or other), which is not "
            "supported; save it as an 8-bit RGB PNG"
        )
    _refuse_wide_transparency(image, path)
    if image.mode == "La":
        image = image.convert("LA")
    rgba = _array(image if image.mode == "RGBA" else image.convert("RGBA"))
    if profile:
        grey = image.mode in ("1", "L", "LA", "La")
        rgba[..., :3] = _to_srgb(Image.fromarray(rgba[..., :3]), profile, grey, path)
    return rgba


def _p3(
    image: Image.Image, said: tuple[int, int], path: Path
) -> UInt8[np.ndarray, "height width 4"]:
    """Return a Display P3 picture as sRGB; colours outside of it are clipped."""
    if said != P3_SAID:
        raise PictureError(
            f"{path}: its cICP chunk says colours of kind {said[0]}, {said[1]} (HDR or video), "
            "which are not supported; save it as an sRGB PNG"
        )
    grey = image.mode in ("1", "L", "LA", "La", *GREY_16_MODES)  # P3 and sRGB share white and curve
    rgba = rgba_of(image, path, SRGB_SAID)
    if not grey:
        for top in range(0, len(rgba), ROWS):
            part = rgba[top : top + ROWS, :, :3]
            part[...] = np.rint(255 * srgb_from_linear(LINEAR_OF_LEVEL[part] @ SRGB_FROM_P3.T))
    return rgba


def _array(image: Image.Image) -> UInt8[np.ndarray, "height width 4"]:
    """Return an RGBA picture's pixels, some rows at a time: Pillow's own way holds them thrice."""
    width, height = image.size
    pixels = np.empty((height, width, 4), dtype=np.uint8)
    for top in range(0, height, ROWS):
        bottom = min(top + ROWS, height)
        pixels[top:bottom] = np.asarray(image.crop((0, top, width, bottom)))
    return pixels


def _grey_8(image: Image.Image) -> Image.Image:
    """Scale 16-bit grey to 8 bit; one transparent grey value becomes alpha."""
    values = np.asarray(image).astype(np.uint32)
    grey = ((values * 255 + 32767) // 65535).astype(np.uint8)
    transparent = image.info.get("transparency")
    if not isinstance(transparent, int):
        return Image.fromarray(grey)
    alpha = np.where(values == transparent, 0, 255).astype(np.uint8)
    return Image.merge("LA", (Image.fromarray(grey), Image.fromarray(alpha)))


def _refuse_wide_transparency(image: Image.Image, path: Path) -> None:
    """Refuse a transparent colour of 16-bit RGB: Pillow has already cut the pixels to 8 bit."""
    transparent = image.info.get("transparency")
    if image.mode == "RGB" and isinstance(transparent, tuple) and max(transparent) > 255:
        raise PictureError(
            f"{path}: is a 16-bit PNG with a transparent colour, which is not supported; save it "
            "with an alpha channel"
        )


def _cmyk(image: Image.Image, profile: bytes | None, path: Path) -> UInt8[np.ndarray, "h w 4"]:
    if not profile:
        raise PictureError(
            f"{path}: is CMYK without a colour profile, so its colours are not known; save it as "
            "an RGB PNG"
        )
    rgb = _to_srgb(image, profile, False, path)
    return np.dstack([rgb, np.full(rgb.shape[:2], 255, dtype=np.uint8)])


def _to_srgb(
    image: Image.Image, profile: bytes, grey: bool, path: Path
) -> UInt8[np.ndarray, "h w 3"]:
    """Convert through the embedded profile; a picture that is sRGB already keeps every value."""
    try:
        source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        inner: Any = source.profile
        space = str(inner.xcolor_space).strip()
        if grey and space == "GRAY":
            image = image.convert("L")
        if space != {"L": "GRAY", "RGB": "RGB", "CMYK": "CMYK"}[image.mode]:
            return np.asarray(image.convert("RGB"))  # a profile for other pixels says nothing
        transform = ImageCms.buildTransform(
            source, ImageCms.createProfile("sRGB"), image.mode, "RGB"
        )
        if _is_srgb(transform, image.mode):
            return np.asarray(image.convert("RGB"))
        converted = ImageCms.applyTransform(image, transform)
    except (ImageCms.PyCMSError, OSError, ValueError, TypeError) as error:
        raise PictureError(
            f"{path}: its colour profile is damaged ({error}); save it as sRGB"
        ) from error
    assert converted is not None  # only an in-place conversion returns nothing
    return np.asarray(converted)


def _is_srgb(transform: ImageCms.ImageCmsTransform, mode: str) -> bool:
    """Return whether the transform leaves a grid of colours where they are."""
    if mode == "CMYK":
        return False
    steps = np.linspace(0, 255, 9).astype(np.uint8)
    grid = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(27, 27, 3)
    sample = Image.fromarray(grid).convert(mode)
    moved = ImageCms.applyTransform(sample, transform)
    assert moved is not None
    change = np.asarray(moved).astype(int) - np.asarray(sample.convert("RGB"))
    return int(np.abs(change).max()) <= SRGB_TOLERANCE
