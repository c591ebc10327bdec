"""The verbs that write, and what they read."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path

from lab.faults.child import in_child


@dataclass(frozen=True)
class Case:
    """A verb and its outputs: `{i}` stands for the folder of inputs, `{o}` for that of outputs.

    Attributes:
        name: of the case.
        new: arguments.
        old: arguments whose output is there before, replaced with --force; () where `before` is.
        before: an input that is copied to be written into.
    """

    name: str
    new: str
    old: str = ""
    before: str = ""

    @property
    def starts(self) -> dict[str, str]:
        """Return the arguments by what is there before: nothing, an old output."""
        return {"new": self.new} | ({"old": f"{self.new} --force"} if self.old else {})


CASES = (
    Case("split", "split {i}/sheet.png -o {o}/a", "split {i}/single.png -o {o}/a"),
    Case(
        "calibrate",
        "calibrate {i}/sheet.png --mesh {i}/mannequin.obj -o {o}/a",
        "calibrate {i}/sheet.png --mesh {i}/mannequin.obj --drop 1 -o {o}/a",
    ),
    Case("palette", "palette {i}/bundle -o {o}/a", "palette {i}/other -o {o}/a"),
    Case("palette-in", "palette {o}/bare", before="bare"),
    Case("palette-again", "palette {o}/bundle --max-colors 2", before="bundle"),
    Case(
        "recolor",
        "recolor {i}/bundle --recolor red=#010203 -o {o}/a",
        "recolor {i}/bundle --recolor red=#040506 -o {o}/a",
    ),
    Case(
        "train",
        "train {i}/bundle --steps 2 --threads 1 -o {o}/a",
        "train {i}/bundle --steps 1 --threads 1 -o {o}/a",
    ),
    Case(
        "render",
        "render {i}/run --turntable 2 --size 32 -o {o}/a",
        "render {i}/run --turntable 1 --size 32 -o {o}/a",
    ),
    Case("view", "view {i}/run -o {o}/a.html", "view {i}/bundle -o {o}/a.html"),
    Case(
        "evaluate",
        "evaluate {i}/run --bundle {i}/bundle --test {i}/bundle -o {o}/a",
        "evaluate {i}/run --bundle {i}/bundle --test {i}/other -o {o}/a",
    ),
    Case("consistency", "consistency {i}/bundle -o {o}/a", "consistency {i}/other -o {o}/a"),
    Case("mesh", "mesh {i}/run -o {o}/a.obj", "mesh {i}/run --faces 200 -o {o}/a.obj"),
    *(
        Case(
            f"export-{to}", *(f"export {{i}}/{b} --to {to} -o {{o}}/a" for b in ("bundle", "other"))
        )
        for to in ("colmap", "nerfstudio", "blender-synthetic", "blender", "gltf")
    ),
    Case("import", "import {i}/colmap -o {o}/a", "import {i}/colmap2 -o {o}/a"),
    Case("pack", "pack {i}/batch --to folder -o {o}/a", "pack {i}/batch --to webdataset -o {o}/a"),
    Case("mannequin", "mannequin -o {o}/a.obj", "mannequin --heads 4 -o {o}/a.obj"),
    Case(
        "synth",
        "synth {i}/mannequin.obj --views 2 --cell 64 -o {o}/a",
        "synth {i}/mannequin.obj --views 3 --cell 64 -o {o}/a",
    ),
)

CALIBRATE = "calibrate sheet.png --mesh mannequin.obj -o"
INPUTS = {  # what verbs read: what it is made of, and how
    "bare": ("sheet.png", [f"{CALIBRATE} bare"]),
    "bundle": ("sheet.png", [f"{CALIBRATE} bundle", "palette bundle"]),
    "other": ("sheet.png", [f"{CALIBRATE} other --drop 1", "palette other"]),
    "run": ("bundle", ["train bundle --steps 2 --threads 1 -o run"]),
    "batch": (
        "sheet.png",
        [
            "batch sheet.png -o batch --stages calibrate,palette --workers 1 "
            "--with 'calibrate --mesh mannequin.obj'"
        ],
    ),
    "colmap": ("bundle", ["export bundle --to colmap -o colmap"]),
    "colmap2": ("other", ["export other --to colmap -o colmap2"]),
}


def draw_sheet(folder: Path) -> None:
    """Draw a sheet, the first drawing of it, and the mannequin."""
    from lab.bench.cases.bodies import random_body
    from toonset.dataset.images.picture import encode_png
    from toonset.dataset.mesh.load import save_obj
    from toonset.dataset.synthetic.options import SynthOptions
    from toonset.dataset.synthetic.turnaround import make_turnaround

    drawn = make_turnaround(random_body(11), SynthOptions(views=4, cell_px=96, elevation_deg=8), 11)
    (folder / "sheet.png").write_bytes(encode_png(drawn.sheet))
    (folder / "single.png").write_bytes(encode_png(drawn.sheet[:, :96].copy()))
    (folder / "mannequin.obj").write_bytes(save_obj(drawn.mesh))


def make_input(folder: Path, name: str) -> None:
    """Make what a verb reads, if it is not there."""
    if name in INPUTS and not (folder / name).exists():
        source, lines = INPUTS[name]
        make_input(folder, source)
        with contextlib.chdir(folder):
            for line in lines:
                in_child(line)
