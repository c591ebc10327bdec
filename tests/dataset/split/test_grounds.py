"""Grounds that are no plain paper: pages in a picture, patterns, steps, faint alpha, watermarks."""

import base64
import io
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from lab.bench.messy.sheet import make_messy_sheet
from toonset.apps.web.editor.scene import sheet_url
from toonset.dataset.images.zones import find_meetings, find_zones
from toonset.dataset.split.background import find_background, remove_residual_alpha, ring_of
from toonset.dataset.split.background_zones import fit_backdrop, fit_steps
from toonset.dataset.split.pages import find_pages, straightened
from toonset.dataset.split.sheet import Segmentation, split_picture
from toonset.dataset.split.watermark import find_watermark
from toonset.dataset.split_folder.load import split_sheet

WIDTH, HEIGHT, FIGURES = 800, 260, 4
BLACK, TEAL, SKIN, BROWN = (10, 10, 10), (38, 138, 140), (250, 205, 165), (124, 72, 48)
ROWS, COLUMNS = np.mgrid[:HEIGHT, :WIDTH]

Picture = np.ndarray


def plain(color: int | tuple[int, int, int], width: int = WIDTH, height: int = HEIGHT) -> Picture:
    return np.full((height, width, 3), color, np.uint8)


def figures(ground: Picture) -> tuple[Picture, np.ndarray]:
    """Return a picture with four outlined figures on it, and their mask."""
    picture, mask = ground.copy(), np.zeros(ground.shape[:2], np.uint8)
    parts = (((-8, 190), (14, 48), BROWN), ((0, 130), (30, 60), TEAL), ((0, 60), (26, 30), SKIN))
    for k in range(FIGURES):
        for target, grow in ((picture, 0), (mask, 0)):
            for (x, y), (a, b), color in parts:
                center, axes = (100 + 200 * k + x, y), (a + grow, b + grow)
                paint = color if target is picture else 1
                edge = BLACK if target is picture else 1
                cv2.ellipse(target, center, axes, 0, 0, 360, paint, -1)
                cv2.ellipse(target, center, axes, 0, 0, 360, edge, 3)
    return picture, mask > 0


def jpeg(rgb: Picture, quality: int = 80) -> Picture:
    data = io.BytesIO()
    Image.fromarray(rgb).save(data, "JPEG", quality=quality)
    return np.asarray(Image.open(data).convert("RGB"))


def opaque(rgb: Picture) -> Picture:
    return np.dstack([rgb, np.full(rgb.shape[:2], 255, np.uint8)])


def overlap(found: Segmentation, truth: np.ndarray) -> float:
    """Return intersection over union of the views' pixels, where they lie in the sheet."""
    mask = np.zeros(truth.shape, bool)
    for view in found.views:
        x, y, width, height = view.box
        mask[y : y + height, x : x + width] |= view.mask
    return float((mask & truth).sum() / (mask | truth).sum())


def assert_right(rgba: Picture, truth: np.ndarray) -> Segmentation:
    found = split_picture(rgba)
    assert len(found.views) == FIGURES
    assert overlap(found, truth) >= 0.95
    return found


def graph(period: int, paper: tuple[int, int, int], line: tuple[int, int, int]) -> Picture:
    ground = plain(paper)
    ground[((ROWS + 3) % period < 1) | ((COLUMNS + 5) % period < 1)] = line
    return ground


def dots(period: int, radius: int) -> Picture:
    ground = plain(255)
    for y in range(0, HEIGHT + period, period):
        for x in range(0, WIDTH + period, period):
            cv2.circle(ground, (x, y), radius, (255, 205, 215), -1, cv2.LINE_AA)
    return ground


def checks(side: float, dark: int = 204, light: int = 255) -> Picture:
    odd = (np.floor(ROWS / side) + np.floor(COLUMNS / side)) % 2 > 0
    return np.repeat(np.where(odd, dark, light).astype(np.uint8)[..., None], 3, axis=2)


def turned_graph() -> Picture:
    wide = np.full((800, 1200, 3), 255, np.uint8)
    rows, columns = np.mgrid[:800, :1200]
    wide[(rows % 22 < 2) | (columns % 22 < 2)] = (170, 200, 225)
    matrix = cv2.getRotationMatrix2D((600, 400), 3, 1)
    return np.asarray(cv2.warpAffine(wide, matrix, (1200, 800))[200:460, 200:1000])


PATTERNS: dict[str, Callable[[], Picture]] = {
    "graph": lambda: graph(20, (252, 252, 250), (190, 215, 240)),
    "fine graph": lambda: graph(7, (255, 255, 255), (200, 220, 240)),
    "faint graph": lambda: graph(12, (255, 255, 255), (244, 244, 244)),
    "blueprint": lambda: graph(24, (30, 80, 140), (100, 140, 190)),
    "turned graph": turned_graph,
    "dots": lambda: dots(15, 1),
    "polka": lambda: dots(24, 5),
    "diamonds": lambda: np.where(
        (((ROWS + COLUMNS) % 28 < 1) | ((ROWS - COLUMNS) % 28 < 1))[..., None],
        np.array((180, 200, 220), np.uint8),
        plain(255),
    ),
    "checks": lambda: checks(8),
    "dark checks": lambda: checks(12, 0x66, 0x99),
    "resized checks": lambda: checks(7.5),
}


@pytest.mark.parametrize("name", PATTERNS)
@pytest.mark.parametrize("quality", [None, 80])
def test_patterned_paper_is_ground(name: str, quality: int | None) -> None:
    picture, truth = figures(PATTERNS[name]())
    picture = picture if quality is None else jpeg(picture, quality)
    found = assert_right(opaque(picture), truth)
    assert any("patterned" in remark for remark in found.remarks)
    assert not found.warnings


def test_repeated_figures_are_no_pattern() -> None:
    """Sixty sprites in equal cells repeat, too; nothing larger would be left."""
    sheet = plain((90, 160, 90), 400, 240)
    for y in range(0, 240, 40):
        for x in range(0, 400, 40):
            cv2.ellipse(sheet, (x + 20, y + 20), (8, 17), 0, 0, 360, TEAL, -1)
            cv2.ellipse(sheet, (x + 20, y + 10), (7, 8), 0, 0, 360, SKIN, -1)
    found = split_picture(opaque(sheet))
    assert not any("patterned" in remark for remark in found.remarks)


def sky_and_floor() -> Picture:
    top = np.linspace(0, 1, HEIGHT)[:, None, None]
    ground = (np.array([150, 195, 250]) * (1 - top) + np.array([235, 245, 255]) * top) + 0 * plain(
        0
    )
    ground[205:] = (170, 150, 120)
    return ground.astype(np.uint8)


STEPS: dict[str, Callable[[], Picture]] = {
    "horizon": lambda: np.where(
        (ROWS > 180)[..., None], np.array((200, 180, 150), np.uint8), plain(250)
    ),
    "sloping horizon": lambda: np.where(
        (ROWS > 170 + 0.03 * COLUMNS)[..., None], np.array((200, 180, 150), np.uint8), plain(250)
    ),
    "soft horizon": lambda: cv2.GaussianBlur(
        np.where((ROWS > 215)[..., None], np.array((110, 160, 100), np.uint8), plain(255)),
        (0, 0),
        2,
    ),
    "halves": lambda: np.where(
        (COLUMNS > 400)[..., None], np.array((70, 60, 60), np.uint8), plain(255)
    ),
    "three panels": lambda: np.where(
        (COLUMNS > 533)[..., None],
        np.array((230, 215, 200), np.uint8),
        np.where((COLUMNS > 266)[..., None], np.array((200, 220, 230), np.uint8), plain(255)),
    ),
    "sky": sky_and_floor,
    "scanner's edge": lambda: np.where((COLUMNS > 786)[..., None], np.uint8(40), plain(248)),
}


@pytest.mark.parametrize("name", STEPS)
@pytest.mark.parametrize("quality", [None, 85])
def test_grounds_with_steps(name: str, quality: int | None) -> None:
    picture, truth = figures(STEPS[name]())
    found = assert_right(opaque(picture if quality is None else jpeg(picture, quality)), truth)
    assert any("stepped" in remark for remark in found.remarks)


def on_board(
    board: tuple[int, int, int], paper: int = 255, side: int = 40
) -> tuple[Picture, Picture]:
    """Return a page with figures on a board, and their mask."""
    page, mask = figures(plain(paper))
    picture = plain(board, WIDTH + 2 * side, HEIGHT + 2 * side)
    truth = np.zeros(picture.shape[:2], bool)
    inside = slice(side, side + HEIGHT), slice(side, side + WIDTH)
    picture[inside], truth[inside] = page, mask
    return picture, truth


@pytest.mark.parametrize("board", [(83, 83, 83), (229, 229, 229), (240, 240, 244), (20, 40, 60)])
@pytest.mark.parametrize("side", [10, 40])
def test_page_on_a_board(board: tuple[int, int, int], side: int) -> None:
    picture, truth = on_board(board, side=side)
    found = assert_right(opaque(picture), truth)
    assert any("around one page" in remark for remark in found.remarks)
    assert not found.warnings


def test_page_among_toolbars_with_an_outline_and_a_shadow() -> None:
    picture, truth = on_board((240, 240, 240), side=60)
    cv2.rectangle(picture, (0, 0), (picture.shape[1], 30), (60, 60, 60), -1)
    for k in range(8):
        cv2.rectangle(picture, (8, 60 + 30 * k), (28, 80 + 30 * k), (150, 150, 150), -1)
    picture[60 + HEIGHT : 68 + HEIGHT, 68 : 68 + WIDTH] = 190
    picture[68 : 68 + HEIGHT, 60 + WIDTH : 68 + WIDTH] = 190
    assert_right(opaque(picture), truth)


@pytest.mark.parametrize("cards", [1, FIGURES])
@pytest.mark.parametrize("paper", [(255, 255, 255), (250, 240, 230)])
def test_cards_on_transparency(cards: int, paper: tuple[int, int, int]) -> None:
    picture, truth = figures(plain(paper))
    alpha = np.zeros(truth.shape, np.uint8)
    for k in range(cards):
        left, right = k * WIDTH // cards + 8, (k + 1) * WIDTH // cards - 8
        cv2.rectangle(alpha, (left, 6), (right, HEIGHT - 6), 255, -1)
    found = assert_right(np.dstack([picture, alpha]), truth)
    assert found.background == paper


def photographed(page: Picture, tilt: float, pan: float, roll: float) -> Picture:
    """Return a page on a desk as a camera of focal length .75 sees it."""
    size, (height, width) = np.array((2400, 1800)), page.shape[:2]
    turns = [
        cv2.Rodrigues(np.radians(a) * np.eye(3)[i])[0] for i, a in enumerate((tilt, pan, roll))
    ]
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    corners = np.column_stack([signs * (width, height) / width / 2, np.zeros(4)])
    seen = corners @ (turns[0] @ turns[1] @ turns[2]).T + (0, 0, 1.1)
    places = 0.75 * size[0] * seen[:, :2] / seen[:, 2:] + size / 2
    flat = (signs + 1) * (width / 2, height / 2)
    matrix = cv2.getPerspectiveTransform(flat.astype(np.float32), places.astype(np.float32))
    cover = cv2.warpPerspective(np.ones((height, width), np.float32), matrix, size.tolist())
    photo = cv2.warpPerspective(page, matrix, size.tolist(), flags=cv2.INTER_AREA)
    cover = cover[..., None]
    return (cover * photo + (1 - cover) * np.array((100, 70, 50))).astype(np.uint8)


@pytest.mark.parametrize("angles", [(0, 0, 6), (25, 10, -8), (10, 28, 12)])
def test_paper_on_a_desk_is_straightened(angles: tuple[float, float, float]) -> None:
    page, _ = figures(plain(245))
    large = cv2.resize(page, None, fx=2, fy=2)
    photo = opaque(jpeg(photographed(large, *angles), 90))
    flat = straightened(photo)
    assert flat is not None
    assert flat.shape == photo.shape
    found = split_picture(flat)
    boxes = np.array([view.figure_box for view in found.views], float)
    true = np.array([view.figure_box for view in split_picture(opaque(page)).views], float)
    assert len(boxes) == len(true) == FIGURES
    shape, wanted = boxes[:, 2] / boxes[:, 3], true[:, 2] / true[:, 3]
    np.testing.assert_allclose(shape, wanted, rtol=0.03)
    np.testing.assert_allclose(boxes[:, 1:], boxes[:1, 1:].repeat(FIGURES, axis=0), atol=4)
    assert not any("angle" in line for line in found.warnings)


def test_papers_at_angles_are_cut_as_they_are_and_told() -> None:
    page, mask = figures(plain(245))
    corners = np.array([[0, 0], [WIDTH, 0], [WIDTH, HEIGHT], [0, HEIGHT]], np.float32)
    seen = np.array([[40, 40], [850, 60], [830, 350], [25, 330]], np.float32)
    matrix = cv2.getPerspectiveTransform(corners, seen)
    photo, cover = (
        cv2.warpPerspective(page, matrix, (900, 400)),
        cv2.warpPerspective(np.full(mask.shape, 255, np.uint8), matrix, (900, 400)),
    )
    truth = cv2.warpPerspective(mask.view(np.uint8), matrix, (900, 400)) > 0
    photo = np.where(cover[..., None] > 127, photo, np.array((100, 70, 50), np.uint8))
    found = split_picture(np.vstack([opaque(jpeg(photo, 90))] * 2))
    assert len(found.views) == 2 * FIGURES
    assert overlap(found, np.vstack([truth] * 2)) >= 0.95
    assert straightened(np.vstack([opaque(photo)] * 2)) is None
    assert any("lies at an angle" in line for line in found.warnings)


@pytest.mark.parametrize("page", [figures(plain(255))[0], jpeg(figures(plain((250, 240, 230)))[0])])
def test_an_upright_page_is_left_as_it_is(page: Picture) -> None:
    desk = plain((100, 70, 50), WIDTH + 120, HEIGHT + 100)
    desk[50 : 50 + HEIGHT, 60 : 60 + WIDTH] = page
    assert find_pages(opaque(desk)) is not None
    assert straightened(opaque(desk)) is None
    assert straightened(opaque(page)) is None


def test_a_panel_beside_the_figures_is_no_page() -> None:
    picture, _ = figures(plain(255))
    picture = np.vstack([picture, plain(255, height=160)])
    cv2.rectangle(picture, (300, 280), (500, 400), (200, 220, 250), -1)
    for x in (350, 450):
        cv2.circle(picture, (x, 340), 30, SKIN, -1)
    assert find_pages(opaque(picture)) is None


def test_a_sheet_is_no_page_of_itself() -> None:
    assert find_pages(opaque(figures(plain(255))[0])) is None


ALPHAS: dict[str, np.ndarray] = {
    "one": np.full((HEIGHT, WIDTH), 1),
    "twenty": np.full((HEIGHT, WIDTH), 20),
    "noise": np.random.default_rng(1).integers(0, 4, (HEIGHT, WIDTH)),
    "smear": np.where(np.abs(ROWS - 130) < 30, 6, 0),
    "ramp": COLUMNS * 20 // WIDTH,
}


@pytest.mark.parametrize("name", ALPHAS)
def test_residual_alpha_is_ground(name: str) -> None:
    picture, truth = figures(plain(0))
    alpha = np.where(truth, 255, ALPHAS[name]).astype(np.uint8)
    found = assert_right(np.dstack([picture, alpha]), truth)
    assert not found.warnings
    assert any("taken for transparent" in remark for remark in found.remarks)


def test_soft_edges_and_glows_keep_their_alpha() -> None:
    picture, truth = figures(plain(0))
    glow = cv2.GaussianBlur(truth.astype(np.float32), (0, 0), 5)
    rgba = np.dstack([picture, np.where(truth, 255, 120 * glow).astype(np.uint8)])
    cleaned, level = remove_residual_alpha(rgba)
    assert level == 0
    assert cleaned is rgba


def samples() -> np.ndarray:
    """Return the coverage of a word that is repeated all over, at an angle."""
    letters = np.zeros((1000, 1400), np.uint8)
    for j, y in enumerate(range(30, 1000, 70)):
        for x in range(-60 * (j % 3), 1400, 200):
            cv2.putText(letters, "SAMPLE", (x, y), 0, 1, 255, 2, cv2.LINE_AA)
    turn = cv2.getRotationMatrix2D((700, 500), 20, 1)
    turned = cv2.warpAffine(letters, turn, (1400, 1000))[370 : 370 + HEIGHT, 300 : 300 + WIDTH]
    return np.asarray(turned[..., None] / 255)


@pytest.mark.parametrize(("color", "opacity"), [((0, 0, 0), 0.15), ((120, 120, 120), 0.25)])
def test_a_watermark_is_taken_off_and_told(color: tuple[int, int, int], opacity: float) -> None:
    picture, truth = figures(plain(255))
    share = opacity * samples()
    marked = (picture * (1 - share) + np.array(color) * share).astype(np.uint8)
    found = assert_right(opaque(marked), truth)
    assert any("watermark" in line for line in found.warnings)
    for view in found.views:
        x, y, width, height = view.box
        clean = picture[y : y + height, x : x + width].astype(int)
        off = np.abs(view.rgba[..., :3] - clean).max(axis=2)[view.mask]
        assert np.mean(off > 12) < 0.03  # letters cover about a sixth


@pytest.mark.parametrize(("color", "opacity"), [((0, 0, 0), 0.15), ((120, 120, 120), 0.25)])
def test_letters_behind_the_figures_are_no_watermark(
    color: tuple[int, int, int], opacity: float
) -> None:
    picture, truth = figures(plain(255))
    share = np.where(truth[..., None], 0, opacity * samples())
    sheet = (picture * (1 - share) + np.array(color) * share).astype(np.uint8)
    found = assert_right(opaque(sheet), truth)
    assert not found.warnings
    assert any("behind the figures" in line for line in found.remarks)
    for view in found.views:
        x, y, width, height = view.box
        off = np.abs(view.rgba[..., :3] - picture[y : y + height, x : x + width].astype(int))
        assert (
            np.mean(off.max(axis=2)[view.mask & truth[y : y + height, x : x + width]] > 12) < 0.01
        )


def test_what_covers_most_of_the_paper_is_no_watermark() -> None:
    light = (ROWS % 30 > 4) & ((COLUMNS + 17 * (ROWS // 30)) % 46 > 4)  # on paper with a dark rim
    picture, _ = figures(np.where(light[..., None], (238, 229, 213), (230, 218, 197)).astype("u1"))
    assert light.mean() > 0.7
    assert find_watermark(picture, (230, 218, 197)) is None


def test_zones_end_at_edges() -> None:
    picture = plain(200, 60, 40)
    picture[:, 30:] = 100
    zones = find_zones(picture, 1.0, 0.1)
    assert zones.count == 2
    assert zones.labels[20, 5] != zones.labels[20, 55]


def test_a_drawn_frame_on_a_gradient_is_no_step() -> None:
    shade = np.linspace(215, 150, 500)[:, None, None]
    sheet = np.broadcast_to(shade, (500, 700, 3)).astype(np.uint8)
    cv2.rectangle(sheet, (6, 6), (693, 493), BLACK, 7)
    assert fit_steps(sheet, ring_of(500, 700)) is None


def test_a_panel_over_whose_edge_figures_stand() -> None:
    slope = np.linspace(0, 1, WIDTH)[None, :, None]
    shades = np.array((232, 240, 255)) * (1 - slope) + np.array((190, 215, 250)) * slope
    picture, mask = figures(np.tile(shades, (HEIGHT, 1, 1)).astype(np.uint8))
    rgba = np.full((HEIGHT + 60, WIDTH + 80, 4), 255, np.uint8)
    rgba[10 : HEIGHT + 10, 40 : WIDTH + 40, :3] = picture
    below = slice(225, HEIGHT + 10)  # the panel ends above the feet
    outside = ~np.pad(mask, ((10, 50), (40, 40)))[below]
    rgba[below][outside] = 255
    found = assert_right(rgba, np.pad(mask, ((10, 50), (40, 40))))
    assert any("straight edges" in remark for remark in found.remarks)


def test_a_boxy_figure_is_no_panel() -> None:
    rgba = opaque(plain(255, 300, 320))
    cv2.rectangle(rgba, (40, 30), (260, 270), (40, 90, 160, 255), -1)
    cv2.circle(rgba, (110, 100), 11, (255, 255, 255, 255), -1)
    cv2.circle(rgba, (190, 100), 11, (255, 255, 255, 255), -1)
    for x in (90, 180):
        cv2.rectangle(rgba, (x, 270), (x + 30, 300), (20, 20, 20, 255), -1)
    (view,) = split_picture(rgba).views
    assert view.figure_box == (40, 30, 221, 271)
    assert view.mask[20, 20]


def test_places_are_those_of_the_straightened_picture(tmp_path: Path) -> None:
    page = cv2.resize(figures(plain(245))[0], None, fx=2, fy=2)
    photo = photographed(page, 25, 10, -8)
    file = tmp_path / "desk.png"
    Image.fromarray(photo).save(file)
    sheet = split_sheet(file)
    (picture,), (source,) = sheet.pictures, sheet.split.sources
    assert "seen from straight above" in source.remarks[0]
    assert source.size_wh == photo.shape[1::-1]
    assert len(sheet.views) == FIGURES
    assert picture is not None
    for view in sheet.views:
        left, top, width, height = view.box
        shown = picture[top : top + height, left : left + width, :3][view.mask]
        away = np.abs(shown.astype(int) - view.rgba[view.mask][:, :3])
        assert away.mean() < 4  # rims are without paper
    png = base64.b64decode(sheet_url(file, sheet).partition(",")[2])
    shown = np.asarray(Image.open(io.BytesIO(png)))
    np.testing.assert_array_equal(shown, picture)


def bands() -> Picture:
    """Return flat bands parted by white lines, under a strip with a title."""
    ground = large_plain((225, 250, 250))
    ground[180:360], ground[360:] = (120, 250, 240), 255
    ground[188:194], ground[344:350] = 255, 255
    ground[:34] = (40, 60, 70)
    cv2.putText(ground, "A HUSKY", (20, 26), 0, 0.8, (255, 255, 255), 2, cv2.LINE_AA)
    return ground


def facets() -> Picture:
    """Return bands with pale polygons, and one ellipse of ground under all feet."""
    ground = bands()
    for color, corners in (
        ((198, 255, 249), [(0, 34), (300, 34), (260, 170), (0, 180)]),
        ((255, 255, 255), [(700, 34), (900, 34), (930, 180), (640, 180)]),
        ((211, 255, 251), [(0, 360), (420, 360), (300, 520), (0, 520)]),
        ((230, 240, 255), [(800, 520), (900, 360), (1200, 360), (1200, 420)]),
    ):
        cv2.fillPoly(ground, [np.array(corners)], color, cv2.LINE_AA)
    cv2.ellipse(ground, (600, 478), (570, 26), 0, 0, 360, (64, 224, 208), -1, cv2.LINE_AA)
    return ground


def panel_with_swatches(line: int = 0) -> Picture:
    """Return a panel that ends above the feet, with swatches where its corner is cut out."""
    ground = large_plain((241, 255, 217))
    outline = [(60, 90), (1140, 90), (1140, 330), (1060, 330), (1060, 450), (60, 450)]
    cv2.fillPoly(ground, [np.array(outline)], (210, 243, 154))
    if line:
        cv2.polylines(ground, [np.array(outline)], True, (20, 20, 20), line)
    for k, color in enumerate(((200, 60, 60), (60, 60, 200), (240, 220, 90))):
        cv2.circle(ground, (1110, 370 + 30 * k), 12, color, -1, cv2.LINE_AA)
    return ground


def band_behind_the_bodies() -> Picture:
    ground = large_plain(255)
    ground[170:330] = (200, 220, 250)
    return ground


def two_panels() -> Picture:
    ground = large_plain((241, 255, 217))
    ground[90:450, 30:590], ground[90:450, 620:1170] = (210, 243, 154), (200, 220, 250)
    return ground


def large_plain(color: int | tuple[int, int, int]) -> Picture:
    return plain(color, 1200, 520)


def large_figures(
    ground: Picture, *, outlined: bool = True, white: bool = False
) -> tuple[Picture, Picture]:
    """Return a picture with four figures on it that are twice as large, and their mask."""
    picture, mask = ground.copy(), np.zeros(ground.shape[:2], np.uint8)
    parts = (((-16, 380), (28, 96), BROWN), ((0, 260), (60, 120), TEAL), ((0, 120), (52, 60), SKIN))
    for k in range(FIGURES):
        for (x, y), axes, color in parts:
            center, paint = (150 + 300 * k + x, y), (255, 255, 255) if white else color
            for target, fill, edge in ((picture, paint, BLACK), (mask, 1, 1)):
                cv2.ellipse(target, center, axes, 0, 0, 360, fill, -1)
                if outlined:
                    cv2.ellipse(target, center, axes, 0, 0, 360, edge, 5)
    return picture, mask > 0


BACKDROPS = {
    "bands": bands,
    "facets": facets,
    "panel": panel_with_swatches,
    "outlined panel": lambda: panel_with_swatches(4),
    "band": band_behind_the_bodies,
    "two panels": two_panels,
}


@pytest.mark.parametrize("name", BACKDROPS)
@pytest.mark.parametrize("outlined", [True, False])
def test_graphic_backdrops(name: str, outlined: bool) -> None:
    picture, truth = large_figures(BACKDROPS[name](), outlined=outlined)
    assert_right(opaque(picture), truth)


@pytest.mark.parametrize("name", ["bands", "facets"])
def test_white_figures_are_no_part_of_a_white_backdrop(name: str) -> None:
    picture, truth = large_figures(BACKDROPS[name](), white=True)
    assert_right(opaque(picture), truth)
    assert_right(opaque(jpeg(picture, 88)), truth)


def blocky_figures(ground: Picture) -> tuple[Picture, Picture]:
    """Return a picture with four figures of rectangles without outlines, and their mask."""
    picture, mask = ground.copy(), np.zeros(ground.shape[:2], bool)
    shirt, trousers = (60, 110, 200), (40, 40, 120)
    for k in range(FIGURES):
        middle = 150 + 300 * k
        for left, right, top, bottom, color in (
            (-45, 45, 130, 300, shirt),
            (-25, 25, 150, 280, (255, 255, 255)),
            (-40, 40, 40, 130, SKIN),
            (-75, -45, 130, 310, SKIN),
            (45, 75, 130, 310, SKIN),
            (-45, 45, 300, 480, trousers),
        ):
            part = slice(top, bottom), slice(middle + left, middle + right)
            picture[part], mask[part] = color, True
    return picture, mask


@pytest.mark.parametrize("name", ["bands", "facets", "paper"])
def test_blocky_figures_are_no_panels(name: str) -> None:
    ground = large_plain(255) if name == "paper" else BACKDROPS[name]()
    picture, truth = blocky_figures(ground)
    found = assert_right(opaque(picture), truth)
    assert not found.warnings


def test_a_drawn_frame_is_no_panel() -> None:
    picture, truth = large_figures(large_plain((242, 237, 223)))
    for inset in (10, 16):
        cv2.rectangle(picture, (inset, inset), (1199 - inset, 519 - inset), (30, 50, 120), 4)
    assert fit_backdrop(picture, ring_of(520, 1200), only_panels=True) is None
    assert_right(opaque(picture), truth)


def test_a_border_of_one_color_is_no_backdrop_whatever_stands_on_it() -> None:
    messy = make_messy_sheet(165635304)  # line art: its straight insides were zones of the ground
    assert find_background(messy.rgba, None).kind != "stepped"


def test_a_lattice_needs_two_ways() -> None:
    messy = make_messy_sheet(933938367)  # both of its vectors came to one peak
    assert len(split_picture(messy.rgba).views) == len(messy.boxes)


def test_zones_meet_in_straight_steps() -> None:
    picture = plain(200, 300, 300)
    picture[150:] = 120
    cv2.circle(picture, (150, 80), 45, (40, 40, 40), -1)
    zones = find_zones(picture, 1.0, 0.001)
    upper, lower, disc = (int(zones.labels[y, x]) for y, x in ((10, 10), (290, 10), (80, 150)))
    met = find_meetings(zones, zones.colors(picture).astype(np.uint8)[zones.grown], picture)
    assert met.straight[lower, upper] >= 0.9 * met.length[lower, upper] > 0
    assert met.length[disc, upper] > 0
    assert met.straight[disc, upper] == 0
