"""Rows and small pictures of a batch that nobody had to run."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from PIL import Image

from toonset.apps.batch.rows import SheetRow, StageRow
from toonset.apps.batch.stages import Entry

STAGES = ("calibrate", "palette", "train", "render")
# State, verdict of the cameras: what a reader looks at first comes first.
FIRST_FIRST = (
    ("quarantined", ""),
    ("failed", ""),
    ("done", "failed"),
    ("done", "ambiguous"),
    ("done", "weak"),
    ("done", "ok"),
    ("running", ""),
    ("waiting", ""),
)
ERRORS = {
    "failed": "sheet.png: found no figures; crop the sheet, or say --background",
    "quarantined": "the process died (signal 11), 3 times",
}
REASONS = {
    "failed": "no camera fits drawing 3",
    "ambiguous": "drawing 2 may show the back",
    "weak": "two drawings say little of the camera",
}


def sheet(
    name: str,
    state: str = "done",
    verdict: str = "ok",
    *,
    position: int = 0,
    error: str | None = None,
    character: str = "",
    reason: str | None = None,
    seconds: float = 10.0,
    memory: float = 800.0,
    views: int = 8,
    words: dict[str, tuple[str, ...]] | None = None,
) -> SheetRow:
    """Return a row: of a failure the second stage failed, of a success all are done."""
    stages = []
    for number, stage in enumerate(STAGES):
        done = state == "done" or (state in ERRORS and number == 0)
        fails = state in ERRORS and number == 1
        line = (ERRORS[state] if error is None else error) if fails else ""
        own: dict[str, Any] = {"state": "done" if done else "waiting"}
        if done or fails:
            own |= {"attempts": 1, "wall_s": seconds / len(STAGES), "peak_mb": memory - number}
        if fails:
            own |= {"state": state, "error": line}
        if done and stage == "calibrate":
            said = REASONS.get(verdict, "") if reason is None else reason
            own |= {"verdict": verdict, "facts": {"reason": said, "views": views}}
        if done and stage == "palette":
            own |= {"facts": {"colors": 7}}
        if done and stage == "train":
            weak = position % 5 == 0
            reasons = ["no drawing shows the left side"] if weak else []
            own |= {
                "verdict": "weak" if weak else "ok",
                "facts": {"psnr": 31.234, "reasons": reasons},
            }
        stages.append(StageRow(stage, "key", **own))
    entry = Entry(name, (f"{name}.png",), words or {}, character or name)
    crashes = 3 if state == "quarantined" else 0
    return SheetRow(entry, position, state, "", crashes, 0.0, tuple(stages))  # type: ignore[arg-type]


def many(count: int) -> Iterator[SheetRow]:
    """Yield sheets of which few went wrong."""
    characters = ("Knight", "Rogue", "Mage", "Barbarian")
    for i in range(count):
        kind = 5 if i % 10 else i // 10 % 8
        state, verdict = FIRST_FIRST[kind]
        yield sheet(
            f"sheet{i}",
            state,
            verdict,
            position=i,
            character=characters[i % 4],
            seconds=5 + i * 7919 % 1000 / 10,
            memory=500 + i * 104729 % 900,
            views=3 + i % 9,
        )


def draw_thumbs(out: Path, names: Iterable[str]) -> None:
    """Put small pictures beside a page: a blue overlay, a turn of red and green."""
    thumbs = out / "thumbs"
    thumbs.mkdir(parents=True, exist_ok=True)
    overlay, turn = io.BytesIO(), io.BytesIO()
    Image.new("RGB", (48, 24), "blue").save(overlay, "WEBP", lossless=True)
    frames = [Image.new("RGB", (24, 24), color) for color in ("red", "lime")]
    frames[0].save(
        *(turn, "WEBP"), save_all=True, append_images=frames[1:], duration=40, loop=0, lossless=True
    )
    for name in names:
        (thumbs / f"{name}.webp").write_bytes(overlay.getvalue())
        (thumbs / f"{name}.turn.webp").write_bytes(turn.getvalue())
