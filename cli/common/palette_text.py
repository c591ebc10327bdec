"""Format a palette for `toonset palette`: colours, left-out colours, evidence."""

from __future__ import annotations

from toonset.palette.palette import DroppedColor, Evidence, Palette, PaletteColor

HUNDRED = 100.0
MOST_NAMED = 6  # left-out colours; more are counted
PIXELS = 4096  # for which the evidence counts bits
LEAST_BITS = 1.0  # less decides nothing
LEAST_SURE = 0.9  # less sure labels are told
LEAST_SHARE = 0.0005  # what rounds to 0.1 %


def palette_lines(found: Palette, *, verbose: bool) -> list[str]:
    """Return a line per colour, then what is left out; if verbose, the rule and the evidence."""
    lines = [_color_line(color, found) for color in found.colors]
    if not verbose:
        return [*lines, *_left_out(found), *_printed(found)]
    lines.append(f"shares are of all the character's pixels; rule: {found.rule}")
    if found.shadow is not None:
        factor = ", ".join(f"{value:.2f}" for value in found.shadow.factor)
        lines.append(f"shadow: colours in light times {factor}; colours are those in light")
    lines += [*_contour_lines(found), *_printed(found)]
    if found.dropped:
        lines.append("left out (with the mean OKLab error that this costs, and the largest patch):")
        lines += [_dropped_line(color, found) for color in found.dropped]
    if found.evidence is not None:
        lines.append(_evidence_line(found.evidence))
    return lines


def _color_line(color: PaletteColor, found: Palette) -> str:
    """Return a colour's line, with how much of it lies in shadow, and whether it is a feature."""
    notes = [f"{HUNDRED * dark.share:.1f} % in shadow" for dark in color.tones[1:]]
    if found.has_ramps:
        notes = _ramp_notes(color, stepped=found.stepped)
    notes += ["feature"] if color.rgb in found.features else []
    return _line(color.rgb, color.share, color.name) + (f" ({', '.join(notes)})" if notes else "")


def _ramp_notes(color: PaletteColor, *, stepped: bool) -> list[str]:
    """Return a ramp's ends, and how sure its labels are if they are not."""
    from toonset.palette.names import hex_of

    notes = []
    if len(color.tones) > 1:
        steps = f"{len(color.tones)} tones " if stepped else ""
        notes.append(f"{steps}from {hex_of(color.tones[0].rgb)} to {hex_of(color.tones[-1].rgb)}")
    if color.sure is not None and color.sure < LEAST_SURE:
        notes.append(f"{HUNDRED * color.sure:.0f} % sure")
    return notes


def _left_out(found: Palette) -> list[str]:
    from toonset.palette.names import hex_of

    if not found.dropped:
        return []
    names = [f"{hex_of(color.rgb)} {color.name}" for color in found.dropped[:MOST_NAMED]]
    more = [f"{len(found.dropped) - MOST_NAMED} more"] if len(found.dropped) > MOST_NAMED else []
    first = hex_of(found.dropped[0].rgb)
    return [f"left out by the rule: {', '.join([*names, *more])} (--keep '{first}' keeps one)"]


def _printed(found: Palette) -> list[str]:
    """Return how much of the palette that the sheet prints is painted."""
    from toonset.palette.names import hex_of
    from toonset.palette.printed import paint_of

    if not found.printed:
        return []
    colors = [color.rgb for color in found.colors]
    missing = [hex_of(rgb) for rgb in found.printed if paint_of(rgb, colors) is None]
    lacks = f", not painted: {', '.join(missing)}" if missing else ""
    return [f"printed on the sheet: {len(found.printed)} colours{lacks} (--no-swatches: unused)"]


def _evidence_line(evidence: Evidence) -> str:
    """Return why so many colours: with them the drawings are described in the fewest bits."""
    number = evidence.colors
    others = [_other_number(number + 1, evidence.one_more)]
    if number > 1:
        others.insert(0, _other_number(number - 1, evidence.one_less))
    colors = "1 colour describes" if number == 1 else f"{number} colours describe"
    return f"{colors} {PIXELS:,} pixels in the fewest bits; {', '.join(others)}"


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


def _dropped_line(color: DroppedColor, found: Palette) -> str:
    line = f"{_line(color.rgb, color.share, color.name)}  {color.cost:.3f}"
    if color.place is not None:
        x, y, width, height = color.place.box
        line += f"  picture {color.place.view} at ({x}, {y}), {width} x {height} px"
    return line + _like(color, found)


def _like(color: DroppedColor, found: Palette) -> str:
    """Return what colour of the palette a left-out one looks like; "" if it does not."""
    import numpy as np

    from toonset.palette.colors import JUST_NOTICEABLE
    from toonset.palette.names import hex_of
    from toonset.palette.pixels.labels import nearest_colors

    if color.cost > JUST_NOTICEABLE:
        return ""
    number = int(nearest_colors(np.array([color.rgb], dtype=np.uint8), found.rgb)[0])
    return f", looks like {hex_of(found.colors[number].rgb)} and is counted as that, too"


def _line(rgb: tuple[int, int, int], share: float, name: str) -> str:
    from toonset.palette.names import hex_of

    percent = f"{HUNDRED * share:5.1f}" if share >= LEAST_SHARE else "< 0.1"
    return f"{hex_of(rgb)}  {percent} %  {name}"
