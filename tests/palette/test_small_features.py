"""Colours that the palette lacks are said: near-equal ones, and those of tiny features."""

import io

import numpy as np
import pytest
from PIL import Image

from lab.bench.palette.cases import palette_cases, random_paints
from tests.palette.pictures import as_set, block, opaque, soft_stripes
from toonset.cli.common.palette_text import palette_lines
from toonset.palette.colors import oklab_from_rgb
from toonset.palette.paints.extract import LEAST_LISTED, find_palette
from toonset.palette.paints.histogram import count_pixels
from toonset.palette.paints.places import patches_of, pixels_of
from toonset.palette.paints.select import PaletteRule
from toonset.palette.palette import Palette, Place
from toonset.palette.pixels.labels import label_pixels

SKIN, HAIR, SHIRT, EYE = (242, 190, 150), (238, 187, 147), (30, 90, 160), (20, 190, 180)


def listed(palette: Palette) -> list[tuple[int, int, int]]:
    return [color.rgb for color in palette.dropped]


def with_spots(color: tuple[int, int, int], *corners: tuple[int, int], px: int = 3) -> np.ndarray:
    """Return two stripes with square spots on the first."""
    picture = block((SKIN, 200), (SHIRT, 60))
    for x, y in corners:
        picture[y : y + px, x : x + px, :3] = color
    return picture


def away(first: tuple[int, int, int], second: tuple[int, int, int]) -> float:
    lab = oklab_from_rgb(np.array([first, second], dtype=np.uint8))
    return float(np.linalg.norm(lab[0] - lab[1]))


def as_jpeg(picture: np.ndarray, quality: int) -> np.ndarray:
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(picture[..., :3])).save(buffer, "JPEG", quality=quality)
    return np.dstack([np.asarray(Image.open(buffer)), picture[..., 3]])


# ---- near-equal colours


@pytest.mark.parametrize("order", [(SKIN, SHIRT, HAIR), (HAIR, SKIN, SHIRT)])
def test_a_near_equal_colour_is_listed_with_what_it_looks_like(order: tuple) -> None:
    wide = {SKIN: 60, HAIR: 30, SHIRT: 40}
    assert 0.008 < away(SKIN, HAIR) < 0.015
    palette = find_palette([block(*((color, wide[color]) for color in order))])
    assert as_set(palette) == {SKIN, SHIRT}
    (hair,) = palette.dropped
    assert hair.rgb == HAIR
    assert hair.share == pytest.approx(30 / 130)
    assert hair.cost == pytest.approx(away(SKIN, HAIR))
    before = sum(wide[color] for color in order[: order.index(HAIR)])
    assert hair.place == Place(0, (before, 0, 30, 40))
    assert any(
        ", looks like #f2be96 and is counted" in line
        for line in palette_lines(palette, verbose=True)
    )


def test_a_near_equal_colour_can_be_kept() -> None:
    picture = block((SKIN, 60), (HAIR, 30), (SHIRT, 40))
    palette = find_palette([picture], PaletteRule(keep=(HAIR,)))
    assert as_set(palette) == {SKIN, HAIR, SHIRT}
    assert palette.dropped == palette.warnings == ()
    assert {c.rgb: round(130 * c.share) for c in palette.colors} == {SKIN: 60, SHIRT: 40, HAIR: 30}
    labels = label_pixels(picture, palette.rgb)
    assert np.array_equal(palette.rgb[labels[:, 4:-4]][5, 60:80], [HAIR] * 20)


def test_a_near_equal_colour_under_the_rule_is_not_listed() -> None:
    picture = block((SKIN, 60), (HAIR, 3), (SHIRT, 40))
    assert listed(find_palette([picture])) == []
    assert listed(find_palette([picture], PaletteRule(min_share=0.02))) == [HAIR]


def test_near_equal_colours_of_a_jpeg_are_listed() -> None:
    palette = find_palette([as_jpeg(block((SKIN, 64), (SHIRT, 40), (HAIR, 64)), 90)])
    assert len(palette.colors) == 2
    kept = min((color.rgb for color in palette.colors), key=lambda rgb: away(rgb, SKIN))
    (other,) = listed(palette)
    assert {True} == {min(away(rgb, one) for one in (kept, other)) < 0.005 for rgb in (SKIN, HAIR)}


@pytest.mark.parametrize("levels", [6, 12, 40])
def test_gradients_and_noise_have_no_near_equal_colours(levels: int) -> None:
    rng = np.random.default_rng(levels)
    ramp = (200 + np.arange(240) * levels // 240)[None, :, None] * np.ones((40, 1, 3))
    for picture in (ramp, 200 + rng.normal(0, levels / 8, ramp.shape)):
        assert listed(find_palette([opaque(picture)])) == []


def test_the_ends_of_an_uneven_gradient_are_no_near_equal_colours() -> None:
    ends = ((200, 120, 90), 60), ((206, 123, 93), 60)
    between = [((200 + i, 120 + i // 2, 90 + i // 2), 18) for i in range(1, 6)]
    rest = (SHIRT, 700)
    assert listed(find_palette([block(ends[0], *between, ends[1], rest)])) == []
    (near,) = listed(find_palette([block(*ends, rest)]))
    assert near in [color for color, _ in ends]


# ---- tiny features


def test_tiny_features_of_an_own_colour_are_listed_and_can_be_kept() -> None:
    picture = with_spots(EYE, (50, 10), (70, 10))
    palette = find_palette([picture])
    assert as_set(palette) == {SKIN, SHIRT}
    (eye,) = palette.dropped
    assert (eye.rgb, eye.place) == (EYE, Place(0, (50, 10, 3, 3)))
    assert eye.share == pytest.approx(18 / 10400)
    kept = find_palette([picture], PaletteRule(keep=(EYE,)))
    assert as_set(kept) == {SKIN, SHIRT, EYE}
    assert kept.dropped == kept.warnings == ()


def test_a_feature_may_be_there_once_in_two_pictures() -> None:
    once = with_spots(EYE, (50, 10))
    assert listed(find_palette([once])) == []
    assert listed(find_palette([once, once[:, ::-1]])) == [EYE]


def test_what_blends_and_shades_look_like_is_no_feature() -> None:
    middle, shade = (136, 140, 155), (226, 172, 132)
    assert 0.04 < away(SKIN, shade) < 0.08
    for color in (middle, shade):
        assert listed(find_palette([with_spots(color, (50, 10), (70, 10))])) == []
    assert listed(find_palette([soft_stripes(SKIN, SHIRT, EYE)])) == []


@pytest.mark.parametrize("seed", [5, 1000])
def test_tiny_features_that_are_listed_are_true_colours(seed: int) -> None:
    for case in palette_cases(None, seed, quick=True):
        true = oklab_from_rgb(case.colors)
        for color in find_palette(case.images).dropped:
            own = oklab_from_rgb(np.array(color.rgb, dtype=np.uint8))
            near = np.linalg.norm(true - own, axis=1).min() < 0.02
            assert near or color.share >= LEAST_LISTED, (case.name, case.group, color)


def test_large_spots_are_listed_in_a_jpeg_too_and_smears_are_not() -> None:
    paints = random_paints(np.random.default_rng(4), 4)
    picture = block(*((color, 150) for color in paints)).repeat(12, axis=0)
    for x in (40, 90):
        picture[50:66, x : x + 16, :3] = EYE
    assert min(away(EYE, color) for color in paints) > 0.1
    noisy = as_jpeg(picture, 90)
    assert [away(rgb, EYE) < 0.03 for rgb in listed(find_palette([noisy]))] == [True]


def test_ink_that_no_pixel_shows_pure_is_listed() -> None:
    cases = palette_cases(None, 1007, quick=True)
    lined = next(case for case in cases if case.group == "150 px, lines, jpeg 80")
    palette = find_palette(lined.images)
    assert (0, 0, 0) in listed(palette)
    assert all(color.cost > 0 for color in palette.dropped)


# ---- where they are


def test_patches_are_what_squares_fit_into() -> None:
    rng = np.random.default_rng(1)
    for px, density in ((1, 0.05), (1, 0.75), (2, 0.4), (2, 0.75), (3, 0.75)):
        mask = rng.random((24, 30)) < density
        rgb = np.where(mask[..., None], np.array([200, 30, 40]), np.array([20, 60, 180]))
        histogram = count_pixels([opaque(rgb)])
        red = np.flatnonzero(histogram.colors[:, 0] == 200)
        slow = np.zeros(mask.shape, dtype=bool)
        for y in range(24 - px + 1):
            for x in range(30 - px + 1):
                window = np.s_[y : y + px, x : x + px]
                slow[window] |= mask[window].all()
        fast = np.zeros(mask.shape, dtype=bool)
        places = patches_of(pixels_of(histogram, [red])[0], px)
        for place in places:
            x, y, width, height = place.box
            box = np.s_[y : y + height, x : x + width]
            assert slow[box].any(axis=1).all()
            assert slow[box].any(axis=0).all()
            fast[box] = True
        assert not (slow & ~fast).any()
        areas = [width * height for _, _, width, height in (place.box for place in places)]
        assert areas[0] == max(areas)


# ---- spots too small to show their colour


def with_dots(color: tuple[int, int, int], *at: tuple[float, float], radius: float) -> np.ndarray:
    """Return two stripes with round soft dots, as much of the colour as they cover."""
    fine = 8
    picture = block((SKIN, 200), (SHIRT, 60))
    y, x = (np.mgrid[: 40 * fine, : 260 * fine] + 0.5) / fine
    inside = np.any([(x - a) ** 2 + (y - b) ** 2 < radius**2 for a, b in at], axis=0)
    share = inside.reshape(40, fine, 260, fine).mean(axis=(1, 3))[..., None]
    picture[..., :3] = np.rint(picture[..., :3] * (1 - share) + share * np.array(color))
    return picture


@pytest.mark.parametrize("radius", [0.5, 0.8, 1.1])
def test_spots_too_small_to_show_their_colour_are_warned_of(radius: float) -> None:
    palette = find_palette([with_dots(EYE, (50.3, 20.2), (80.4, 20.6), radius=radius)])
    (warning,) = palette.warnings
    assert warning.startswith("2 spots such as picture 0 at (")
    assert "draw the sheet larger" in warning


@pytest.mark.parametrize(
    ("color", "at"),
    [
        (EYE, [(50.3, 20.2)]),  # alone: perhaps a slip
        (SHIRT, [(50.3, 20.2), (80.4, 20.6)]),  # a paint
        (SKIN, [(199.7, 10.0), (200.4, 30.3)]),  # blends, across a border
    ],
)
def test_small_spots_of_no_unknown_colour_are_not_warned_of(
    color: tuple[int, int, int], at: list[tuple[float, float]]
) -> None:
    assert not find_palette([with_dots(color, *at, radius=0.8)]).warnings


def test_spots_that_a_line_surrounds_are_blends_of_three() -> None:
    ink = (20, 16, 24)
    both = np.array(SHIRT) * 0.4 + np.array(ink) * 0.35 + np.array(SKIN) * 0.25
    blend = (round(both[0]), round(both[1]), round(both[2]))
    spots = with_spots(blend, (50, 20), (80, 20), px=1)
    assert find_palette([spots]).warnings  # without the ink it is no blend of what there is
    spots[:, 100::8, :3] = ink
    spots[:, 100:101, :3] = SKIN
    assert not find_palette([spots]).warnings


@pytest.mark.parametrize("other", [np.s_[:0], np.s_[:, :0], np.s_[:1], np.s_[:, :1], np.s_[:2]])
def test_pictures_without_room_for_a_spot_have_none(other: tuple) -> None:
    spots = with_dots(EYE, (50.3, 20.2), (80.4, 20.6), radius=0.8)
    assert find_palette([spots, np.zeros_like(spots), spots[other]]).warnings
    assert not find_palette([spots[:2], spots[:, :2]]).warnings


def test_texture_is_soon_given_up() -> None:
    picture = block((SKIN, 400), (SHIRT, 400))
    picture = np.tile(picture, (10, 1, 1))
    picture[2::5, 2::5, :3] = EYE
    (warning,) = find_palette([picture]).warnings
    assert warning.startswith("at least 512 spots")
