"""R15: hostile names and hostile text must be shown and exported, never obeyed."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from lab.audit.case import Case, Row, run_cases
from lab.audit.documents import JSON_KINDS, dotted, places_of, value_at, writes
from lab.audit.judge import Ran
from lab.audit.material import EXPORTS, Material

NAMES = (
    *('"""; import os #', '"; import os; "', "@VIEWS@", "</script><script>alert(1)</script>"),
    *("a\x1b[31mb", "line\nbreak", "'); DROP", "../../up"),
)
TEXTS = ("\x1b[31mred", "</script><b>", "two\nlines", "\x9b2J", "a\u202eb\u2028c", "\ud800")
PER_KIND = 18
SCRIPT = "import_cameras.py"  # of an export to Blender


def in_exports(material: Material) -> Row:
    """Export a bundle whose first view has a hostile name, to every format."""
    ours = script(material.root / "blender")

    def judge(folder: Path, ran: Ran) -> Iterator[str]:
        if (folder / "o" / SCRIPT).exists() and script(folder / "o") != ours:
            yield "the Blender script holds other code, or other views"

    lines = {to: ("export", "b", "--to", *to.split(), "-o", "o") for to in EXPORTS}
    cases = [
        Case(f"{to} {name}", line, partial(renamed, material, name), judge=judge)
        for name in NAMES
        for to, line in lines.items()
    ]
    return run_cases(cases, material.work)


def renamed(material: Material, name: str, folder: Path) -> None:
    """Copy the bundle; the first view gets the name, its picture as far as a file can have it."""
    bundle = material.copy("bundle", folder / "b")
    picture = f"images/{name}.png" if ".." in name else f"images/{name.replace('/', '_')}.png"
    if ".." not in name:
        (bundle / "images/000.png").rename(bundle / picture)
    for file, text, place in (
        ("transforms.json", picture, ("frames", 0, "file_path")),
        ("calibration.json", Path(picture).name, ("views", 0, "name")),
    ):
        writes((bundle / file).read_bytes(), place, [text])(bundle / file)


def script(folder: Path) -> tuple[str, int]:
    """Return the code of an exported Blender script without its views, and how many there are.

    Nothing in it is executed: the views must be a literal, JSON in a text.
    """
    tree = ast.parse((folder / SCRIPT).read_text())
    line = next(i for i, node in enumerate(tree.body) if ast.unparse(node).startswith("VIEWS ="))
    views = tree.body.pop(line)
    assert isinstance(views, ast.Assign)
    assert isinstance(views.value, ast.Call)
    assert ast.unparse(views.value.func) == "json.loads"
    return ast.dump(tree), len(json.loads(ast.literal_eval(views.value.args[0])))


def in_documents(material: Material) -> Row:
    """Put hostile text where documents hold text, and read them with every verb."""

    def cases() -> Iterator[Case]:
        for kind in JSON_KINDS:
            content = kind.content(material)
            document = json.loads(content)
            places = [*places_of(document)]
            texts = [place for place in places if isinstance(value_at(document, place), str)]
            texts += places[:3]
            for i in range(PER_KIND):
                place = texts[i % len(texts)]
                change = writes(content, place, [TEXTS[i % len(TEXTS)]])
                yield from kind.only(i).cases(material, f"{i} {dotted(place)}", change)

    return run_cases(cases(), material.work)
