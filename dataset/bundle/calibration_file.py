"""Read and write calibration.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from toonset.dataset.bundle.calibration_schema import SCHEMA, VERSION, CalibrationFile
from toonset.errors import BundleError, CameraError
from toonset.json_file import read_json, validate
from toonset.palette.names import hex_of
from toonset.read import schema_version
from toonset.view import View

RUN_ONLY = ("seconds",)  # of this run, not of the result: the same input gives the same bytes


def calibration_content(report: Mapping[str, Any], views: Sequence[View]) -> dict[str, Any]:
    """Return the content of calibration.json: the report, and what its views look like.

    Args:
        report: of `toonset.calib.verdict.report`, with what the caller adds (options, versions,
            inputs).
        views: the drawings, in the report's order.
    """
    content = {key: value for key, value in report.items() if key not in RUN_ONLY}
    content["views"] = [
        {**found, "line_width_px": round(view.line_width_px, 3), **_place(view)}
        for found, view in zip(report["views"], views, strict=True)
    ]
    CalibrationFile.model_validate(content)  # what is written can be read
    return content


def _place(view: View) -> dict[str, Any]:
    """Return where a drawing lies in which sheet, and the palette that this prints."""
    place: dict[str, Any] = {"box": [int(side) for side in view.box]}
    if view.sheet:
        place["sheet"] = {"name": view.sheet.name, "sha256": view.sheet.sha256}
    if view.swatches:
        place["swatches"] = [hex_of(rgb) for rgb in view.swatches]
    return place


def read_calibration(file: Path) -> CalibrationFile:
    """Return the content of a calibration.json.

    Raises:
        BundleError: the file cannot be read, is of another version, does not fit its schema, or
            holds a camera that cannot exist.
    """
    content = read_json(file)
    version = schema_version(content, SCHEMA, VERSION, str(file), BundleError)
    if version != VERSION:
        said = "no schema" if version is None else f"'{SCHEMA}/{version}'"
        raise BundleError(f"{file}: states {said}, '{SCHEMA}/{VERSION}' is needed; calibrate again")
    found = validate(CalibrationFile, content, file)
    for number, view in enumerate(found.views):
        try:
            view.check()
        except (CameraError, BundleError) as error:
            where = f"{file}: view {number} ({view.name[:80]!r})"
            raise BundleError(f"{where}: {error}; calibrate again") from error
    return found
