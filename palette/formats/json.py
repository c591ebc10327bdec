"""JSON: toonset's own palette.json, and lists of hex colours such as Lospec gives."""

from __future__ import annotations

from typing import Any

from toonset.errors import PaletteError
from toonset.palette.formats.hex import rgb_of_hex
from toonset.palette.formats.tones import SUFFIX
from toonset.palette.names import NamedColor, clean_name, hex_of
from toonset.palette.palette import Palette, Tone
from toonset.read import parse_json

NAME, VERSION = "toonset-palette", 1  # toonset.palette.formats.schema says what may change


def read_json(data: bytes, where: str) -> list[NamedColor]:
    """Return the colours of a list, or of an object's "colors"; tones follow their colour.

    An entry is "#rrggbb", or an object with "hex" and perhaps "name" and "tones".

    Raises:
        PaletteError: no JSON, no such list, or an entry that is no colour.
    """
    content = parse_json(data, where, PaletteError)
    entries = content.get("colors") if isinstance(content, dict) else content
    if not isinstance(entries, list):
        raise PaletteError(f'{where}: has no list of colours; ["#aabbcc", ...] is needed')
    return [
        swatch
        for i, entry in enumerate(entries, start=1)
        for swatch in _swatches(entry, f"{where}: colour {i}")
    ]


def json_title(data: bytes) -> str:
    """Return what an object calls itself, as toonset and Lospec write it; "" if it does not."""
    content = parse_json(data, "palette", PaletteError)
    said = [content.get(key) for key in ("title", "name")] if isinstance(content, dict) else []
    return next((clean_name(text) for text in said if isinstance(text, str)), "")


def to_json(palette: Palette) -> dict[str, Any]:
    """Return the content of palette.json."""
    contour, evidence = palette.contour, palette.evidence
    return {
        "schema": f"{NAME}/{VERSION}",
        **({"title": palette.title} if palette.title else {}),
        "colors": [
            {
                **_record(color.rgb, color.share, color.name),
                **({"tones": [_tone(tone) for tone in color.tones]} if color.tones else {}),
            }
            for color in palette.colors
        ],
        "rule": palette.rule,
        "dropped": [
            {
                **_record(color.rgb, color.share, color.name),
                "oklab_cost": round(color.cost, 6),
                "place": color.place and {"view": color.place.view, "box": list(color.place.box)},
            }
            for color in palette.dropped
        ],
        "warnings": list(palette.warnings),
        "contour": contour
        and {**_record(contour.rgb, contour.share, contour.name), "cloth": round(contour.cloth, 6)},
        "evidence": evidence
        and {
            "colors": evidence.colors,
            "one_less": round(evidence.one_less, 3),
            "one_more": round(evidence.one_more, 3),
        },
        **_shaded_keys(palette),
    }


def _shaded_keys(palette: Palette) -> dict[str, Any]:
    """Return what only shaded sheets and those with features have."""
    shadow = palette.shadow
    keys: dict[str, Any] = {}
    if shadow is not None:
        keys["shadow"] = {
            "factor": [round(value, 4) for value in shadow.factor],
            "spread": [round(value, 4) for value in shadow.spread],
            "bits": round(shadow.bits, 3),
        }
    if palette.features:
        keys["features"] = [hex_of(rgb) for rgb in palette.features]
    return keys


def _tone(tone: Tone) -> dict[str, Any]:
    return {"hex": hex_of(tone.rgb), "share": round(tone.share, 6)}


def _swatches(entry: Any, where: str) -> list[NamedColor]:
    """Return an entry's colour, and after it its tones in shadow."""
    if not isinstance(entry, dict):
        return [NamedColor(rgb_of_hex(entry, where))]
    name, tones = entry.get("name"), entry.get("tones")
    name = clean_name(name) if isinstance(name, str) else ""
    found = [NamedColor(rgb_of_hex(entry.get("hex"), where), name)]
    for tone in tones[1:] if isinstance(tones, list) and name else ():
        rgb = rgb_of_hex(tone.get("hex") if isinstance(tone, dict) else tone, where)
        found.append(NamedColor(rgb, name + SUFFIX))
    return found


def _record(rgb: tuple[int, int, int], share: float, name: str) -> dict[str, Any]:
    return {"hex": hex_of(rgb), "share": round(share, 6), "name": name}
