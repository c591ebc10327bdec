"""Sheets shaded in two tones: a paint is one colour with tones; flat sheets stay as they are."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.palette.shaded import EYE, FACTOR, PAINTS, Drawing, drawings
from toonset.palette.colors import oklab_from_rgb
from toonset.palette.extract import extract_palette, paint_maps
from toonset.palette.formats.json import palette_of, to_json
from toonset.palette.formats.registry import encode_palette
from toonset.palette.names import hex_of
from toonset.palette.options import PaletteOptions
from toonset.palette.paints.features import find_features
from toonset.palette.palette import Palette
from toonset.palette.pixels.ink_lines import find_contour
from toonset.palette.pixels.shadow import find_shadow, find_tones


def pictures(drawn: list[Drawing]) -> list[np.ndarray]:
    return [one.rgba for one in drawn]


def contours(drawn: list[Drawing]) -> list[np.ndarray]:
    return [find_contour(one.rgba) for one in drawn]


def inner(paint: np.ndarray) -> np.ndarray:
    """Return pixels two away from every border."""
    square = np.ones((5, 5), dtype=np.uint8)
    return (cv2.erode(paint, square) == cv2.dilate(paint, square)) & (paint < 255)


def away(rgb: tuple[int, int, int], other: tuple[int, int, int]) -> float:
    lab = oklab_from_rgb(np.array([rgb, other], dtype=np.uint8))
    return float(np.linalg.norm(lab[0] - lab[1]))


def test_a_shadow_is_found_with_its_factor_and_its_place() -> None:
    drawn = drawings(shadow=True, noisy=True)
    shadow = find_shadow(pictures(drawn), contours(drawn))
    assert shadow is not None
    assert shadow.factor == pytest.approx(FACTOR, abs=0.03)
    for one, dark in zip(drawn, find_tones(pictures(drawn), contours(drawn), shadow), strict=True):
        sure = inner(one.paint) & inner(one.dark.astype(np.uint8)) & (one.paint != 4)
        assert (dark == one.dark)[sure].mean() > 0.95


@pytest.mark.parametrize("noisy", [False, True])
def test_a_flat_sheet_has_no_shadow(noisy: bool) -> None:
    drawn = drawings(shadow=False, noisy=noisy)
    assert find_shadow(pictures(drawn), contours(drawn)) is None


def test_paint_that_is_darker_on_one_side_in_half_of_the_views_is_no_shadow() -> None:
    half = [drawings(shadow=True, noisy=False, views=4, light=side) for side in (1, -1)]
    drawn = [*half[0], *half[1]]
    assert find_shadow(pictures(drawn), contours(drawn)) is None


def test_the_light_may_be_on_the_other_side_and_the_drawing_larger() -> None:
    drawn = drawings(shadow=True, noisy=False, light=-1)
    large = [one.rgba.repeat(2, axis=0).repeat(2, axis=1) for one in drawn]
    shadow = find_shadow(large, [find_contour(picture) for picture in large])
    assert shadow is not None
    assert shadow.factor == pytest.approx(FACTOR, abs=0.03)


def test_pictures_without_room_have_no_shadow() -> None:
    small = [np.full((h, w, 4), 255, dtype=np.uint8) for h, w in ((0, 0), (1, 9), (4, 4))]
    assert find_shadow(small, [picture[..., 0] * 0 for picture in small]) is None
    assert find_shadow([], []) is None
    shaded = pictures(drawings(shadow=True, noisy=False))
    assert extract_palette([*shaded, *small[1:]]).shadow is not None


def test_paints_are_what_they_are_in_light_with_both_tones() -> None:
    drawn = drawings(shadow=True, noisy=True)
    palette = extract_palette(pictures(drawn), PaletteOptions(features=False))
    assert len(palette.colors) == len(PAINTS)
    paint = np.concatenate([one.paint.ravel() for one in drawn])
    dark = np.concatenate([one.dark.ravel() for one in drawn])
    figure = paint < 255
    for number, rgb in enumerate(PAINTS):
        color = min(palette.colors, key=lambda one: away(one.rgb, rgb))
        assert away(color.rgb, rgb) < 0.02
        light, shade = color.tones
        assert light.rgb == color.rgb
        assert away(shade.rgb, tuple(np.rint(np.multiply(rgb, FACTOR)).astype(int))) < 0.03
        assert light.share + shade.share == pytest.approx(color.share)
        for tone, where in ((light, ~dark), (shade, dark)):
            true = (figure & where & (paint == number)).sum() / figure.sum()
            assert tone.share == pytest.approx(true, abs=0.03)


def test_labels_are_of_paints_whatever_their_tone() -> None:
    drawn = drawings(shadow=True, noisy=True)
    palette = extract_palette(pictures(drawn))
    names = [min(range(5), key=lambda n: away(c.rgb, (*PAINTS, EYE)[n])) for c in palette.colors]
    table = np.full(256, 255)
    table[: len(names)] = names
    found = [m.labels for m in paint_maps(pictures(drawn), contours(drawn), palette)]
    right, sure = 0, 0
    for one, labels in zip(drawn, found, strict=True):
        pure = inner(one.paint)
        right += int((table[labels] == one.paint)[pure].sum())
        sure += int(pure.sum())
    assert right / sure > 0.95


def test_small_eyes_are_features_of_a_shaded_sheet() -> None:
    drawn = drawings(shadow=True, noisy=True)
    palette = extract_palette(pictures(drawn))
    (eye,) = palette_of(to_json(palette), "palette.json").features
    assert away(eye, EYE) < 0.05
    assert eye in [color.rgb for color in palette.colors]
    assert eye not in [color.rgb for color in palette.dropped]
    plain = extract_palette(pictures(drawn), PaletteOptions(features=False))
    assert plain.features == ()
    assert [color.rgb for color in plain.dropped] == [eye]
    few = extract_palette(pictures(drawn), PaletteOptions(max_colors=len(PAINTS)))
    assert few.features == ()


def test_features_of_flat_sheets_are_kept_too() -> None:
    drawn = pictures(drawings(shadow=False, noisy=False))
    plain = to_json(extract_palette(drawn, PaletteOptions(features=False)))
    assert {color["hex"] for color in plain["colors"]} == {hex_of(rgb) for rgb in PAINTS}
    assert (plain["shadow"], plain["features"]) == (None, [])
    assert all(color["tones"] == [] for color in plain["colors"])
    palette = extract_palette(drawn)
    assert palette.features == (EYE,)
    assert {color.rgb for color in palette.colors} == {*PAINTS, EYE}


def test_spots_at_another_height_in_every_drawing_are_no_features() -> None:
    drawn = drawings(shadow=False, noisy=False, eyes=False)
    spotted = pictures(drawn)
    assert find_features(_with_spots(spotted, [40] * 8), spotted) == (EYE,)
    spotted = pictures(drawings(shadow=False, noisy=False, eyes=False))
    heights = [20, 45, 70, 95, 120, 145, 170, 205]
    assert find_features(_with_spots(spotted, heights), spotted) == ()


@pytest.mark.parametrize(("side", "is_one"), [(4, False), (5, True)])
def test_specks_in_two_drawings_are_no_features_until_there_is_enough(
    side: int, is_one: bool
) -> None:
    spotted = pictures(drawings(shadow=False, noisy=False, eyes=False))
    palette = _with_spots(spotted[:2], [40, 40], side)
    assert palette.dropped
    assert find_features(palette, spotted) == ((EYE,) if is_one else ())


def _with_spots(spotted: list[np.ndarray], heights: list[int], side: int = 9) -> Palette:
    """Draw a white spot into every picture and return their palette."""
    for picture, row in zip(spotted, heights, strict=True):
        picture[row : row + side, 62 : 62 + side] = (*EYE, 255)
    return extract_palette(spotted, PaletteOptions(features=False))


def test_tones_say_which_paint_lies_in_shadow() -> None:
    drawn = drawings(shadow=True, noisy=True)
    palette = extract_palette(pictures(drawn))
    for one, found in zip(
        drawn, paint_maps(pictures(drawn), contours(drawn), palette), strict=True
    ):
        assert found.tones is not None
        assert np.array_equal(found.tones == 255, found.labels == 255)
        sure = inner(one.paint) & inner(one.dark.astype(np.uint8)) & (found.labels < 255)
        assert (found.tones == one.dark)[sure & (one.paint != 4)].mean() > 0.95
    flat = pictures(drawings(shadow=False, noisy=False))
    lines = [find_contour(one) for one in flat]
    assert all(one.tones is None for one in paint_maps(flat, lines, extract_palette(flat)))


@pytest.mark.parametrize("extension", [".gpl", ".ase", ".json"])
def test_a_file_with_tones_gives_the_same_paints_of_the_sheet(
    extension: str, tmp_path: Path
) -> None:
    drawn = drawings(shadow=True, noisy=True)
    found = extract_palette(pictures(drawn))
    file = tmp_path / f"own{extension}"
    file.write_bytes(encode_palette(found, extension))
    again = extract_palette(pictures(drawn), PaletteOptions(colors=str(file)))
    assert again.shadow == found.shadow
    assert np.array_equal(again.rgb, found.rgb)
    for one, other in zip(again.colors, found.colors, strict=True):
        assert [tone.rgb for tone in one.tones] == [tone.rgb for tone in other.tones]
    plain = ",".join(hex_of(color.rgb) for color in found.colors)
    assert extract_palette(pictures(drawn), PaletteOptions(colors=plain)).shadow is None
    content = to_json(found)
    assert content["shadow"]
    assert to_json(palette_of(content, "palette.json")) == content


@pytest.mark.parametrize("tunic", [0.86, 1.16])
def test_a_paint_whose_shadow_is_lighter_or_deeper_is_one_paint(tunic: float) -> None:
    drawn = drawings(shadow=True, noisy=True, tunic=tunic)
    palette = extract_palette(pictures(drawn))
    large = [color for color in palette.colors if color.share >= 0.05]
    assert len(large) == len(PAINTS)
    found = min(large, key=lambda color: away(color.rgb, PAINTS[1]))
    dark = np.rint(np.array(PAINTS[1]) * np.array(FACTOR) * tunic).astype(int)
    assert np.abs(np.array(found.tones[1].rgb) - dark).max() <= 8
    palette = palette_of(to_json(palette), "palette.json")
    number = [color.rgb for color in palette.colors].index(found.rgb)
    for one, own in zip(drawn, paint_maps(pictures(drawn), contours(drawn), palette), strict=True):
        sure = inner(one.paint) & inner(one.dark.astype(np.uint8)) & (one.paint == 1)
        assert (own.labels == number)[sure].mean() > 0.98
        assert own.tones is not None
        assert (own.tones == one.dark)[sure].mean() > 0.95


def test_a_colour_that_is_to_be_kept_is_no_shadow() -> None:
    drawn = drawings(shadow=True, noisy=False, tunic=1.16)
    dark = np.rint(np.array(PAINTS[1]) * np.array(FACTOR) * 1.16).astype(int)
    palette = extract_palette(pictures(drawn), PaletteOptions(keep=hex_of(tuple(dark.tolist()))))
    assert all(color.factor is None for color in palette.colors)
