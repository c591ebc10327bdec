"""A palette in words, for the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from toonset.palette.palette import DroppedColor, Evidence, Palette

HUNDRED = 100.0
PIXELS = 4096  # for which the evidence counts bits
LEAST_BITS = 1.0  # less decides nothing


def palette_lines(found: Palette) -> list[str]:
    """Return a line per colour, then the rule, lines, left-out colours and why so many."""
    lines = [_line(color.rgb, color.share, color.name) for color in found.colors]
    lines.append(f"shares are of all the character's pixels; rule: {found.rule}")
    lines += _contour_lines(found)
    if found.dropped:
        lines.append("left out (with the mean OKLab error that this costs, and the largest patch):")
        lines += [_dropped_line(color) for color in found.dropped]
    if found.evidence is not None:
        lines.append(_evidence_line(found.evidence))
    return lines


def _evidence_line(evidence: Evidence) -> str:
    """Return why so many colours: with them the drawing is described most briefly."""
    number = evidence.colors
    others = [_other_number(number + 1, evidence.one_more)]
    if number > 1:
        others.insert(0, _other_number(number - 1, evidence.one_less))
    colors = "1 colour describes" if number == 1 else f"{number} colours describe"
    return (
        f"{colors} the drawing most briefly, those left out included; {', '.join(others)} "
        f"(bits per {PIXELS:,} pixels)"
    )


def _other_number(number: int, more_bits: float) -> str:
    if more_bits < LEAST_BITS:
        return f"{number} would do nearly as well, a close call"
    return f"{number} would take {more_bits:.0f} bits more"


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
