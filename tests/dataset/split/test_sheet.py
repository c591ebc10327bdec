"""Sheets: the right figures in reading order, and cutouts that give the sheet again."""

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from toonset.dataset.split.sheet import PictureOptions, Segmentation, split_picture
from toonset.errors import SheetError

WHITE = (255, 255, 255)
RED, BLUE, SKIN, BLACK = (200, 30, 40), (20, 60, 180), (236, 188, 155), (10, 10, 10)
FINE = 8  # drawings are made so many times larger and averaged: exact coverage


class Drawing:
    """A canvas with a soft-edged picture and the true coverage of what was drawn."""

    def __init__(self, width: int, height: int, ground: tuple[int, int, int] = WHITE) -> None:
        self.fine = np.full((height * FINE, width * FINE, 3), ground, dtype=np.uint8)
        self.cover = np.zeros(self.fine.shape[:2], dtype=np.uint8)

    def ellipse(
        self, x: float, y: float, a: float, b: float, color: tuple[int, int, int], line: float = 0
    ) -> "Drawing":
        center = (round(x * FINE), round(y * FINE))
        axes = (round(a * FINE), round(b * FINE))
        if line:
            outer = (axes[0] + round(line * FINE), axes[1] + round(line * FINE))
            cv2.ellipse(self.fine, center, outer, 0, 0, 360, BLACK, -1)
            cv2.ellipse(self.cover, center, outer, 0, 0, 360, 255, -1)
        cv2.ellipse(self.fine, center, axes, 0, 0, 360, color, -1)
        cv2.ellipse(self.cover, center, axes, 0, 0, 360, 255, -1)
        return self

    def text(self, words: str, x: int, y: int) -> "Drawing":
        place = (x * FINE, y * FINE)
        cv2.putText(self.fine, words, place, cv2.FONT_HERSHEY_SIMPLEX, 0.5 * FINE, BLACK, FINE)
        return self

    def hole(self, x: float, y: float, a: float, b: float) -> "Drawing":
        center, axes = (round(x * FINE), round(y * FINE)), (round(a * FINE), round(b * FINE))
        ground = tuple(int(value) for value in self.fine[0, 0])
        cv2.ellipse(self.fine, center, axes, 0, 0, 360, ground, -1)
        cv2.ellipse(self.cover, center, axes, 0, 0, 360, 0, -1)
        return self

    def _shrunk(self, fine: np.ndarray) -> np.ndarray:
        height, width = fine.shape[0] // FINE, fine.shape[1] // FINE
        return cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA)

    @property
    def rgba(self) -> np.ndarray:
        rgb = self._shrunk(self.fine)
        return np.dstack([rgb, np.full(rgb.shape[:2], 255, dtype=np.uint8)])

    @property
    def coverage(self) -> np.ndarray:
        return self._shrunk(self.cover)


COLORS = [RED, BLUE, SKIN, (30, 120, 60)]


def row_of_four(
    ground: tuple[int, int, int] = WHITE, line: float = 0, height: int = 130
) -> Drawing:
    drawing = Drawing(360, height, ground)
    for i, color in enumerate(COLORS):
        x = 50.3 + 85 * i
        drawing.ellipse(x, 75.4, 14 + 4 * i, 42, color, line)
        drawing.ellipse(x + 3, 25.2, 17, 17, SKIN, line)
    return drawing


def pasted(sheet: Segmentation, shape: tuple[int, ...]) -> np.ndarray:
    """Return the views' alpha laid back to their places."""
    alpha = np.zeros(shape[:2], dtype=np.uint8)
    for view in sheet.views:
        x, y, width, height = view.box
        window = alpha[y : y + height, x : x + width]
        np.maximum(window, view.rgba[..., 3], out=window)
    return alpha


def recomposed(sheet: Segmentation, shape: tuple[int, ...], ground: tuple[int, ...]) -> np.ndarray:
    result = np.empty((*shape[:2], 3))
    result[:] = ground
    for view in sheet.views:
        x, y, width, height = view.box
        alpha = view.rgba[..., 3:] / 255
        window = result[y : y + height, x : x + width]
        window[:] = alpha * view.rgba[..., :3] + (1 - alpha) * window
    return result


def main_colors(sheet: Segmentation) -> list[int]:
    """Return for every view which of COLORS its lower half has."""
    found = []
    for view in sheet.views:
        lower = view.rgba[view.rgba.shape[0] // 2 :]
        middle = np.median(lower[lower[..., 3] == 255][:, :3], axis=0)
        found.append(int(np.abs(np.array(COLORS) - middle).sum(axis=1).argmin()))
    return found


@pytest.mark.parametrize("ground", [WHITE, (0, 255, 0), (120, 130, 140), (250, 246, 235)])
@pytest.mark.parametrize("line", [0, 2.5])
def test_laying_the_views_back_gives_the_sheet(ground: tuple[int, int, int], line: float) -> None:
    drawing = row_of_four(ground, line)
    sheet = split_picture(drawing.rgba)
    assert len(sheet.views) == 4
    assert sheet.background == ground
    assert sheet.sure > 0.99
    again = recomposed(sheet, drawing.rgba.shape, ground)
    assert np.abs(again - drawing.rgba[..., :3]).max() <= 2


@pytest.mark.parametrize("ground", [WHITE, (0, 255, 0), (120, 130, 140)])
@pytest.mark.parametrize("line", [0, 2.5])
def test_alpha_is_the_true_coverage(ground: tuple[int, int, int], line: float) -> None:
    drawing = row_of_four(ground, line)
    sheet = split_picture(drawing.rgba)
    difference = np.abs(pasted(sheet, drawing.rgba.shape).astype(int) - drawing.coverage)
    edge = (drawing.coverage > 0) & (drawing.coverage < 255)
    assert difference[~edge].mean() < 0.2
    assert difference[edge].mean() < 12
    assert np.percentile(difference[edge], 90) < 40


def test_edge_colours_are_pure() -> None:
    drawing = Drawing(100, 100).ellipse(50, 50, 30, 30, RED)
    view = split_picture(drawing.rgba).views[0]
    edge = (view.rgba[..., 3] > 60) & (view.rgba[..., 3] < 255)
    assert edge.sum() > 50
    assert np.abs(view.rgba[edge, :3].astype(int) - RED).max() <= 4


def test_pixel_art_stays_hard() -> None:
    art = np.random.default_rng(0).integers(0, 200, (12, 8, 3), dtype=np.uint8)
    picture = np.full((80, 60, 4), 255, dtype=np.uint8)
    picture[10:58, 14:46, :3] = art.repeat(4, axis=0).repeat(4, axis=1)
    view = split_picture(picture).views[0]
    assert set(np.unique(view.rgba[..., 3])) == {0, 255}
    assert np.array_equal(view.rgba[view.mask][:, :3], picture[10:58, 14:46, :3].reshape(-1, 3))


def test_a_transparent_sheet_is_cut_by_its_own_alpha() -> None:
    drawing = row_of_four()
    picture = np.dstack([drawing.rgba[..., :3], drawing.coverage])
    sheet = split_picture(picture)
    assert sheet.background is None
    assert np.array_equal(pasted(sheet, picture.shape), drawing.coverage)
    assert main_colors(sheet) == [0, 1, 2, 3]
    assert [view.name for view in sheet.views] == ["000.png", "001.png", "002.png", "003.png"]


def test_transparency_counts_even_where_the_figure_fills_the_border() -> None:
    picture = np.full((80, 60, 4), (*RED, 255), dtype=np.uint8)
    picture[:20, :12] = (*BLUE, 0)  # hidden colour under no coverage
    sheet = split_picture(picture)
    assert sheet.background is None
    assert np.array_equal(sheet.views[0].rgba[..., 3], picture[..., 3])


def test_a_stray_transparent_pixel_shows_paper_and_a_mirrored_sheet_is_read_mirrored() -> None:
    picture = row_of_four().rgba
    picture[3, 4] = (0, 0, 0, 0)
    assert main_colors(split_picture(picture)) == [0, 1, 2, 3]
    assert split_picture(picture).warnings == ()
    assert main_colors(split_picture(np.ascontiguousarray(picture[:, ::-1]))) == [3, 2, 1, 0]


@pytest.mark.parametrize("shift", [(0, 7), (11, 0), (23, 40)])
def test_moving_the_drawings_moves_only_the_boxes(shift: tuple[int, int]) -> None:
    picture = row_of_four(line=2).rgba
    moved = np.pad(picture, ((shift[0], 3), (shift[1], 9), (0, 0)), constant_values=255)
    before, after = split_picture(picture), split_picture(moved)
    for old, new in zip(before.views, after.views, strict=True):
        assert np.array_equal(old.rgba, new.rgba)
        assert new.box == (old.box[0] + shift[1], old.box[1] + shift[0], *old.box[2:])
        assert new.line_width_px == old.line_width_px


def test_two_rows_of_uneven_heights() -> None:
    drawing = Drawing(300, 260)
    for i, (x, y) in enumerate([(50, 66), (150, 60), (250, 70), (60, 190), (200, 196)]):
        drawing.ellipse(x, y, 20, 30 + 5 * (i % 3), COLORS[i % 4])
    assert main_colors(split_picture(drawing.rgba)) == [0, 1, 2, 3, 0]


@pytest.mark.parametrize("specks", [1, 3])
def test_dust_on_blank_paper_is_no_figure(specks: int) -> None:
    paper = np.full((300, 600, 4), 255, np.uint8)
    paper[150, 100 : 100 + 40 * specks : 40, :3] = 0
    with pytest.raises(SheetError, match="the largest patch is 1 x 1 px"):
        split_picture(paper)


def test_apart_parts_join_and_captions_and_specks_do_not() -> None:
    drawing = row_of_four(height=150)
    drawing.ellipse(50, 4, 9, 2.5, BLUE)  # a hat that floats above the first figure
    drawing.ellipse(222, 120, 6, 2, BLUE)  # a hand beside the third
    drawing.text("FRONT", 20, 137)
    drawing.ellipse(350, 5, 1, 1, RED)
    sheet = split_picture(drawing.rgba)
    assert len(sheet.views) == 4
    assert (sheet.views[0].rgba[:10, :, 2] == 180).any()
    assert [left.kind for left in sheet.left_out] == ["text", "speck"]
    assert sheet.remarks[1] == "small patches that belong to no figure were left out (1)"
    assert sheet.warnings == ()
    assert sheet.views[0].box[1] + sheet.views[0].box[3] < 126  # no letter in the crop


def test_a_gap_between_arm_and_body_is_a_hole_and_an_eye_is_not() -> None:
    drawing = Drawing(140, 160).ellipse(70, 85, 40, 60, RED).hole(52, 100, 6, 20)
    drawing.ellipse(80, 50, 12, 8, WHITE)
    drawing.ellipse(80, 50, 4, 4, BLACK)  # the pupil: the white round it is an eye
    view = split_picture(drawing.rgba).views[0]
    x, y = view.box[:2]
    assert view.rgba[100 - y, 52 - x, 3] == 0
    assert view.rgba[50 - y, 71 - x, 3] == 255


def test_a_white_shirt_without_contour_in_an_inked_drawing_is_no_hole() -> None:
    drawing = Drawing(140, 160).ellipse(70, 80, 40, 60, RED, 3)
    drawing.ellipse(70, 80, 20, 20, WHITE)
    view = split_picture(drawing.rgba).views[0]
    assert view.rgba[80 - view.box[1], 70 - view.box[0], 3] == 255


def test_line_art_keeps_its_paper() -> None:
    drawing = Drawing(140, 160).ellipse(70, 85, 40, 60, WHITE, 3)
    view = split_picture(drawing.rgba).views[0]
    assert view.rgba[85 - view.box[1], 70 - view.box[0], 3] == 255
    assert view.line_width_px == pytest.approx(3, abs=0.4)


@pytest.mark.parametrize("line", [0, 2, 3, 5])
def test_contour_width(line: float) -> None:
    drawing = Drawing(170, 230).ellipse(85, 120, 45, 90, SKIN, line)
    view = split_picture(drawing.rgba).views[0]
    assert view.line_width_px == pytest.approx(line, abs=0.5)
    dark = Drawing(170, 230).ellipse(85, 120, 45, 90, (20, 22, 30))
    assert split_picture(dark.rgba).views[0].line_width_px == 0


@pytest.mark.parametrize("line", [0, 2])
@pytest.mark.parametrize("quality", [60, 75, 85, 95])
def test_jpeg_noise_neither_makes_figures_nor_fattens_them(quality: int, line: float) -> None:
    drawing = row_of_four(line=line)
    buffer = io.BytesIO()
    Image.fromarray(drawing.rgba[..., :3]).save(buffer, "JPEG", quality=quality)
    picture = np.asarray(Image.open(buffer).convert("RGBA"))
    sheet = split_picture(picture)
    assert main_colors(sheet) == [0, 1, 2, 3]
    overlap = (pasted(sheet, picture.shape) >= 128) ^ (drawing.coverage >= 128)
    assert overlap.sum() < 0.01 * (drawing.coverage >= 128).sum()


def test_frame_and_guide_lines_are_no_figures() -> None:
    picture = row_of_four().rgba
    picture = np.pad(picture, ((9, 9), (9, 9), (0, 0)), constant_values=255)
    picture[3:5, 3:-3, :3] = picture[-5:-3, 3:-3, :3] = 90  # a frame
    picture[3:-3, 3:5, :3] = picture[3:-3, -5:-3, :3] = 90
    bare = split_picture(picture)
    assert main_colors(bare) == [0, 1, 2, 3]
    picture[70, 5:-5, :3] = (90, 160, 220)  # a guide at the height of the waists
    ruled = split_picture(picture)
    assert main_colors(ruled) == [0, 1, 2, 3]
    for old, new in zip(bare.views, ruled.views, strict=True):
        assert (old.mask ^ new.mask).sum() < 0.02 * old.mask.sum()


def test_two_touching_figures_are_told() -> None:
    drawing = Drawing(420, 120)
    for x in (40, 110, 180, 290, 338):
        drawing.ellipse(x, 60, 25, 45, RED)
    sheet = split_picture(drawing.rgba)
    assert len(sheet.views) == 4
    assert sheet.warnings == ("view 003.png is unusually wide: do two figures touch?",)


def test_a_single_figure_that_touches_the_border() -> None:
    drawing = Drawing(100, 120).ellipse(50, 70, 30, 60, RED)
    sheet = split_picture(drawing.rgba)
    assert len(sheet.views) == 1
    assert sheet.sure < 0.95


@pytest.mark.parametrize(
    ("picture", "fragment"),
    [
        (np.full((90, 120, 4), 255, np.uint8), r"the sheet is blank \(all #ffffff\)"),
        (np.zeros((90, 120, 4), np.uint8), r"the sheet is blank \(all transparent\)"),
        (np.full((1, 1, 4), 255, np.uint8), "the sheet is blank"),
        (Drawing(90, 90).ellipse(45, 45, 2, 2, RED).rgba, "the largest patch is 5 x 5 px"),
        (
            np.random.default_rng(0).integers(0, 256, (90, 90, 4), np.uint8) | [0, 0, 0, 255],
            "the background is not one colour",
        ),
    ],
)
def test_sheets_without_figures_are_refused(picture: np.ndarray, fragment: str) -> None:
    with pytest.raises(SheetError, match=fragment):
        split_picture(picture.astype(np.uint8))


def test_too_many_figures_are_refused() -> None:
    picture = np.full((200, 200, 4), 255, dtype=np.uint8)
    for row in range(5, 190, 18):
        for column in range(5, 190, 18):
            picture[row : row + 10, column : column + 10, :3] = 0
    with pytest.raises(SheetError, match="found 121 figures, at most 64"):
        split_picture(picture)
    assert len(split_picture(picture, PictureOptions(most_figures=200)).views) == 121
