"""The content of palette.json, as pydantic checks it.

Within a version keys may be added (see `toonset.read`): readers ignore keys that they do not know.
To add one, give it a default here, write it in `toonset.palette.formats.json.to_json`, and leave
the version as it is. Whatever would make an older reader draw a wrong conclusion needs the next
one.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from toonset.errors import PaletteError
from toonset.palette.formats.hex import rgb_of_hex
from toonset.palette.formats.json import NAME, VERSION
from toonset.palette.names import RGB, clean_name, one_line
from toonset.palette.palette import (
    MAX_COLORS,
    ContourColor,
    DroppedColor,
    Evidence,
    Palette,
    PaletteColor,
    Place,
    Shadow,
    Tone,
)
from toonset.read import parse_json, read_whole, schema_version

MAX_BYTES = 2**20

Name = Annotated[str, AfterValidator(clean_name)]
Line = Annotated[str, AfterValidator(one_line)]
Hex = Annotated[str, Field(pattern=r"^#([0-9a-fA-F]{3}|[0-9a-fA-F]{6})$")]
Share = Annotated[float, Field(ge=0, le=1)]
Cost = Annotated[float, Field(ge=0)]
Count = Annotated[int, Field(ge=0)]


class Record(BaseModel):
    """An object of the file: no number for a text, no text for a number, nothing infinite."""

    model_config = ConfigDict(extra="ignore", strict=True, allow_inf_nan=False)


class ColorRecord(Record):
    """One colour."""

    hex: Hex
    share: Share
    name: Name

    @property
    def rgb(self) -> RGB:
        """Return the colour as 8-bit sRGB."""
        return rgb_of_hex(self.hex, "hex")


class ToneRecord(Record):
    """A paint's colour in light or in shadow."""

    hex: Hex
    share: Share


class PaintRecord(ColorRecord):
    """A colour of the palette, perhaps with its tones."""

    tones: list[ToneRecord] = []


class ShadowRecord(Record):
    """A sheet's shadow."""

    factor: Annotated[list[Annotated[float, Field(gt=0, le=1)]], Field(min_length=3, max_length=3)]
    spread: Annotated[list[Cost], Field(min_length=3, max_length=3)]
    bits: float


class PlaceRecord(Record):
    """Where most of a colour is."""

    view: Count
    box: Annotated[list[Count], Field(min_length=4, max_length=4)]


class DroppedRecord(ColorRecord):
    """A colour under the rule."""

    oklab_cost: Cost
    place: PlaceRecord | None = None


class ContourRecord(ColorRecord):
    """The drawn lines' colour."""

    cloth: Share


class EvidenceRecord(Record):
    """Why so many colours."""

    colors: Count
    one_less: float
    one_more: float


class PaletteRecord(Record):
    """The whole file."""

    colors: Annotated[list[PaintRecord], Field(min_length=1, max_length=MAX_COLORS)]
    rule: Line
    dropped: list[DroppedRecord] = []
    warnings: list[Line] = []
    contour: ContourRecord | None = None
    evidence: EvidenceRecord | None = None
    shadow: ShadowRecord | None = None
    features: list[Hex] = []
    title: Name = ""


def read_palette_json(path: Path) -> Palette:
    """Return the palette of a palette.json.

    Raises:
        PaletteError: the file is missing, damaged, of another schema or of a newer toonset.
    """
    data = read_whole(path, "palette", PaletteError, MAX_BYTES)
    return palette_of(parse_json(data, str(path), PaletteError), str(path))


def palette_of(content: Any, where: str) -> Palette:
    """Return the palette that the content of a palette.json states.

    Raises:
        PaletteError: of another schema, of a newer toonset, or not fitting its schema.
    """
    _check_version(content, where)
    try:
        record = PaletteRecord.model_validate(content)
    except ValidationError as error:
        raise PaletteError(
            f"{where}: {_first_problem(error)}; write it again with `toonset palette`"
        ) from error
    contour, evidence = record.contour, record.evidence
    return Palette(
        tuple(_color(color) for color in record.colors),
        record.rule,
        tuple(_dropped(color) for color in record.dropped),
        tuple(record.warnings),
        None
        if contour is None
        else ContourColor(contour.rgb, contour.share, contour.cloth, contour.name),
        None
        if evidence is None
        else Evidence(evidence.colors, evidence.one_less, evidence.one_more),
        None if record.shadow is None else _shadow(record.shadow),
        tuple(rgb_of_hex(one, "hex") for one in record.features),
        record.title,
    )


def _color(color: PaintRecord) -> PaletteColor:
    tones = tuple(Tone(rgb_of_hex(tone.hex, "hex"), tone.share) for tone in color.tones)
    return PaletteColor(color.rgb, color.share, color.name, tones)


def _shadow(shadow: ShadowRecord) -> Shadow:
    (red, green, blue), spread = shadow.factor, shadow.spread
    return Shadow((red, green, blue), (spread[0], spread[1], spread[2]), shadow.bits)


def _dropped(color: DroppedRecord) -> DroppedColor:
    place = None
    if color.place is not None:
        x, y, width, height = color.place.box
        place = Place(color.place.view, (x, y, width, height))
    return DroppedColor(color.rgb, color.share, color.name, color.oklab_cost, place)


def _check_version(content: Any, where: str) -> None:
    if schema_version(content, NAME, VERSION, where, PaletteError) is None:
        raise PaletteError(
            f"{where}: states no schema, '{NAME}/{VERSION}' is needed; write it again with "
            "`toonset palette`"
        )


def _first_problem(error: ValidationError) -> str:
    problem = error.errors(include_url=False, include_input=True)[0]
    place = ".".join(str(part) for part in problem["loc"])
    found = "" if problem["type"] == "missing" else f" (found {problem['input']!r:.40})"
    return one_line(f"{place}: {problem['msg']}{found}")
