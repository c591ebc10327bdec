"""Read what is written: FRONT, 3/4, Seite, 背面 under or over figures, #d95430 beside swatches.

The reader is RapidOCR with the PP-OCRv6 weights of its wheel (extra `captions`): Latin letters,
Han and kana, but no Hangul. Without it sheets have no captions. A caption is evidence and never
law (`toonset.calib.captions`); a code counts where its swatch is painted in it.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from itertools import combinations
from typing import Any

import cv2
import numpy as np
from jaxtyping import UInt8

from toonset.dataset.split.beside_views import FigureGroup, Swatch
from toonset.dataset.split.figures.rows import Taken
from toonset.dataset.split.sheet import Segmentation
from toonset.palette.colors import JUST_NOTICEABLE, oklab_from_rgb
from toonset.palette.names import RGB, hex_of, rgb_of_hex
from toonset.view import Box

LONGEST_PX = 2000  # of a sheet as it is read
SURE = 0.8  # of a text, by the reader; printed words have .9 and more
BAND = 0.25  # of a figure's height: a text farther below or above it is a title
ASIDE = 0.1  # of a figure's height: its caption's middle is no farther beside it
LEAST_SAID = 2  # captions that make a row of figures a turnaround
LEAST_FUZZY = 6  # letters: "light" is no "right"
PRINTED = 2 * JUST_NOTICEABLE  # in OKLab: a code and its swatch, a JPEG's even, differ by less
MARKED = re.compile(r"#\s*([0-9a-fA-FOoIlSs]{6})\b")
PLAIN = re.compile(r"([0-9a-fA-FOoIlSs]{6})")
DIGITS = str.maketrans("OoIlSs", "001155")  # #D9S43O
SETTINGS = {  # one thread: the same texts on any number of cores
    "Global.log_level": "critical",
    "Global.use_cls": False,  # nothing stands on its head
    "Det.limit_type": "max",  # small sheets are not enlarged
    "Det.limit_side_len": LONGEST_PX,
    "EngineConfig.onnxruntime.intra_op_num_threads": 1,
}
BETWEEN_WORDS = re.compile(r"[\W_]+")
THREE_QUARTERS = re.compile(r"3\s?/\s?4")
ALIKE = str.maketrans("01358", "oiesb")  # FR0NT


def _plain(text: str) -> str:
    """Return a text in small letters without accents and full-width forms."""
    split = unicodedata.normalize("NFKD", text.casefold()).replace("\N{FRACTION SLASH}", "/")
    bare = "".join(letter for letter in split if not unicodedata.combining(letter))
    return unicodedata.normalize("NFC", bare)


def _table(text: dict[str, str]) -> dict[str, str]:
    return {_plain(word): meaning for meaning, words in text.items() for word in words.split()}


WORDS = _table(
    {  # English, German, French, Spanish
        "front": """front frontal frontansicht vorn vorne vorderansicht vorderseite face avant
        devant frente delante delantera delantero""",
        "back": """back rear behind hinten hinteransicht rückansicht rückseite rücken dos arrière
        derrière espalda espaldas atrás detrás trasera trasero posterior""",
        "side": """side profile seite seitlich seitenansicht profil côté perfil lado lateral""",
        "left": "left links linke gauche izquierda izquierdo",
        "right": "right rechts rechte droite droit derecha derecho",
        "3q": """3q quarter quarters dreiviertel dreiviertelansicht dreiviertelprofil halbprofil
        quart quarts cuarto cuartos""",
        "": """view views three the from facing full body ansicht von der trois vue de du la tres
        vista el""",
    }
)
STEMS = _table(
    {  # Chinese, Japanese, Korean: words without spaces between them
        "front": "正 前 まえ 정면 전면 앞",
        "back": "背 後 后 裏 うしろ 正背 후면 뒤 뒷",
        "side": "侧 側 横 よこ 正侧 正側 측면 옆",
        "left": "左 좌 왼",
        "right": "右 우 오른",
        "3q": "四分之三 斜 半 ななめ 반 사선 대각",
        "": "面 视 視 图 圖 図 向 き ろ め 方 身 全 姿 면 모습 쪽 측",
    }
)


@dataclass(frozen=True)
class Text:
    """A text on a sheet.

    Attributes:
        words: as read.
        box: (x, y, width, height) in the sheet, pixels.
    """

    words: str
    box: tuple[float, float, float, float]


def with_captions(
    rgba: UInt8[np.ndarray, "height width 4"],
    found: Segmentation,
    cut: Callable[[Taken], Segmentation] | None = None,
) -> Segmentation:
    """Return the drawings with their captions, and swatches in the colours that codes say.

    All stays as it is where no reader is installed.

    Args:
        rgba: the sheet.
        found: its views.
        cut: returns those of another group, which is taken if it has captions and the likeliest
            turnaround has none; None: a person said which group.
    """
    read = _reader()
    boxes = [view.figure_box for view in found.views]
    drawn = [box for group in found.groups for row in group.rows for box in row]
    captioned = _may_have_captions(found, [*boxes, *drawn])
    if read is None or not (captioned or found.swatches):
        return found
    texts = read(rgba)
    if captioned:
        found = _captioned(texts, found, cut)
    return _coded(texts, found)


def _captioned(
    texts: Sequence[Text], found: Segmentation, cut: Callable[[Taken], Segmentation] | None
) -> Segmentation:
    boxes = [view.figure_box for view in found.views]
    labels = caption_labels(texts, boxes)
    named = None if cut is None or any(labels) else _captioned_group(texts, found.groups)
    if cut is not None and named is not None:
        found = cut(Taken(named))
        remark = f"group {named + 1} was taken: its figures have captions"
        found = replace(found, remarks=(remark, *found.remarks))
        boxes = [view.figure_box for view in found.views]
        labels = caption_labels(texts, boxes)
    if not any(labels):
        return found
    listed = ", ".join(label or "?" for label in labels)
    if _contradict(labels, boxes):
        remark = f"captions contradict each other and do not count: {listed}"
        return replace(found, remarks=(*found.remarks, remark))
    views = zip(found.views, labels, strict=True)
    return replace(
        found,
        views=tuple(replace(view, caption=label) for view, label in views),
        remarks=(*found.remarks, f"captions were read: {listed}; --views says otherwise"),
    )


def _coded(texts: Sequence[Text], found: Segmentation) -> Segmentation:
    """Return the drawings whose swatches have the colours that are written beside them."""
    swatches, remarks = list(found.swatches), list(found.remarks)
    for text in texts:
        code = _code(text.words)
        near = [i for i, one in enumerate(swatches) if _apart(text.box, one.box) <= one.box[3]]
        if code is None or not near:
            continue
        said, is_sure = code
        colors = np.array([said, *(swatches[i].color for i in near)], dtype=np.uint8)
        places = oklab_from_rgb(colors)
        off = np.linalg.norm(places[1:] - places[0], axis=1)
        meant = near[int(off.argmin())]
        if off.min() <= PRINTED:
            swatches[meant] = Swatch(swatches[meant].box, said)
        elif is_sure:
            beside = min(near, key=lambda i: _apart(text.box, swatches[i].box))
            remarks.append(
                f"the sheet says {hex_of(said)} beside a swatch of "
                f"{hex_of(swatches[beside].color)}: the swatch counts"
            )
    if swatches == list(found.swatches) and len(remarks) == len(found.remarks):
        return found
    return replace(found, swatches=tuple(swatches), remarks=tuple(remarks))


def _code(words: str) -> tuple[RGB, bool] | None:
    """Return the colour that a text says, and whether it is surely meant as one."""
    code = MARKED.search(words) or PLAIN.fullmatch(words.strip())
    if code is None:
        return None
    return rgb_of_hex(code[1].translate(DIGITS), "code"), code.re is MARKED


def _apart(one: Sequence[float], other: Sequence[float]) -> float:
    """Return how far two boxes are apart; 0 where they overlap."""
    x, y = (
        max(one[i] - other[i] - other[i + 2], other[i] - one[i] - one[i + 2], 0) for i in (0, 1)
    )
    return float(np.hypot(x, y))


def caption_labels(texts: Sequence[Text], boxes: Sequence[Box]) -> tuple[str, ...]:
    """Return per figure the label that its caption gives, "" where it has none.

    Captions of a sheet all stand under their figures or all over them: which has more labels is
    taken.

    Args:
        texts: what is written on the sheet.
        boxes: (x, y, width, height) of the figures in the sheet.
    """
    said = [(text, label) for text in texts if (label := label_of(text.words))]
    ways = [_labels_beside(said, boxes, under) for under in (True, False)]
    return max(ways, key=lambda labels: sum(map(bool, labels)))


def _captioned_group(texts: Sequence[Text], groups: Sequence[FigureGroup]) -> int | None:
    """Return the group of which most figures have captions, two at least; None if none has."""
    counts = [
        (len(boxes), sum(map(bool, caption_labels(texts, boxes))))
        for boxes in ([box for row in group.rows for box in row] for group in groups)
    ]
    said = [count if count >= max(LEAST_SAID, size / 2) else 0 for size, count in counts]
    return int(np.argmax(said)) if any(said) else None


def label_of(text: str) -> str:
    """Return the direction that a text names, as `--views` takes it; "" where it says more."""
    words = BETWEEN_WORDS.split(THREE_QUARTERS.sub(" 3q ", _plain(text)))
    meanings = [_meanings(word) for word in words if word and not word.isdecimal()]
    if any(one is None for one in meanings):
        return ""
    said = {meaning for one in meanings for meaning in one or () if meaning}
    if {"front", "back"} <= said or {"left", "right"} <= said:
        return ""
    turned = "3q" in said or (
        len(said) > 1 and bool(said & {"left", "right"} and "side" not in said)
    )
    if turned:
        return "3q-back" if "back" in said else "3q"
    return next((name for name in ("front", "back") if name in said), "side" if said else "")


def _meanings(word: str) -> tuple[str, ...] | None:
    """Return the directions that a word names; None where it is another word."""
    if word[0] >= "\N{HANGUL CHOSEONG KIYEOK}":
        return _stems(word)
    for spelling in (word, word.translate(ALIKE)):
        if spelling in WORDS:
            return (WORDS[spelling],)
    near = {WORDS[known] for known in WORDS if len(known) >= LEAST_FUZZY and _nearly(word, known)}
    return (near.pop(),) if len(near) == 1 else None


def _stems(word: str) -> tuple[str, ...] | None:
    """Return what a word of East Asian stems says, the longest stem first at every place."""
    said = []
    while word:
        stem = max((stem for stem in STEMS if word.startswith(stem)), key=len, default="")
        if not stem:
            return None
        said.append(STEMS[stem])
        word = word[len(stem) :]
    return tuple(said)


def _nearly(word: str, known: str) -> bool:
    """Return whether one letter is wrong, missing or too many."""
    pairs = enumerate(zip(word, known, strict=False))
    same = next((i for i, (a, b) in pairs if a != b), min(len(word), len(known)))
    own, other = word[same:], known[same:]
    return own[1:] == other[1:] or own[1:] == other or own == other[1:]


def _labels_beside(
    said: Sequence[tuple[Text, str]], boxes: Sequence[Box], under: bool
) -> tuple[str, ...]:
    """Return per figure what stands under it, or over it."""
    of_figure: list[set[str]] = [set() for _ in boxes]
    for text, label in said:
        x, y, width, height = text.box
        ways = [_way(box, x + width / 2, y + height / 2, under) for box in boxes]
        nearest = int(np.argmin(ways))
        if np.isfinite(ways[nearest]):
            of_figure[nearest].add(label)
    return tuple(_joined(labels) for labels in of_figure)


def _way(box: Box, x: float, y: float, under: bool) -> float:
    """Return how far a place is from below or above a figure, in its heights; else infinite."""
    left, top, width, height = box
    gap = (y - top - height if under else top - y) / height
    aside = max(left - x, x - left - width, 0) / height
    return gap + aside if 0 <= gap <= BAND and aside <= ASIDE else np.inf


def _joined(labels: set[str]) -> str:
    """Return what the lines of one caption say together; "" where they contradict each other."""
    if len(labels) == 1:
        return next(iter(labels))
    if "3q" not in labels or len(labels) > 2:
        return ""
    return "3q-back" if labels & {"back", "3q-back"} else "3q"


def _contradict(labels: Sequence[str], boxes: Sequence[Box]) -> bool:
    """Return whether two figures of one row are both said to be the front, or the back."""
    pairs = combinations(zip(labels, boxes, strict=True), 2)
    return any(
        one == other and one in ("front", "back") and _in_one_row(a, b)
        for (one, a), (other, b) in pairs
    )


def _in_one_row(a: Box, b: Box) -> bool:
    shared = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
    return shared > min(a[3], b[3]) / 2


def _may_have_captions(found: Segmentation, boxes: Sequence[Box]) -> bool:
    """Return whether anything was left out under or over a figure, or nobody has looked."""
    middles = [
        (x + width / 2, y + height / 2)
        for x, y, width, height in (left.box for left in found.left_out if left.kind != "frame")
    ]
    return not found.groups or any(
        np.isfinite(_way(box, *middle, under))
        for middle in middles
        for box in boxes
        for under in (True, False)
    )


@cache
def _reader() -> Callable[[UInt8[np.ndarray, "height width 4"]], list[Text]] | None:
    """Return what reads the texts of a sheet; None where it is not installed."""
    try:
        import_module("onnxruntime")
        reader = import_module("rapidocr").RapidOCR
    except ImportError:
        return None
    engine = reader(params=SETTINGS)
    return lambda rgba: _read(engine, rgba)


def _read(engine: Any, rgba: UInt8[np.ndarray, "height width 4"]) -> list[Text]:
    by = min(1.0, LONGEST_PX / max(rgba.shape[:2]))
    small = cv2.resize(rgba, None, fx=by, fy=by, interpolation=cv2.INTER_AREA) if by < 1 else rgba
    alpha = small[..., 3:] / 255
    bgr = np.rint(small[..., 2::-1] * alpha + 255 * (1 - alpha)).astype(np.uint8)
    page = engine(bgr)
    texts = []
    for corners, words, sure in (
        zip(page.boxes, page.txts, page.scores, strict=True) if page else ()
    ):
        if sure >= SURE:
            x, y = corners.min(axis=0) / by
            width, height = np.ptp(corners, axis=0) / by
            texts.append(Text(words, (float(x), float(y), float(width), float(height))))
    return texts
