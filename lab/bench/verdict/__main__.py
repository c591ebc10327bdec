"""`python -m lab.bench.verdict`: does the verdict of a run say how its new views look?

Trains on the steps of `bench stability`'s pages about training, or on case folders, and compares
what the verdict rests on with FLIP of held-out views. Of cases it also says how well this and
measures of views between drawings rank characters that they were not fitted on. The same command
goes on where it was stopped; a sheet takes 8 to 20 CPU s.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from lab.bench.cases.cases import MANNEQUIN_FILE, case_folders, halved
from lab.bench.stability.fields import TRAINING
from lab.bench.stability.pages import PAGES
from lab.bench.stability.sheets import Step
from lab.bench.stability.trials import Page
from lab.bench.verdict.curve import draw_curve, table
from lab.bench.verdict.fit import OWN, told_text
from lab.bench.verdict.measure import QUICK, Judged, judge
from toonset.dataset.bundle.read_scene import read_scene
from toonset.dataset.bundle.scene import Scene
from toonset.dataset.mesh.load import load_mesh
from toonset.errors import ToonsetError
from toonset.json_file import read_json
from toonset.write import write_bytes, write_json

SHEETS, CURVE = "sheets.json", "curve.png"
EVERY = 2  # of a case's held-out views

Drawer = Callable[[], tuple[Scene, Scene, Any]]


def main(
    out: Annotated[Path, typer.Option("-o", "--out")] = Path("bench-results/verdict"),
    seeds: Annotated[int, typer.Option(help="Bodies, from seed 0 on.")] = 2,
    only: Annotated[str, typer.Option(help="Sheets whose name contains this.")] = "",
    cases: Annotated[
        Path | None, typer.Option(help="Folders with views/ and test/, at half size.")
    ] = None,
    own: Annotated[
        bool, typer.Option("--own", help="Of cases, train on their own mannequin.obj, too.")
    ] = False,
) -> None:
    """Judge every sheet that is not judged yet, then say and draw what was found."""
    out.mkdir(parents=True, exist_ok=True)
    kept = out / SHEETS
    done = [_judged(row) for row in read_json(kept)] if kept.is_file() else []
    for name, draw in _cases(cases, own=own) if cases else _synthetic(seeds):
        if only not in name or name in {sheet.name for sheet in done}:
            continue
        try:
            scene, test, where = draw()
            found, picture = judge(name, scene, test, QUICK, where)
        except ToonsetError as error:
            print(f"{name}: {error}", flush=True)
            continue
        write_bytes(out / f"{name.replace(' ', '_')}.png", picture)
        done.append(found)
        write_json(kept, [asdict(sheet) for sheet in done])
        print(f"{name}: {100 * found.off:.2f} %, {found.verdict}", flush=True)
    groups = {
        name: [s for s in done if _group(s) == name] for name in sorted(set(map(_group, done)))
    }
    for name, sheets in groups.items():
        print(f"\n{name}\n{table(sheets)}\n{told_text(sheets)}")
    write_bytes(out / CURVE, draw_curve(groups))


def _synthetic(seeds: int) -> Iterator[tuple[str, Drawer]]:
    for seed in range(seeds):
        base_is_drawn = False
        for page in (page for page in PAGES if page.kind is TRAINING):
            for step in page.steps:
                if not (step == page.base and base_is_drawn):
                    yield f"{page.name} {step} s{seed}", partial(_drawn, page, step, seed)
                base_is_drawn |= step == page.base


def _drawn(page: Page, step: Step, seed: int) -> tuple[Scene, Scene, Any]:
    scene = page.draw(step, seed)
    return scene.train, scene.test, scene.where


def _cases(folder: Path, *, own: bool) -> Iterator[tuple[str, Drawer]]:
    for case in case_folders(folder, "test/transforms.json"):
        yield case.name, partial(_case, case, None)
        if own and (case / MANNEQUIN_FILE).is_file():
            yield f"{case.name}{OWN}", partial(_case, case, case / MANNEQUIN_FILE)


def _case(folder: Path, mannequin: Path | None) -> tuple[Scene, Scene, None]:
    train, test = (halved(read_scene(folder / name)) for name in ("views", "test"))
    if mannequin is not None:
        train = replace(train, mannequin=load_mesh(mannequin))
    return train, replace(test, frames=test.frames[::EVERY]), None


def _judged(row: dict[str, Any]) -> Judged:
    lists: dict[str, Any] = {
        name: tuple(row.get(name, ())) for name in ("reasons", "look", "terms", "flip")
    }
    return Judged(**row | lists)


def _group(sheet: Judged) -> str:
    """Return where a sheet comes from."""
    seed = sheet.name.rpartition(" s")[2]
    return f"seed {seed}" if seed.isdigit() else "cases"


if __name__ == "__main__":
    typer.run(main)
