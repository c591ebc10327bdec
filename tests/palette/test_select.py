"""Palettes: which colours the rule keeps, what is kept on request, and what is said of the rest."""

from collections.abc import Callable

import numpy as np
import pytest

from tests.palette.pictures import as_set, block, ramp, soft_stripes
from toonset.errors import PaletteError
from toonset.palette.colors import oklab_from_rgb
from toonset.palette.options import PaletteOptions
from toonset.palette.paints.extract import find_palette, pick_palette
from toonset.palette.paints.places import add_places
from toonset.palette.paints.select import PaletteRule
from toonset.palette.palette import Palette, PaletteColor, Place
from toonset.palette.pixels.labels import nearest_colors


def test_the_five_percent_rule_and_what_it_costs() -> None:
    red, green, blue = (200, 30, 40), (30, 160, 60), (20, 60, 180)
    picture = block((red, 90), (green, 6), (blue, 4))
    palette = find_palette([picture])
    assert [color.rgb for color in palette.colors] == [red, green]
    (dropped,) = palette.dropped
    assert dropped.rgb == blue
    assert dropped.share == pytest.approx(0.04)
    lab = oklab_from_rgb(np.array([blue, red, green], dtype=np.uint8))
    nearest = nearest_colors(np.array([blue], np.uint8), np.array([red, green], np.uint8))[0]
    assert dropped.cost == pytest.approx(float(np.linalg.norm(lab[0] - lab[1 + nearest])))
    assert len(find_palette([picture], PaletteRule(min_share=0.03)).colors) == 3


def test_all_pictures_count_together() -> None:
    front, back = block(((200, 30, 40), 100)), block(((200, 30, 40), 91), ((20, 60, 180), 9))
    assert len(find_palette([back]).colors) == 2
    assert len(find_palette([front, back]).colors) == 1


def test_if_nothing_reaches_the_share_the_largest_is_kept_and_said() -> None:
    picture = block(((200, 30, 40), 40), ((20, 60, 180), 35), ((30, 160, 60), 25))
    palette = find_palette([picture], PaletteRule(min_share=0.5))
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


BLACK = PaletteColor((0, 0, 0), 0.0, "black")


@pytest.mark.parametrize(
    ("work", "said"),
    [
        (lambda: find_palette([]), "no picture given"),
        (lambda: find_palette([np.zeros((9, 9, 4), dtype=np.uint8)]), "no opaque pixel"),
        (lambda: PaletteOptions(min_share=5.0), "--min-share: 5 is no share; give 0 to 1"),
        (lambda: PaletteOptions(max_colors=0), "--max-colors: 0 colours; give 1 to 255"),
        (lambda: Palette((), "none"), "0 colours; 1 to 255 are needed"),
        (lambda: Palette((BLACK,) * 256, "many"), "256 colours; 1 to 255 are needed"),
    ],
)
def test_nothing_to_see_is_an_error(work: Callable[[], object], said: str) -> None:
    with pytest.raises(PaletteError, match=said):
        work()


def test_evidence_says_what_one_colour_less_would_cost() -> None:
    palette = find_palette([block(((200, 30, 40), 60), ((20, 60, 180), 40))])
    assert palette.evidence is not None
    assert palette.evidence.colors == 2
    assert palette.evidence.one_less > 1000
    assert palette.evidence.one_more > 0


def test_small_colours_are_kept_on_request() -> None:
    red, blue, green = (200, 30, 40), (20, 60, 180), (30, 160, 60)
    picture = block((red, 95), (blue, 3), (green, 2))
    assert as_set(find_palette([picture])) == {red}
    options = PaletteRule(keep=((24, 64, 178),))  # near the blue that is there
    assert as_set(find_palette([picture], options)) == {red, blue}
    with pytest.raises(
        PaletteError, match="--keep: #ffff00: no such colour was found; the nearest is"
    ):
        find_palette([picture], PaletteRule(keep=((255, 255, 0),)))
    all_three = PaletteRule(min_share=0.0, max_colors=2, keep=(green,))
    assert as_set(find_palette([picture], all_three)) == {red, green}
    with pytest.raises(PaletteError, match="raise --max-colors"):
        PaletteRule(max_colors=1, keep=(red, blue))


def test_a_colour_kept_in_the_place_of_another_is_said() -> None:
    red, blue = (200, 30, 40), (20, 60, 180)
    small = block((red, 97), (blue, 3))
    near = ((40, 85, 190),)  # 0.07 away in OKLab
    (note,) = find_palette([small], PaletteRule(keep=near)).warnings
    assert note == "--keep: #2855be itself was not found; kept the nearest, #143cb4"
    (note,) = find_palette([block((red, 60), (blue, 40))], PaletteRule(keep=near)).warnings
    assert note.endswith("#143cb4, which the rule keeps anyway")
    assert find_palette([small], PaletteRule(keep=(blue,))).warnings == ()


def test_a_found_palette_picked_by_hand_has_the_same_shares() -> None:
    rgba = soft_stripes((200, 30, 40), (20, 60, 180), (30, 160, 60), width=6)
    line = np.zeros(rgba.shape[:2], dtype=bool)
    line[:, 8:12] = True
    rgba[:, 8:12, :3] = (0, 0, 0)
    rgba[:, [7, 12], :3] = rgba[:, [7, 12], :3] // 2  # the line's soft edges
    line[:, [7, 12]] = True
    found = find_palette([rgba], contours=[line])
    assert found.dropped == ()
    picked = pick_palette([rgba], found.rgb, [line])
    assert [color.share for color in picked.colors] == [color.share for color in found.colors]
    assert picked.contour == found.contour


def test_shades_stay_with_their_paint_and_what_is_left_out_goes_to_the_nearest() -> None:
    shaded = ramp(0.55, (210, 60, 50), 200)
    dark, blue = (100, 20, 50), (20, 60, 180)  # the dark one is nearest to some shades
    rgba = np.concatenate([shaded, block((dark, 60), (blue, 5))], axis=1)
    found = find_palette([rgba])
    assert [color.rgb for color in found.dropped] == [blue]
    picked = pick_palette([rgba], found.rgb)
    more = [p.share - f.share for p, f in zip(picked.colors, found.colors, strict=True)]
    assert sorted(more) == pytest.approx([0, 5 / 265])
    two = np.array([found.rgb[0], shaded[0, 0, :3]], dtype=np.uint8)  # both of the gradient
    assert min(color.share for color in pick_palette([shaded], two).colors) > 0.1


def test_the_rule_names_the_least_share_of_all_pixels() -> None:
    rgba, line = lined(0)
    palette = find_palette([rgba], contours=[line])
    assert "here 4.8 % of all its pixels" in palette.rule  # 96 % are no lines
    assert min(color.share for color in palette.colors) >= 0.048
    assert "of the character's pixels" in find_palette([rgba]).rule
    assert "at most 2 colours" in find_palette([rgba], PaletteRule(max_colors=2)).rule


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
    assert (20, 60, 180) not in as_set(find_palette([rgba]))  # 4 %
    rgba, line = rgba[:, 10:], line[:, 10:]  # 4.6 % of all, 5.7 % of what is no line
    assert (20, 60, 180) not in as_set(find_palette([rgba]))
    palette = find_palette([rgba], contours=[line])
    assert as_set(palette) == {(200, 30, 40), (0, 0, 0), (20, 60, 180)}
    assert palette.contour is not None
    assert palette.contour.share == pytest.approx(12 / 65)
    assert palette.contour.cloth == 0


@pytest.mark.parametrize(("black_cloth", "stays"), [(0, False), (10, True)])
def test_without_its_lines_black_stays_only_as_cloth(black_cloth: int, stays: bool) -> None:
    rgba, line = lined(black_cloth)
    palette = find_palette([rgba], PaletteRule(contour=False), [line])
    assert ((0, 0, 0) in as_set(palette)) == stays
    assert palette.contour is not None
    assert palette.contour.cloth == pytest.approx(black_cloth / (50 + black_cloth))
    if not stays:
        kept = PaletteRule(contour=False, keep=((0, 0, 0),))
        assert (0, 0, 0) in as_set(find_palette([rgba], kept, [line]))


def test_left_out_colours_are_shown_where_they_are() -> None:
    pictures = [block(((200, 30, 40), 90)), block(((200, 30, 40), 90))]
    pictures[1][5:9, 20:26, :3] = (20, 60, 180)
    pictures[0][30:32, 3:5, :3] = (20, 60, 180)
    palette = add_places(find_palette(pictures), pictures)
    assert [color.place for color in palette.dropped] == [Place(1, (20, 5, 6, 4))]
