"""Write the page of a run, or of a bundle that is not trained yet: one HTML file.

Numbers are JSON within the page; pictures and maps are bytes in one deflated blob.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from toonset.html_page import base64_text, data_url, html_page, json_text
from toonset.nerf.layered_views.build import Views, views_of

FOLDER = Path(__file__).parent / "page"
EFFORT = 7  # 9 takes five times as long for 2 %


@dataclass(eq=False)
class Blob:
    """Bytes of many parts one after the other."""

    parts: list[bytes] = field(default_factory=list)
    size: int = 0

    def keep(self, record: Any) -> Any:
        """Return a record with the bytes in it put here: where they begin, how many they are."""
        if isinstance(record, dict):
            return {name: self.keep(value) for name, value in record.items()}
        if isinstance(record, list):
            return [self.keep(value) for value in record]
        if not isinstance(record, bytes):
            return record
        self.parts.append(record)
        self.size += len(record)
        return [self.size - len(record), len(record)]

    def deflated(self) -> bytes:
        """Return everything, as `DecompressionStream("deflate")` reads it."""
        return zlib.compress(b"".join(self.parts), EFFORT)


def view_html(folder: Path, size: int | None = None, title: str = "") -> str:
    """Return the page of a run folder, or of a bundle: see `views_of`.

    Args:
        folder: of the run or bundle.
        size: side of the views' pictures, px; None: as it suits.
        title: of the page; "": the sheet's name, or the folder's where the sheet is not known.

    Raises:
        ToonsetError: a file is missing or damaged.
    """
    return page_of(views_of(folder, size, title))


def page_of(views: Views) -> str:
    """Return the page that shows views."""
    blob = Blob()
    scene = blob.keep(views.record)
    return page_html(scene, blob.deflated(), views.poster)


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
