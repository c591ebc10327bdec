"""The picture of a split: it shows every view, and its tags hide nobody's face."""

import numpy as np
import pytest

from toonset.dataset.split.beside_views import LeftOut
from toonset.dataset.split_folder.overlay import draw_split
from toonset.dataset.split_folder.panel import (
    FIGURES,
    HEAD,
    LEFT_OUT,
    MARGIN,
    WIDEST,
    Panel,
    draw_panel,
)
from toonset.dataset.split_folder.tags import FIGURE, Costs, Line, draw_tag, layout_size
from toonset.view import View

INK = (250, 250, 10)  # of the figures: no colour of the overlay's own
SIDE = 160


def view(number: int, x: int, y: int, width: int, height: int) -> View:
    """Return a figure that fills its box but for a border of 4 px."""
    rgba = np.zeros((height, width, 4), np.uint8)
    rgba[4:-4, 4:-4] = (*INK, 255)
    return View(rgba, (x, y, width, height), 2.0, f"{number:03d}.png")


def panel(
    views: list[View],
    size_wh: tuple[int, int],
    paper: tuple[int, int, int] | None,
    left_out: tuple[LeftOut, ...] = (),
) -> Panel:
    rgba = np.zeros((size_wh[1], size_wh[0], 4), np.uint8)
    rgba[:] = (0, 0, 0, 0) if paper is None else (*paper, 255)
    for one in views:
        x, y, width, height = one.box
        window = rgba[y : y + height, x : x + width]
        window[one.mask] = one.rgba[one.mask]
    labels = tuple("front" if i % 2 else "" for i in range(len(views)))
    return Panel("sheet.png", rgba, paper, tuple(views), labels, left_out)


def rows_of(columns: int, rows: int, gap: int) -> tuple[list[View], tuple[int, int]]:
    views = [
        view(r * columns + c, gap + c * (SIDE + gap), gap + r * (SIDE + gap), SIDE, SIDE)
        for r in range(rows)
        for c in range(columns)
    ]
    return views, (gap + columns * (SIDE + gap), gap + rows * (SIDE + gap))


def inner(one: Panel, *, enlarged: bool = False) -> np.ndarray:
    """Return the overlay at the sheet's own size, without the room round it."""
    picture = draw_panel(one, alone=enlarged)[HEAD:-MARGIN, MARGIN:-MARGIN]
    zoom = picture.shape[1] // one.rgba.shape[1]
    assert (zoom > 1) == enlarged
    return picture[zoom // 2 :: zoom, zoom // 2 :: zoom]


def shown(picture: np.ndarray, color: tuple[int, int, int]) -> np.ndarray:
    return (picture == color).all(axis=2)


@pytest.mark.parametrize("paper", [(255, 255, 255), (12, 14, 20), (128, 60, 60), None])
@pytest.mark.parametrize(("columns", "rows"), [(1, 1), (4, 1), (2, 2)])
def test_every_pixel_of_every_figure_shows_where_there_is_room(columns, rows, paper):
    views, size = rows_of(columns, rows, gap=90)
    picture = inner(panel(views, size, paper), enlarged=True)
    for one in views:
        x, y, width, height = one.box
        assert shown(picture[y : y + height, x : x + width], INK)[one.mask].all()


def test_packed_figures_keep_their_upper_halves():
    """No gap at all between the figures: tags must go on them, but never on a face."""
    views, size = rows_of(4, 4, gap=0)
    full = [View(np.full_like(v.rgba, 255), v.box, 2.0, v.name) for v in views]
    picture = inner(panel(full, size, (255, 255, 255)), enlarged=True)
    for one in full:
        x, y, width, _ = one.box
        upper = picture[y + 8 : y + SIDE // 2 - 4, x + 8 : x + width - 8]
        assert (upper == 255).all(), one.name


def test_a_wrong_cut_shows():
    """The outline follows the mask, and what the mask lacks is faded."""
    whole = view(0, 20, 20, 150, 300)
    half = View(whole.rgba * (np.arange(300)[:, None, None] < 150), whole.box, 2.0, "000.png")
    cut = panel([whole], (200, 340), (255, 255, 255))
    cut = Panel(cut.title, cut.rgba, cut.background, (half,), ("",))
    picture = inner(cut)
    assert shown(picture[24:170, 24:166], INK).all()
    assert not shown(picture[170:320], INK).any()
    assert shown(picture[171:173, 24:166], FIGURES[0]).any(axis=0).all()  # along the cut
    assert (picture[250, 60] == np.rint(0.4 * np.array(INK) + 0.6 * 255)).all()  # faded


def test_holes_have_an_outline():
    ring = view(0, 20, 20, 150, 300)
    rgba = ring.rgba.copy()
    rgba[100:140, 60:100] = 0
    holed = View(rgba, ring.box, 0.0, "000.png")
    picture = inner(panel([holed], (200, 340), (255, 255, 255)))
    assert shown(picture[120:160, 80:82], FIGURES[0]).all()


def test_what_was_left_out_is_orange_and_dropped_views_too():
    views = [view(0, 20, 20, 150, 300)]
    left = (LeftOut((200, 40, 120, 60), "text"), LeftOut((200, 150, 120, 150), "dropped"))
    picture = inner(panel(views, (340, 340), (255, 255, 255), left))
    for x, y, width, _ in (thing.box for thing in left):
        row = picture[y - 2, x : x + width]
        assert (row == LEFT_OUT).all(axis=1).mean() > 0.5


@pytest.mark.parametrize("size", [(7000, 700), (900, 9000), (24, 24), (400, 100)])
def test_the_picture_is_never_huge_nor_tiny(size):
    width, height = size
    one = view(0, 2, 2, min(width, 20 * height) - 4, height - 4)
    picture = draw_split([panel([one], size, (255, 255, 255))], ["a note"])
    assert 150 <= picture.shape[1] <= WIDEST + 2 * MARGIN
    assert picture.shape[0] <= 3600


def test_many_files_stand_side_by_side_and_one_without_views_is_still_shown():
    panels = [panel([view(i, 0, 0, 60, 100)], (60, 100), (255, 255, 255)) for i in range(40)]
    picture = draw_split(panels, ())
    assert picture.shape[1] <= WIDEST
    assert picture.shape[0] < 4000
    picture = draw_split([panel([], (300, 200), (255, 255, 255))], ["word " * 400])
    assert picture.shape[1] == 8 * 300 + 2 * MARGIN


def test_a_tag_takes_the_fullest_layout_that_hides_nothing():
    long, short = (Line("a long line of words", 20),), (Line("7", 20),)
    box = (40, 60, 100, 180)
    free, narrow = Costs(200, 400), Costs(200, 140)
    for costs, expected in ((free, long), (narrow, short)):
        costs.add_figure(box, np.ones((120, 60), bool))
        picture = np.zeros((*costs.map.shape, 3), np.uint8)
        assert draw_tag(picture, costs, box, [long, short], (0, 0, 200))
        rows, columns = np.nonzero(picture.any(axis=2))
        size = (int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1)
        assert size == layout_size(expected)
        assert not picture[60:180, 40:100].any()


def test_an_optional_tag_without_room_is_left_out():
    costs = Costs(100, 100)
    costs.map[:] = FIGURE
    picture = np.zeros((100, 100, 3), np.uint8)
    assert not draw_tag(
        picture, costs, (10, 10, 50, 50), [(Line("text", 13),)], LEFT_OUT, must=False
    )
    assert not picture.any()
