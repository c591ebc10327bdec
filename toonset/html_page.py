"""Build one self-contained HTML file of a template, its modules and styles, and data.

A content security policy sees to that: scripts and styles are allowed by their hashes, pictures
only from the file itself. The modules are plain ES modules in a folder `page/`, which may import
those of another page's folder; here they follow each other in one script, imported ones first,
which is all that a bundler would do.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

TEMPLATE = "index.html"
IMPORT = re.compile(r'^import (?:[^"]*?) from "(\.[\w./]+\.js)";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?:\{\};\n)?", re.MULTILINE)


def html_page(
    folder: Path,
    title: str,
    parts: Mapping[str, str],
    *,
    styles: Sequence[str] = ("style.css",),
    first: str = "main.js",
    asks_server: bool = False,
) -> str:
    """Return the page.

    Args:
        folder: of the template, its modules and styles.
        title: plain text.
        parts: what stands for `{{name}}` in the template, as HTML: see `json_text`, `base64_text`.
        styles: style sheets, relative to the folder.
        first: the module that everything starts from.
        asks_server: the page may ask the server that it came from, and nobody else.
    """
    script = _script(folder / first)
    style = "".join((folder / name).read_text(encoding="utf-8") for name in styles)
    server = "connect-src 'self'; " if asks_server else ""
    known = {
        "policy": (
            f"default-src 'none'; {server}img-src data: blob:; script-src '{_hash(script)}'; "
            f"style-src '{_hash(style)}'; base-uri 'none'; form-action 'none'"
        ),
        "title": html.escape(title),
        "style": style,
        "script": script,
        **parts,
    }
    template = (folder / TEMPLATE).read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda found: known[found[1]], template)


def json_text(values: Any) -> str:
    """Return JSON that ends no script element, whatever names are in it."""
    text = json.dumps(values, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def base64_text(data: bytes) -> str:
    """Return bytes as text."""
    return base64.b64encode(data).decode("ascii")


def data_url(data: bytes, kind: str) -> str:
    """Return a file as an address of itself; `kind` is its media type."""
    return f"data:{kind};base64,{base64_text(data)}"


def _script(first: Path) -> str:
    """Return a module and all that it imports, each once and after those that it imports."""
    parts: dict[Path, str] = {}

    def visit(path: Path) -> None:
        if path in parts:
            return
        text = path.read_text(encoding="utf-8")
        parts[path] = ""  # entered: circles end here
        for other in IMPORT.findall(text):
            visit((path.parent / other).resolve())
        del parts[path]
        parts[path] = EXPORT.sub("", IMPORT.sub("", text))

    visit(first.resolve())
    return "\n".join(parts.values())


def _hash(text: str) -> str:
    return f"sha256-{base64_text(hashlib.sha256(text.encode('utf-8')).digest())}"
