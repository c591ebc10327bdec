"""Assemble a page: template and modules, data and pictures, in one file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from toonset.html_page import base64_text, data_url, html_page, json_text

FOLDER = Path(__file__).parent / "page"


def page_html(scene: dict[str, Any], blob: bytes, poster: bytes) -> str:
    """Return the page.

    Args:
        scene: numbers: see `page/types.js`.
        blob: what else it shows, deflated.
        poster: a WebP picture of the first view: shown until the page draws by itself.
    """
    parts = {
        "poster": data_url(poster, "image/webp"),
        "scene": json_text(scene),
        "blob": base64_text(blob),
    }
    return html_page(FOLDER, scene["title"], parts, styles=("base.css", "style.css"))
