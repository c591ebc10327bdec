"""Show results in notebooks: an HTML table without scripts, foreign text escaped."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape

RGB = tuple[int, int, int]
Cell = str | bytes | RGB  # text, a PNG file, a colour

MOST_ROWS = 40
MOST_LETTERS = 300  # of a text
MOST_PICTURES = 160_000  # bytes of all pictures of a table; a third more as text
SWATCH = "display:inline-block;width:2.5em;height:1.5em;border:1px solid #888;background:"


def picture_bytes(count: int) -> int:
    """Return how large every picture of a table of so many rows may be."""
    return MOST_PICTURES // max(1, min(count, MOST_ROWS))


def table(
    caption: str, head: Sequence[str], rows: Sequence[Sequence[Cell]], above: bytes | None = None
) -> str:
    """Return a table; of more rows than MOST_ROWS it says how many there are.

    Args:
        caption: text above it.
        head: names of the columns.
        rows: as many cells each.
        above: a PNG file to be shown above it.
    """
    lines = [f"<p>{_text(caption)}</p>"]
    if above is not None:
        lines.append(f"<p>{_cell(above)}</p>")
    lines.append("<table><thead><tr>" + "".join(f"<th>{_text(name)}</th>" for name in head))
    lines.append("</tr></thead><tbody>")
    for row in rows[:MOST_ROWS]:
        lines.append("<tr>" + "".join(f"<td>{_cell(cell)}</td>" for cell in row) + "</tr>")
    lines.append("</tbody></table>")
    if len(rows) > MOST_ROWS:
        lines.append(f"<p>and {len(rows) - MOST_ROWS} more</p>")
    return "\n".join(lines)


def _cell(cell: Cell) -> str:
    if isinstance(cell, bytes):
        return f'<img alt="" src="data:image/png;base64,{b64encode(cell).decode()}">'
    if isinstance(cell, tuple):
        red, green, blue = (int(level) for level in cell)
        return f'<span style="{SWATCH}rgb({red},{green},{blue})"></span>'
    return _text(cell)


def _text(text: str) -> str:
    return escape(text if len(text) <= MOST_LETTERS else text[: MOST_LETTERS - 1] + "…")
