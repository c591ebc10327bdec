"""Records of calibration as a table for people: a row per condition and method, figures beside."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from bench.calib.figures import NOT_PLACED
from bench.records.record import CPU_SECONDS, Record
from toonset.calib.result import SEVERITY

MISSING = "-"
NOT_IN_COLUMNS = (NOT_PLACED, "failed runs")
TIMES = ("seconds", CPU_SECONDS)

Figures = Mapping[str, Record]  # by metric


@dataclass(frozen=True)
class Column:
    """A column: two lines of heading, and what stands in it."""

    heading: tuple[str, str]
    cell: Callable[[Figures], str]


def sheets_table(records: Sequence[Record]) -> str:
    """Return the table of `python -m bench calib`; a line has 120 characters at most."""
    return "\n".join([*_table(records, SHEET_COLUMNS), *_notes(records), "", *SHEET_LEGEND])


def sprites_table(records: Sequence[Record]) -> str:
    """Return the table of `python -m bench calib --sprites`."""
    return "\n".join([*_table(records, SPRITE_COLUMNS), "", *SPRITE_LEGEND])


def _table(records: Sequence[Record], columns: Sequence[Column]) -> list[str]:
    groups: dict[str, dict[str, dict[str, Record]]] = {}
    for record in records:
        methods = groups.setdefault(record.group, {})
        methods.setdefault(record.method, {})[record.metric] = record
    rows = [("", *(c.heading[0] for c in columns)), ("", *(c.heading[1] for c in columns))]
    titles = {}
    for group, methods in groups.items():
        titles[len(rows)] = f"{group}: {_size(next(iter(methods.values())))}"
        rows += [(f"  {m}", *(c.cell(f) for c in columns)) for m, f in methods.items()]
    widths = [max(len(row[i]) for row in rows) for i in range(len(columns) + 1)]
    lines = []
    for number, (name, *cells) in enumerate(rows):
        lines += [titles[number]] if number in titles else []
        right = (cell.rjust(width) for cell, width in zip(cells, widths[1:], strict=True))
        lines.append("  ".join([name.ljust(widths[0]), *right]).rstrip())
    return lines


def _size(figures: Figures) -> str:
    views = next(r.n for r in figures.values() if r.metric not in TIMES)
    return f"{views} views, {figures['seconds'].n} sheets"


def _notes(records: Sequence[Record]) -> list[str]:
    return [
        f"{r.group}, {r.method}: {r.metric} {r.value:.0f} of {r.n}"
        for r in records
        if r.metric in NOT_IN_COLUMNS and r.value > 0
    ]


def _median(metric: str) -> Callable[[Figures], str]:
    return lambda found: _number(found[metric].median) if metric in found else MISSING


def _p95(metric: str) -> Callable[[Figures], str]:
    return lambda found: _number(found[metric].p95) if metric in found else MISSING


def _value(metric: str) -> Callable[[Figures], str]:
    return lambda found: _number(found[metric].value) if metric in found else MISSING


def _total(metric: str) -> Callable[[Figures], str]:
    return lambda found: f"{found[metric].value:.0f}" if metric in found else MISSING


def _percent(metric: str) -> Callable[[Figures], str]:
    return lambda found: f"{100 * found[metric].value:.0f}" if metric in found else MISSING


def _part(metric: str) -> Callable[[Figures], str]:
    def cell(found: Figures) -> str:
        if metric not in found:
            return MISSING
        record = found[metric]
        return f"{record.value * record.n:.0f}/{record.n}"

    return cell


def _verdicts(found: Figures) -> str:
    if not all(name in found for name in SEVERITY):
        return MISSING
    return "/".join(f"{100 * found[name].value:.0f}" for name in SEVERITY)


def _number(value: float) -> str:
    """Return three digits, of these at most two decimals."""
    return f"{value:.{2 if value < 9.995 else 1 if value < 99.95 else 0}f}"


SHEET_COLUMNS = (
    Column(("error", "median"), _median("rotation error")),
    Column(("deg", "p95"), _p95("rotation error")),
    Column(("twin", "median"), _median("rotation error modulo twin")),
    Column(("deg", "p95"), _p95("rotation error modulo twin")),
    Column(("<5deg", "%"), _percent("within 5 deg")),
    Column(("twin", "%"), _percent("within 5 deg modulo twin")),
    Column(("", "flips"), _total("flipped views")),
    Column(("wrong", "as ok"), _total("wrong but ok")),
    Column(("wrong", "said"), _part("wrong and announced")),
    Column(("yaw", "z"), _value("yaw z-score")),
    Column(("ok/weak/", "amb/fail %"), _verdicts),
    Column(("sec.", "wall"), _median("seconds")),
    Column(("", "CPU"), _median(CPU_SECONDS)),
)
SHEET_LEGEND = (
    "twin: modulo the mirror twin. flips: views more than 15 deg off whose twin is less.",
    "wrong as ok: views more than 15 deg off with verdict ok. said: of such, how many are not ok.",
    "yaw z: spread of error / sigma, 1 is right (views less than 15 deg off). sec.: per sheet.",
)
SPRITE_COLUMNS = (
    Column(("yaw", "median"), _median("yaw error")),
    Column(("deg", "p95"), _p95("yaw error")),
    Column(("<3deg", "%"), _percent("within 3 deg")),
    Column(("right", "bin %"), _percent("right 45 deg bin")),
    Column(("wrong", "as ok"), _total("wrong but ok")),
    Column(("ok/weak/", "amb/fail %"), _verdicts),
    Column(("sheets", "all ok"), _part("ok sheets")),
    Column(("sec.", "median"), _median("seconds")),
    Column(("", "p95"), _p95("seconds")),
)
SPRITE_LEGEND = (
    "right bin: yaw less than 22.5 deg off. wrong as ok: in a wrong bin with verdict ok. "
    "sec.: per sheet.",
)
