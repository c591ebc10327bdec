"""R15: hostile names and hostile text must be shown and exported, never obeyed."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from tests.audit.case import Case, Ran, Row, run_cases
from tests.audit.documents import JSON_KINDS, Kind, dotted, leaves, writes
from tests.audit.material import EXPORTS, Material

NAMES = (
    *('"""; import os #', '"; import os; "', "@VIEWS@", "</script><script>alert(1)</script>"),
    *("a\x1b[31mb", "line\nbreak", "'); DROP", "../../up"),
)
TEXTS = ("\x1b[31mred", "</script><b>", "two\nlines", "\x9b2J", "a\u202eb\u2028c", "\ud800")
PER_KIND = 18


def in_exports(material: Material) -> Row:
    """Export a bundle whose views have hostile names, to every format."""
    cases = []
    for name in NAMES:
        for to in EXPORTS:
            line = ("export", "b", "--to", *to.split(), "-o", "o")
            make = partial(renamed, material, name)
            cases.append(Case(f"{to} {name}", line, make, judge=harmless))
    return run_cases(cases, material.work)


def renamed(material: Material, name: str, folder: Path) -> None:
    """Copy the bundle; the first view's picture gets the name, as far as a file can have it."""
    bundle = material.copy("bundle", folder / "b")
    picture = f"images/{name.replace('/', '_') if '..' not in name else name}.png"
    if ".." not in name:
        (bundle / "images/000.png").rename(bundle / picture)
    for file, key, path in (
        ("transforms.json", picture, ("frames", 0, "file_path")),
        ("calibration.json", Path(picture).name, ("views", 0, "name")),
    ):
        writes((bundle / file).read_bytes(), path, lambda old, key=key: key)(bundle / file)


def harmless(folder: Path, ran: Ran) -> Iterable[str]:
    """Return whether the Blender script is code of ours with a literal list of views."""
    script = folder / "o/import_cameras.py"
    if not script.exists():
        return
    tree = ast.parse(script.read_text())
    imports = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    imports |= {n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    if "os" in imports:
        yield "the Blender script imports os"
    values = [
        json.loads(ast.literal_eval(node.value.args[0]))
        for node in tree.body
        if isinstance(node, ast.Assign)
        and ast.unparse(node.targets[0]) == "VIEWS"
        and isinstance(node.value, ast.Call)
        and ast.unparse(node.value.func) == "json.loads"
    ]
    if len(values) != 1 or len(values[0]) != 3:
        yield f"the Blender script has {len(values)} lists of views"


def in_documents(material: Material) -> Row:
    """Put hostile text where documents hold text, and read them with every verb."""

    def cases() -> Iterator[Case]:
        for kind in JSON_KINDS:
            content = kind.content(material)
            document = json.loads(content)
            texts = [path for path in leaves(document) if isinstance(value_at(document, path), str)]
            texts = [*texts, *[path for path in leaves(document) if path not in texts][:3]]
            for i in range(PER_KIND):
                path, text = texts[i % len(texts)], TEXTS[i % len(TEXTS)]
                one = Kind(kind.parts, kind.file, (kind.runs[i % len(kind.runs)],), kind.text)
                yield from one.cases(
                    material,
                    f"{i} {dotted(path)}",
                    writes(content, path, lambda old, text=text: text),
                )

    return run_cases(cases(), material.work)


def value_at(document: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        document = document[key]
    return document
