"""Assemble a page: template and modules, data and pictures, in one file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from toonset.html_page import base64_text, data_url, html_page, json_text

FOLDER = Path(__file__).parent / "page"


def page_html(scene: dict[str, Any], blob: bytes, pictures: Sequence[bytes]) -> str:
    """Return the page.

    Args:
        scene: numbers: see `page/types.js`.
        blob: deflated arrays.
        pictures: WebP pictures of a whole turn, the front first: shown until the page draws by
            itself, and where it cannot.
    """
    turn = [data_url(picture, "image/webp") for picture in pictures]
    parts = {
        "poster": turn[0] if turn else "",
        "scene": json_text(scene),
        "turn": json_text(turn),
        "blob": base64_text(blob),
    }
    return html_page(FOLDER, scene["title"], parts, styles=("base.css", "style.css"))
