"""R3: the files that people and programs write by hand, changed by rule and by lot."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.audit.case import REFUSED, Case, Ran, Row, run_cases
from tests.audit.material import Material

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
AS_IT_IS = "as it is"
PER_MUTATION, ODD_VALUES = 25, 12  # per kind of file


def taken(folder: Path, ran: Ran) -> Iterator[str]:
    """Say that a file was refused that has nothing wrong with it."""
    if ran.code == REFUSED:
        yield f"refused as it is: {ran.err.decode()}"


def fine(folder: Path, ran: Ran) -> Iterator[str]:
    """Say nothing."""
    return iter(())


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes:
        parts: of the material that a case copies.
        file: which of them is changed.
        runs: the command lines that read it.
        text: its content; None: as the material has it.
        outputs: names that the commands write.
    """

    parts: tuple[str, ...]
    file: str
    runs: tuple[tuple[str, ...], ...]
    text: str | None = None
    outputs: tuple[str, ...] = ("o", "b")

    def content(self, material: Material) -> bytes:
        """Return the file as it should be."""
        at = material.root / self.file
        return at.read_bytes() if self.text is None else self.text.encode()

    def cases(self, material: Material, name: str, change: Callable[[Path], Any]) -> Iterator[Case]:
        """Yield every command with the file changed."""

        def make(folder: Path) -> None:
            material.link_all(folder, *self.parts)
            for link, part in (("b", "bundle"), ("r", "run")):
                if part in self.parts:
                    (folder / part).rename(folder / link)
            change(self.at(folder))

        for run in self.runs:
            title, judge = f"{self.file} {name}: {run[0]}", taken if name == AS_IT_IS else fine
            yield Case(title, run, make, outputs=self.outputs, judge=judge)

    def at(self, folder: Path) -> Path:
        """Return where a case has the file."""
        short = {"bundle": "b", "run": "r"}
        first, *rest = Path(self.file).parts
        return folder.joinpath(short.get(first, first), *rest)


def imported(folder: str) -> tuple[tuple[str, ...], ...]:
    return (("import", folder, "-o", "o"), ("info", folder), ("check", folder))


LOOKS = (("info", "b"), ("check", "b"))
JSON_KINDS = (
    Kind(
        ("bundle",), "bundle/transforms.json",
        (*LOOKS, ("palette", "b"), TRAIN, ("export", "b", "--to", "colmap", "-o", "o")),
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
OTHER_KINDS = (
    Kind(("bundle",), "bundle/palette.gpl", (("palette", "b", "--colors", "b/palette.gpl"),)),
    Kind(("bundle",), "bundle/palette.ase", (("palette", "b", "--colors", "b/palette.ase"),)),
    Kind(("bundle",), "bundle/palette.hex", (("palette", "b", "--colors", "b/palette.hex"),)),
    Kind(
        ("sheet.png",), "boxes.csv", (("split", "sheet.png", "--boxes", "boxes.csv", "-o", "o"),),
        "x,y,width,height\n" + "".join(f"{','.join(map(str, box))}\n" for box in BOXES),
    ),
    *[Kind(("colmap",), f"colmap/sparse/0/{name}.bin", imported("colmap")[:1])
      for name in ("cameras", "images", "points3D", "rigs", "frames")],
    *[Kind(("colmap--text",), f"colmap--text/sparse/0/{name}.txt", imported("colmap--text")[:1])
      for name in ("cameras", "images")],
)  # fmt: skip
ODD: tuple[Any, ...] = (
    *(None, True, "", "x", "\x1b[31m", "../x", "/etc/passwd", "a\0b", "n" * 70_000, [], {}, [[]]),
    *(0, -1, 0.5, 1e-300, 1e300, -1e308, 2**31, 2**62, 2**70, [0] * 2000, {"x": {"y": 1}}),
)
WHOLE = {
    "empty": b"",
    "brace": b"{",
    "list": b"[]",
    "null": b"null",
    "string": b'"x"',
    "nan": b'{"schema": NaN}',
    "deep": b"[" * 100_000,
    "deep-closed": b"[" * 70 + b"]" * 70,
    "digits": b'{"version": ' + b"9" * 5000 + b"}",
    "twice": b'{"version": 1, "version": 1}',
    "not-utf-8": b'{"version": "\xff"}',
    "nul": bytes(1000),
}


def by_hand(material: Material) -> Row:
    """Put odd values, texts and links in the place of what belongs there."""
    lot = random.Random(material.seed)

    def cases() -> Iterator[Case]:
        for kind in JSON_KINDS:
            for name, change in changes(kind.content(material), lot):
                yield from kind.cases(material, name, change)

    return run_cases(cases(), material.work)


def changes(content: bytes, lot: random.Random) -> Iterator[tuple[str, Callable[[Path], Any]]]:
    """Yield what a person might do to a JSON file: 12 whole ones, keys gone, odd values, links."""
    yield AS_IT_IS, lambda at: at.write_bytes(content)
    for name, data in WHOLE.items():
        yield name, lambda at, data=data: at.write_bytes(data)
    yield "utf-16", lambda at: at.write_bytes(content.decode().encode("utf-16"))
    yield "gone", lambda at: at.unlink(missing_ok=True)
    yield "folder", lambda at: (at.unlink(missing_ok=True), at.mkdir())
    yield "link", lambda at: (at.unlink(missing_ok=True), at.symlink_to("/etc/passwd"))
    yield "to-zero", lambda at: (at.unlink(missing_ok=True), at.symlink_to("/dev/zero"))
    places = [*leaves(json.loads(content))]
    for odd in lot.sample(ODD, ODD_VALUES):
        path = lot.choice(places)
        yield f"{dotted(path)}={short(odd)}", writes(content, path, lambda old, odd=odd: odd)
    for path in lot.sample(places, min(4, len(places))):
        yield f"{dotted(path)} gone", writes(content, path, None)


def writes(
    content: bytes, path: tuple[Any, ...], new: Callable[[Any], Any] | None
) -> Callable[[Path], Any]:
    """Return what writes the document with one value replaced, or taken away."""

    def write(at: Path) -> None:
        document = json.loads(content)
        holder = document
        for key in path[:-1]:
            holder = holder[key]
        if new is None:
            del holder[path[-1]]
        else:
            holder[path[-1]] = new(holder[path[-1]])
        at.write_text(json.dumps(document))

    return write


def leaves(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the path of every value in a document, of lists the first three."""
    if path:
        yield path
    items = value.items() if isinstance(value, dict) else []
    items = list(enumerate(value))[:3] if isinstance(value, list) else items
    for key, item in items:
        yield from leaves(item, (*path, key))


def dotted(path: tuple[Any, ...]) -> str:
    return ".".join(map(str, path))


def short(value: Any) -> str:
    return json.dumps(value)[:20]


def mutated(material: Material) -> Row:
    """Change bytes and values by lot: 16 kinds of mutations, among them COLMAP's .bin."""
    lot = random.Random(material.seed + 1)

    def cases() -> Iterator[Case]:
        for kind in (*JSON_KINDS, *OTHER_KINDS):
            content = kind.content(material)
            json_too = kind in JSON_KINDS
            for i in range(2 * PER_MUTATION if json_too or "colmap" in kind.file else PER_MUTATION):
                name, data = mutation(content, lot, json_too and i % 2 == 0)
                run = kind.runs[i % len(kind.runs)]
                one = Kind(kind.parts, kind.file, (run,), kind.text)
                change = lambda at, data=data: at.write_bytes(data)  # noqa: E731
                yield from one.cases(material, f"{i} {name}", change)

    return run_cases(cases(), material.work)


def mutation(content: bytes, lot: random.Random, as_json: bool) -> tuple[str, bytes]:
    """Return a name and the content with one to three changes, of its values or its bytes."""
    if as_json:
        document = json.loads(content)
        names = [mutate_value(document, lot) for _ in range(lot.randint(1, 3))]
        return "+".join(names), json.dumps(document).encode()
    data = bytearray(content)
    names = [mutate_bytes(data, lot) for _ in range(lot.randint(1, 3))]
    return "+".join(names), bytes(data)


def mutate_value(document: Any, lot: random.Random) -> str:
    """Change one value of a document in place; return how."""
    path = lot.choice([*leaves(document)] or [()])
    if not path:
        return "nothing"
    holder = document
    for key in path[:-1]:
        holder = holder[key]
    old = holder[path[-1]]
    number = old if isinstance(old, int | float) and abs(old) < 1e9 else 1
    other = lot.choice([*leaves(document)])
    kinds: dict[str, Callable[[], Any]] = {
        "odd": lambda: lot.choice(ODD),
        "negative": lambda: -number,
        "a thousand": lambda: number * 1000,
        "a thousandth": lambda: number / 1000,
        "a bit more": lambda: number + lot.gauss(0, 0.01),
        "as text": lambda: str(old),
        "in a list": lambda: [old],
        "twice": lambda: [old, old],
        "another": lambda: found(document, other),
    }
    kind = lot.choice([*kinds, "gone"])
    if kind == "gone":
        del holder[path[-1]]
    else:
        holder[path[-1]] = json.loads(json.dumps(kinds[kind]()))
    return kind


def found(document: Any, path: tuple[Any, ...]) -> Any:
    """Return the value at a path."""
    for key in path:
        document = document[key]
    return document


def mutate_bytes(data: bytearray, lot: random.Random) -> str:
    """Change some bytes in place; return how."""
    at = lot.randrange(max(1, len(data)))
    to = min(len(data), at + lot.choice((1, 4, 8, 50)))
    kinds: dict[str, bytes] = {
        "flip": bytes([data[at] ^ 1 << lot.randrange(8)]) + data[at + 1 : to] if data else b"x",
        "cut out": b"",
        "repeat": bytes(data[at:to]) * 2,
        "noise": lot.randbytes(to - at),
        "ones": b"\xff" * (to - at),
        "insert": lot.randbytes(3) + data[at:to],
    }
    kind = lot.choice([*kinds])
    data[at:to] = kinds[kind]
    return kind
