"""Draw many small sheets of random figures, with a manifest."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

from lab.bench.cases.bodies import random_body
from lab.bench.cases.cases import DRAWN
from toonset.dataset.images.picture import encode_png
from toonset.dataset.mesh.load import save_obj
from toonset.dataset.synthetic.turnaround import make_turnaround

SMALL = replace(DRAWN, views=2, cell_px=48, outline_px=1.5)
BODIES = 10  # that the sheets share
MANIFEST = "sheets.csv"


def write_sheets(folder: Path, count: int, seed: int = 0) -> Path:
    """Write sheets s0000.png ..., their mannequins, and a manifest; return the manifest.

    Args:
        folder: to fill.
        count: of sheets.
        seed: of bodies and drawings.
    """
    folder.mkdir(parents=True, exist_ok=True)
    bodies = [random_body(seed + number) for number in range(min(BODIES, count))]
    for number, mesh in enumerate(bodies):
        (folder / f"body{number}.obj").write_bytes(save_obj(mesh))
    width = len(str(count - 1))
    with (folder / MANIFEST).open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["sheet", "mesh", "character", "license", "source"])
        for number in range(count):
            body, name = number % len(bodies), f"s{number:0{width}d}.png"
            drawn = make_turnaround(bodies[body], SMALL, seed + number)
            (folder / name).write_bytes(encode_png(drawn.sheet))
            rows.writerow([name, f"body{body}.obj", f"body{body}", "CC0-1.0", "toonset synth"])
    return folder / MANIFEST
