"""Make the example: our own character, its turnaround sheet, its mannequin and the true cameras.

    python examples/making/make_character.py [FOLDER]

writes sheet.png, mannequin.obj, truth.json (the cameras) and character.obj (too large to be kept in
the repository) to FOLDER, by default beside the numbered examples.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from character import character, mannequin

from toonset.dataset.images.picture import encode_png
from toonset.dataset.mesh.load import save_obj
from toonset.dataset.synthetic.files import truth_dict
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.mesh import Mesh
from toonset.write import write_bytes, write_json

OPTIONS = SynthOptions(elevation_deg=8.0, warp_percent=0.8)
SEED = 7


def main(folder: Path) -> None:
    pip = character()
    turnaround = make_turnaround(pip, OPTIONS, SEED)
    write_bytes(folder / "sheet.png", encode_png(turnaround.sheet[..., :3]))
    write_bytes(folder / "mannequin.obj", save_obj(rounded(mannequin())))
    write_bytes(folder / "character.obj", save_obj(pip))
    write_json(folder / "truth.json", truth_dict(turnaround))


def rounded(mesh: Mesh) -> Mesh:
    """Return the mesh without colours, coordinates to 0.1 mm of a 1.7 m body: a small file."""
    return replace(mesh, vertices=np.round(mesh.vertices, 4), face_colors=None)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1])
