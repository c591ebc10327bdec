"""Paints of drawings that are shaded throughout: laws, ramps, labels, recolouring."""

from time import process_time

import numpy as np
import pytest

from toonset.errors import PaletteError
from toonset.nerf.look.paint_labels import paint_labels, repainted
from toonset.palette.choice import choose_palette
from toonset.palette.colors import oklab_from_rgb, rgb_from_oklab, shaded_oklab_from_rgb
from toonset.palette.corrected import correct_palette
from toonset.palette.corrections import Divided, PaletteCorrections
from toonset.palette.extract import extract_palette, paint_maps
from toonset.palette.formats.json import palette_of, to_json
from toonset.palette.names import hex_of
from toonset.palette.options import PaletteOptions
from toonset.palette.paints.ramps import join_patches, moments_of
from toonset.palette.paints.select import PaletteRule
from toonset.palette.palette import Palette
from toonset.palette.pixels.patches import Patches, find_patches, smooth_lab
from toonset.palette.pixels.ramp_labels import Ramp, ramps_of, savings
from toonset.palette.pixels.ramp_recolor import (
    _without_blends,
    find_shaded_mixtures,
    recolor_shaded,
)
from toonset.palette.recolor import recolor_drawing
from toonset.palette.shaded import find_shaded_palette, is_shaded
from toonset.raster import erode

SKIN, HAIR, COAT, BELT = (230, 180, 145), (110, 64, 42), (50, 96, 160), (190, 40, 44)
PAINTS = (SKIN, HAIR, COAT, BELT)
SIZE = 200, 90


def _drawing(seed: int, size: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return a shaded drawing and the number of every pixel's paint, 255 = none."""
    rng = np.random.default_rng(seed)
    height, width = SIZE[0] * size, SIZE[1] * size
    rows, columns = np.mgrid[:height, :width] / size
    paint = np.full((height, width), 255)
    body = np.abs(columns - 45) < 34
    paint[body & (rows > 70)] = 2
    paint[body & (rows > 120) & (rows < 134)] = 3
    paint[(columns - 45) ** 2 + (rows - 42) ** 2 < 32**2] = 0
    paint[((columns - 45) ** 2 + (rows - 42) ** 2 < 32**2) & (rows < 32)] = 1
    light = 0.55 + 0.45 * np.sin(np.clip(columns / 60, 0, 1.5))
    light = light * (1 + 0.12 * np.sin(rows / 4 + seed) * np.sin(columns / 5))
    shade = np.stack([light**1.1, light, light**0.9], axis=-1)
    table = np.array([*PAINTS, (0, 0, 0)], dtype=float)
    rgb = table[np.where(paint == 255, 4, paint)] * shade + rng.normal(0, 0.7, (height, width, 1))
    alpha = np.where(paint == 255, 0, 255)
    rgba = np.dstack([np.rint(rgb).clip(0, 255), alpha]).astype(np.uint8)
    return rgba, paint


def _found(size: int = 1) -> tuple[list[np.ndarray], list[np.ndarray], Palette]:
    drawn = [_drawing(seed, size) for seed in range(3)]
    pictures = [rgba for rgba, _ in drawn]
    return pictures, [paint for _, paint in drawn], extract_palette(pictures)


def test_shade_that_scales_levels_changes_lightness_alone() -> None:
    rng = np.random.default_rng(1)
    full = rng.integers(60, 256, (200, 3)).astype(np.uint8)
    half = np.rint((full + 4.0) * 0.5 - 4).astype(np.uint8)
    one, other = shaded_oklab_from_rgb(full), shaded_oklab_from_rgb(half)
    hue = one[:, 1:] / one[:, :1] - other[:, 1:] / other[:, :1]
    assert np.abs(hue).max() < 0.01
    assert (other[:, 0] < one[:, 0]).all()


def test_oklab_and_back_is_the_same_colour() -> None:
    rgb = np.random.default_rng(2).integers(0, 256, (500, 3)).astype(np.uint8)
    assert np.array_equal(rgb_from_oklab(oklab_from_rgb(rgb)), rgb)


@pytest.mark.parametrize("size", [1, 3])
def test_every_paint_is_found_and_labelled(size: int) -> None:
    pictures, truth, palette = _found(size)
    assert is_shaded(pictures)
    assert palette.has_ramps
    assert palette.shadow is None
    maps = paint_maps(pictures, [np.zeros(one.shape, np.uint8) for one in truth], palette)
    table = np.zeros((256, 256), dtype=int)
    for own, found in zip(truth, maps, strict=True):
        assert found.tones is None
        assert np.array_equal(found.labels == 255, own == 255)
        np.add.at(table, (own[own < 255], found.labels[own < 255]), 1)
    best = table[:4].argmax(axis=1)
    assert len(set(best.tolist())) == 4
    assert table[range(4), best].sum() / table[:4].sum() > 0.97


def test_ramps_go_from_light_to_dark_and_are_colours_that_are_there() -> None:
    pictures, _, palette = _found()
    seen = np.concatenate([one[one[..., 3] > 0][:, :3] for one in pictures]).astype(int)
    for color in palette.colors:
        light = [float(oklab_from_rgb(np.array(t.rgb, np.uint8))[0]) for t in color.tones]
        assert light == sorted(light, reverse=True)
        assert sum(tone.share for tone in color.tones) == pytest.approx(color.share)
        assert 0 < (color.sure or 0) <= 1
        for tone in color.tones:
            assert np.abs(seen - tone.rgb).max(axis=1).min() <= 3
    again = palette_of(to_json(palette), "palette.json")
    assert again.has_ramps


def test_flat_paint_is_not_shaded_nor_is_grain() -> None:
    rng = np.random.default_rng(3)
    _, paint = _drawing(0)
    table = np.array([*PAINTS, (0, 0, 0)], dtype=float)
    rgb = table[np.where(paint == 255, 4, paint)]
    for levels in (0, 4, 12):
        noisy = np.rint(rgb + rng.normal(0, levels, rgb.shape[:2])[..., None]).clip(0, 255)
        rgba = np.dstack([noisy, np.where(paint == 255, 0, 255)]).astype(np.uint8)
        assert not is_shaded([rgba])


def test_a_ramp_is_one_patch_and_an_edge_parts_two() -> None:
    ramp = np.linspace(90, 200, 60)[None, :, None] * np.array([1, 0.8, 0.5]) * np.ones((40, 1, 1))
    rgba = np.dstack([np.rint(ramp), np.full((40, 60), 255)]).astype(np.uint8)
    assert len(find_patches(*smooth_lab(rgba))[1].pixels) == 1
    rgba[20:, :, :3] = rgba[20:, :, 2::-1]
    assert len(find_patches(*smooth_lab(rgba))[1].pixels) == 2


def test_left_out_paints_are_listed_and_come_back() -> None:
    pictures, _, _ = _found()
    lines = [np.zeros(one.shape[:2], np.uint8) for one in pictures]
    plain = choose_palette(pictures, lines, PaletteOptions(min_share=0.2, features=False))
    belt = min(plain.dropped, key=lambda one: np.abs(np.array(one.rgb) - BELT).sum())
    assert belt.share < 0.2
    assert belt.rgb not in [color.rgb for color in plain.colors]
    for options in (
        PaletteOptions(min_share=0.2, features=False, keep=hex_of(belt.rgb)),
        PaletteOptions(min_share=0.01, features=False),
    ):
        kept = choose_palette(pictures, lines, options)
        away = [np.abs(np.array(color.rgb) - belt.rgb).max() for color in kept.colors]
        assert min(away) <= 6
    with pytest.raises(PaletteError, match="no such colour"):
        choose_palette(pictures, lines, PaletteOptions(keep="#00ff00"))


def test_colours_picked_by_hand_get_ramps() -> None:
    pictures, truth, _ = _found()
    lines = [np.zeros(one.shape, np.uint8) for one in truth]
    palette = choose_palette(pictures, lines, PaletteOptions("#e6b491,#6e402a,#3260a0,#be282c"))
    assert [color.rgb for color in palette.colors] == list(PAINTS)
    assert all(color.tones for color in palette.colors)
    assert sum(color.share for color in palette.colors) == pytest.approx(1)


def test_recolouring_turns_the_hue_and_keeps_the_order_of_light() -> None:
    pictures, truth, palette = _found()
    lines = [np.zeros(one.shape, np.uint8) for one in truth]
    maps = paint_maps(pictures, lines, palette)
    coat = min(
        range(len(palette.colors)),
        key=lambda n: np.abs(np.array(palette.colors[n].rgb, int) - COAT).sum(),
    )
    new = palette.rgb.copy()
    new[coat] = (150, 110, 30)
    same = recolor_drawing(pictures[0], maps[0], lines[0], palette, palette.rgb)
    assert np.array_equal(same, pictures[0])
    turned = recolor_drawing(pictures[0], maps[0], lines[0], palette, new)
    inside = truth[0] == 2
    before, after = oklab_from_rgb(pictures[0][inside, :3]), oklab_from_rgb(turned[inside, :3])
    assert (after[:, 2] > 0).mean() > 0.999  # was blue
    assert np.corrcoef(before[:, 0], after[:, 0])[0, 1] > 0.98
    assert np.array_equal(turned[truth[0] == 1], pictures[0][truth[0] == 1])


def test_a_look_of_shaded_drawings_keeps_no_old_hue() -> None:
    pictures, truth, palette = _found()
    old = palette.rgb
    coat = int(np.abs(old.astype(int) - COAT).sum(axis=1).argmin())
    new = old.copy()
    new[coat] = (170, 90, 30)
    turned = repainted(pictures, old, new, None, ramps_of(palette))
    for before, after, paint in zip(pictures, turned, truth, strict=True):
        own = erode(paint == 2, 3)
        light = [oklab_from_rgb(one[own, :3])[:, 0] for one in (before, after)]
        assert (after[own, 0] > after[own, 2]).all()
        assert np.corrcoef(light[0], light[1])[0, 1] > 0.99
        assert np.array_equal(after[erode(paint == 0, 3)], before[erode(paint == 0, 3)])


def test_a_blend_on_a_third_paints_ramp_does_not_shine() -> None:
    rows, columns = np.mgrid[:80, :80]
    light = (0.8 + 0.2 * np.sin(rows / 9))[..., None]
    blue, tan, grey = np.array([(40, 110, 190), (200, 150, 90), (120, 130, 140)], np.uint8)
    rgb = np.where((columns < 40)[..., None], blue, tan).astype(float)
    rgb[:, 40] = (blue.astype(float) + tan) / 2
    rgb[60:, :20] = grey
    picture = np.dstack([np.rint(rgb * light), np.full((80, 80), 255)]).astype(np.uint8)
    labels = np.where(columns < 40, 0, 1).astype(np.uint8)
    labels[:, 40] = labels[60:, :20] = 2  # the border's blend is nearest to grey
    old = np.stack([blue, tan, grey])
    new = old.copy()
    new[2] = (250, 230, 40)
    turned = recolor_shaded(picture, labels, old, new)
    assert np.array_equal(turned[:50], picture[:50])
    assert (turned[64:, :16, 2] < 90).all()
    new = old.copy()
    new[0] = (190, 60, 40)
    blends = recolor_shaded(picture, labels, old, new)[:50, 40, :3].astype(int)
    wanted = light[:50, 40] * (new[0].astype(float) + tan) / 2
    assert np.abs(blends - wanted).max() < 12


@pytest.mark.parametrize("wide", [2, 3])
def test_a_trim_in_a_colour_between_its_neighbours_is_recoloured(wide: int) -> None:
    old = np.array([(110, 70, 40), (240, 220, 190), (175, 140, 90)], np.uint8)
    labels = np.where(np.arange(80) < 40, 0, 1).astype(np.uint8) * np.ones((80, 1), np.uint8)
    labels[:, 40 : 40 + wide] = labels[70:, :10] = 2
    picture = np.dstack([old[labels], np.full(labels.shape, 255, np.uint8)])
    new = old.copy()
    new[2] = (60, 90, 220)
    turned = recolor_shaded(picture, labels, old, new)
    assert (turned[:60, 40 : 40 + wide, :3] == new[2]).all()


def test_many_paints_cost_little_more_than_few() -> None:
    rng = np.random.default_rng(0)
    seconds = []
    for count in (10, 60):
        labels = np.kron(rng.integers(0, count, (50, 50)), np.ones((6, 6), int)).astype(np.uint8)
        labels[:, ::17] = rng.integers(0, count, labels[:, ::17].shape)
        color = rng.integers(30, 225, (count, 3)).astype(np.float32)[labels]
        start = process_time()
        _without_blends(color, labels, np.ones(labels.shape, np.bool_))
        seconds.append(process_time() - start)
    assert seconds[1] < 15 * seconds[0] + 0.1  # pairs are 39 times as many


def test_mixtures_of_shaded_paints_are_what_borders_are_made_of() -> None:
    pictures, truth, _ = _found()
    labels = truth[0].astype(np.uint8)
    found = find_shaded_mixtures(pictures[0][..., :3], labels, labels < 255)
    inner = erode(labels == 2, 3)
    assert (found.share[inner] == 0).all()
    assert (found.first[inner] == 2).all()
    assert (found.share <= 0.5).all()
    assert ((found.share > 0) == (found.first != found.second)).all()


def test_a_look_labels_shaded_drawings_as_their_palette_does() -> None:
    pictures, _, palette = _found()
    maps = paint_maps(pictures, [np.zeros_like(p[..., 0]) for p in pictures], palette)
    again = paint_labels(pictures, palette.rgb, None, ramps_of(palette))
    assert all(np.array_equal(one.labels, own) for one, own in zip(maps, again, strict=True))


def _patches(colors: list[tuple[float, float, float]]) -> Patches:
    """Return a hundred large patches of every colour, each lit a little differently."""
    rng = np.random.default_rng(4)
    mean = np.repeat(np.array(colors), 100, axis=0)
    mean *= rng.uniform(0.8, 1.2, (len(mean), 1))
    pixels = np.full(len(mean), 2000)
    return Patches(pixels, pixels, mean, np.zeros((len(mean), 3, 3)))


@pytest.mark.parametrize(
    ("colors", "paints"),
    [
        ([(0.5, 0.05, -0.1), (0.5, 0.055, -0.104)], 1),  # nobody can tell these apart
        ([(0.5, 0.05, -0.1), (0.5, 0.03, -0.07)], 2),
        ([(0.5, 0.01, 0.01), (0.25, 0.001, 0.001)], 2),  # two greys
    ],
)
def test_two_paints_that_nobody_can_tell_apart_are_one(
    colors: list[tuple[float, float, float]], paints: int
) -> None:
    assert len(np.unique(join_patches(moments_of([_patches(colors)])))) == paints


def test_thin_stripes_are_one_paint_in_whatever_light() -> None:
    rng = np.random.default_rng(0)
    stripe = (np.array(COAT) + BELT) / 2
    pictures = []
    for seed in range(3):
        rgba, _ = _drawing(seed)
        for row in (90, 100, 110, 145, 155, 165, 175, 185):
            rgba[row, 14:76, :3] = np.clip(stripe * rng.uniform(0.3, 1.2), 0, 255)
        pictures.append(rgba)
    found = find_shaded_palette(pictures, PaletteRule(min_share=0.001))
    assert len(found.colors) == len(PAINTS) + 1
    away = oklab_from_rgb(found.rgb) - oklab_from_rgb(stripe.astype(np.uint8))
    assert np.linalg.norm(away[:, 1:], axis=1).min() < 0.03


def test_what_a_ramp_saves_is_what_its_pixels_cost_as_another() -> None:
    stops = oklab_from_rgb(np.array([SKIN, COAT, COAT], np.uint8))
    ramps = [Ramp(stop[None], float(stop[0]), 0.1) for stop in stops]
    lab = np.repeat(stops[:2], 50, axis=0).reshape(10, 10, 3).astype(np.float32)
    labels = np.repeat(np.array([0, 1], np.uint8), 50).reshape(10, 10)
    labels[0] = 255
    skin, coat, twin = savings(lab, labels, ramps)
    assert skin > 300
    assert coat == pytest.approx(0)
    assert twin == 0
    assert np.isinf(savings(lab, np.zeros_like(labels), ramps[:1])).all()


def test_colours_that_are_merged_keep_a_ramp_and_are_parted_again_by_it() -> None:
    pictures, truth, found = _found()
    contours = [np.zeros_like(picture[..., 0]) for picture in pictures]
    pair = hex_of(found.colors[0].rgb), hex_of(found.colors[1].rgb)
    one, _ = correct_palette(pictures, contours, found, PaletteCorrections(merge=(pair,)))
    assert len(one.colors) == len(found.colors) - 1
    assert all(len(color.tones) == len(found.colors[0].tones) for color in one.colors)
    parted = PaletteCorrections(split=(Divided(pair[0], pair),))
    two, maps = correct_palette(pictures, contours, one, parted)
    number = {color.rgb: at for at, color in enumerate(found.colors)}
    table = np.array([number[color.rgb] for color in two.colors])
    for own, old, paint in zip(maps, paint_maps(pictures, contours, found), truth, strict=True):
        inside = erode(paint < 255, 2)
        assert (table[own.labels[inside]] == old.labels[inside]).mean() > 0.97


def test_a_split_that_parts_nothing_is_refused() -> None:
    pictures, _, found = _found()
    contours = [np.zeros_like(picture[..., 0]) for picture in pictures]
    color, pale = hex_of(found.colors[0].rgb), "#ffffff"
    nothing = PaletteCorrections(split=(Divided(color, (color, pale)),))
    with pytest.raises(PaletteError, match=r"palette\.split\.0\.into\.1: hardly a pixel of"):
        correct_palette(pictures, contours, found, nothing)


def test_a_dark_tone_of_a_ramp_is_no_colour_to_keep_besides() -> None:
    pictures, _, found = _found()
    dark = found.colors[0].tones[-1].rgb
    kept = choose_palette(
        pictures, [np.zeros_like(p[..., 0]) for p in pictures], PaletteOptions(keep=hex_of(dark))
    )
    assert len(kept.colors) == len(found.colors)


def test_what_a_shaded_palette_leaves_out_is_written_and_read() -> None:
    pictures, _, _ = _found()
    contours = [np.zeros_like(picture[..., 0]) for picture in pictures]
    found = choose_palette(pictures, contours, PaletteOptions(max_colors=2))
    assert found.dropped
    assert [one.rgb for one in palette_of(to_json(found), "here").dropped] == [
        one.rgb for one in found.dropped
    ]
