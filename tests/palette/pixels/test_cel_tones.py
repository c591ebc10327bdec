"""Sheets shaded in flat steps: a paint has its tones, garments stay garments."""

from functools import cache

import numpy as np
import pytest

from toonset.palette.choice import choose_palette
from toonset.palette.colors import oklab_from_rgb
from toonset.palette.corrected import correct_palette
from toonset.palette.corrections import PaletteCorrections
from toonset.palette.extract import extract_palette, paint_maps
from toonset.palette.formats.json import palette_of, to_json
from toonset.palette.names import hex_of
from toonset.palette.options import PaletteOptions
from toonset.palette.palette import MOST_TONES, Palette
from toonset.palette.pixels.cel_tones import _darker, find_steps, tone_colors
from toonset.palette.pixels.ink_lines import find_contours
from toonset.palette.pixels.shadow import FLOOR
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


@pytest.mark.parametrize("off", [0, 1])
@pytest.mark.parametrize("tone", [1, 2])
def test_a_colour_to_keep_is_no_tone(tone: int, off: int) -> None:
    pictures = _drawn(3)[0]
    shade = extract_palette(pictures).colors[0].tones[tone].rgb
    red, green, blue = (level + off for level in shade)
    kept = extract_palette(pictures, PaletteOptions(keep=hex_of((red, green, blue))))
    assert kept.stepped
    assert shade in [color.rgb for color in kept.colors]
    assert shade not in [one.rgb for c in kept.colors for one in c.tones if one.rgb != c.rgb]
    assert f"kept by hand: {hex_of((red, green, blue))}" in kept.rule


def test_a_paint_to_keep_has_its_tones() -> None:
    pictures = _drawn(3)[0]
    palette = extract_palette(pictures)
    least = palette.colors[-1]
    kept = extract_palette(pictures, PaletteOptions(keep=hex_of(least.rgb), max_colors=2))
    assert [color.rgb for color in kept.colors] == [palette.colors[0].rgb, least.rgb]
    assert [color.tones for color in kept.colors] == [palette.colors[0].tones, least.tones]


@pytest.mark.parametrize("share", [0.0, 0.05])
def test_a_paint_whose_tones_are_all_kept_has_no_steps(share: float) -> None:
    pictures = _drawn(3)[0]
    own = extract_palette(pictures).colors[0]
    keep = ",".join(hex_of(tone.rgb) for tone in own.tones)
    kept = extract_palette(pictures, PaletteOptions(keep=keep, min_share=share))
    assert kept.stepped
    single = {color.rgb for color in kept.colors if len(color.tones) == 1}
    assert single == {tone.rgb for tone in own.tones}


@pytest.mark.parametrize("most", [1, 2, 3, 4])
def test_the_largest_paints_are_kept_with_their_tones(most: int) -> None:
    palette, _ = _palette(3)
    found = extract_palette(_drawn(3)[0], PaletteOptions(max_colors=most))
    assert found.stepped
    assert [color.rgb for color in found.colors] == [c.rgb for c in palette.colors[:most]]
    assert [color.tones for color in found.colors] == [c.tones for c in palette.colors[:most]]
    assert ("at most" in found.rule, "kept" in found.rule) == (True, False)


@pytest.mark.parametrize("share", [0.25, 0.3])
def test_shades_of_paints_that_are_left_out_are_no_features(share: float) -> None:
    palette, _ = _palette(3)
    found = extract_palette(_drawn(3)[0], PaletteOptions(min_share=share))
    assert found.colors == tuple(color for color in palette.colors if color.share >= share)
    assert found.features == ()


def test_where_no_paint_has_steps_the_palette_has_none() -> None:
    assert not extract_palette(_drawn(3)[0], PaletteOptions(min_share=1.0)).stepped


def test_printed_paints_stay_in_their_order_and_have_their_tones() -> None:
    pictures = [picture.copy() for picture in _drawn(3)[0]]
    yellow = (250, 220, 40)
    for picture in pictures:
        picture[110:116, 80:88, :3] = yellow
    lights = [(round(r), round(g), round(b)) for r, g, b in PAINTS.tolist()]
    printed = (lights[3], yellow, lights[1], lights[2], lights[0])
    options = PaletteOptions(features=False)
    found = choose_palette(pictures, find_contours(pictures), options, printed)
    assert found.stepped
    assert found.printed == printed
    assert tuple(color.rgb for color in found.colors) == printed
    assert [len(color.tones) for color in found.colors] == [3, 1, 3, 3, 3]


def test_tones_of_grainy_drawings_are_read_as_they_are_drawn() -> None:
    rng = np.random.default_rng(0)
    pictures = []
    for picture in _drawn(3)[0]:
        noisy = picture[..., :3] + rng.normal(0, 7, (*picture.shape[:2], 1))
        rgb = np.rint(noisy).clip(0, 255).astype(np.uint8)
        pictures.append(np.dstack([rgb, picture[..., 3]]))
    truth, _ = _palette(3)
    found = extract_palette(pictures)
    assert found.stepped
    for own in truth.colors:
        near = min(found.colors, key=lambda c: np.abs(np.subtract(c.rgb, own.rgb)).sum())
        assert len(near.tones) == 3
        for one, other in zip(near.tones, own.tones, strict=True):
            assert np.abs(np.subtract(one.rgb, other.rgb)).max() <= 3


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
    for some in (colors, colors[:1], colors[:0]):
        assert find_steps([], [], some) == []


def test_no_two_colours_are_each_others_shade() -> None:
    rng = np.random.default_rng(0)
    colors = rng.integers(0, 256, (600, 3)).astype(np.uint8)
    colors[::2, rng.integers(0, 3, 300)] //= 12
    shade = _darker(colors, np.log(colors / 255 + FLOOR))
    order = np.log(colors / 255 + FLOOR).mean(axis=-1)
    assert shade.any()
    assert (order[None, :] > order[:, None])[shade].all()
