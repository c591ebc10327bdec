"""Take a picture's figures off its background by a matting network that the user has.

Networks such as U2-Net, IS-Net or BiRefNet in ONNX, as rembg uses them: one picture of fixed size
in, coverage out. OpenCV runs them. They see the page first, then every part that they found, larger
(a network of 320 px shows figures of a page as small as thumbnails).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from toonset.errors import PictureError
from toonset.raster import dilate, sized_parts
from toonset.read import read_whole
from toonset.view import over_white

MEAN, STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)  # of ImageNet
LEAST_PART = 0.002  # of the page: smaller ones are looked at once
AROUND = 0.15  # of a part's longer side, on each of its sides
COVERED = 0.5


@dataclass(frozen=True)
class MattingNetwork:
    """A network in memory.

    Attributes:
        path: its file, for messages.
        net: OpenCV's network.
        size_wh: of the pictures that it takes.
        mean: per channel, of pictures from 0 to 1.
        std: the same.
    """

    path: Path
    net: Any
    size_wh: tuple[int, int]
    mean: tuple[float, float, float]
    std: tuple[float, float, float]

    def coverage(
        self, rgb: UInt8[np.ndarray, "height width 3"]
    ) -> Float[np.ndarray, "height width"]:
        """Return how much of every pixel a figure covers, 0 to 1.

        Raises:
            PictureError: the network does not run.
        """
        small = cv2.resize(rgb, self.size_wh, interpolation=cv2.INTER_AREA).astype(np.float32)
        scaled = (small / max(float(small.max()), 1.0) - self.mean) / self.std
        try:
            self.net.setInput(scaled.transpose(2, 0, 1)[None].astype(np.float32))
            found = np.asarray(self.net.forward(self.net.getUnconnectedOutLayersNames()[0]))
        except cv2.error as error:
            raise self._unfit() from error
        if found.ndim != 4 or found.shape[:2] != (1, 1) or not np.isfinite(found).all():
            raise self._unfit()
        cover = found[0, 0].astype(np.float32)
        if cover.min() < 0 or cover.max() > 1:
            cover = 1 / (1 + np.exp(-cover))
        size = rgb.shape[1::-1]
        return np.asarray(cv2.resize(cover, size, interpolation=cv2.INTER_LINEAR))

    def _unfit(self) -> PictureError:
        return PictureError(
            f"{self.path}: is no matting network: a picture in and one plane of coverage out are "
            "needed; take one that rembg can use"
        )


def read_network(path: Path) -> MattingNetwork:
    """Return the matting network of an ONNX file.

    Networks whose name says "isnet" take pictures as IS-Net does, others as U2-Net and BiRefNet do.

    Raises:
        PictureError: the file is not there, or no network that takes pictures of a fixed size.
    """
    data = read_whole(path, "matting network", PictureError, 2**31)
    size = _input_size(data)
    try:
        net = cv2.dnn.readNetFromONNX(np.frombuffer(data, np.uint8)) if size else None
    except cv2.error:
        net = None
    if net is None or size is None:
        raise PictureError(
            f"{path}: is no ONNX network for colour pictures of a fixed size; take a matting "
            "network that rembg can use, such as u2net.onnx"
        )
    mean, std = ((0.5, 0.5, 0.5), (1.0, 1.0, 1.0)) if "isnet" in path.stem.lower() else (MEAN, STD)
    return MattingNetwork(path, net, size, mean, std)


def without_background(
    rgba: UInt8[np.ndarray, "height width 4"], network: MattingNetwork
) -> UInt8[np.ndarray, "height width 4"]:
    """Return the picture with what the network takes for background transparent.

    Raises:
        PictureError: the network does not run, or sees no figure.
    """
    rgb = np.rint(255 * over_white(rgba)).astype(np.uint8)
    page = network.coverage(rgb)
    numbers, areas = sized_parts(page >= COVERED)
    cover = np.where(page >= COVERED, 0, page)
    for number in 1 + np.flatnonzero(areas[1:] >= LEAST_PART * page.size):
        part = numbers == number
        x, y, width, height = cv2.boundingRect(part.view(np.uint8))
        around = round(AROUND * max(width, height))
        rows = slice(max(y - around, 0), y + height + around)
        columns = slice(max(x - around, 0), x + width + around)
        own = dilate(part[rows, columns], around)
        fine = network.coverage(np.ascontiguousarray(rgb[rows, columns])) * own
        cover[rows, columns] = np.maximum(cover[rows, columns], fine)
    if not (cover >= COVERED).any():
        raise PictureError(
            f"{network.path}: sees no figure in the sheet; split it without --matting"
        )
    result = rgba.copy()
    result[..., 3] = np.minimum(result[..., 3], np.rint(255 * cover)).astype(np.uint8)
    return result


def _input_size(data: bytes) -> tuple[int, int] | None:
    """Return width and height of the picture that an ONNX model takes; None if it says no size.

    The path through the file's messages: graph, input, type, tensor type, shape, dimension, value
    (onnx.proto of the ONNX project).
    """
    try:
        for graph in _fields(data, 7):
            for given in _fields(graph, 11):
                (kind,) = _fields(given, 2)
                (tensor,) = _fields(kind, 1)
                (shape,) = _fields(tensor, 2)
                sizes = [next(iter(_fields(dim, 1)), 0) for dim in _fields(shape, 1)]
                if len(sizes) == 4 and sizes[1] == 3 and min(sizes[2:]) > 0:
                    return sizes[3], sizes[2]
    except (ValueError, IndexError, TypeError):
        pass
    return None


def _fields(message: Any, wanted: int) -> Iterator[Any]:
    """Yield the values of one field of a protocol-buffers message: numbers, or bytes of parts."""
    message, at = memoryview(message), 0
    while at < len(message):
        key, at = _number(message, at)
        wire = key & 7
        if wire == 0:
            value, at = _number(message, at)
        elif wire == 2:
            length, at = _number(message, at)
            value, at = message[at : at + length], at + length
        elif wire in (1, 5):
            value, at = None, at + (8 if wire == 1 else 4)
        else:
            raise ValueError("no protocol buffers")
        if key >> 3 == wanted:
            yield value


def _number(message: memoryview, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = message[at]
        value |= (byte & 127) << shift
        at, shift = at + 1, shift + 7
        if byte < 128:
            return value, at
