"""Traced views: regions cover the figure, their borders are the picture's, and SVG keeps names."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.nerf.render.test_open_raster import rendering
from toonset.errors import UsageError
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.look.drawn_view import DrawnView
from toonset.nerf.look.outline import Outline
from toonset.nerf.render.bezier import fit_closed, flattened
from toonset.nerf.render.stack import LINES, OFF_PX, Region
from toonset.nerf.render.svg import check_traced, encode_svg, svg_of
from toonset.nerf.render.vectors import Vectors, trace
from toonset.raster import erode, is_uniform

SVG = "{http://www.w3.org/2000/svg}"
INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
FINER = 8  # samples a side of a pixel
NOTHING = 255
PAINTS = np.array([[230, 90, 50], [250, 205, 165], [40, 140, 140], [20, 20, 30]], dtype=np.uint8)
PEN = Outline((20, 20, 30), 2.0)


def view_of(labels: np.ndarray, paints: np.ndarray = PAINTS) -> DrawnView:
    """Return a view of labels that are FINER times as large as it."""
    size = (labels.shape[1] // FINER, labels.shape[0] // FINER)
    solid = labels != NOTHING
    colors = np.where(solid[..., None], paints[np.where(solid, labels, 0)] / 255.0, 0)
    small = cv2.resize(np.dstack([colors, solid]), size, interpolation=cv2.INTER_AREA)
    middle = labels[FINER // 2 :: FINER, FINER // 2 :: FINER]
    alpha = small[..., 3].astype(np.float32)
    rgb = small[..., :3].astype(np.float32)
    own = np.where(middle == NOTHING, 0, middle).astype(np.uint8)
    straight = rgb / np.maximum(alpha, 1e-6)[..., None]
    return DrawnView(rgb, alpha, np.zeros_like(alpha), own, straight, np.zeros_like(own))


def canvas(side: int = 64) -> np.ndarray:
    return np.full((side * FINER, side * FINER), NOTHING, np.uint8)


def disc(labels: np.ndarray, x: float, y: float, radius: float, label: int) -> None:
    center = (round(x * FINER), round(y * FINER))
    cv2.circle(labels, center, round(radius * FINER), label, thickness=-1)


def figure() -> np.ndarray:
    """Return a head with an eye that has a highlight, on a body beside it."""
    labels = canvas()
    disc(labels, 32, 48, 14, 2)
    disc(labels, 32, 24, 18, 1)
    disc(labels, 26, 24, 5, 3)
    disc(labels, 28, 22, 1.6, 0)
    return labels


def shown(vectors: Vectors, times: int = FINER) -> np.ndarray:
    """Return a traced view as pixels, premultiplied, as a renderer shows it."""
    width, height = vectors.size_wh
    picture = np.zeros((height * times, width * times, 4), np.float32)
    for region in vectors.regions:
        for shape in region.shapes:
            polygons = [np.rint(flattened(one) * times - 0.5).astype(np.int32) for one in shape]
            cv2.fillPoly(picture, polygons, (*(value / 255 for value in region.rgb), 1.0))
    return cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)


def all_points(region: Region) -> np.ndarray:
    return np.concatenate([flattened(one) for shape in region.shapes for one in shape])


@pytest.mark.parametrize("radius", [3.0, 20.0, 150.0])
def test_circles_are_followed_by_few_curves(radius: float) -> None:
    turn = np.linspace(0, 2 * np.pi, int(6 * radius), endpoint=False)
    circle = radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    [curve] = fit_closed([circle], OFF_PX)
    off = np.abs(np.linalg.norm(flattened(curve), axis=1) - radius)
    assert off.max() < OFF_PX + 0.05
    assert 2 <= len(curve) <= 12


def test_corners_are_kept() -> None:
    side = np.arange(0, 20, 0.5)
    zero, full = np.zeros_like(side), np.full_like(side, 20)
    square = np.concatenate(
        [
            np.stack(one, axis=1)
            for one in ((side, zero), (full, side), (20 - side, full), (zero, 20 - side))
        ]
    )
    [curve] = fit_closed([square], OFF_PX)
    for corner in ((0, 0), (20, 0), (20, 20), (0, 20)):
        assert np.linalg.norm(flattened(curve) - corner, axis=1).min() < 0.6


def test_contours_are_fitted_each_for_itself() -> None:
    turn = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    contours = [9 * circle, 30 + 4 * circle, 80 + 20 * circle]
    together = fit_closed(contours, OFF_PX)
    for contour, curve in zip(contours, together, strict=True):
        np.testing.assert_allclose(curve, fit_closed([contour], OFF_PX)[0], atol=1e-9)
    assert fit_closed([], OFF_PX) == []


def test_regions_cover_the_figure_and_nothing_else() -> None:
    view = view_of(figure())
    picture = shown(trace(view, PAINTS, None))
    assert np.abs(picture[..., 3] - view.alpha).mean() < 0.005
    inside = erode(view.alpha > 1 - 1e-6, 1)
    assert picture[..., 3][inside].min() > 0.999  # no seam
    assert np.abs(picture[..., :3] - view.rgb)[inside].mean() < 0.01
    plain = is_uniform(view.labels) & inside
    assert np.abs(picture[..., :3] - view.rgb)[plain].max() < 0.02


def test_borders_lie_within_half_a_pixel() -> None:
    labels = canvas()
    disc(labels, 31.3, 30.8, 22, 1)
    disc(labels, 34.1, 29.6, 9, 0)
    skin, red = trace(view_of(labels), PAINTS, None).regions
    for region, x, y, radius in ((skin, 31.3, 30.8, 22), (red, 34.1, 29.6, 9)):
        away = np.linalg.norm(all_points(region) - (x, y), axis=1)
        assert np.abs(away - radius).max() < 0.5
    assert len(skin.shapes) == 1
    assert len(skin.shapes[0]) == 1


def test_a_thin_line_is_one_path_of_its_paint() -> None:
    labels = canvas()
    disc(labels, 32, 32, 26, 1)
    cv2.ellipse(labels, (256, 250), (130, 70), 0, 20, 160, 3, thickness=10)  # 1.25 px
    disc(labels, 32, 14, 4, 3)
    skin, ink = trace(view_of(labels), PAINTS, None).regions
    assert (skin.paint, ink.paint) == (1, 3)
    assert len(ink.shapes) == 2


def test_lines_are_what_is_as_thin_as_the_pen() -> None:
    labels = canvas()
    disc(labels, 32, 32, 26, 3)
    disc(labels, 32, 32, 24, 1)
    disc(labels, 32, 24, 7, 3)
    skin, black, lines = trace(view_of(labels), PAINTS, PEN).regions
    assert [one.paint for one in (skin, black, lines)] == [1, 3, LINES]
    assert np.abs(np.linalg.norm(all_points(black) - (32, 24), axis=1) - 7).max() < 0.6
    assert {len(shape) for shape in lines.shapes} == {2}  # a ring


def test_an_outline_that_was_drawn_anew_is_the_ink() -> None:
    labels = canvas()
    disc(labels, 32, 32, 24, 1)
    view = view_of(labels)
    inner = canvas()
    disc(inner, 32, 32, 22, 1)
    ink = view.alpha - view_of(inner).alpha
    rgb = view.paint * (view.alpha - ink)[..., None] + ink[..., None] * np.array(PEN.rgb) / 255
    view = replace(view, ink=ink, rgb=rgb.astype(np.float32))
    *_, lines = trace(view, PAINTS, PEN).regions
    assert lines.paint == LINES
    assert lines.rgb == PEN.rgb
    [[outer, hole]] = lines.shapes
    for curve, radius in ((outer, 24), (hole, 22)):
        away = np.linalg.norm(flattened(curve) - 32, axis=1)
        assert np.abs(away - radius).max() < 0.5


def test_islands_that_nobody_sees_are_left_out() -> None:
    labels = canvas()
    disc(labels, 32, 32, 26, 1)
    view = view_of(labels)
    rng = np.random.default_rng(5)
    noise = rng.normal(0, 0.01, view.rgb.shape).astype(np.float32)
    rgb = np.clip(view.rgb + noise * view.alpha[..., None], 0, view.alpha[..., None])
    [region] = trace(replace(view, rgb=rgb, paint=rgb), PAINTS, None).regions
    assert len(region.shapes) == 1


def test_every_one_of_many_paints_has_its_group() -> None:
    steps = np.linspace(30, 230, 5).astype(int)
    paints = np.array([(r, g, b) for r in steps for g in steps[::2] for b in steps[::2]][:40])
    labels = canvas(96)
    for number in range(40):
        disc(labels, 8 + 13 * (number % 7), 8 + 13 * (number // 7), 6, number)
    vectors = trace(view_of(labels, paints), paints.astype(np.uint8), None)
    assert sorted(region.paint for region in vectors.regions) == list(range(40))
    assert all(len(region.shapes) == 1 for region in vectors.regions)


def test_nothing_and_one_colour() -> None:
    empty = trace(view_of(canvas(16)), PAINTS, PEN)
    assert (empty.size_wh, empty.regions) == ((16, 16), ())
    whole = np.zeros_like(canvas(16))
    [region] = trace(view_of(whole), PAINTS, PEN).regions
    assert (region.paint, region.rgb) == (0, tuple(PAINTS[0]))
    assert np.abs(shown(trace(view_of(whole), PAINTS, None))[2:-2, 2:-2, 3] - 1).max() < 1e-6
    assert ET.fromstring(encode_svg(empty, [], "none")).get("viewBox") == "0 0 16 16"


def test_enlarged_views_are_traced_as_large_as_drawn() -> None:
    view = view_of(figure())
    large = DrawnView(
        *(
            cv2.resize(getattr(view, name), None, fx=3, fy=3, interpolation=cv2.INTER_LINEAR)
            for name in DrawnView.__annotations__
        )
    )
    vectors = trace(large, PAINTS, None, enlarged=3.0)
    assert vectors.size_wh == (192, 192)
    picture = shown(vectors, times=2)
    assert np.abs(picture[..., 3] - large.alpha).mean() < 0.02


@pytest.mark.parametrize("enlarged", [1.0, 150 / 100.49, 150 / 100.51])
def test_what_is_traced_smaller_stays_where_it_is(enlarged: float) -> None:
    labels = canvas(150)
    disc(labels, 120, 100, 20, 1)  # far from the corner, where a wrong scale shows
    vectors = trace(view_of(labels), PAINTS, None, enlarged)
    cover = shown(vectors)[..., 3]
    middle = [(np.indices(cover.shape)[axis] + 0.5).ravel() @ cover.ravel() for axis in (1, 0)]
    place = np.array(middle) / cover.sum()
    np.testing.assert_allclose(place, (120, 100), atol=OFF_PX)


@pytest.mark.parametrize(("off", "is_paint"), [(3, True), (8, False)])
def test_colours_but_for_rounding_are_the_palettes(off: int, is_paint: bool) -> None:
    drawn = PAINTS.copy()
    drawn[1] += np.uint8(off)
    regions = trace(view_of(figure(), drawn), PAINTS, None).regions
    assert (tuple(PAINTS[1].tolist()) in {region.rgb for region in regions}) == is_paint


def test_svg_names_groups_and_holds_every_colour_in_one_class() -> None:
    names = ["red & <hot>", 'skin "light"', "teal", "3rd"]
    data = encode_svg(trace(view_of(figure()), PAINTS, None), names, "a < b")
    root = ET.fromstring(data)
    assert root.findtext(f"{SVG}title") == "a < b"
    groups = root.findall(f"{SVG}g")
    assert {group.get(f"{INKSCAPE}label") for group in groups} == set(names)
    idents = [group.get("id") for group in groups]
    assert len(set(idents)) == len(idents)
    assert "paint-3rd" in idents
    styles = root.findtext(f"{SVG}style", "")
    for part in root.iter(f"{SVG}g"):
        if part.get("class"):
            assert styles.count(f".{part.get('class')}{{fill:{part.get('fill')}}}") == 1
    assert all(
        path.get("d", "")[0] == "M" and path.get("d", "")[-1] == "z"
        for path in root.iter(f"{SVG}path")
    )
    assert data == encode_svg(trace(view_of(figure()), PAINTS, None), names, "a < b")


def test_tones_of_a_paint_share_its_group() -> None:
    square = np.array([[[[0, 0], [4, 0], [4, 0]], [[4, 4], [0, 0], [0, 0]]]], dtype=float)
    tones = tuple(Region(0, (value, 0, 0), ((square[0],),)) for value in (200, 100))
    root = ET.fromstring(encode_svg(Vectors((8, 8), tones), ["red"], "000"))
    [group] = root.findall(f"{SVG}g")
    assert [one.get("class") for one in group] == ["red", "red_2"]


@pytest.mark.parametrize("degrees", [0, 22.5])
def test_a_view_of_a_run_is_written_with_its_lines_on_top(egg: Drawings, degrees: float) -> None:
    data = svg_of(rendering(egg, np.deg2rad(degrees)), "000")
    groups = ET.fromstring(data).findall(f"{SVG}g")
    assert groups[-1].get("id") == "lines"
    assert len(groups) > 2


def test_only_the_drawn_look_is_traced() -> None:
    check_traced("drawn")
    with pytest.raises(UsageError, match="layer 'depth': cannot be written as SVG"):
        check_traced("depth")
