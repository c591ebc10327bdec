"""Facts of run folders and split folders, as data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

SHOWN_METRICS = ("psnr", "psnr_mask", "ssim")


def summarise_run(folder: Path) -> dict[str, Any]:
    """Return what a run folder says of itself; the field is not loaded.

    Raises:
        BundleError: config.json or metrics.json cannot be read.
    """
    from toonset.dataset.bundle.summary import sizes
    from toonset.json_file import read_json

    config = _table(read_json(folder / "config.json"))
    metrics = _table(read_json(folder / "metrics.json"))
    field, scene = _table(config.get("field")), _table(config.get("scene"))
    verdict = _table(metrics.get("verdict"))
    return {
        "kind": "run",
        "path": str(folder),
        "steps": metrics.get("steps"),
        "stopped": metrics.get("stopped"),
        "fit": {k: v for k, v in _table(metrics.get("train")).items() if k in SHOWN_METRICS},
        "verdict": verdict.get("verdict"),
        "reasons": verdict.get("reasons", []),
        "views": scene.get("views"),
        "palette": field.get("palette"),
        "options": config.get("options"),
        "versions": config.get("versions"),
        "bytes": sizes(folder),
    }


def summarise_split(folder: Path) -> dict[str, Any]:
    """Return what split.json says, and which pictures came and went since.

    The pictures are not looked into.

    Raises:
        SheetError: split.json cannot be read.
    """
    from toonset.dataset.bundle.summary import sizes
    from toonset.dataset.images.folder import picture_files
    from toonset.dataset.split_folder.places import IMAGES
    from toonset.dataset.split_folder.write import read_records

    sheets, views = read_records(folder)
    place = folder / IMAGES
    there = [path.name for path in picture_files(place)[0]] if place.is_dir() else []
    known = [view.name for view in views]
    return {
        "kind": "split",
        "path": str(folder),
        "sheets": [
            {
                "name": sheet.name,
                "size_wh": list(sheet.size_wh),
                "warnings": list(sheet.warnings),
                "left_out": [{"kind": one.kind, "box": list(one.box)} for one in sheet.left_out],
            }
            for sheet in sheets
        ],
        "views": [view.model_dump(mode="json") for view in views],
        "gone": [name for name in known if name not in there],
        "new": [name for name in there if name not in known],
        "bytes": sizes(folder),
    }


def _table(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}
