"""Palettes: exact on flat drawings, blind to order and orientation, open about what is dropped."""

import importlib
import io

import cv2
import numpy as np
import pytest
from PIL import Image

from toonset.errors import PaletteError
from toonset.palette.choice import PaletteOptions
from toonset.palette.extcolors_palette import extcolors_palette
from toonset.palette.extract import extract_palette, pick_palette
from toonset.palette.labels import label_image, nearest_colors
from toonset.palette.names import NAMED, name_of
from toonset.palette.oklab import oklab_from_rgb
from toonset.palette.palette import Palette, PaletteColor, Place
from toonset.palette.patches import with_places
from toonset.palette.pixels import count_pixels

FINE = 8
COLORS = np.array(
    [(200, 30, 40), (20, 60, 180), (236, 188, 155), (125, 78, 45), (10, 10, 10)], dtype=np.uint8
)


def flat_drawing(size: int = 96) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a soft-edged RGBA figure, its exact labels (255 = mixed), and its colours' areas."""
    fine = np.full((size * FINE, size * FINE), 255, dtype=np.uint8)
    center = size * FINE // 2
    cv2.circle(fine, (center, center), int(0.46 * size * FINE), 4, -1)  # the contour
    cv2.circle(fine, (center, center), int(0.43 * size * FINE), 0, -1)
    cv2.rectangle(fine, (center, center), (center + 27 * FINE, center + 20 * FINE + 3), 1, -1)
    cv2.rectangle(fine, (center - 26 * FINE - 5, center), (center - 29, center + 170), 2, -1)
    cv2.rectangle(fine, (center - 160, center - 200 + 5), (center + 165, center - 29), 3, -1)
    table = np.zeros((256, 4))
    table[:5, :3], table[:5, 3] = COLORS, 255
    soft = table[fine].reshape(size, FINE, size, FINE, 4)
    alpha = soft[..., 3].mean(axis=(1, 3))
    rgb = (soft[..., :3] * soft[..., 3:]).sum(axis=(1, 3)) / np.maximum(
        soft[..., 3:].sum(axis=(1, 3)), 1
    )
    blocks = fine.reshape(size, FINE, size, FINE).transpose(0, 2, 1, 3).reshape(size, size, -1)
    pure = (blocks == blocks[..., :1]).all(axis=2)
    labels = np.where(pure, blocks[..., 0], 255).astype(np.uint8)
    areas = np.bincount(fine[fine < 255], minlength=5) / (fine < 255).sum()
    return np.rint(np.dstack([rgb, alpha])).astype(np.uint8), labels, areas


def as_set(palette: Palette) -> set[tuple[int, int, int]]:
    return {color.rgb for color in palette.colors}


RGBA, LABELS, AREAS = flat_drawing()


def test_a_flat_drawing_gives_exactly_its_colours() -> None:
    palette = extract_palette([RGBA])
    assert as_set(palette) == {tuple(color) for color in COLORS.tolist()}
    shares = {color.rgb: color.share for color in palette.colors}
    for color, share in zip(COLORS.tolist(), AREAS, strict=True):
        assert shares[tuple(color)] == pytest.approx(share, abs=0.03)
    assert [c.share for c in palette.colors] == sorted(shares.values(), reverse=True)
    assert palette.warnings == ()


def test_labels_equal_the_truth_on_flat_pixels() -> None:
    found = label_image(RGBA, COLORS)
    labelled = found != 255
    assert np.array_equal(found[labelled & (LABELS != 255)], LABELS[labelled & (LABELS != 255)])
    assert labelled[LABELS != 255].mean() > 0.98  # flat pixels that were taken for mixtures
    inside = (LABELS == 255) & (RGBA[..., 3] == 255)
    assert inside.sum() > 150
    assert labelled[inside].mean() < 0.2  # mixtures that were given a label
    assert not labelled[RGBA[..., 3] < 250].any()


def test_palette_is_blind_to_order_orientation_and_repetition() -> None:
    other = np.ascontiguousarray(RGBA[10:, 5:80])
    palette = extract_palette([RGBA, other])
    turned = [np.rot90(other), RGBA[::-1], RGBA[:, ::-1], np.rot90(other, 2)]
    assert extract_palette(turned) == palette
    big = [image.repeat(2, axis=0).repeat(2, axis=1) for image in (RGBA, other)]
    assert as_set(extract_palette(big)) == as_set(palette)


def test_labels_turn_with_the_picture() -> None:
    assert np.array_equal(label_image(RGBA[:, ::-1], COLORS), label_image(RGBA, COLORS)[:, ::-1])


def block(*parts: tuple[tuple[int, int, int], int]) -> np.ndarray:
    """Return a picture of full-height stripes (colour, width)."""
    stripes = [np.full((40, width, 3), color, dtype=np.uint8) for color, width in parts]
    rgb = np.concatenate(stripes, axis=1)
    return np.dstack([rgb, np.full(rgb.shape[:2], 255, dtype=np.uint8)])


def test_the_five_percent_rule_and_what_it_costs() -> None:
    red, green, blue = (200, 30, 40), (30, 160, 60), (20, 60, 180)
    picture = block((red, 90), (green, 6), (blue, 4))
    palette = extract_palette([picture])
    assert [color.rgb for color in palette.colors] == [red, green]
    (dropped,) = palette.dropped
    assert dropped.rgb == blue
    assert dropped.share == pytest.approx(0.04)
    away = oklab_from_rgb(np.array([blue, red, green], dtype=np.uint8))
    nearest = 1 + int(
        nearest_colors(np.array([blue], np.uint8), np.array([red, green], np.uint8))[0]
    )
    assert dropped.cost == pytest.approx(float(np.linalg.norm(away[0] - away[nearest])))
    assert len(extract_palette([picture], PaletteOptions(min_share=0.03)).colors) == 3


def test_all_pictures_count_together() -> None:
    front, back = block(((200, 30, 40), 100)), block(((200, 30, 40), 91), ((20, 60, 180), 9))
    assert len(extract_palette([back]).colors) == 2
    assert len(extract_palette([front, back]).colors) == 1


def test_a_gradient_is_one_colour_and_two_paints_stay_two() -> None:
    ramp = np.linspace(0.8, 1.0, 200)[None, :, None] * [210, 60, 50] * np.ones((40, 1, 1))
    ramp = np.dstack([np.rint(ramp), np.full((40, 200), 255)]).astype(np.uint8)
    assert len(extract_palette([ramp]).colors) == 1
    base, shadow = (214, 120, 80), (160, 80, 60)
    assert as_set(extract_palette([block((base, 60), (shadow, 40))])) == {base, shadow}


@pytest.mark.parametrize("quality", [70, 85, 95])
def test_jpeg_noise_does_not_shatter_colours(quality: int) -> None:
    big = RGBA.repeat(2, axis=0).repeat(2, axis=1)
    over_white = big[..., :3] * (big[..., 3:] / 255.0) + 255 * (1 - big[..., 3:] / 255.0)
    buffer = io.BytesIO()
    Image.fromarray(over_white.astype(np.uint8)).save(buffer, "JPEG", quality=quality)
    noisy = np.dstack([np.asarray(Image.open(buffer)), big[..., 3]])
    palette = extract_palette([noisy])
    assert len(palette.colors) == 5
    drawn = oklab_from_rgb(np.concatenate([COLORS[:4], [(0, 0, 0)]]).astype(np.uint8))
    for color in palette.colors:
        away = drawn - oklab_from_rgb(np.array(color.rgb, dtype=np.uint8))
        near_black = max(color.rgb) <= 16  # the ink, but for the noise
        assert near_black or np.linalg.norm(away, axis=1).min() < 0.02


def test_if_nothing_reaches_the_share_the_largest_is_kept_and_said() -> None:
    picture = block(((200, 30, 40), 40), ((20, 60, 180), 35), ((30, 160, 60), 25))
    palette = extract_palette([picture], PaletteOptions(min_share=0.5))
    assert [color.rgb for color in palette.colors] == [(200, 30, 40)]
    assert palette.warnings == (
        "no colour reaches 50.0% of the pixels; the largest, with 40.0%, was kept alone: lower "
        "--min-share",
    )
    assert [color.rgb for color in palette.dropped] == [(20, 60, 180), (30, 160, 60)]


def test_hand_picked_colours_keep_their_order_and_say_their_share() -> None:
    picture = block(((200, 30, 40), 75), ((20, 60, 180), 25))
    picked = np.array([(0, 0, 255), (255, 0, 0), (0, 255, 0)], dtype=np.uint8)
    palette = pick_palette([picture], picked)
    assert np.array_equal(palette.rgb, picked)
    assert [color.share for color in palette.colors] == [0.25, 0.75, 0.0]
    assert palette.warnings == ("no pixel is nearest to #00ff00",)


def test_nothing_to_see_is_an_error() -> None:
    with pytest.raises(PaletteError, match="no picture given"):
        extract_palette([])
    with pytest.raises(PaletteError, match="no opaque pixel"):
        extract_palette([np.zeros((9, 9, 4), dtype=np.uint8)])
    with pytest.raises(PaletteError, match="--min-share: 5 is no share; give 0 to 1"):
        PaletteOptions(min_share=5.0)
    with pytest.raises(PaletteError, match="--max-colors: 0 colours; 1 to 255 are possible"):
        PaletteOptions(max_colors=0)
    with pytest.raises(PaletteError, match="0 colours; 1 to 255 are needed"):
        Palette((), "none")
    with pytest.raises(PaletteError, match="256 colours; 1 to 255 are needed"):
        Palette(tuple(PaletteColor((0, 0, i), 0.0, "x") for i in range(256)), "many")


def test_nearest_is_the_brute_force_nearest() -> None:
    rng = np.random.default_rng(3)
    colors = rng.integers(0, 256, (500, 3), dtype=np.uint8)
    palette = rng.integers(0, 256, (17, 3), dtype=np.uint8)
    slow = ((colors[:, None].astype(int) - palette) ** 2).sum(axis=2).argmin(axis=1)
    assert np.array_equal(nearest_colors(colors, palette), slow)


def test_oklab_of_known_colours() -> None:
    # Source: B. Ottosson's table and the CSS Color 4 samples
    rgb = np.array([(255, 255, 255), (0, 0, 0), (255, 0, 0), (0, 0, 255)], dtype=np.uint8)
    expected = [(1, 0, 0), (0, 0, 0), (0.62796, 0.22486, 0.12585), (0.45201, -0.03246, -0.31153)]
    np.testing.assert_allclose(oklab_from_rgb(rgb), expected, atol=2e-4)


def test_names_name_themselves() -> None:
    for name, rgb in NAMED.items():
        assert name_of(rgb) == name
    assert name_of((12, 9, 11)) == "black"
    assert name_of((36, 28, 48)) == "dark purple"
    assert name_of((27, 25, 43)) == "dark blue"
    assert name_of((42, 42, 42)) == "dark charcoal"
    assert name_of((228, 30, 30)) == "red"


def soft_stripes(*colors: tuple[int, int, int], width: int = 12, tall: int = 60) -> np.ndarray:
    """Return stripes with one soft column of 45 : 55 between them: a blend that repeats exactly."""
    parts: list[np.ndarray] = []
    for index, color in enumerate(colors):
        if index:
            mean = np.rint(0.45 * np.array(colors[index - 1]) + 0.55 * np.array(color))
            parts.append(np.tile(mean.astype(np.uint8), (tall, 1, 1)))
        parts.append(np.tile(np.array(color, np.uint8), (tall, width, 1)))
    rgb = np.concatenate(parts, axis=1)
    return np.dstack([rgb, np.full(rgb.shape[:2], 255, np.uint8)])


def test_counts_are_the_pixels() -> None:
    rng = np.random.default_rng(2)
    rgba = rng.integers(0, 4, (70, 90, 4), dtype=np.uint8) * 60
    rgba[..., 3] = rng.choice([0, 200, 255], rgba.shape[:2])
    histogram = count_pixels([rgba, rgba[::-1]])
    colors, counts = np.unique(rgba[rgba[..., 3] == 255][:, :3], axis=0, return_counts=True)
    found = {tuple(c): n for c, n in zip(histogram.colors.tolist(), histogram.counts, strict=True)}
    assert found == {tuple(c): 2 * n for c, n in zip(colors.tolist(), counts, strict=True)}


def test_large_and_small_pictures_are_counted_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    once = count_pixels([RGBA])
    monkeypatch.setattr("toonset.palette.pixels.TABLE_RUNS", 1)
    monkeypatch.setattr("toonset.palette.pixels.BAND_PIXELS", 500)
    again = count_pixels([RGBA])
    for name in ("colors", "counts", "flat", "thin"):
        assert np.array_equal(getattr(once, name), getattr(again, name)), name


def test_blends_are_no_colours_and_count_half_to_either_side() -> None:
    colors = (200, 30, 40), (20, 60, 180), (30, 160, 60)
    palette = extract_palette([soft_stripes(*colors, width=4)])
    assert as_set(palette) == set(colors)
    assert sum(color.share for color in palette.colors) == pytest.approx(1)


def test_near_shades_merge_and_near_paints_do_not() -> None:
    near, far = block(((150, 90, 60), 60), ((152, 91, 60), 40)), ((150, 90, 60), (160, 104, 72))
    assert as_set(extract_palette([near])) == {(150, 90, 60)}
    apart = oklab_from_rgb(np.array(far, dtype=np.uint8))
    assert 0.04 < np.linalg.norm(apart[0] - apart[1]) < 0.06
    assert as_set(extract_palette([block((far[0], 60), (far[1], 40))])) == set(far)


@pytest.mark.parametrize("low", [0.8, 0.4])
def test_long_gradients_are_one_colour(low: float) -> None:
    for color in ((210, 60, 50), (90, 200, 120), (240, 220, 90)):
        ramp = np.linspace(low, 1.0, 300)[None, :, None] * np.array(color) * np.ones((40, 1, 1))
        rgba = np.dstack([np.rint(ramp), np.full((40, 300), 255)]).astype(np.uint8)
        assert len(extract_palette([rgba]).colors) == 1, color


def test_evidence_says_what_one_colour_less_would_cost() -> None:
    palette = extract_palette([block(((200, 30, 40), 60), ((20, 60, 180), 40))])
    assert palette.evidence is not None
    assert palette.evidence.colors == 2
    assert palette.evidence.one_less > 1000
    assert palette.evidence.one_more > 0


def test_small_colours_are_kept_on_request() -> None:
    red, blue, green = (200, 30, 40), (20, 60, 180), (30, 160, 60)
    picture = block((red, 95), (blue, 3), (green, 2))
    assert as_set(extract_palette([picture])) == {red}
    options = PaletteOptions(keep=((24, 64, 178),))  # near the blue that is there
    assert as_set(extract_palette([picture], options)) == {red, blue}
    with pytest.raises(
        PaletteError, match="--keep: #ffff00: no such colour was found; the nearest is"
    ):
        extract_palette([picture], PaletteOptions(keep=((255, 255, 0),)))
    all_three = PaletteOptions(min_share=0.0, max_colors=2, keep=(green,))
    assert as_set(extract_palette([picture], all_three)) == {red, green}
    with pytest.raises(PaletteError, match="raise --max-colors"):
        PaletteOptions(max_colors=1, keep=(red, blue))


def test_a_colour_kept_in_the_place_of_another_is_said() -> None:
    red, blue = (200, 30, 40), (20, 60, 180)
    small = block((red, 97), (blue, 3))
    near = ((40, 85, 190),)  # 0.07 away in OKLab
    (note,) = extract_palette([small], PaletteOptions(keep=near)).warnings
    assert note == "--keep: #2855be itself was not found; kept the nearest, #143cb4"
    (note,) = extract_palette([block((red, 60), (blue, 40))], PaletteOptions(keep=near)).warnings
    assert note.endswith("#143cb4, which the rule keeps anyway")
    assert extract_palette([small], PaletteOptions(keep=(blue,))).warnings == ()


def test_a_found_palette_picked_by_hand_has_the_same_shares() -> None:
    rgba = soft_stripes((200, 30, 40), (20, 60, 180), (30, 160, 60), width=6)
    line = np.zeros(rgba.shape[:2], dtype=bool)
    line[:, 8:12] = True
    rgba[:, 8:12, :3] = (0, 0, 0)
    rgba[:, [7, 12], :3] = rgba[:, [7, 12], :3] // 2  # the line's soft edges
    line[:, [7, 12]] = True
    found = extract_palette([rgba], contours=[line])
    assert found.dropped == ()
    picked = pick_palette([rgba], found.rgb, [line])
    assert [color.share for color in picked.colors] == [color.share for color in found.colors]
    assert picked.contour == found.contour


def test_shades_stay_with_their_paint_and_what_is_left_out_goes_to_the_nearest() -> None:
    ramp = np.linspace(0.55, 1.0, 200)[None, :, None] * [210, 60, 50] * np.ones((40, 1, 1))
    shaded = np.dstack([np.rint(ramp), np.full((40, 200), 255)]).astype(np.uint8)
    dark, blue = (100, 20, 50), (20, 60, 180)  # the dark one is nearest to some shades
    rgba = np.concatenate([shaded, block((dark, 60), (blue, 5))], axis=1)
    found = extract_palette([rgba])
    assert [color.rgb for color in found.dropped] == [blue]
    picked = pick_palette([rgba], found.rgb)
    more = [p.share - f.share for p, f in zip(picked.colors, found.colors, strict=True)]
    assert sorted(more) == pytest.approx([0, 5 / 265])
    two = np.array([found.rgb[0], shaded[0, 0, :3]], dtype=np.uint8)  # both of the gradient
    assert min(color.share for color in pick_palette([shaded], two).colors) > 0.1


def test_a_paint_of_very_different_shades_is_said() -> None:
    for low, count in ((0.7, 0), (0.0, 1)):
        ramp = np.linspace(low, 1.0, 300)[None, :, None] * [240, 225, 190] * np.ones((40, 1, 1))
        shaded = np.dstack([np.rint(ramp), np.full((40, 300), 255)]).astype(np.uint8)
        palette = extract_palette([shaded])
        assert len(palette.colors) == 1
        assert len(palette.warnings) == count, low
    assert "stands for very different shades" in palette.warnings[0]


def test_the_rule_names_the_least_share_of_all_pixels() -> None:
    rgba, line = lined(0)
    palette = extract_palette([rgba], contours=[line])
    assert "here 4.8 % of all its pixels" in palette.rule  # 96 % are no lines
    assert min(color.share for color in palette.colors) >= 0.048
    assert "of the character's pixels" in extract_palette([rgba]).rule
    assert "at most 2 colours" in extract_palette([rgba], PaletteOptions(max_colors=2)).rule


def lined(black_cloth: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a figure with black lines 2 px wide, some black cloth, and where the lines are."""
    rgba = block(((200, 30, 40), 44), ((0, 0, 0), 2), ((20, 60, 180), 4), ((0, 0, 0), black_cloth))
    line = np.zeros(rgba.shape[:2], dtype=bool)
    line[:, 44:46] = True
    return rgba, line


def test_lines_count_to_their_ink_and_do_not_push_others_out() -> None:
    rgba = block(((200, 30, 40), 60), ((0, 0, 0), 12), ((20, 60, 180), 3))
    line = np.zeros(rgba.shape[:2], dtype=bool)
    line[:, 60:72] = True
    assert (20, 60, 180) not in as_set(extract_palette([rgba]))  # 4 %
    rgba, line = rgba[:, 10:], line[:, 10:]  # 4.6 % of all, 5.7 % of what is no line
    assert (20, 60, 180) not in as_set(extract_palette([rgba]))
    palette = extract_palette([rgba], contours=[line])
    assert as_set(palette) == {(200, 30, 40), (0, 0, 0), (20, 60, 180)}
    assert palette.contour is not None
    assert palette.contour.share == pytest.approx(12 / 65)
    assert palette.contour.cloth == 0


@pytest.mark.parametrize(("black_cloth", "stays"), [(0, False), (10, True)])
def test_without_its_lines_black_stays_only_as_cloth(black_cloth: int, stays: bool) -> None:
    rgba, line = lined(black_cloth)
    palette = extract_palette([rgba], PaletteOptions(contour=False), [line])
    assert ((0, 0, 0) in as_set(palette)) == stays
    assert palette.contour is not None
    assert palette.contour.cloth == pytest.approx(black_cloth / (50 + black_cloth))
    if not stays:
        kept = PaletteOptions(contour=False, keep=((0, 0, 0),))
        assert (0, 0, 0) in as_set(extract_palette([rgba], kept, [line]))


def test_thin_soft_lines_give_their_pure_ink() -> None:
    rgb = np.full((80, 80, 3), (230, 180, 60), dtype=np.uint8)
    for x in range(6, 78, 6):  # 1.5 px wide: a core, and half of it beside
        rgb[:, x], rgb[:, x + 1] = (10, 10, 10), (120, 95, 35)
    palette = extract_palette([np.dstack([rgb, np.full((80, 80), 255, np.uint8)])])
    assert as_set(palette) == {(230, 180, 60), (10, 10, 10)}


def test_extcolors_is_the_library() -> None:
    palette = extcolors_palette([RGBA])
    extcolors = importlib.import_module("extcolors")  # untyped
    pixels = RGBA[RGBA[..., 3] > 0]
    found, total = extcolors.extract_from_image(Image.fromarray(pixels[None]))
    assert [(color.rgb, color.share) for color in palette.colors] == [
        (rgb, count / total) for rgb, count in found if count >= 0.05 * total
    ]
    with pytest.raises(PaletteError, match="no pixel to count"):
        extcolors_palette([np.zeros((4, 4, 4), np.uint8)])


def test_left_out_colours_are_shown_where_they_are() -> None:
    pictures = [block(((200, 30, 40), 90)), block(((200, 30, 40), 90))]
    pictures[1][5:9, 20:26, :3] = (20, 60, 180)
    pictures[0][30:32, 3:5, :3] = (20, 60, 180)
    palette = with_places(extract_palette(pictures), pictures)
    assert [color.place for color in palette.dropped] == [Place(1, (20, 5, 6, 4))]
