"""Read a sheet of a batch as the record that is packed: one part for every view.

What is in a record is read from the bundle itself, not from the table: a person may have corrected
its cameras since.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import toonset as ts
from toonset.apps.batch.rows import SheetRow
from toonset.apps.batch.stages import BUNDLE
from toonset.dataset.bundle_files import (
    PINHOLE,
    BundleFiles,
    CalibrationFile,
    FrameRecord,
    ViewRecord,
)
from toonset.errors import BundleError
from toonset.palette.names import hex_of

MEND = "copy it back, or run the batch again"
UNKNOWN = "unknown"  # license of a sheet where nobody says
ANGLES = ("yaw_deg", "elevation_deg", "roll_deg")
BLOCK = 512  # of a tar file

# Names and types of a view's values: a list holds one type, a dict the types of its own values.
_TEXT, _WHOLE, _NUMBER = "string", "int64", "float64"
FIELDS: dict[str, Any] = {
    "sheet": _TEXT,
    "view": _WHOLE,  # number in the sheet, from 0
    "views": _WHOLE,  # of the sheet
    "character": _TEXT,
    "license": _TEXT,
    "source": _TEXT,
    "verdict": _TEXT,  # on the sheet's cameras together
    "reason": _TEXT,
    "view_verdict": _TEXT,
    "view_reason": _TEXT,
    **dict.fromkeys(ANGLES, _NUMBER),
    **{f"sigma_{name}": _NUMBER for name in ANGLES},
    "p_flip": _NUMBER,
    "transform_matrix": [[_NUMBER]],
    **dict.fromkeys(("fl_x", "fl_y", "cx", "cy"), _NUMBER),
    **dict.fromkeys(("w", "h"), _WHOLE),
    "camera": {
        "model": _TEXT,
        "rotation": [[_NUMBER]],
        "target": [_NUMBER],
        "scale": _NUMBER,
        "center": [_NUMBER],
        "k": _NUMBER,
        "pixel_aspect": _NUMBER,
        "size_wh": [_WHOLE],
        "pinhole_error_px": _NUMBER,
    },
    "palette": [{"hex": _TEXT, "share": _NUMBER, "name": _TEXT}],
    "toonset": _TEXT,  # version that found the cameras
}


@dataclass(frozen=True, eq=False)
class PackedView:
    """One view of a sheet.

    Attributes:
        values: all but the pictures, as `FIELDS` has them.
        name: of its picture's file in the bundle.
        image: the drawing, RGBA, as PNG.
        labels: its label map, as an indexed PNG; None without a palette.
    """

    values: Mapping[str, Any]
    name: str
    image: bytes
    labels: bytes | None

    @property
    def key(self) -> str:
        """Return a name that no other view of the batch has: letters, digits, "_" and "-"."""
        return f"{self.values['sheet']}-{self.values['view']:03d}"

    @property
    def label_name(self) -> str:
        """Return the name of the label map's file in the bundle."""
        return f"{Path(self.name).stem}.png"

    @cached_property
    def json(self) -> bytes:
        """Return the values as one line."""
        return json.dumps(self.values, allow_nan=False).encode()

    @property
    def parts(self) -> Iterator[tuple[str, bytes]]:
        """Yield the view's files by their endings."""
        yield "png", self.image
        if self.labels is not None:
            yield "labels.png", self.labels
        yield "json", self.json


@dataclass(frozen=True, eq=False)
class SheetRecord:
    """One sheet.

    Attributes:
        views: in the sheet's order.
        files: the bundle's own files about cameras and palette, by name.
    """

    views: tuple[PackedView, ...]
    files: Mapping[str, bytes]

    @property
    def values(self) -> Mapping[str, Any]:
        """Return the values of the first view: those of the sheet are the same in each."""
        return self.views[0].values

    @property
    def name(self) -> str:
        """Return the sheet's name."""
        return str(self.values["sheet"])

    @property
    def size(self) -> int:
        """Return the bytes that the views take in a tar file, which is the most they take."""
        sizes = [len(data) for view in self.views for _, data in view.parts]
        return sum(BLOCK * (1 + -(-size // BLOCK)) for size in sizes)

    @property
    def digest(self) -> bytes:
        """Return the hash of all that can be packed of it."""
        found = hashlib.sha256()
        parts = [part for view in self.views for part in view.parts]
        for name, data in (*parts, *self.files.items()):
            found.update(f"{name}\0{len(data)}\0".encode())
            found.update(data)
        return found.digest()


def read_sheet(
    home: Path, row: SheetRow, verdicts: Container[str], *, decode: bool
) -> SheetRecord | None:
    """Return the record of a sheet that is done; None if its verdict is none of those wanted.

    Args:
        home: the sheet's folder.
        row: of the sheet.
        verdicts: those that are wanted.
        decode: look into the pictures, too, and not only at their bytes.

    Raises:
        ToonsetError: its bundle is gone, damaged, or its files do not belong together.
    """
    folder = home / BUNDLE
    if not re.fullmatch(r"[\w-]+", row.name) or not folder.is_dir():
        raise BundleError(
            f"{folder}: is not there; copy it back, or run the batch again with --only {row.name}"
        )
    bundle = BundleFiles.of(folder, MEND)
    if bundle.calibration.verdict not in verdicts:
        return None
    is_colored = any(one.stage == "palette" and one.state == "done" for one in row.stages)
    palette, found = bundle.read(with_palette=is_colored, decode=decode)
    of_sheet = _of_sheet(row, bundle.calibration, palette)
    views = []
    for number, one in enumerate(found):
        known = of_sheet | _of_view(one.record, one.judged) | {"view": number}
        values = {name: known[name] for name in FIELDS}
        name = Path(one.record.file_path).name
        views.append(PackedView(values, name, one.image, one.labels))
    return SheetRecord(tuple(views), bundle.contents(with_palette=palette is not None))


def _of_sheet(
    row: SheetRow, calibration: CalibrationFile, palette: ts.Palette | None
) -> dict[str, Any]:
    """Return the values that all views of a sheet share."""
    colors = () if palette is None else palette.colors
    return {
        "sheet": row.name,
        "views": len(calibration.views),
        "character": row.entry.character or row.name,
        "license": row.entry.license or UNKNOWN,
        "source": row.entry.source,
        "verdict": calibration.verdict,
        "reason": calibration.reason,
        "palette": [
            {"hex": hex_of(color.rgb), "share": float(color.share), "name": color.name}
            for color in colors
        ],
        "toonset": calibration.versions.get("toonset", ""),
    }


def _of_view(record: FrameRecord, view: ViewRecord) -> dict[str, Any]:
    """Return the values of one view's camera."""
    assert record.toonset is not None  # is checked
    return {
        "view_verdict": view.verdict,
        "view_reason": view.reason,
        **{name: getattr(view.camera, name) for name in ANGLES},
        **{f"sigma_{name}": getattr(view.sigma, name) for name in ANGLES},
        "p_flip": view.p_flip,
        "transform_matrix": [list(line) for line in record.transform_matrix],
        **{name: getattr(record, name) for name in PINHOLE},
        "camera": record.toonset.model_dump(mode="json"),
    }
