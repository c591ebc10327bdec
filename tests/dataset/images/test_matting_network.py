"""Matting networks: a tiny one in ONNX takes dark figures off a light backdrop."""

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.conftest import Command
from toonset.dataset.images.matting_network import read_network, without_background
from toonset.dataset.images.picture import encode_png
from toonset.dataset.split_folder.load import split_sheet
from toonset.dataset.split_folder.options import SheetOptions
from toonset.errors import PictureError

SIDE = 64


def part(field: int, *values: bytes | str | int) -> bytes:
    """Return fields of a protocol-buffers message: numbers, or parts with their lengths."""
    message = b""
    for value in values:
        if isinstance(value, int):
            message += number(8 * field) + number(value)
        else:
            data = value.encode() if isinstance(value, str) else value
            message += number(8 * field + 2) + number(len(data)) + data
    return message


def number(value: int) -> bytes:
    digits = []
    while True:
        digits.append(value & 127 | (128 if value > 127 else 0))
        value >>= 7
        if not value:
            return bytes(digits)


def place(name: str, channels: int, side: int = SIDE) -> bytes:
    shape = b"".join(part(1, part(1, size)) for size in (1, channels, side, side))
    return part(1, name) + part(2, part(1, part(1, 1) + part(2, shape)))


def constant(name: str, shape: tuple[int, ...], values: tuple[float, ...]) -> bytes:
    data = struct.pack(f"<{len(values)}f", *values)
    return part(1, *shape) + part(2, 1) + part(8, name) + part(9, data)


def network(path: Path, side: int = SIDE) -> Path:
    """Write a network that calls dark pixels figure: a convolution of one pixel, and a sigmoid."""
    nodes = [
        part(1, "picture", "weights", "bias") + part(2, "sum") + part(4, "Conv"),
        part(1, "sum") + part(2, "coverage") + part(4, "Sigmoid"),
    ]
    graph = part(1, *nodes) + part(2, "darkness")
    graph += part(5, constant("weights", (1, 3, 1, 1), (-4.0,) * 3), constant("bias", (1,), (6.0,)))
    graph += part(11, place("picture", 3, side)) + part(12, place("coverage", 1, side))
    path.write_bytes(part(1, 8) + part(7, graph) + part(8, part(2, 11)))
    return path


@pytest.fixture
def scene() -> np.ndarray:
    """Return two dark figures on a light scene of several colours."""
    rng = np.random.default_rng(0)
    rgb = np.kron(rng.integers(190, 256, (15, 30, 3)), np.ones((20, 20, 1))).astype(np.uint8)
    for x in (150, 420):
        cv2.ellipse(rgb, (x, 150), (45, 120), 0, 0, 360, (70, 30, 50), -1)
    return np.dstack([rgb, np.full(rgb.shape[:2], 255, np.uint8)])


def test_figures_come_off_a_backdrop(scene: np.ndarray, tmp_path: Path) -> None:
    cut = without_background(scene, read_network(network(tmp_path / "dark.onnx")))
    truth = (scene[..., :3] == (70, 30, 50)).all(axis=2)
    found = cut[..., 3] >= 128
    assert (found & truth).sum() / (found | truth).sum() > 0.95
    assert np.array_equal(cut[..., :3], scene[..., :3])


def test_a_sheet_is_split_with_it(scene: np.ndarray, tmp_path: Path, toonset: Command) -> None:
    sheet, file = tmp_path / "sheet.png", network(tmp_path / "dark.onnx")
    sheet.write_bytes(encode_png(scene))
    found = split_sheet(sheet, SheetOptions(matting=file))
    left = [view.figure_box[0] for view in found.views]
    assert np.abs(np.subtract(left, [105, 375])).max() <= 10  # the tiny network sees 64 px
    assert found.options == {"matting": "dark.onnx"}
    assert [one.role for one in found.files] == ["sheet", "matting"]
    done = toonset("split", sheet, "--matting", file, "-o", tmp_path / "views")
    assert done.code in (0, 3)
    assert (tmp_path / "views" / "images" / "001.png").exists()
    twice = toonset("split", sheet, "--matting", file, "--background", "white")
    assert "drop one" in twice.reason


@pytest.mark.parametrize("data", [b"no network", b"", part(7, part(11, place("picture", 1)))])
def test_what_is_no_network_is_refused(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "bad.onnx"
    path.write_bytes(data)
    with pytest.raises(PictureError, match=r"bad\.onnx"):
        read_network(path)


def test_a_network_that_sees_nothing_says_so(tmp_path: Path) -> None:
    white = np.full((100, 100, 4), 255, np.uint8)
    with pytest.raises(PictureError, match="sees no figure"):
        without_background(white, read_network(network(tmp_path / "dark.onnx")))
