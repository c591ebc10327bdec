"""R3: documents that people and other programs write, with everything in them that may be wrong."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial, reduce
from pathlib import Path
from typing import Any

from lab.audit.case import Case, Row, run_cases
from lab.audit.judge import REFUSED, Ran
from lab.audit.material import Material

TRAIN = ("train", "b", "--steps", "2", "--threads", "1", "--device", "cpu", "-o", "o")
TURN = ("render", "r", "--turntable", "1", "--size", "24", "-o", "o")
BOXES = [[20, 0, 56, 96], [122, 0, 42, 96], [214, 0, 60, 96]]
PAIRS = {"head_top": [29, 4], "chin": [29, 30], "nose": [30, 20], "neck": [29, 38]}
MARKS = {"schema": "toonset-landmarks/1", "points": {"tip": [0, 1, 0]}, "views": {"0": PAIRS}}
CORRECTIONS: dict[str, Any] = {
    "version": 1,
    "sheet": {"name": "sheet.png", "sha256": "", "size": [288, 96]},
    "boxes": BOXES,
    "views": [{"box": BOXES[0], "label": "front", "lock": True}, {"box": BOXES[1], "label": "90"}],
    "palette": {"keep": [], "names": {}, "strokes": []},
}
SHORT = {"b": "bundle", "r": "run"}
ODD_VALUES, KEYS_GONE = 12, 4  # per kind of file
PASSWD, ZERO = "/etc/passwd", "/dev/zero"

Change = Callable[[Path], Any]
Judge = Callable[[Path, Ran], Iterable[str]]
Place = tuple[Any, ...]  # keys and numbers on the way to a value of a document


def nothing(folder: Path, ran: Ran) -> tuple[str, ...]:
    """Find no more faults."""
    return ()


def taken(folder: Path, ran: Ran) -> tuple[str, ...]:
    """Find fault with a refusal: nothing is wrong with the file."""
    return (f"refused as it is: {ran.err.decode()}",) if ran.code == REFUSED else ()


def refused(folder: Path, ran: Ran) -> tuple[str, ...]:
    """Find fault with what is not refused."""
    return () if ran.code == REFUSED else ("followed a link out of the folder",)


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes:
        parts: of the material that a case copies.
        file: which of them is changed.
        runs: the command lines that read it.
        text: its content; None: as the material has it.
    """

    parts: tuple[str, ...]
    file: str
    runs: tuple[tuple[str, ...], ...]
    text: str | None = None

    def content(self, material: Material) -> bytes:
        """Return the file as it should be."""
        at = material.root / self.file
        return at.read_bytes() if self.text is None else self.text.encode()

    def cases(
        self, material: Material, name: str, change: Change, judge: Judge = nothing
    ) -> Iterator[Case]:
        """Yield every command with the file changed."""

        def make(folder: Path) -> None:
            material.copy_all(folder, *self.parts)
            for short, part in SHORT.items():
                if part in self.parts:
                    (folder / part).rename(folder / short)
            change(folder / self.there)

        for run in self.runs:
            title = f"{self.file} {name}: {run[0]}"
            yield Case(title, run, make, outputs=("o", "b"), judge=judge)

    @property
    def there(self) -> str:
        """Return where a case has the file."""
        first, *rest = self.file.split("/")
        return "/".join((first[0] if first in SHORT.values() else first, *rest))

    def only(self, number: int) -> Kind:
        """Return the kind with one of its commands, in turn."""
        return replace(self, runs=(self.runs[number % len(self.runs)],))


def imported(folder: str) -> tuple[tuple[str, ...], ...]:
    return (("import", folder, "-o", "o"), ("info", folder), ("check", folder))


EXPORT = ("export", "b", "--to", "colmap", "-o", "o")
LOOKS = (("info", "b"), ("check", "b"))
JSON_KINDS = (
    Kind(
        ("bundle",), "bundle/transforms.json",
        (*LOOKS, ("palette", "b"), TRAIN, EXPORT),
    ),
    Kind(("bundle",), "bundle/calibration.json", (*LOOKS, ("palette", "b"), ("consistency", "b"))),
    Kind(
        ("bundle",), "bundle/palette.json",
        (*LOOKS, TRAIN, ("recolor", "b", "--recolor", "#cccccc=#00aa00", "-o", "o")),
    ),
    Kind(
        ("split", "m.obj"), "split/split.json",
        (("info", "split"), ("check", "split"), ("palette", "split", "-o", "o")),
    ),
    Kind(("run",), "run/config.json", (("info", "r"), ("check", "r"), TURN)),
    Kind(("run",), "run/metrics.json", (("info", "r"), ("check", "r"), TURN)),
    Kind(("nerfstudio",), "nerfstudio/transforms.json", imported("nerfstudio")),
    Kind(("nerfstudio",), "nerfstudio/toonset.json", imported("nerfstudio")[:1]),
    Kind(("colmap",), "colmap/toonset.json", imported("colmap")[:1]),
    Kind(
        ("blender-synthetic",), "blender-synthetic/transforms_train.json",
        imported("blender-synthetic"),
    ),
    Kind(
        ("sheet.png", "m.obj", "m.landmarks.json"), "marks.json",
        (("calibrate", "sheet.png", "--mesh", "m.obj", "--landmarks", "marks.json", "-o", "o"),),
        json.dumps(MARKS),
    ),
    Kind(
        ("m.obj", "m.landmarks.json"), "m.landmarks.json",
        (("synth", "m.obj", "--condition", "artist", "--views", "2", "--cell", "64", "-o", "o"),),
    ),
    Kind(
        ("sheet.png",), "boxes.json",
        (("split", "sheet.png", "--boxes", "boxes.json", "-o", "o"),),
        json.dumps({"boxes": [{"x": x, "y": y, "width": w, "height": h} for x, y, w, h in BOXES]}),
    ),
    Kind(
        ("sheet.png", "bundle"), "fix.json",
        (
            ("palette", "b", "--corrections", "fix.json", "-o", "o"),
            ("calibrate", "sheet.png", "--mesh", "none", "--corrections", "fix.json", "-o", "o"),
        ),
        json.dumps(CORRECTIONS),
    ),
)  # fmt: skip
INSIDE = {  # files that links must not bring in from elsewhere, and what reads them
    "bundle/transforms.json": (*LOOKS, ("palette", "b"), TRAIN, EXPORT),
    "bundle/palette.json": (LOOKS[1], TRAIN),
    "bundle/calibration.json": (LOOKS[1],),
    "bundle/images/000.png": (LOOKS[1], ("palette", "b"), TRAIN, EXPORT),
    "bundle/labels/000.png": (LOOKS[1], TRAIN),
    "bundle/mannequin.obj": (LOOKS[1], TRAIN, EXPORT),
    "split/split.json": (("check", "split"), ("palette", "split", "-o", "o")),
    "split/images/000.png": (("check", "split"), ("palette", "split", "-o", "o")),
}
ODD: tuple[Any, ...] = (
    *(None, True, "", "x", "\x1b[31m", "../x", "/etc/passwd", "a\0b", "n" * 70_000, [], {}, [[]]),
    *(0, -1, 0.5, 1e-300, 1e300, -1e308, 2**31, 2**62, 2**70, [0] * 2000, {"x": {"y": 1}}),
)
WHOLE = (
    *(b"", b"{", b"[]", b"null", b'"x"', b'{"schema": NaN}', b'{"version": 1, "version": 1}'),
    *(b"[" * 100_000, b"[" * 70 + b"]" * 70, b'{"version": ' + b"9" * 5000 + b"}"),
    *(b'{"version": "\xff"}', bytes(1000)),
)


def by_hand(material: Material) -> Row:
    """Put odd values, texts and links in the place of what belongs there."""
    lot = random.Random(material.seed)

    def cases() -> Iterator[Case]:
        for kind in JSON_KINDS:
            content = kind.content(material)
            yield from kind.cases(material, "as it is", put(content), taken)
            for name, change in changes(content, lot):
                yield from kind.cases(material, name, change)
        for file, runs in INSIDE.items():
            kind = Kind((file.split("/")[0],), file, runs)
            yield from kind.cases(material, "lies outside", moved_out, refused)

    return run_cases(cases(), material.work)


def changes(content: bytes, lot: random.Random) -> Iterator[tuple[str, Change]]:
    """Yield what a person might do to a JSON file: other texts, no file, odd values, keys gone."""
    for data in (*WHOLE, content.decode().encode("utf-16")):
        yield f"is {data[:16]!r}", put(data)
    yield "gone", lambda at: at.unlink(missing_ok=True)
    yield "folder", lambda at: (at.unlink(missing_ok=True), at.mkdir())
    for target in (PASSWD, ZERO):
        yield target, partial(linked, target=target)
    places = [*places_of(json.loads(content))]
    for odd in lot.sample(ODD, ODD_VALUES):
        place = lot.choice(places)
        yield f"{dotted(place)}={json.dumps(odd)[:20]}", writes(content, place, [odd])
    for place in lot.sample(places, min(KEYS_GONE, len(places))):
        yield f"{dotted(place)} gone", writes(content, place, [])


def put(data: bytes) -> Change:
    """Return what writes this content."""
    return lambda at: at.write_bytes(data)


def linked(at: Path, target: str) -> None:
    """Put a link in the place of a file."""
    at.unlink(missing_ok=True)
    at.symlink_to(target)


def moved_out(at: Path) -> None:
    """Move a file out of its folder; a link stays."""
    outside = at.parents[1] if at.parent.name in ("b", "split") else at.parents[2]
    at.rename(outside / "outside")
    at.symlink_to(outside / "outside")


def writes(content: bytes, place: Place, new: list[Any]) -> Change:
    """Return what writes the document with one value replaced, or taken away if `new` is empty."""
    document = json.loads(content)
    set_at(document, place, new)
    return put(json.dumps(document).encode())


def set_at(document: Any, place: Place, new: list[Any]) -> None:
    """Replace the value at a place, or take it away if `new` is empty."""
    holder = value_at(document, place[:-1])
    if new:
        holder[place[-1]] = new[0]
    else:
        del holder[place[-1]]


def value_at(document: Any, place: Place) -> Any:
    """Return the value at a place."""
    return reduce(lambda holder, key: holder[key], place, document)


def places_of(value: Any, at: Place = ()) -> Iterator[Place]:
    """Yield the place of every value in a document, of lists the first three."""
    items = enumerate(value[:3]) if isinstance(value, list) else ()
    for key, item in value.items() if isinstance(value, dict) else items:
        yield (*at, key)
        yield from places_of(item, (*at, key))


def dotted(place: Place) -> str:
    """Return a place on one line."""
    return ".".join(map(str, place))
