"""calibration.json, both ways; version 1 is read in the shape of version 2.

While version 1 grew, `distance_heights` was one number or None for the sheet before it was a list,
the evidence stood beside it as `bic_gain_of_perspective` and one `bic_margin` for all, the drawing
error was one number, and `inputs` was a table of hashes, then a list without roles. All held
`seconds`, which made two runs' bytes differ; version 2 does not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from toonset.dataset.bundle.calibration_schema import SCHEMA, VERSION, CalibrationFile
from toonset.errors import BundleError, CameraError
from toonset.json_file import read_json, validated
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
    """Return where a drawing lies in which sheet."""
    sheet = view.sheet and {"name": view.sheet.name, "sha256": view.sheet.sha256}
    return {"box": [int(side) for side in view.box], **({"sheet": sheet} if sheet else {})}


def read_calibration(file: Path) -> CalibrationFile:
    """Return the content of a calibration.json of this or an earlier version.

    Raises:
        BundleError: the file cannot be read, is of a newer toonset, does not fit its schema, or
            holds a camera that cannot exist.
    """
    content = read_json(file)
    version = schema_version(content, SCHEMA, VERSION, str(file), BundleError)
    if version is None:
        raise BundleError(
            f"{file}: states no schema, '{SCHEMA}/{VERSION}' is needed; calibrate again"
        )
    found = validated(CalibrationFile, upgraded(content) if version == 1 else content, file)
    for number, view in enumerate(found.views):
        try:
            view.check()
        except (CameraError, BundleError) as error:
            where = f"{file}: view {number} ({view.name[:80]!r})"
            raise BundleError(f"{where}: {error}; calibrate again") from error
    return found


def upgraded(content: dict[str, Any]) -> dict[str, Any]:
    """Return a version 1 file as version 2; what is not as it was is left for the schema."""
    found = dict(content)
    found.pop("seconds", None)
    model = found.get("camera_model")
    if isinstance(model, dict):
        views = found.get("views")
        found["camera_model"] = _model(model, len(views) if isinstance(views, list) else 0)
    if "outline_noise_of_height" in found:
        noise = found.pop("outline_noise_of_height")
        found["drawing_error_of_height"] = {"smooth": 0.0, "white": noise}
    found["inputs"] = _inputs(found.get("inputs", []))
    return found


def _model(model: dict[str, Any], views: int) -> dict[str, Any]:
    found = dict(model)
    margin = found.pop("bic_margin", None)
    if "bic_gain_of_perspective" in found:
        gain = found.pop("bic_gain_of_perspective")
        found["tried"] = [{"model": "perspective", "bic_gain": gain, "unknowns": 1}]
    if not isinstance(found.get("distance_heights"), list):
        found["distance_heights"] = [found.get("distance_heights")] * views
    tried = found.get("tried")
    if margin is not None and isinstance(tried, list):
        found["tried"] = [
            {"margin": margin, **rung} if isinstance(rung, dict) else rung for rung in tried
        ]
    return found


def _inputs(inputs: Any) -> Any:
    if isinstance(inputs, dict):
        inputs = [{"name": name, "sha256": digest} for name, digest in inputs.items()]
    if not isinstance(inputs, list):
        return inputs
    return [{"role": "input", **one} if isinstance(one, dict) else one for one in inputs]
