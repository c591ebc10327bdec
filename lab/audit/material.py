"""Make what the audit's cases start from: a sheet, a body, a bundle, a run, exports; once."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from lab.audit.case import Case, run_forked

FEW = ("--steps", "30", "--threads", "1", "--device", "cpu")
EXPORTS = (
    *("colmap", "nerfstudio", "instant-ngp", "blender-synthetic", "blender", "gltf"),
    "colmap --text",
)


@dataclass(frozen=True)
class Material:
    """A folder with everything, and the seed of what is drawn by lot.

    Attributes:
        work: the audit's own folder, for the cases.
        seed: of everything random.
    """

    work: Path
    seed: int

    @property
    def root(self) -> Path:
        """Return the folder with the material."""
        return self.work / "material"

    def path(self, name: str) -> str:
        """Return a part of it as an argument."""
        return str(self.root / name)

    def copy(self, name: str, to: Path) -> Path:
        """Copy a file or folder of it."""
        source = self.root / name
        return Path((shutil.copytree if source.is_dir() else shutil.copy)(source, to))

    def copy_all(self, folder: Path, *names: str) -> None:
        """Copy parts of it into a folder, under their names."""
        for name in names:
            self.copy(name, folder / name)


def make_material(work: Path, seed: int) -> Material:
    """Draw a small sheet of a plain body and take it through the verbs, as a person would.

    Makes m.obj, m.landmarks.json, sheet.png, synth/, split/, bundle/, run/ (trained on bundle/) and
    one folder per format of `export`.
    """
    material = Material(work, seed)
    material.root.mkdir()
    views = ("--views", "3", "--cell", "96", "--outline", "1.5", "--elevation", "8")
    bent = ("--yaw-jitter", "4", "--seed", str(seed))
    steps: list[tuple[str, ...]] = [
        ("mannequin", "-o", "m.obj"),
        ("synth", "m.obj", *views, *bent, "-o", "synth"),
        ("split", "synth/sheet.png", "-o", "split"),
        ("calibrate", "synth/sheet.png", "--mesh", "m.obj", "-o", "bundle"),
        ("palette", "bundle"),
        ("train", "bundle", "-o", "run", *FEW),
        *[("export", "bundle", "-o", to.replace(" ", ""), "--to", *to.split()) for to in EXPORTS],
    ]
    for step in steps:
        ran = run_forked(Case("material", step), material.root)
        assert ran.code in (0, 3), (step, ran)
    shutil.copy(material.root / "synth/sheet.png", material.root / "sheet.png")
    return material
