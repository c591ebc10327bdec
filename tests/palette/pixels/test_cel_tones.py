"""Sheets shaded in flat steps: a paint has its tones, garments stay garments."""

from functools import cache

import numpy as np
import pytest

from toonset.palette.colors import oklab_from_rgb
from toonset.palette.corrected import correct_palette
from toonset.palette.corrections import PaletteCorrections
from toonset.palette.extract import extract_palette, paint_maps
from toonset.palette.formats.json import palette_of, to_json
from toonset.palette.names import hex_of
from toonset.palette.palette import Palette
from toonset.palette.pixels.cel_tones import MOST_TONES, find_steps, tone_colors
from toonset.palette.pixels.ink_lines import find_contours
from toonset.palette.recolor import recolor_drawing
from toonset.raster import erode

PAINTS = np.array([(226, 178, 140), (60, 84, 160), (190, 60, 50), (90, 150, 90)], float)
# centre and half size of every part, x and y; its paint
PARTS = (
    ((62, 170), (20, 56), 2),
    ((112, 170), (20, 56), 2),
    ((62, 232), (26, 16), 3),
    ((116, 232), (26, 16), 3),
    ((86, 112), (42, 44), 1),
    ((86, 40), (40, 36), 0),
)
STEPS = np.log([[1.0] * 3, [0.74, 0.75, 0.82], [0.54, 0.56, 0.66], [0.40, 0.42, 0.54]])
CUTS = (0.1, 0.55, 0.8)


@cache
def _drawn(
    tones: int, turned: bool = False
) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
    """Return five drawings, their paints and tones; `turned`: light on the other side in two."""
    rng = np.random.default_rng(tones)
    depth = 1 + 0.12 * rng.uniform(-1, 1, (len(PAINTS), 1))
    table = np.exp(np.log(PAINTS)[None] + depth * STEPS[:, None])
    pictures, paints, steps = [], [], []
    for view in range(5):
        y, x = np.mgrid[:260, :176] + 0.5
        paint, tone = np.full(y.shape, 255, np.uint8), np.zeros(y.shape, np.uint8)
        side = -1 if turned and view % 2 else 1
        for (cx, cy), (rx, ry), number in PARTS:
            across, down = (x - cx) / (rx * rng.uniform(0.95, 1.05)), (y - cy) / ry
            inside = across**2 + down**2 < 1
            light = side * across + 0.3 * down
            shade = sum((light > cut).astype(np.uint8) for cut in CUTS[: tones - 1])
            paint[inside], tone[inside] = number, np.broadcast_to(shade, y.shape)[inside]
        there = paint < 255
        rgb = np.zeros((*y.shape, 3))
        rgb[there] = table[tone[there], paint[there]]
        pictures.append(np.dstack([np.rint(rgb), 255 * there]).astype(np.uint8))
        paints.append(paint)
        steps.append(np.where(there, tone, 255).astype(np.uint8))
    return pictures, paints, steps


def _palette(tones: int) -> tuple[Palette, list[int]]:
    """Return the palette, and the number in it of each of the paints."""
    palette = extract_palette(_drawn(tones)[0])
    apart = np.abs(palette.rgb[None].astype(float) - PAINTS[:, None]).sum(axis=-1)
    return palette, apart.argmin(axis=1).tolist()


@pytest.mark.parametrize("tones", [3, 4])
def test_every_paint_has_its_tones_from_light_to_dark(tones: int) -> None:
    palette, places = _palette(tones)
    assert palette.stepped
    assert len(palette.colors) == len(PAINTS)
    assert sorted(places) == list(range(len(PAINTS)))
    for color in palette.colors:
        assert len(color.tones) == tones
        assert color.tones[0].rgb == color.rgb
        light = [sum(tone.rgb) for tone in color.tones]
        assert light == sorted(light, reverse=True)
        assert sum(tone.share for tone in color.tones) == pytest.approx(color.share)
    assert sum(color.share for color in palette.colors) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("tones", [3, 4])
def test_labels_are_of_paints_and_tones_say_how_dark_they_are(tones: int) -> None:
    palette, places = _palette(tones)
    pictures, paints, steps = _drawn(tones)
    maps = paint_maps(pictures, find_contours(pictures), palette)
    for one, paint, step in zip(maps, paints, steps, strict=True):
        assert one.tones is not None
        there = paint < 255
        assert (one.labels[there] == np.array(places)[paint[there]]).mean() > 0.99
        assert (one.tones[there] == step[there]).mean() > 0.98
        assert (one.tones[one.labels == 255] == 255).all()


def test_a_palette_with_steps_is_written_and_read() -> None:
    palette, _ = _palette(3)
    content = to_json(palette)
    assert content["stepped"] is True
    again = palette_of(content, "palette.json")
    assert again.stepped
    assert [c.tones for c in again.colors] == [
        tuple(type(t)(t.rgb, round(t.share, 6)) for t in c.tones) for c in palette.colors
    ]


def test_flat_paints_have_no_steps() -> None:
    palette, _ = _palette(1)
    assert not palette.stepped
    assert "stepped" not in to_json(palette)
    assert all(not color.tones for color in palette.colors)


def test_shades_whose_light_changes_sides_stay_paints() -> None:
    pictures, _, _ = _drawn(3, turned=True)
    palette = extract_palette(pictures)
    assert not palette.stepped
    assert len(palette.colors) > 2 * len(PAINTS)


@pytest.mark.parametrize("light", [0.45, 0.6, 0.7, 0.8])
def test_a_darker_garment_of_the_same_hue_stays_a_paint(light: float) -> None:
    pictures, paints = ([one.copy() for one in part] for part in _drawn(3)[:2])
    vest = np.rint(PAINTS[1] * light)  # on the breast of the blue shirt, on either side of it
    for picture, paint in zip(pictures, paints, strict=True):
        y, x = np.mgrid[: paint.shape[0], : paint.shape[1]]
        band = (paint == 1) & (np.abs(y - 120) < 14) & (np.abs(x - 86) < 26)
        picture[band, :3] = vest
    palette = extract_palette(pictures)
    assert palette.stepped
    assert tuple(vest.astype(int).tolist()) in [color.rgb for color in palette.colors]


def test_a_colour_to_keep_is_no_tone() -> None:
    pictures = _drawn(3)[0]
    shade = extract_palette(pictures).colors[0].tones[1].rgb
    kept = extract_palette(pictures, keep="#{:02x}{:02x}{:02x}".format(*shade))
    assert shade in [color.rgb for color in kept.colors]


def test_recolouring_turns_all_tones_and_keeps_their_order_and_contrast() -> None:
    palette, places = _palette(3)
    pictures, paints, _ = _drawn(3)
    lines = find_contours(pictures)
    maps = paint_maps(pictures, lines, palette)
    number = places[1]
    new = palette.rgb.copy()
    new[number] = (200, 140, 40)
    same = recolor_drawing(pictures[0], maps[0], lines[0], palette, palette.rgb)
    assert np.array_equal(same, pictures[0])
    turned = recolor_drawing(pictures[0], maps[0], lines[0], palette, new)
    own = erode(paints[0] == 1, 2)
    before, after = (oklab_from_rgb(one[own, :3]) for one in (pictures[0], turned))
    assert (after[:, 2] > 0.02).all()  # was blue
    ratio = oklab_from_rgb(new[number])[0] / oklab_from_rgb(palette.rgb[number])[0]
    assert after[:, 0] == pytest.approx(ratio * before[:, 0], rel=0.03)
    others = erode((paints[0] < 255) & (paints[0] != 1), 3)
    assert np.array_equal(turned[others], pictures[0][others])


def test_merged_paints_have_tones_that_their_maps_name() -> None:
    palette, _ = _palette(3)
    pictures, lines = _drawn(3)[0], find_contours(_drawn(3)[0])
    first, second = (hex_of(color.rgb) for color in palette.colors[:2])
    wanted = PaletteCorrections(merge=((first, second),))
    found, maps = correct_palette(pictures, lines, palette, wanted)
    assert len(found.colors) == len(palette.colors) - 1
    for number, color in enumerate(found.colors):
        assert 1 <= len(color.tones) <= MOST_TONES
        assert sum(tone.share for tone in color.tones) == pytest.approx(color.share)
        for one in maps:
            assert one.tones is not None
            own = one.tones[one.labels == number]
            assert own.max(initial=0) < len(color.tones)


def test_all_paints_have_as_many_tones_in_tables() -> None:
    palette, _ = _palette(3)
    table = tone_colors(palette, palette.rgb)
    assert table.shape == (3 * len(palette.colors), 3)
    assert np.array_equal(table[: len(palette.colors)], palette.rgb)


def test_colours_without_a_shade_among_them_are_not_looked_at() -> None:
    colors = np.array([(200, 30, 30), (30, 200, 30), (30, 30, 200)], np.uint8)
    assert find_steps([], [], colors) == []
