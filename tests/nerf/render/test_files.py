"""A turn as GIF, WebP, MP4 and sprite sheet: what comes out is what went in."""

from __future__ import annotations

import io
import json
import sys
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageSequence

from toonset.errors import OutputError, SetupError
from toonset.nerf.render.animation import duration_ms, encode_gif, encode_mp4, encode_webp, smaller
from toonset.nerf.render.files import turntable_files
from toonset.nerf.render.sprite_sheet import LARGEST_SIDE, sprite_json, sprite_sheet
from toonset.nerf.render.turntable import turntable
from toonset.nerf.train.result import Training

COLORS = np.array([[200, 40, 40], [40, 80, 200], [20, 20, 20], [250, 240, 10]], dtype=np.uint8)


def turn(count: int = 6, height: int = 31, width: int = 25) -> list[np.ndarray]:
    """Squares of flat colours that move to the right, soft on one side."""
    pictures = []
    for number in range(count):
        picture = np.zeros((height, width, 4), dtype=np.uint8)
        picture[5:27, 3 + number : 9 + number, :3] = COLORS[number % 4]
        picture[5:27, 3 + number : 9 + number, 3] = 255
        picture[5:27, 3 + number, 3] = 120
        pictures.append(picture)
    return pictures


def frames_of(data: bytes, mode: str) -> list[np.ndarray]:
    with Image.open(io.BytesIO(data)) as image:
        assert image.info.get("loop") == 0
        return [np.array(frame.convert(mode)) for frame in ImageSequence.Iterator(image)]


def test_webp_loses_nothing() -> None:
    pictures = turn()
    found = frames_of(encode_webp(pictures), "RGBA")
    assert len(found) == len(pictures)
    for got, picture in zip(found, pictures, strict=True):
        np.testing.assert_array_equal(got[..., 3], picture[..., 3])
        seen = picture[..., 3] > 0
        np.testing.assert_array_equal(got[seen], picture[seen])


def test_gif_shows_flat_colours_over_white_without_flicker() -> None:
    pictures = turn()
    data = encode_gif(pictures)
    with Image.open(io.BytesIO(data)) as image:
        assert image.info["duration"] == duration_ms(len(pictures))
    found = frames_of(data, "RGB")
    assert len(found) == len(pictures)
    for got, picture in zip(found, pictures, strict=True):
        full, empty = picture[..., 3] == 255, picture[..., 3] == 0
        assert (got[empty] == 255).all()
        np.testing.assert_array_equal(got[full], picture[full][:, :3])
    rng = np.random.default_rng(2)
    for picture in pictures:  # many colours below: the flat ones are kept
        picture[28:] = (*np.zeros(3), 255)
        picture[28:, :, :3] = rng.integers(0, 256, (3, 25, 3))
    for got, picture in zip(frames_of(encode_gif(pictures), "RGB"), pictures, strict=True):
        flat = (picture[..., 3] == 255) & (np.arange(31) < 28)[:, None]
        np.testing.assert_array_equal(got[flat], picture[flat][:, :3])
        assert np.abs(got[28:].astype(int) - picture[28:, :, :3]).mean() < 20


def test_a_picture_is_made_smaller_with_its_colours() -> None:
    picture = np.zeros((60, 40, 4), dtype=np.uint8)
    picture[10:50, 10:30] = (200, 40, 40, 255)
    small = smaller(picture, 30)
    assert small.shape == (30, 20, 4)
    assert set(map(tuple, small[small[..., 3] > 0])) == {(200, 40, 40, 255)}
    assert small[..., 3].mean() == pytest.approx(picture[..., 3].mean())
    for most in (60, 90, None):
        assert smaller(picture, most) is picture


def test_loops_are_made_smaller_and_sprites_are_not(training: Training) -> None:
    pictures = turn()
    cameras = turntable(training.result, len(pictures), size=25)
    files = turntable_files(["gif", "webp", "sprites"], pictures, training.result, cameras, 20)
    sizes = {}
    for name in ("turntable.gif", "turntable.webp", "sprites.png"):
        with Image.open(io.BytesIO(files[name])) as image:
            sizes[name] = max(image.size)
    assert sizes["turntable.gif"] == sizes["turntable.webp"] == 20
    assert sizes["sprites.png"] > 20


@pytest.mark.parametrize("count", [1, 8, 36, 400])
def test_a_turn_takes_three_seconds_or_what_viewers_can(count: int) -> None:
    assert duration_ms(count) * count == pytest.approx(3000 if count < 150 else 8000, rel=0.05)


@pytest.mark.parametrize("encode", [encode_gif, encode_webp, encode_mp4, sprite_sheet])
def test_pictures_of_two_sizes_are_refused(encode: Any) -> None:
    with pytest.raises(OutputError, match="2 sizes"):
        encode([*turn(), np.zeros((8, 8, 4), np.uint8)])


def test_mp4_plays_or_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    av = pytest.importorskip("av")
    pictures = turn()
    with av.open(io.BytesIO(encode_mp4(pictures))) as file:
        assert file.streams.video[0].codec_context.name == "h264"
        found = [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]
    assert len(found) == len(pictures)
    assert found[0].shape == (32, 26, 3)
    for got, picture in zip(found, pictures, strict=True):
        assert (got[:3] > 245).all()
        column = int(np.nonzero(picture[15, :, 3])[0][0]) + 3  # in the middle of the square
        assert np.abs(got[15, column].astype(int) - picture[15, column, :3]).max() < 30
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(SetupError, match="pip install av"):
        encode_mp4(pictures)


def test_sprites_are_the_pictures_cut_alike() -> None:
    pictures = turn(7)
    sheet = sprite_sheet(pictures)
    about = json.loads(json.dumps(sprite_json(sheet, "turn.png", [(12.0, 27.0)] * 7)))
    assert about["animations"]["turn"] == list(about["frames"])
    assert about["meta"]["size"] == {"w": sheet.rgba.shape[1], "h": sheet.rgba.shape[0]}
    assert about["meta"]["frameTags"][0]["to"] == 6
    x0, y0 = sheet.crop_xy
    for entry, picture in zip(about["frames"].values(), pictures, strict=True):
        x, y, w, h = (entry["frame"][key] for key in "xywh")
        cell = sheet.rgba[y : y + h, x : x + w]
        assert (cell[[0, -1]] == 0).all()
        assert (cell[:, [0, -1]] == 0).all()
        whole = np.zeros_like(picture)
        whole[y0 : y0 + h, x0 : x0 + w] = cell
        np.testing.assert_array_equal(whole, picture)
        assert entry["pivot"]["x"] * w + x0 == pytest.approx(12, abs=1e-3)
        assert entry["pivot"]["y"] * h + y0 == pytest.approx(27, abs=1e-3)
        assert entry["duration"] == duration_ms(7)


def test_sprites_of_nothing_and_of_too_much() -> None:
    empty = [np.zeros((6, 5, 4), np.uint8)] * 3
    assert not sprite_sheet(empty).rgba.any()
    wide = np.zeros((4, LARGEST_SIDE + 1, 4), np.uint8)
    wide[...] = 255
    with pytest.raises(OutputError, match="smaller --size"):
        sprite_sheet([wide])
