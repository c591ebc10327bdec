"""`python -m bench.verdict`: does the verdict of a run say how its new views look?

Draws sheets with known faults, trains on them, and compares what the verdict rests on with FLIP of
held-out views. The same command goes on where it was stopped; a sheet takes about 12 CPU s.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from bench.verdict.curve import draw_curve, table
from bench.verdict.measure import FULL, QUICK, Judged, judge
from bench.verdict.sheets import FAULTS, draw_sheet, small
from toonset.dataset.bundle.read_scene import read_scene
from toonset.dataset.bundle.scene import Scene
from toonset.json_file import read_json
from toonset.write import write_bytes, write_json

SHEETS, CURVE = "sheets.json", "curve.png"
EVERY = 2  # of a case's held-out views

Drawer = Callable[[], tuple[Scene, Scene]]


def main() -> None:
    """Judge every sheet that is not judged yet, then say and draw what was found."""
    asked = _arguments()
    folder: Path = asked.out
    folder.mkdir(parents=True, exist_ok=True)
    kept = folder / SHEETS
    done = [_judged(row) for row in read_json(kept)] if kept.is_file() else []
    for name, draw in _cases(asked.cases) if asked.cases else _synthetic(asked):
        if asked.only not in name or name in {sheet.name for sheet in done}:
            continue
        scene, test = draw()
        found, picture = judge(name, scene, test, FULL if asked.full else QUICK)
        write_bytes(folder / f"{name.replace(' ', '_')}.png", picture)
        done.append(found)
        write_json(kept, [asdict(sheet) for sheet in done])
        print(f"{name}: {100 * found.statistic:.2f} %, {found.verdict}", flush=True)
    groups = _groups(done)
    for name, sheets in groups.items():
        print(f"\n{name}\n{table(sheets)}")
    write_bytes(folder / CURVE, draw_curve(groups))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m bench.verdict", description=__doc__)
    parser.add_argument("-o", "--out", type=Path, default=Path("bench-results/verdict"))
    parser.add_argument("--seeds", type=int, default=4, help="bodies, from seed 0 on")
    parser.add_argument("--only", default="", help="sheets whose name contains this")
    parser.add_argument("--mannequin", action="store_true", help="drawings come with their body")
    parser.add_argument("--cases", type=Path, help="folders with views/ and test/, at half size")
    parser.add_argument("--full", action="store_true", help="train as users do: three times longer")
    return parser.parse_args()


def _synthetic(asked: argparse.Namespace) -> Iterator[tuple[str, Drawer]]:
    for seed in range(asked.seeds):
        for fault in FAULTS:
            draw = partial(draw_sheet, fault, seed, mannequin=asked.mannequin)
            yield f"{fault.name} s{seed}", draw


def _cases(folder: Path) -> Iterator[tuple[str, Drawer]]:
    for case in sorted(folder.iterdir()):
        if (case / "test" / "transforms.json").is_file():
            yield case.name, partial(_case, case)


def _case(folder: Path) -> tuple[Scene, Scene]:
    train, test = (small(0.5)(read_scene(folder / name), 0) for name in ("views", "test"))
    return train, replace(test, frames=test.frames[::EVERY])


def _judged(row: dict[str, Any]) -> Judged:
    lists = {name: tuple(row[name]) for name in ("reasons", "flip", "look")}
    return Judged(**{**row, **lists})


def _groups(done: list[Judged]) -> dict[str, list[Judged]]:
    """Return sheets by where they come from; bounds were chosen on even seeds."""

    def group(name: str) -> str:
        seed = name.rpartition(" s")[2]
        return ("odd seeds" if int(seed) % 2 else "even seeds") if seed.isdigit() else "cases"

    names = sorted({group(sheet.name) for sheet in done})
    return {name: [sheet for sheet in done if group(sheet.name) == name] for name in names}


if __name__ == "__main__":
    main()
