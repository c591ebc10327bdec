"""Read and write corrections.json: everything a person corrected of one sheet.

    {"version": 1,
     "sheet": {"name": "sheet.png", "sha256": "...", "size": [1600, 400]},
     "background": "#ffffff", "boxes": [[12, 8, 120, 300], ...],  (or "group": 2, "outfit": "B")
     "views": [{"box": [12, 8, 120, 300], "label": "front", "exclude": true, "lock": true,
                "camera": {"yaw": 30, "elevation": 5, "roll": 0, "scale": 310.2,
                           "middle": [72, 158]},
                "landmarks": [{"world": [0, 1.2, 0.3], "pixel": [71, 40]}]}],
     "palette": {"keep": [], "drop": [], "merge": [], "split": [], "names": {}, "strokes": []}}

Only "version" must be there. Pixels are those of the sheet, angles degrees; a view is found again
by its box. What the palette's part means is said in `toonset.palette.corrections`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, TypeAdapter, ValidationError

from toonset.dataset.split_folder.view_labels import parse_labels
from toonset.errors import SheetError, one_line
from toonset.json_file import STRICT
from toonset.palette.corrections import FigureBox, Number, PaletteCorrections, Pixel, hex_word
from toonset.read import BOM, parse_json, read_whole
from toonset.view import Box

VERSION: Literal[1] = 1
MAX_BYTES = 8 * 2**20
UPRIGHT = 89.0  # degrees of elevation: straight from above a yaw says nothing
SHOWN = 60  # characters of a key or a value in a message
UNKNOWN_KEY = "unexpected_keyword_argument"  # as pydantic calls it


def _label(word: str) -> str:
    if "," in word:
        raise ValueError("several directions; write one")
    try:
        return word.strip() if parse_labels(word[:SHOWN], 1)[0] else ""
    except SheetError as error:
        raise ValueError(str(error).removeprefix("--views: ")) from error


def _paper(text: str) -> str:
    return text and hex_word(text)


Label = Annotated[str, AfterValidator(_label)]
Paper = Annotated[str, AfterValidator(_paper)]
Size = Annotated[float, Field(gt=0, le=1e6)]


@dataclass(frozen=True)
class SheetName:
    """Name and hash of the sheet that corrections belong to.

    Attributes:
        name: its file name.
        sha256: of the file; "" if unknown.
        size: width and height, pixels; None if unknown.
    """

    __pydantic_config__ = STRICT

    name: Annotated[str, Field(max_length=1000)] = ""
    sha256: Annotated[str, Field(pattern="^([0-9a-f]{64})?$")] = ""
    size: tuple[Annotated[int, Field(gt=0)], Annotated[int, Field(gt=0)]] | None = None


@dataclass(frozen=True)
class PlacedCamera:
    """A camera as a person placed it.

    Attributes:
        yaw: degrees, 0 = front.
        scale: pixels per world unit.
        middle: where the middle of the mannequin's bounds appears, sheet pixels.
        elevation: degrees, > 0 looks down.
        roll: degrees.
    """

    __pydantic_config__ = STRICT

    yaw: Number
    scale: Size
    middle: Pixel
    elevation: Annotated[float, Field(ge=-UPRIGHT, le=UPRIGHT)] = 0.0
    roll: Number = 0.0


@dataclass(frozen=True)
class PointPair:
    """A point of the mannequin (world units) and the pixel of the sheet that shows it."""

    __pydantic_config__ = STRICT

    world: tuple[Number, Number, Number]
    pixel: Pixel


@dataclass(frozen=True)
class ViewCorrection:
    """Corrections of one view.

    Attributes:
        box: (x, y, width, height) of its figure in the sheet.
        exclude: leave it out.
        label: what it shows, one word of `--views`; "" for nothing.
        camera: as placed by hand; None if it was not.
        lock: keep the camera's yaw and elevation, or the label's yaw.
        landmarks: clicked points.
    """

    __pydantic_config__ = STRICT

    box: FigureBox
    exclude: bool = False
    label: Label = ""
    camera: PlacedCamera | None = None
    lock: bool = False
    landmarks: tuple[PointPair, ...] = ()

    @property
    def yaws(self) -> tuple[float, ...]:
        """Return the yaws that it may be seen from, radians; a placed camera goes before words."""
        if self.camera is not None:
            return (math.radians(self.camera.yaw) % (2 * math.pi),)
        return parse_labels(self.label, 1)[0]


@dataclass(frozen=True)
class Corrections:
    """Everything a person corrected of one sheet.

    Attributes:
        sheet: which one; None for the one that is given.
        background: the paper's colour; "" to find it.
        boxes: of the figures, in this order; empty to find them.
        group: number of the group of figures, from 1; None: the likeliest turnaround.
        outfit: letter of a row of the group, "A" is the uppermost; "": all rows.
        views: what was said of single views.
        palette: what was said of the colours.
    """

    __pydantic_config__ = STRICT

    version: Literal[1] = VERSION
    sheet: SheetName | None = None
    background: Paper = ""
    boxes: tuple[FigureBox, ...] = ()
    group: Annotated[int, Field(ge=1)] | None = None
    outfit: Annotated[str, Field(pattern="^[A-Z]?$")] = ""
    views: tuple[ViewCorrection, ...] = ()
    palette: PaletteCorrections = field(default_factory=PaletteCorrections)

    @property
    def figures_key(self) -> str:
        """Return the key that says which figures count; "" where none does."""
        return next((key for key in ("boxes", "group", "outfit") if getattr(self, key)), "")


_SCHEMA: TypeAdapter[Corrections] = TypeAdapter(Corrections)


def read_corrections(path: str | Path) -> Corrections:
    """Read a corrections.json.

    Raises:
        SheetError: the file cannot be read, is larger than 8 MB, or says what cannot be meant.
    """
    data = read_whole(Path(path), "corrections", SheetError, MAX_BYTES)
    return parse_corrections(data, str(path))


def parse_corrections(data: bytes, where: str) -> Corrections:
    """Parse the bytes of a corrections.json.

    Args:
        data: of the file.
        where: its name, for messages.

    Raises:
        SheetError: no JSON, another version, an unknown key or a value that cannot be meant; the
            message names file and key.
    """
    content = parse_json(data, where, SheetError)
    stated = content.get("version") if isinstance(content, dict) else None
    if type(stated) is not int or stated != VERSION:
        shown = "no version" if stated is None else f"version {str(stated)[:SHOWN]}"
        raise SheetError(
            f'{where}: states {shown}, this toonset reads {{"version": {VERSION}, ...}}; correct '
            "the file, or update toonset"
        )
    try:
        found = _SCHEMA.validate_json(data.removeprefix(BOM), strict=True)
    except ValidationError as error:
        raise SheetError(f"{where}: {_problem(error)}") from error
    _check(found, where)
    return found


def _check(found: Corrections, where: str) -> None:
    """Refuse what contradicts itself."""
    if found.boxes and (found.group or found.outfit):
        other = "group" if found.group else "outfit"
        raise SheetError(f"{where}: boxes and {other} both say which figures count; drop one")
    first: dict[Box, int] = {}
    for number, view in enumerate(found.views):
        key = f"{where}: views.{number}"
        if first.setdefault(view.box, number) != number:
            raise SheetError(f"{key}.box: is that of views.{first[view.box]}; merge them")
        if view.lock and len(view.yaws) != 1:
            raise SheetError(
                f"{key}.lock: there is no one yaw to keep; give a camera, or a label such as left"
            )


def _problem(error: ValidationError) -> str:
    """Return where and what the first problem is; unknown keys come first, they explain others."""
    found = error.errors(include_url=False, include_context=False, include_input=False)
    first = min(found, key=lambda one: one["type"] != UNKNOWN_KEY)
    place = ".".join(str(part)[:SHOWN] for part in first["loc"] if part != "[key]")
    if first["type"] == UNKNOWN_KEY:
        return one_line(f"unknown key {place!r}; remove it, or check how it is written")
    reason = first["msg"].removeprefix("Value error, ").replace("tuple", "list")
    if "missing" in first["type"]:
        reason = "is missing"
    advice = "" if ";" in reason else "; correct it"
    return one_line(f"{place or 'the whole'}: {reason}{advice}")
