"""Encode pictures as a loop: GIF, animated WebP, MP4."""

from __future__ import annotations

import importlib
import io
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import cv2
import numpy as np
from jaxtyping import Int, UInt8
from PIL import Image

from toonset.errors import OutputError, SetupError
from toonset.view import over_white, premultiply, straight

SECONDS_PER_TURN = 3.0
SHORTEST_MS = 20  # viewers slow shorter frames down
ANIMATED_PX = 1024  # side of a GIF or WebP unless a size is asked for: larger ones stutter
GIF_COLORS = 256
GIF_EXACT = 96  # of them: flat colours stay as they are, mixed ones share the others
LOSSLESS_EFFORT = 60  # of 100: more takes three times as long for 2 %
MP4_QUALITY = 16  # x264's constant rate factor: flat colours keep no visible blocks
INSTALL_AV = "pip install av"

Pictures = Sequence[UInt8[np.ndarray, "height width 4"]]


def duration_ms(count: int) -> int:
    """Return how long each of `count` pictures of a turn is shown; a GIF counts hundredths."""
    return max(SHORTEST_MS, 10 * round(100 * SECONDS_PER_TURN / count))


def smaller(
    picture: UInt8[np.ndarray, "height width 4"], most_px: int | None
) -> UInt8[np.ndarray, "h w 4"]:
    """Return a picture with a longest side of at most `most_px`; None: as it is."""
    height, width = picture.shape[:2]
    by = 1.0 if most_px is None else most_px / max(height, width)
    if by >= 1:
        return picture
    size = max(1, round(by * width)), max(1, round(by * height))
    return straight(cv2.resize(premultiply(picture), size, interpolation=cv2.INTER_AREA))


def encode_gif(pictures: Pictures) -> bytes:
    """Return the pictures over white as a GIF that turns once in three seconds.

    All pictures share one palette and none is dithered, so flat colours neither flicker nor crawl.

    Raises:
        OutputError: the pictures differ in size.
    """
    check_one_size(pictures, "turntable.gif")
    codes = [_code(_flat(picture)) for picture in pictures]
    used, counts = np.unique(np.concatenate(codes, axis=None), return_counts=True)
    colors = np.stack([used >> 16, used >> 8 & 255, used & 255], axis=1).astype(np.uint8)
    shared = _shared_palette(colors, counts)
    nearest = np.zeros(1 << 24, dtype=np.uint8)
    palette, paints = shared.astype(np.float64), colors.astype(np.float64)
    off = np.square(palette).sum(axis=1) - 2 * paints @ palette.T  # less the paint's own square
    nearest[used] = off.argmin(axis=1)
    frames = [Image.fromarray(nearest[one]) for one in codes]
    for frame in frames:
        frame.putpalette(shared.tobytes())
    return _loop(frames, "GIF", disposal=1)


def _code(rgb: UInt8[np.ndarray, "height width 3"]) -> Int[np.ndarray, "height width"]:
    """Return colours as 24-bit numbers."""
    return rgb.astype(np.int32) @ np.array([1 << 16, 1 << 8, 1], dtype=np.int32)


def _shared_palette(
    colors: UInt8[np.ndarray, "n 3"], counts: Int[np.ndarray, " n"]
) -> UInt8[np.ndarray, "few 3"]:
    """Return at most 256 colours: the common ones as they are, and means of the others."""
    if len(colors) <= GIF_COLORS:
        return colors
    order = np.argsort(-counts, kind="stable")
    common, rare = colors[order[:GIF_EXACT]], colors[order[GIF_EXACT:]]
    means = Image.fromarray(rare[None]).quantize(GIF_COLORS - GIF_EXACT, Image.Quantize.MEDIANCUT)
    rest = np.array(means.getpalette(), dtype=np.uint8).reshape(-1, 3)
    return np.concatenate([common, rest[: GIF_COLORS - GIF_EXACT]])


def encode_webp(pictures: Pictures) -> bytes:
    """Return the pictures as a lossless animated WebP, transparent where they are.

    Raises:
        OutputError: the pictures differ in size.
    """
    check_one_size(pictures, "turntable.webp")
    frames = [Image.fromarray(picture) for picture in pictures]
    clear = (0, 0, 0, 0)
    return _loop(frames, "WEBP", lossless=True, quality=LOSSLESS_EFFORT, background=clear)


def _loop(frames: Sequence[Image.Image], kind: str, **settings: Any) -> bytes:
    """Return pictures as a file of Pillow's format `kind` that turns for ever."""
    shown = {"duration": duration_ms(len(frames)), "loop": 0}
    buffer = io.BytesIO()
    frames[0].save(buffer, kind, save_all=True, append_images=frames[1:], **shown, **settings)
    return buffer.getvalue()


def encode_mp4(pictures: Pictures) -> bytes:
    """Return the pictures over white as an MP4 that every player shows (H.264, 4:2:0, no sound).

    An odd side gets one more row or column of white, which the format needs.

    Raises:
        OutputError: the pictures differ in size.
        SetupError: PyAV is not installed.
    """
    check_one_size(pictures, "turntable.mp4")
    av = check_mp4()
    frames = [_even(_flat(picture)) for picture in pictures]
    rate = Fraction(1000, duration_ms(len(frames)))
    buffer = io.BytesIO()
    with av.open(buffer, "w", format="mp4") as file:
        stream = file.add_stream("libx264", rate=rate)
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": str(MP4_QUALITY), "tune": "animation"}
        for frame in frames:
            file.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        file.mux(stream.encode())
    return buffer.getvalue()


def check_mp4() -> Any:
    """Return PyAV, which writes MP4; it can be asked for before any work.

    Raises:
        SetupError: it is not installed.
    """
    try:
        return importlib.import_module("av")  # an extra, so type checkers may not find it
    except ImportError as error:
        said = f"MP4 needs PyAV, which is missing here; install it: {INSTALL_AV}"
        raise SetupError(said) from error


def check_one_size(pictures: Pictures, name: str) -> None:
    """Refuse pictures that cannot share a file.

    Raises:
        OutputError: they differ in size, or there are none.
    """
    sizes = {picture.shape[:2] for picture in pictures}
    if len(sizes) != 1:
        raise OutputError(
            f"{name}: pictures of {len(sizes)} sizes, one is needed; leave out its format"
        )


def _flat(picture: UInt8[np.ndarray, "height width 4"]) -> UInt8[np.ndarray, "height width 3"]:
    return (over_white(picture) * 255 + 0.5).astype(np.uint8)


def _even(rgb: UInt8[np.ndarray, "height width 3"]) -> UInt8[np.ndarray, "h w 3"]:
    height, width = rgb.shape[:2]
    return np.pad(rgb, ((0, height % 2), (0, width % 2), (0, 0)), constant_values=255)
