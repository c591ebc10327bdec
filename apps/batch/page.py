"""Write the page of a batch: one HTML file with a row for every sheet.

The rows are JSON within the page, in blocks that are written as they come, and small pictures lie
beside it. So the page appears in one step, asks for nothing that a page on a disk may not ask for,
and runs no script but its own.
"""

from __future__ import annotations

import io
import math
import os
import time
from collections.abc import Container, Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8
from PIL import Image

import toonset as ts
from toonset import lock
from toonset.apps.batch.rows import SheetRow, StageRow
from toonset.apps.batch.stages import BUNDLE, RANKS, RUN, STAGES
from toonset.errors import PictureError
from toonset.html_page import html_page, json_text
from toonset.write import new_files

FOLDER = Path(__file__).parent / "page"
STYLES = ("../../web/viewer/page/base.css", "style.css")
PAGE = "index.html"
SHEETS, THUMBS, LOG = "sheets", "thumbs", "log.txt"
OVERLAY, TURN = ".webp", ".turn.webp"  # ends of the small pictures' names
GIF = "turntable/turntable.gif"
BLOCK = 500  # rows in memory at once
MOST_CHARACTERS = 600  # of one text; a sheet's log has the rest
PATIENCE_S = 60.0  # for another process that writes the page
ROWS = "<rows>"  # stands for them in the page: no title and no JSON in there holds a "<"
LOCAL = "img-src data: blob:", "img-src 'self' data:"  # policy of a page with pictures beside it

OVERLAY_WH, TURN_PX = (480, 240), 120  # at most
MOST_FRAMES, FRAME_MS = 12, 160
QUALITY = 70  # of small pictures

# What a stage leaves to look at, in a sheet's folder: what it is called and where it lies.
RESULTS = {
    "calibrate": (("overlay", f"{BUNDLE}/overlay.png"), ("cameras", f"{BUNDLE}/transforms.json")),
    "palette": (("palette", f"{BUNDLE}/palette.png"),),
    "train": (("scores", f"{RUN}/metrics.json"),),
    "render": (("turntable", GIF),),
    "view": (("viewer", "character.html"),),
    "mesh": (("mesh", "character.glb"),),
    "export": (("export", "export/"),),
}


def write_page(out: Path, rows: Iterable[SheetRow], title: str, *, store: str = "") -> None:
    """Write the page of a batch so that a reader sees the old one or all of the new one.

    Args:
        out: the batch's folder.
        rows: its sheets, in order; they are taken one block at a time.
        title: of the page, plain text.
        store: URL that results are copied to; "": they lie in `out`.

    Raises:
        OutputError: the place cannot be written.
    """
    thumbs = _names_in(out / THUMBS)
    head = {
        "title": _text(title),
        "written": round(time.time()),
        "results": _results(store),
        "stages": [{"name": name, "results": RESULTS.get(name, ())} for name in STAGES],
    }
    page = html_page(FOLDER, _text(title), {"head": json_text(head), "rows": ROWS}, styles=STYLES)
    before, after = page.replace(*LOCAL, 1).split(ROWS)
    path = out / PAGE
    with (
        lock.hold(lock.set_of(path), path, PATIENCE_S),
        new_files(path, force=True) as new,
        open(new / PAGE, "w", encoding="utf-8", newline="") as file,
    ):
        file.write(before)
        for block in _blocks(rows, BLOCK):
            found = json_text([_values(row, out, thumbs, store) for row in block])
            file.write(f'<script class="rows" type="application/json">{found}</script>\n')
        file.write(after)
        file.flush()
        os.fsync(file.fileno())


def _results(store: str) -> str | None:
    """Return what the addresses of sheets' results begin with; None where a browser has none."""
    if not store:
        return f"{SHEETS}/"
    return f"{store.rstrip('/')}/" if store.startswith(("http://", "https://")) else None


def _blocks(rows: Iterable[SheetRow], size: int) -> Iterator[list[SheetRow]]:
    left = iter(rows)
    while block := list(islice(left, size)):
        yield block


def _names_in(folder: Path) -> frozenset[str]:
    try:
        return frozenset(os.listdir(folder))
    except OSError:
        return frozenset()


def _values(row: SheetRow, out: Path, thumbs: Container[str], store: str) -> list[Any]:
    """Return what the page shows of a sheet, in the order of `Values` in `page/rows.js`."""
    stages = {stage.stage: stage for stage in row.stages}
    calibrate, train = stages.get("calibrate"), stages.get("train")
    failed = next((stage for stage in row.stages if stage.error), None)
    character = row.entry.character
    began = row.crashes + (row.state in ("running", "done", "failed"))
    return [
        row.name,
        _text(character) if character != row.name else "",
        row.state,
        row.verdict,
        _text(str(_fact(calibrate, "reason") or "")),
        _text(failed.error if failed else ""),
        RANKS[failed.stage] if failed else -1,
        _number(_fact(calibrate, "views")),
        _number(sum(stage.wall_s for stage in row.stages), 2),
        _number(max((stage.peak_mb for stage in row.stages), default=0), 1),
        max([began, *(stage.attempts for stage in row.stages)]),
        sum(1 << RANKS[stage.stage] for stage in row.stages if _is_shown(stage, row, out, store)),
        (f"{row.name}{OVERLAY}" in thumbs) + 2 * (f"{row.name}{TURN}" in thumbs),
        train.verdict if train else "",
        _text("; ".join(map(str, _fact(train, "reasons") or ()))),
        _number(_fact(stages.get("palette"), "colors")),
        _number(_fact(train, "psnr"), 2),
    ]


def _is_shown(stage: StageRow, row: SheetRow, out: Path, store: str) -> bool:
    """Return whether a stage's results are there; `render` may be told to write no GIF."""
    if stage.stage == "render" and row.entry.words.get("render") and not store:
        return stage.state == "done" and (out / SHEETS / row.name / GIF).is_file()
    return stage.state == "done"


def _fact(stage: StageRow | None, name: str) -> Any:
    return stage.facts.get(name) if stage and stage.state == "done" else None


def _number(value: Any, digits: int = 0) -> float:
    """Return a number that JSON has; 0 for what is none."""
    if not isinstance(value, int | float) or not math.isfinite(value):
        return 0
    return round(value, digits) if digits else round(value)


def _text(text: str) -> str:
    """Return a text's beginning, as UTF-8 can hold it."""
    short = text if len(text) <= MOST_CHARACTERS else f"{text[:MOST_CHARACTERS]}…"
    return short.encode("utf-8", "replace").decode("utf-8")


# ---- small pictures ------------------------------------------------------------------------------


def thumbnail(picture: Path) -> bytes:
    """Return a picture as a small WebP over white.

    Raises:
        PictureError: it cannot be read.
    """
    return _encoded([_small(ts.load_picture(picture), *OVERLAY_WH)])


def turn_thumbnail(folder: Path) -> bytes:
    """Return a turntable's pictures, 000.png and so on, as a small animated WebP over white.

    Raises:
        PictureError: one cannot be read, or there is none.
    """
    files = sorted(path for path in folder.glob("*.png") if path.stem.isdecimal())
    if not files:
        raise PictureError(f"{folder}: has no 000.png; run `toonset render` with one --layer")
    step = -(-len(files) // MOST_FRAMES)
    frames = [_small(ts.load_picture(file), TURN_PX, TURN_PX) for file in files[::step]]
    return _encoded(frames)


def _small(rgba: UInt8[np.ndarray, "height width 4"], width: int, height: int) -> Image.Image:
    """Return a picture over white that fits into a size."""
    factor = min(1.0, width / rgba.shape[1], height / rgba.shape[0])
    size = (max(1, round(rgba.shape[1] * factor)), max(1, round(rgba.shape[0] * factor)))
    image = Image.fromarray(rgba).resize(size, Image.Resampling.BOX)  # premultiplies by itself
    paper = Image.new("RGBA", size, "white")
    paper.alpha_composite(image)
    return paper.convert("RGB")


def _encoded(frames: Sequence[Image.Image]) -> bytes:
    first, *others = frames
    kept = io.BytesIO()
    more = {"save_all": True, "append_images": others, "duration": FRAME_MS, "loop": 0}
    first.save(kept, "WEBP", quality=QUALITY, method=2, **(more if others else {}))
    return kept.getvalue()
