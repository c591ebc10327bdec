"""Write a split folder, for people to look at and to correct.

    images/000.png     RGBA crops, straight alpha
    split.json         which sheet each was cut from, where it stood, its line width and label
    overlay.png        the sheets with numbered boxes (`toonset.dataset.split_folder.overlay`)

The folder may be corrected by hand; `toonset.dataset.split_folder.read` reads it back.
"""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from jaxtyping import UInt8
from pydantic import BaseModel, Field, TypeAdapter, ValidationError

from toonset import __version__
from toonset.dataset.bundle.transforms_read import place_in
from toonset.dataset.images.picture import encode_png
from toonset.dataset.split.beside_views import InSheet
from toonset.dataset.split_folder.places import IMAGES, OVERLAY, SPLIT_FILE
from toonset.dataset.split_folder.views import Source, Split
from toonset.errors import SheetError
from toonset.json_file import SchemaProblems
from toonset.read import parse_json, read_whole, schema_version
from toonset.write import new_folder, write_bytes, write_json

NAME, VERSION = "toonset-split", 1
MAX_JSON_BYTES = 8 * 2**20
_Label = Annotated[str, Field(max_length=40, pattern="^[^,]*$")]


class SplitProblems(SchemaProblems, SheetError):
    """A split.json that does not fit its schema; all that is wrong is in `problems`."""


class ViewRecord(BaseModel):
    """One view as split.json has it.

    Attributes:
        name: of its picture.
        sheet: number of its sheet.
        box: (x, y, width, height) of the figure in its sheet.
        crop: the same of its picture, which has a margin.
        line_width_px: of the drawn contour; 0 where there is none.
        label: what it shows, where a person has said.
        caption: what it shows as the sheet says, where that was read.
        sha256: of its picture file.
    """

    name: str
    sheet: Annotated[int, Field(strict=True, ge=0)]
    box: InSheet
    crop: InSheet
    line_width_px: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    label: _Label | None = None
    caption: _Label | None = None
    sha256: str = ""


class _SplitFile(BaseModel):
    sheets: tuple[Source, ...]
    views: tuple[ViewRecord, ...]


_SOURCES = TypeAdapter(tuple[Source, ...])


def split_dict(split: Split, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of split.json but for the hashes of the views' files."""
    return {
        "schema": f"{NAME}/{VERSION}",
        "toonset": __version__,
        "sheets": _SOURCES.dump_python(split.sources, mode="json"),
        "views": [
            {
                "name": view.name,
                "sheet": index,
                "box": list(view.figure_box),
                "crop": list(view.box),
                "line_width_px": round(view.line_width_px, 3),
                "label": view.label or None,
            }
            | ({"caption": view.caption} if view.caption else {})
            for view, index in zip(split.views, split.source_of, strict=True)
        ],
        "options": options,
    }


def write_split(
    folder: Path,
    split: Split,
    overlay: UInt8[np.ndarray, "height width 3"],
    options: Mapping[str, Any],
    *,
    force: bool = False,
) -> None:
    """Write a split folder.

    Args:
        folder: where; replaced as a whole with `force`.
        split: what was found.
        overlay: the picture for people.
        options: what a person has said: boxes, drops and the like.
        force: replace an existing folder.

    Raises:
        OutputError: the folder exists, or cannot be written.
    """
    content = split_dict(split, options)
    with new_folder(folder, force=force) as temporary:
        for view, record in zip(split.views, content["views"], strict=True):
            data = encode_png(view.rgba)
            record["sha256"] = sha256(data).hexdigest()
            write_bytes(temporary / IMAGES / view.name, data)
        write_json(temporary / SPLIT_FILE, content)
        write_bytes(temporary / OVERLAY, encode_png(overlay))


def read_records(folder: Path) -> tuple[tuple[Source, ...], tuple[ViewRecord, ...]]:
    """Read split.json's records of sheets and views.

    Raises:
        SheetError: the file is missing, of another version, broken, or speaks of a sheet that it
            does not have.
        BundleError: it is a link out of the folder.
    """
    file = place_in(folder, SPLIT_FILE)
    data = read_whole(file, "split", SheetError, MAX_JSON_BYTES)
    content = parse_json(data, str(file), SheetError)
    if schema_version(content, NAME, VERSION, str(file), SheetError) is None:
        raise SheetError(
            f"{file}: states no schema, '{NAME}/{VERSION}' is needed; split the sheet again"
        )
    try:
        found = _SplitFile.model_validate(content)
    except ValidationError as error:
        raise SplitProblems(file, error) from error
    for view in found.views:
        if view.sheet >= len(found.sheets):
            raise SheetError(
                f"{file}: {view.name} is of sheet {view.sheet}, but there are "
                f"{len(found.sheets)} (numbered from 0); correct it"
            )
    return found.sheets, found.views
