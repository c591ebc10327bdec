"""Format facts of bundles, runs and split folders as text."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

from toonset.errors import counted, printable

NAME_WIDTH = 10  # of the left column below the table
MOST_COLORS, MOST_VIEWS, MOST_FILES = 16, 40, 10
HUNDRED = 100.0


def bundle_text(found: dict[str, Any]) -> str:
    """Return the facts of `toonset.dataset.bundle.summary.summarise` for people."""
    views = found["views"]
    rows = [_judged_row(view) if "verdict" in view else _plain_row(view) for view in views]
    head = _JUDGED if any("verdict" in view for view in views) else _PLAIN
    lines = [_title(found), "", *table([head, *rows[:MOST_VIEWS]])]
    if len(rows) > MOST_VIEWS:
        lines.append(f"... and {len(rows) - MOST_VIEWS} more")
    facts = [
        ("cameras", _model(found)),
        ("pictures", _pictures(found)),
        ("palette", _palette(found["palette"])),
        ("mannequin", _mannequin(found["mannequin"])),
        *[("run", run_line(run)) for run in found["runs"]],
        ("made of", _inputs(found)),
        ("made by", _versions(found)),
        ("on disk", size_line(found["bytes"])),
        *[("damaged", f"{text} (`toonset check` looks at all)") for text in found["damaged"]],
    ]
    return "\n".join([*lines, "", *fact_lines(facts)])


def run_line(found: dict[str, Any]) -> str:
    """Return a run in one line."""
    parts = [f"{found['path']}: {found['steps']} steps"]
    parts += [f"{name} {value:.4g}" for name, value in found["fit"].items() if _is_number(value)]
    views, colors = found["views"], found["palette"]
    parts += [counted(len(views), "view")] if isinstance(views, list) else []
    parts += [counted(len(colors), "colour")] if isinstance(colors, list) else ["no palette"]
    parts += [found["verdict"]] if isinstance(found["verdict"], str) else []
    return ", ".join(parts)


def run_text(found: dict[str, Any]) -> str:
    """Return a run for people."""
    reasons = found["reasons"]
    facts = [
        *[("weak", str(reason)) for reason in (reasons if isinstance(reasons, list) else [])],
        ("stopped", str(found["stopped"] or "")),
        ("options", _pairs(found["options"])),
        ("made by", _pairs(found["versions"])),
        ("on disk", size_line(found["bytes"])),
    ]
    return "\n".join([run_line(found), "", *fact_lines(facts)])


def split_text(found: dict[str, Any]) -> str:
    """Return a split folder for people."""
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


_JUDGED = ("view", "size", "line", "yaw", "elevation", "p_flip", "verdict")
_PLAIN = ("view", "size", "camera", "position", "field of view")


def table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows as lines, columns under each other; the first is the head.

    Columns with nothing under their head are left out.
    """
    columns = [c for c in zip_longest(*rows, fillvalue="") if any(c[1:])]
    widths = [max(map(len, column)) for column in columns]
    return [
        "  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in zip(*columns, strict=True)
    ]


def fact_lines(facts: Sequence[tuple[str, str]]) -> list[str]:
    """Return named facts as lines, those without text left out."""
    return [f"{name:{NAME_WIDTH}}{printable(text)}" for name, text in facts if text]


def size_line(sizes: dict[str, int]) -> str:
    """Return bytes for people, the largest first."""
    largest = sorted(sizes.items(), key=lambda item: -item[1])
    parts = [f"{name} {bytes_text(count)}" for name, count in largest[:MOST_FILES]]
    parts += [f"{len(largest) - MOST_FILES} more files"] if len(largest) > MOST_FILES else []
    return f"{bytes_text(sum(sizes.values()))}: {', '.join(parts)}"


def bytes_text(count: int) -> str:
    """Return a size such as 12.3 kB."""
    size, units = float(count), ["B", "kB", "MB", "GB"]
    while size >= 1000 and len(units) > 1:
        size, units = size / 1000, units[1:]
    return f"{size:.0f} {units[0]}" if units[0] == "B" or size >= 100 else f"{size:.1f} {units[0]}"


def _title(found: dict[str, Any]) -> str:
    count = len(found["views"])
    what = "a bundle" if found["kind"] == "bundle" else f"cameras ({found['file']})"
    text = f"{found['path']}: {what} of {counted(count, 'view')}"
    if "verdict" not in found:
        return text
    return f"{text}, {found['verdict']}" + (f" ({found['reason']})" if found["reason"] else "")


def _size(view: dict[str, Any]) -> str:
    return f"{view['size_wh'][0]} x {view['size_wh'][1]}"


def _yaw(view: dict[str, Any]) -> str:
    return f"{round(view['yaw_deg'], 1) % 360:.1f}"


def _judged_row(view: dict[str, Any]) -> tuple[str, ...]:
    line = view["line_width_px"]
    verdict = view["verdict"] + (f": {view['reason']}" if view["reason"] else "")
    return (
        view["name"],
        _size(view),
        "" if line is None else f"{line:.1f} px" if line else "none",
        f"{_yaw(view):>5} +- {view['yaw_sigma_deg']:.1f}",
        f"{view['elevation_deg']:5.1f} +- {view['elevation_sigma_deg']:.1f}",
        f"{view['p_flip']:.2f}",
        verdict,
    )


def _plain_row(view: dict[str, Any]) -> tuple[str, ...]:
    if view["orthographic"]:
        turn = f"yaw {_yaw(view)}, elevation {view['elevation_deg']:.1f}"
        return view["name"], _size(view), f"orthographic, {turn}"
    position = " ".join(f"{x:.4g}" for x in view["position"])
    return view["name"], _size(view), "pinhole", position, f"{view['field_of_view_deg']:.1f}"


def _model(found: dict[str, Any]) -> str:
    if "camera_model" not in found:
        count = sum(view["orthographic"] for view in found["views"])
        return f"{count} orthographic, {len(found['views']) - count} pinhole"
    model = found["camera_model"]
    near = sorted(d for d in model["distance_heights"] if d is not None)
    text = f"{model['chosen']}" + (f", {near[0]:.1f} to {near[-1]:.1f} heights" if near else "")
    tried = ", ".join(
        f"{t['model']} (BIC {t['bic_gain']:+.0f}, taken from {t['margin']:+.0f})"
        for t in model["tried"]
    )
    return text + (f"; tried: {tried}" if tried else "")


def _pictures(found: dict[str, Any]) -> str:
    total = len(found["views"])
    parts = [f"{found['pictures']} of {total}"]
    parts += [f"{found[n]} {n}" for n in ("labels", "tones", "coverage", "contours") if found[n]]
    return ", ".join(parts)


def _palette(palette: dict[str, Any] | None) -> str:
    if palette is None:
        return "none; `toonset palette` finds it"
    colors = [f"{c['hex']} {c['name']} {HUNDRED * c['share']:.1f} %" for c in palette["colors"]]
    more = [f"{len(colors) - MOST_COLORS} more"] if len(colors) > MOST_COLORS else []
    notes = ["shaded in two tones"] if palette.get("shadow") else []
    features = len(palette.get("features", ()))
    notes += [f"{features} feature{'s' * (features > 1)}"] if features else []
    shown = f"{len(colors)}: {', '.join([*colors[:MOST_COLORS], *more])}"
    return shown + (f" ({', '.join(notes)})" if notes else "")


def _mannequin(mesh: dict[str, int] | None) -> str:
    return "" if mesh is None else f"{mesh['vertices']} vertices, {mesh['faces']} faces"


def _inputs(found: dict[str, Any]) -> str:
    files = found.get("inputs", [])
    return ", ".join(f"{f['name']} ({f['role']}, {f['sha256'][:8]})" for f in files)


def _versions(found: dict[str, Any]) -> str:
    versions = found.get("versions", {})
    seed = "" if found.get("seed") is None else f", seed {found['seed']}"
    return ", ".join(f"{name} {number}" for name, number in versions.items()) + seed


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float)


def _pairs(value: Any) -> str:
    items = value.items() if isinstance(value, dict) else ()
    return ", ".join(f"{name} {number}" for name, number in items)
