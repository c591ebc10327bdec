"""What is known of the numbers: a file of lines, and the table that it comes to."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

from lab.bench.sweep.measure import Measured
from lab.bench.sweep.numbers import Named
from lab.bench.sweep.patches import WAYS

Key = tuple[str, str]
Row = dict[str, Any]


@dataclass(eq=False)
class Kept:
    """Results in a file of one JSON object a line.

    Attributes:
        path: of the file.
        rows: by number, then by set of cases and way.
    """

    path: Path
    rows: dict[Key, dict[tuple[bool, str], Row]] = field(default_factory=dict)

    def of(self, number: Named, *, large: bool) -> list[Row]:
        """Return the rows of a number as it is now."""
        rows = self.rows.get((number.module, number.name), {})
        return [
            row
            for (many, _), row in rows.items()
            if many is large and row["source"] == number.source
        ]

    def lacks(self, number: Named, *, large: bool) -> bool:
        """Return whether a number is to be measured; with many cases only what moved nothing."""
        if large and (not self.of(number, large=False) or self.effect(number) not in STILL):
            return False
        return not self.of(number, large=large)

    def add(self, number: Named, found: Sequence[Measured], *, large: bool) -> None:
        """Append what was found of a number."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a", encoding="utf-8") as file:
            for one in found:
                row = {"large": large, "source": number.source, **asdict(one)}
                file.write(json.dumps(row) + "\n")
                self._take(row)

    def effect(self, number: Named) -> str:
        """Return the word for what a number does."""
        few, many = (self.of(number, large=large) for large in (False, True))
        if not few:
            return "unknown"
        if all(not row["new"] and not row["moved"] for row in few):
            return "fixed"
        rows = [row for row in (*few, *many) if row["way"] in WAYS]
        if any("lost" in own for row in rows for own in row["moved"].values()):
            return "cliff"
        if any(row["moved"] for row in rows):
            return "moves"
        if not any(row["reached"] for row in rows):
            return "unreached"
        return "still" if any(row["moved"] for row in (*few, *many)) else "idle"

    def _take(self, row: Row) -> None:
        own = self.rows.setdefault((row["number"][0], row["number"][1]), {})
        own[row["large"], row["way"]] = row


STILL = ("still", "idle", "unreached")
EFFECTS = ("cliff", "moves", "still", "idle", "unreached", "fixed", "unknown")


def kept_in(path: Path) -> Kept:
    """Return the results of a file; none where there is none. Its later lines count."""
    kept = Kept(path)
    if path.is_file():
        for line in path.read_text(encoding="utf-8").splitlines():
            if line.endswith("}"):  # the last one may be cut short
                kept._take(json.loads(line))
    return kept


def table(numbers: Sequence[Named], kept: Kept) -> str:
    """Return how many numbers every room has and what they do, then each with what it changes."""
    head = ["room".ljust(26) + "numbers" + "".join(effect.rjust(11) for effect in EFFECTS)]
    for room, own in _by_room(numbers):
        effects = [kept.effect(one) for one in own]
        counts = "".join(f"{effects.count(effect):11d}" for effect in EFFECTS)
        head.append(f"{room:26}{len(own):7d}{counts}")
    lines = [_line(one, kept) for one in numbers]
    return "\n".join([*head, "", *lines])


def _by_room(numbers: Sequence[Named]) -> list[tuple[str, list[Named]]]:
    ordered = sorted(numbers, key=lambda one: one.room)
    rooms = [(room, list(own)) for room, own in groupby(ordered, key=lambda one: one.room)]
    return [*rooms, ("in all", list(numbers))]


def _line(number: Named, kept: Kept) -> str:
    rows = kept.of(number, large=False) + kept.of(number, large=True)
    said = [f"{number.module.removeprefix('toonset.')}.{number.name} = {number.source[:60]}"]
    for row in rows:
        moved, which = row["moved"], "many" if row["large"] else "few"
        lost = [name for name, own in moved.items() if "lost" in own]
        text = f"{row['way']} ({which}): {len(moved)} of {row['ran']} moved"
        if lost:
            text += f", {len(lost)} lost: {', '.join(lost[:3])}"
        said.append(text)
        if row["fixed"]:
            said.append(f"fixed at import: {row['fixed']}")
    return f"{kept.effect(number):10}" + "; ".join(dict.fromkeys(said))
