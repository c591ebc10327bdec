"""Small sheets of every kind: messy ones, and figures on grounds that are no plain paper."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator

import cv2
import numpy as np
from jaxtyping import UInt8

from lab.bench.cases.jpeg import through_jpeg
from lab.bench.messy.options import DIFFICULTIES, MessyOptions
from lab.bench.messy.sheet import make_messy_sheet

Sheet = UInt8[np.ndarray, "height width 4"]
Rgb = tuple[int, int, int]
SMALL, USUAL = MessyOptions((60, 110), (2, 5), 4), MessyOptions((130, 240), (2, 6), 8)
TOGETHER = {  # with seeds that draw three or four figures
    ("tinted", "captions", "shadows", "heads"): 1,
    ("gradient", "title", "arrows", "swatches"): 3,
    ("cells", "jpeg", "shadows"): 9,
    ("touching", "jpeg", "captions"): 5,
    ("touching", "transparent", "shadows"): 9,
    ("hand frame",): 9,
    ("ground strokes", "paper"): 13,
}
KNOWN = {  # what no other sheet shows, with seeds
    ("shadows", "tinted", "jpeg"): 7007  # the shadow's tone within a figure
}
SEVERAL = MessyOptions((80, 260), most_figures=4)
ALONE = (
    *DIFFICULTIES,
    ("vignette", "frame", "props"),
    ("transparent", "floating", "captions"),
    ("guides", "line art", "title"),
    ("open contour", "paper"),
    ("overlap", "tinted", "shadows"),
    ("ground strokes", "tinted"),
    ("one", "shadows"),
)
MIXTURES = 40
TIMES = 3  # of sheets that are enlarged without smoothing
FEW = ("checks", "horizon", "page on a board", "haze", "printed palette", "white coats")
HEIGHT, WIDTH, FIGURES = 210, 520, 4
ROWS, COLUMNS = np.mgrid[:HEIGHT, :WIDTH]
INK, PAINTS = (10, 10, 10), ((124, 72, 48), (38, 138, 140), (250, 205, 165))


def sheets(*, large: bool) -> Iterator[tuple[str, Sheet]]:
    """Yield names and sheets: the usual few, or many others of other seeds."""
    for difficulties, seed in () if large else TOGETHER.items():
        yield ", ".join(difficulties), make_messy_sheet(seed, difficulties, SMALL).rgba
    alone: list[tuple[str, ...]] = [(own,) if isinstance(own, str) else own for own in ALONE]
    many: list[tuple[tuple[str, ...], MessyOptions]]
    many = [(own, USUAL if n % 2 else SMALL) for n, own in enumerate(alone)]
    many += [((), USUAL if n % 4 == 0 else SMALL) for n in range(MIXTURES)]
    for difficulties, seed in KNOWN.items() if large else ():
        yield f"known {', '.join(difficulties)}", make_messy_sheet(seed, difficulties, SEVERAL).rgba
    for number, (difficulties, options) in enumerate(many if large else ()):
        if not difficulties or {"rows", "outfits"} & {*difficulties}:
            options = MessyOptions(options.figure_px, options.mixed)
        name = f"{number}: {', '.join(difficulties) or 'mixture'}"
        yield name, make_messy_sheet(zlib.crc32(name.encode()), difficulties, options).rgba
    for name, ground in GROUNDS.items():
        if (name in FEW) is not large:
            yield name, ground()


def _plain(color: int | Rgb) -> UInt8[np.ndarray, "height width 3"]:
    return np.full((HEIGHT, WIDTH, 3), color, np.uint8)


def _split(mask: np.ndarray, here: Rgb, there: Rgb) -> UInt8[np.ndarray, "height width 3"]:
    return np.where(mask[..., None], np.array(here, np.uint8), _plain(there))


def _peopled(ground: UInt8[np.ndarray, "height width 3"]) -> Sheet:
    """Return a picture with four outlined figures on it, the later ones wider."""
    picture = ground.copy()
    height, width = picture.shape[:2]
    top, left, apart = (height - HEIGHT) // 2, (width - WIDTH) // 2, WIDTH // FIGURES
    for k in range(FIGURES):
        x = left + apart // 2 + apart * k
        parts = (((-6, 155), (9 + k, 38)), ((0, 105), (20 + k, 48)), ((0, 48), (20, 24)))
        for ((dx, y), axes), paint in zip(parts, PAINTS, strict=True):
            cv2.ellipse(picture, (x + dx, top + y), axes, 0, 0, 360, paint, -1)
            cv2.ellipse(picture, (x + dx, top + y), axes, 0, 0, 360, INK, 2)
    return np.dstack([picture, np.full((height, width), 255, np.uint8)])


def _checks() -> Sheet:
    odd = (ROWS // 8 + COLUMNS // 8) % 2 > 0
    return _peopled(_split(odd, (204, 204, 204), (255, 255, 255)))


def _graph() -> Sheet:
    lines = (ROWS % 14 < 1) | (COLUMNS % 14 < 1)
    return through_jpeg(_peopled(_split(lines, (190, 215, 240), (252, 252, 250))), 85)


def _diamonds() -> Sheet:
    lines = ((ROWS + COLUMNS) % 22 < 1) | ((ROWS - COLUMNS) % 22 < 1)
    return _peopled(_split(lines, (180, 200, 220), (255, 255, 255)))


def _horizon() -> Sheet:
    return _peopled(_split(ROWS > 150 + 0.03 * COLUMNS, (200, 180, 150), (250, 250, 250)))


def _panels() -> Sheet:
    three = _split(COLUMNS > 2 * WIDTH // 3, (230, 215, 200), (255, 255, 255))
    middle = (COLUMNS > WIDTH // 3) & (COLUMNS <= 2 * WIDTH // 3)
    return _peopled(np.where(middle[..., None], np.array((200, 220, 230), np.uint8), three))


def _sky() -> Sheet:
    top = np.linspace(0, 1, HEIGHT)[:, None, None]
    sky = np.array([150, 195, 250]) * (1 - top) + np.array([235, 245, 255]) * top
    ground = np.broadcast_to(sky, (HEIGHT, WIDTH, 3)).astype(np.uint8).copy()
    ground[168:] = (170, 150, 120)
    return through_jpeg(_peopled(ground), 85)


def _on_board() -> Sheet:
    board = np.full((HEIGHT + 60, WIDTH + 60, 3), (83, 83, 83), np.uint8)
    board[30:-30, 30:-30] = 255
    return _peopled(board)


def _on_desk() -> Sheet:
    """Return a page at an angle, as a camera sees it that looks down."""
    page = _peopled(_plain(248))[..., :3]
    flat = np.array([[0, 0], [WIDTH, 0], [WIDTH, HEIGHT], [0, HEIGHT]], np.float32)
    seen = np.array([[90, 60], [600, 95], [640, 320], [40, 290]], np.float32)
    matrix = cv2.getPerspectiveTransform(flat, seen)
    photo = cv2.warpPerspective(page, matrix, (700, 400), borderValue=(100, 70, 50))
    return np.dstack([photo, np.full(photo.shape[:2], 255, np.uint8)])


def _cards() -> Sheet:
    sheet = _peopled(_plain((250, 240, 230)))
    sheet[..., 3] = 0
    for k in range(FIGURES):
        sheet[4:-4, k * WIDTH // FIGURES + 4 : (k + 1) * WIDTH // FIGURES - 4, 3] = 255
    return sheet


def _haze() -> Sheet:
    sheet = _peopled(_plain(255))
    bare = (sheet[..., :3] == 255).all(axis=-1)
    sheet[bare] = (255, 255, 255, 0)
    sheet[bare & (ROWS > 60), 3] = 3
    return sheet


def _watermark() -> Sheet:
    letters = np.zeros((HEIGHT, WIDTH), np.uint8)
    for j, y in enumerate(range(20, HEIGHT, 34)):
        for x in range(-40 * (j % 3), WIDTH, 120):
            cv2.putText(letters, "SAMPLE", (x, y), 0, 0.7, 255, 2, cv2.LINE_AA)
    share = 0.15 * letters[..., None] / 255
    sheet = _peopled(_plain(255))
    sheet[..., :3] = (sheet[..., :3] * (1 - share)).astype(np.uint8)
    return sheet


def _printed() -> Sheet:
    sheet = np.concatenate([_peopled(_plain(252)), _peopled(_plain(252))[:60]])
    sheet[HEIGHT:, :, :3] = 252
    for k, paint in enumerate((*PAINTS, (200, 40, 40), INK)):
        sheet[HEIGHT + 12 : HEIGHT + 44, 40 + 44 * k : 72 + 44 * k, :3] = paint
    return sheet


def _enlarged() -> Sheet:
    small = make_messy_sheet(3, ("transparent", "captions"), SMALL).rgba[::2, ::2]
    return small.repeat(TIMES, axis=0).repeat(TIMES, axis=1)


def _white_coats() -> Sheet:
    """Return figures with white paint and gaps that show the paper, on white."""
    sheet = _peopled(_plain(255))
    for k in range(FIGURES):
        x = WIDTH // FIGURES // 2 + WIDTH // FIGURES * k
        cv2.ellipse(sheet, (x, 105), (12, 30), 0, 0, 360, (255, 255, 255, 255), -1)
        cv2.ellipse(sheet, (x - 2, 168), (4, 12), 0, 0, 360, (255, 255, 255, 255), -1)
    return sheet


GROUNDS: dict[str, Callable[[], Sheet]] = {
    "checks": _checks,
    "diamonds": _diamonds,
    "horizon": _horizon,
    "sky and floor": _sky,
    "page on a board": _on_board,
    "three panels": _panels,
    "cards": _cards,
    "graph paper": _graph,
    "watermark": _watermark,
    "haze": _haze,
    "enlarged": _enlarged,
    "printed palette": _printed,
    "white coats": _white_coats,
    "paper on a desk": _on_desk,
}
