"""Other colours: nothing else changes, tones and soft edges go along, the way back restores."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.palette.shaded import EYE, FACTOR, PAINTS, TUNIC, Drawing, drawings
from toonset.errors import PaletteError
from toonset.palette.extract import PaintMap, extract_palette, paint_maps
from toonset.palette.palette import Palette, Shadow
from toonset.palette.pixels.ink_lines import find_contour
from toonset.palette.pixels.recolor import recolor, tone_map, tones_of
from toonset.palette.recolor import change_colors, recolor_drawing

GREEN = (40, 140, 70)


def found(drawn: list[Drawing]) -> tuple[Palette, list[PaintMap], list[np.ndarray]]:
    pictures = [one.rgba for one in drawn]
    contours = [find_contour(picture) for picture in pictures]
    palette = extract_palette(pictures)
    return palette, paint_maps(pictures, contours, palette), contours


def index_of(palette: Palette, rgb: tuple[int, int, int]) -> int:
    return int(np.abs(palette.rgb.astype(int) - rgb).sum(axis=1).argmin())


@pytest.mark.parametrize("shadow", [False, True])
def test_the_same_colours_are_the_same_bytes(shadow: bool) -> None:
    drawn = drawings(shadow=shadow, noisy=True, views=2)
    palette, maps, contours = found(drawn)
    for one, paint, contour in zip(drawn, maps, contours, strict=True):
        same = recolor_drawing(one.rgba, paint, contour, palette, palette.rgb)
        assert same.tobytes() == one.rgba.tobytes()


def test_a_paint_has_its_new_colour_with_the_sheets_shadow_and_others_stay() -> None:
    drawn = drawings(shadow=True, noisy=True)
    palette, maps, contours = found(drawn)
    assert palette.shadow is not None
    tunic = index_of(palette, TUNIC)
    colors = palette.rgb
    colors[tunic] = GREEN
    for one, paint, contour in zip(drawn, maps, contours, strict=True):
        new = recolor_drawing(one.rgba, paint, contour, palette, colors)
        assert np.array_equal(new[..., 3], one.rgba[..., 3])
        sure = cv2.erode((one.paint == 1).astype(np.uint8), np.ones((7, 7))) > 0
        for part, factor in ((sure & ~one.dark, (1, 1, 1)), (sure & one.dark, FACTOR)):
            seen = np.median(new[part][:, :3], axis=0)
            np.testing.assert_allclose(seen, np.multiply(GREEN, factor), atol=6)
        far = cv2.dilate((one.paint == 1).astype(np.uint8), np.ones((9, 9))) == 0
        same = (new == one.rgba).all(axis=2)
        assert same[far & (paint.labels != tunic)].mean() > 0.99
        assert same[one.paint == 4].mean() > 0.99


def test_recolouring_back_restores() -> None:
    drawn = drawings(shadow=True, noisy=False)
    palette, maps, contours = found(drawn)
    colors = palette.rgb
    colors[index_of(palette, TUNIC)] = GREEN
    pairs = zip(palette.colors, colors.tolist(), strict=True)
    changed = replace(palette, colors=tuple(replace(one, rgb=tuple(rgb)) for one, rgb in pairs))
    for one, paint, contour in zip(drawn, maps, contours, strict=True):
        new = recolor_drawing(one.rgba, paint, contour, palette, colors)
        back = recolor_drawing(new, paint, contour, changed, palette.rgb)
        off = np.abs(back.astype(int) - one.rgba).max(axis=2)
        assert (off > 2).mean() < 1e-4


def test_soft_edges_are_mixed_as_before_and_lines_and_eyes_stay() -> None:
    share = np.linspace(0, 1, 5)[:, None]
    red, blue, green = np.array([(200, 40, 40), (40, 60, 200), (40, 180, 60)])
    row = np.repeat([red, blue], 10, axis=0).astype(float)
    row[8:13] = (1 - share) * red + share * blue
    picture = np.zeros((20, 20, 4), dtype=np.uint8)
    picture[...] = (*np.zeros(3), 255)
    picture[..., :3] = np.rint(row)
    labels = np.zeros((20, 20), dtype=np.uint8)
    labels[:, 12:], labels[:, 9:12] = 1, 255
    contour = np.zeros((20, 20), dtype=np.uint8)
    picture[15:17, :, :3], contour[15:17] = 0, 255
    picture[3:6, 2:5, :3] = EYE
    old = np.array([red, blue], dtype=np.uint8)
    new = np.array([green, blue], dtype=np.uint8)
    tones = tone_map(labels, None, contour, 2)
    after = recolor(picture, tones, contour, tones_of(old, None), tones_of(new, None))
    assert np.abs(after[9, 8:13, :3] - ((1 - share) * green + share * blue)).max() <= 1.5
    assert np.array_equal(after[15:17], picture[15:17])
    assert np.array_equal(after[4, 3], picture[4, 3])
    assert np.array_equal(after[:, 14:], picture[:, 14:])
    assert (after[9, :8, :3] == green).all()


def test_a_shadow_of_a_new_colour_stays_within_8_bits() -> None:
    shadow = Shadow(FACTOR, (0.0, 0.0, 0.0), 0.0)
    black_and_white = np.array([(0, 0, 0), (255, 255, 255)], dtype=np.uint8)
    tones = tones_of(black_and_white, shadow.factor)
    assert np.array_equal(tones[:2], black_and_white)
    assert np.array_equal(tones[2], (0, 0, 0))
    np.testing.assert_allclose(tones[3], np.multiply(255, FACTOR), atol=2)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["teal"], "OLD=NEW is needed"),
        (["#123456=#ffffff"], "the palette has #e2b28c"),
        (["#e2b28c=blueish"], "is no colour"),
        (["#e2b28c=#111111", "#e2b28c=#222222"], "#e2b28c is replaced twice; drop one"),
    ],
)
def test_a_change_that_means_nothing_is_refused(changes: list[str], words: str) -> None:
    with pytest.raises(PaletteError, match=words):
        change_colors(np.array(PAINTS, dtype=np.uint8), changes)
