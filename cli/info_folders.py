"""Facts of run folders and split folders, as data and as text."""

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


def run_line(found: dict[str, Any]) -> str:
    """Return a run in one line."""
    parts = [f"{found['path']}: {found['steps']} steps"]
    parts += [f"{name} {value:.4g}" for name, value in found["fit"].items() if _is_number(value)]
    views, colors = found["views"], found["palette"]
    parts += [f"{len(views)} views"] if isinstance(views, list) else []
    parts += [f"{len(colors)} colours"] if isinstance(colors, list) else ["no palette"]
    parts += [found["verdict"]] if isinstance(found["verdict"], str) else []
    return ", ".join(parts)


def run_text(found: dict[str, Any]) -> str:
    """Return a run for people."""
    from toonset.cli.info_text import fact_lines, size_line

    reasons = found["reasons"]
    facts = [
        *[("weak", str(reason)) for reason in (reasons if isinstance(reasons, list) else [])],
        ("stopped", str(found["stopped"] or "")),
        ("options", _pairs(found["options"])),
        ("made by", _pairs(found["versions"])),
        ("on disk", size_line(found["bytes"])),
    ]
    return "\n".join([run_line(found), "", *fact_lines(facts)])


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


def split_text(found: dict[str, Any]) -> str:
    """Return a split folder for people."""
    from toonset.cli.info_text import fact_lines, size_line, table

    rows = [("view", "size", "at", "line", "sheet", "shows")]
    for view in found["views"]:
        x, y, width, height = view["box"]
        sheet = found["sheets"][view["sheet"]]["name"]
        line = f"{view['line_width_px']:.1f} px" if view["line_width_px"] else "none"
        shows = view["label"] or ""
        rows.append((view["name"], f"{width} x {height}", f"{x}, {y}", line, sheet, shows))
    facts = []
    for sheet in found["sheets"]:
        kinds = [one["kind"] for one in sheet["left_out"]]
        facts.append(("sheet", f"{sheet['name']}, {sheet['size_wh'][0]} x {sheet['size_wh'][1]}"))
        counts = [f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds)]
        facts.append(("left out", ", ".join(counts)))
        facts += [("warning", text) for text in sheet["warnings"]]
    facts.append(("gone", ", ".join(found["gone"])))
    facts.append(("new", ", ".join(found["new"]) + " (or renamed)" * bool(found["new"])))
    facts.append(("on disk", size_line(found["bytes"])))
    title = f"{found['path']}: a split of {len(found['views'])} views"
    return "\n".join([title, "", *table(rows), "", *fact_lines(facts)])


def _table(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float)


def _pairs(value: Any) -> str:
    return ", ".join(f"{name} {number}" for name, number in _table(value).items())
