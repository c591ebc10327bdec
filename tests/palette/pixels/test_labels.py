"""Label maps: nearest colours, blends between them, and the indexed PNG they become."""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from lab.bench.cases.bodies import random_body
from tests.palette.pictures import opaque
from toonset.dataset.bundle.palette_files import write_palette
from toonset.dataset.images.picture import encode_indexed_png, load_indexed_png
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.errors import OutputError, PictureError
from toonset.palette.colors import oklab_from_rgb
from toonset.palette.palette import Palette, PaletteColor
from toonset.palette.pixels import labels as labels_module
from toonset.palette.pixels.labels import UNLABELLED, label_pixels, nearest_colors, nearest_labels

RED, BLUE, INK, GREY = (200, 30, 40), (20, 60, 180), (0, 0, 0), (128, 128, 128)
PALETTE = np.array([RED, BLUE, INK], dtype=np.uint8)


def row(*colors: tuple[int, int, int], height: int = 9) -> np.ndarray:
    """Return a picture of columns, one colour each."""
    return opaque(np.tile(colors, (height, 1, 1)))


def between(a: tuple[int, int, int], b: tuple[int, int, int], share: float) -> tuple[int, int, int]:
    red, green, blue = (round((1 - share) * x + share * y) for x, y in zip(a, b, strict=True))
    return red, green, blue


@pytest.mark.parametrize("share", [0.03, 0.3, 0.5, 0.8, 0.97])
def test_the_blend_of_two_neighbours_has_no_label(share: float) -> None:
    picture = row(*[RED] * 6, between(RED, BLUE, share), *[BLUE] * 6)
    expected = np.array([0] * 6 + [UNLABELLED] + [1] * 6)
    assert (label_pixels(picture, PALETTE) == expected).all()
    assert (label_pixels(picture.transpose(1, 0, 2), PALETTE) == expected[:, None]).all()


def test_a_line_of_one_pixel_keeps_its_label_and_soft_lines_have_none() -> None:
    line = row(*[RED] * 6, INK, *[RED] * 6)
    assert (label_pixels(line, PALETTE) == np.array([0] * 6 + [2] + [0] * 6)).all()
    faint = row(*[RED] * 6, between(RED, INK, 0.6), between(RED, INK, 0.7), *[RED] * 6)
    assert (label_pixels(faint, PALETTE)[:, 6:8] == UNLABELLED).all()
    assert (np.delete(label_pixels(faint, PALETTE), [6, 7], axis=1) == 0).all()


def test_a_blend_of_three_colours_has_no_label() -> None:
    picture = row(*[RED] * 6, *[BLUE] * 6, height=12)
    picture[6:, :, :3] = INK
    picture[6, 6, :3] = (80, 40, 70)
    assert label_pixels(picture, PALETTE)[6, 6] == UNLABELLED
    assert (label_pixels(picture, PALETTE) == UNLABELLED).sum() == 1


def test_nothing_of_an_upscaled_sprite_is_a_blend() -> None:
    sprite = np.random.default_rng(1).integers(0, 256, (24, 24, 4), dtype=np.uint8)
    sprite[..., 3] = 255 * (sprite[..., 3] > 60)
    big = sprite.repeat(3, axis=0).repeat(3, axis=1)
    found = label_pixels(big, PALETTE)
    assert np.array_equal(found == UNLABELLED, big[..., 3] == 0)


def test_what_is_not_wholly_the_characters_has_no_label() -> None:
    picture = row(*[RED] * 8)
    picture[:, 2, 3], picture[:, 3, 3] = 0, 200
    found = label_pixels(picture, PALETTE)
    assert (found[:, 2:4] == UNLABELLED).all()
    assert (np.delete(found, [2, 3], axis=1) == 0).all()


def test_a_blend_that_equals_no_colour_nearby_is_not_given_a_stray_one() -> None:
    """In noise, a soft pixel that comes near a far colour still is a blend or one of the two."""
    rng = np.random.default_rng(0)
    light, dark, middle = (230, 230, 230), (20, 20, 20), (120, 120, 120)
    palette = np.array([light, dark, middle], dtype=np.uint8)
    clean = row(*[light] * 20, between(light, dark, 0.2), *[dark] * 20, height=60)
    noise = np.dstack([rng.normal(0, 4, (*clean.shape[:2], 3)), np.zeros(clean.shape[:2])])
    noisy = np.clip(clean + np.rint(noise), 0, 255).astype(np.uint8)
    found = label_pixels(noisy, palette)
    assert (found[:, :19] == 0).all()
    assert (found[:, 22:] == 1).all()
    assert (found[:, 20] == UNLABELLED).mean() > 0.9


@pytest.mark.parametrize(("outline", "seed"), [(0.0, 3), (1.2, 4), (3.0, 5)])
def test_synthetic_drawings_are_labelled_right(outline: float, seed: int) -> None:
    options = SynthOptions(views=2, cell_px=200, outline_px=outline, warp_percent=0.8)
    made = make_turnaround(random_body(seed), options, seed)
    palette = np.concatenate([made.palette, [INK]]).astype(np.uint8)
    for view, truth, ink in zip(made.views, made.labels, made.ink, strict=True):
        wholly = view.rgba[..., 3] == 255
        truth = np.where((ink == 255) & wholly, len(made.palette), truth)
        found = label_pixels(view.rgba, palette)
        assert np.array_equal(label_pixels(view.rgba[:, ::-1], palette), found[:, ::-1])
        pure, mixed = truth != UNLABELLED, (truth == UNLABELLED) & (view.rgba[..., 3] >= 250)
        assert (found[pure] == truth[pure]).mean() >= 0.995
        assert (found[mixed] == UNLABELLED).mean() >= 0.9
        assert (truth[(found == UNLABELLED) & (view.rgba[..., 3] > 0)] == UNLABELLED).mean() >= 0.95


def test_bands_and_batches_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    rgba = np.random.default_rng(2).integers(0, 256, (37, 23, 4), dtype=np.uint8)
    whole = nearest_labels(rgba, PALETTE)
    monkeypatch.setattr(labels_module, "BAND_PX", 100)
    monkeypatch.setattr(labels_module, "BATCH", 7)
    assert np.array_equal(nearest_labels(rgba, PALETTE), whole)
    assert np.array_equal(nearest_labels(rgba[::2, ::2], PALETTE), whole[::2, ::2])
    opaque = rgba[..., 3] >= 250
    assert np.array_equal(whole[opaque], nearest_colors(rgba[opaque][:, :3], PALETTE))
    assert (whole[~opaque] == UNLABELLED).all()


def test_nearest_is_the_brute_force_nearest() -> None:
    rng = np.random.default_rng(3)
    colors = rng.integers(0, 256, (500, 3), dtype=np.uint8)
    palette = rng.integers(0, 256, (17, 3), dtype=np.uint8)
    slow = ((colors[:, None].astype(int) - palette) ** 2).sum(axis=2).argmin(axis=1)
    assert np.array_equal(nearest_colors(colors, palette), slow)
    away = np.linalg.norm(oklab_from_rgb(colors)[:, None] - oklab_from_rgb(palette), axis=2)
    assert np.array_equal(nearest_colors(colors, palette, space="oklab"), away.argmin(axis=1))
    assert (slow != away.argmin(axis=1)).any()


def chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    """Return kind and content of every chunk of a PNG, checksums checked."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    found, place = [], 8
    while place < len(data):
        (length,) = struct.unpack(">I", data[place : place + 4])
        kind, body = data[place + 4 : place + 8], data[place + 8 : place + 8 + length]
        (crc,) = struct.unpack(">I", data[place + 8 + length : place + 12 + length])
        assert crc == zlib.crc32(kind + body)
        found.append((kind, body))
        place += 12 + length
    return found


def test_the_indexed_png_holds_all_entries_and_one_transparent_one(tmp_path: Path) -> None:
    """Index 255 must lie within PLTE, and be the one transparent entry.

    Aseprite writes files that GIMP refuses where the index is past PLTE (aseprite issue 5153); it
    takes the transparent entry of tRNS for its own transparent colour.
    """
    labels = np.random.default_rng(4).integers(0, 3, (21, 34)).astype(np.uint8)
    labels[5:9, 3:20] = UNLABELLED
    data = encode_indexed_png(labels, PALETTE)
    parts = chunks(data)
    kinds = [kind for kind, _ in parts]
    assert kinds[0] == b"IHDR"
    assert kinds[-1] == b"IEND"
    assert kinds.index(b"PLTE") < kinds.index(b"tRNS") < kinds.index(b"IDAT")
    content = dict(parts)
    width, height, *rest = struct.unpack(">IIBBBBB", content[b"IHDR"])
    assert (width, height, rest) == (34, 21, [8, 3, 0, 0, 0])  # 8 bit, indexed, not interlaced
    assert len(content[b"PLTE"]) == 3 * 256
    assert content[b"PLTE"][:9] == PALETTE.tobytes()
    assert content[b"tRNS"] == b"\xff" * 255 + b"\x00"
    raw = zlib.decompress(b"".join(body for kind, body in parts if kind == b"IDAT"))
    assert len(raw) == 21 * 35
    expected = np.dstack([PALETTE[labels % 255 % 3], np.full(labels.shape, 255)])
    expected[labels == UNLABELLED] = 0
    pillow = np.asarray(Image.open(io.BytesIO(data)).convert("RGBA")).copy()
    decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert decoded is not None
    opencv = cv2.cvtColor(decoded, cv2.COLOR_BGRA2RGBA)
    for seen in (pillow, opencv):
        assert np.array_equal(seen[labels != UNLABELLED], expected[labels != UNLABELLED])
        assert (seen[labels == UNLABELLED][:, 3] == 0).all()
    file = tmp_path / "labels.png"
    file.write_bytes(data)
    assert np.array_equal(load_indexed_png(file), labels)
    assert encode_indexed_png(labels.copy(), PALETTE) == data


def test_labels_without_a_colour_are_refused() -> None:
    with pytest.raises(PictureError, match="labels up to 3 and 3 colours"):
        encode_indexed_png(np.array([[3]], dtype=np.uint8), PALETTE)


def test_labels_and_contours_lie_beside_the_palette(tmp_path: Path) -> None:
    palette = Palette((PaletteColor(RED, 0.7, "red"), PaletteColor(BLUE, 0.3, "blue")), "by hand")
    labels = np.array([[0, 1, 255]], dtype=np.uint8)
    contour = np.array([[0, 128, 255]], dtype=np.uint8)
    write_palette(tmp_path, palette, [("000.png", labels)], [("000.png", contour)])
    with Image.open(tmp_path / "contours" / "000.png") as grey:
        assert grey.mode == "L"
        assert np.array_equal(np.asarray(grey), contour)
    before = (tmp_path / "contours" / "000.png").read_bytes()
    assert np.array_equal(load_indexed_png(tmp_path / "labels" / "000.png"), labels)
    other = replace(palette, colors=palette.colors[::-1])
    write_palette(tmp_path, other, [("000.png", labels)])
    assert (tmp_path / "contours" / "000.png").read_bytes() == before
    assert sorted(place.name for place in tmp_path.iterdir()) == [
        "contours",
        "labels",
        *(f"palette.{end}" for end in ("ase", "gpl", "hex", "json", "png")),
    ]


def test_tones_come_and_go_with_the_labels(tmp_path: Path) -> None:
    palette = Palette((PaletteColor(RED, 0.7, "red"), PaletteColor(BLUE, 0.3, "blue")), "by hand")
    maps = [("000.png", np.array([[0, 1, 255]], dtype=np.uint8))]
    tones = [("000.png", np.array([[1, 0, 255]], dtype=np.uint8))]
    write_palette(tmp_path, palette, maps, (), tones)
    with Image.open(tmp_path / "tones" / "000.png") as grey:
        assert grey.mode == "L"
        assert np.array_equal(np.asarray(grey), tones[0][1])
    write_palette(tmp_path, palette, maps)
    assert not [place.name for place in tmp_path.iterdir() if "tones" in place.name]
    (tmp_path / "tones").mkdir()
    (tmp_path / "tones" / "song.ogg").write_bytes(b"")
    before = (tmp_path / "palette.json").read_bytes()
    with pytest.raises(OutputError, match=r"holds 'song\.ogg', which this command does not write"):
        write_palette(tmp_path, palette, maps)
    assert (tmp_path / "palette.json").read_bytes() == before
