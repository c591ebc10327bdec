"""A palette in words, for the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from toonset.palette.palette import DroppedColor, Palette

HUNDRED = 100.0


def palette_lines(found: Palette) -> list[str]:
    """Return a line per colour, then what is known of lines, left-out colours and their number."""
    lines = [_line(color.rgb, color.share, color.name) for color in found.colors]
    lines += _contour_lines(found)
    if found.dropped:
        lines.append("left out (with the mean OKLab error that this costs, and the largest patch):")
        lines += [_dropped_line(color) for color in found.dropped]
    evidence = found.evidence
    if evidence is not None:
        lines.append(
            f"told apart: {evidence.colors}; one less costs {evidence.one_less:+.0f} bits, one "
            f"more {evidence.one_more:+.0f}, per 4,096 pixels"
        )
    return lines


def _contour_lines(found: Palette) -> list[str]:
    from toonset.palette.names import hex_of

    ink = found.contour
    if ink is None:
        return []
    kept = ink.rgb in [color.rgb for color in found.colors]
    return [
        f"lines: {hex_of(ink.rgb)}, {HUNDRED * ink.share:.1f} % of the character; without lines "
        f"{HUNDRED * ink.cloth:.1f} % {'' if kept else '(left out) '}has this colour"
    ]


def _dropped_line(color: DroppedColor) -> str:
    line = f"{_line(color.rgb, color.share, color.name)}  {color.cost:.3f}"
    if color.place is None:
        return line
    x, y, width, height = color.place.box
    return f"{line}  picture {color.place.view} at ({x}, {y}), {width} x {height} px"


def _line(rgb: tuple[int, int, int], share: float, name: str) -> str:
    from toonset.palette.names import hex_of

    return f"{hex_of(rgb)}  {HUNDRED * share:5.1f} %  {name}"
