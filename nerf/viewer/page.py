"""The page: its template and modules, its data and pictures, in one HTML file.

Nothing in it comes from elsewhere, and a content security policy sees to that: scripts and styles
are allowed by their hashes, pictures only from the file itself. The modules in `page/` are plain ES
modules; here they follow each other in one script, imported ones first, which is all that a bundler
would do.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent / "page"
IMPORT = re.compile(r'^import (?:[^"]*?) from "\./([a-z_]+\.js)";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?:\{\};\n)?", re.MULTILINE)


def page_html(
    scene: dict[str, Any], blob: bytes, pictures: Sequence[bytes], first: str = "main.js"
) -> str:
    """Return the page.

    Args:
        scene: numbers: see `page/types.js`.
        blob: deflated arrays.
        pictures: WebP pictures of a whole turn, the front first: shown until the page draws by
            itself, and where it cannot.
        first: the module that everything starts from.
    """
    script = _script(first)
    style = (FOLDER / "style.css").read_text(encoding="utf-8")
    turn = [f"data:image/webp;base64,{_base64(picture)}" for picture in pictures]
    parts = {
        "policy": (
            "default-src 'none'; img-src data: blob:; "
            f"script-src '{_hash(script)}'; style-src '{_hash(style)}'; base-uri 'none'; "
            "form-action 'none'"
        ),
        "title": html.escape(scene["title"]),
        "style": style,
        "poster": turn[0] if turn else "",
        "scene": _json(scene),
        "turn": _json(turn),
        "blob": _base64(blob),
        "script": script,
    }
    template = (FOLDER / "index.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], template)


def _script(first: str) -> str:
    """Return a module and all that it imports, each once and after those that it imports."""
    parts: dict[str, str] = {}

    def visit(name: str) -> None:
        if name in parts:
            return
        text = (FOLDER / name).read_text(encoding="utf-8")
        parts[name] = ""  # entered: circles end here
        for other in IMPORT.findall(text):
            visit(other)
        del parts[name]
        parts[name] = EXPORT.sub("", IMPORT.sub("", text))

    visit(first)
    return "\n".join(parts.values())


def _json(values: Any) -> str:
    """Return JSON that ends no script element, whatever names are in it."""
    text = json.dumps(values, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def _hash(text: str) -> str:
    return f"sha256-{_base64(hashlib.sha256(text.encode('utf-8')).digest())}"
