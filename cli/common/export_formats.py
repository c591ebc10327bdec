"""List the formats of `toonset export`: writer, inputs and hint of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from toonset.dataset.exporters.common import ExportView
    from toonset.dataset.exporters.points import TrackedPoints
    from toonset.mesh import Mesh

BESIDE = ("images", "toonset.json", "mannequin.obj")


class Format(StrEnum):
    """Formats of `toonset export`."""

    colmap = "colmap"
    nerfstudio = "nerfstudio"
    instant_ngp = "instant-ngp"
    blender_synthetic = "blender-synthetic"
    blender = "blender"
    blender_addon = "blender-addon"
    gltf = "gltf"


@dataclass(frozen=True, eq=False)
class Job:
    """One export: what to write, and how."""

    out: Path
    views: Sequence[ExportView]
    points: TrackedPoints | None
    mesh: Mesh | None
    body: bytes | None
    text: bool
    old_layout: bool
    pinholes: bool
    force: bool


@dataclass(frozen=True)
class Target:
    """One row of the table.

    Attributes:
        writer: module and function below `toonset.dataset.exporters`.
        written: patterns of the names in its folder.
        takes: what of a job it takes besides folder, views, mesh and force.
        fixed: arguments that make it this format.
        is_exact: whether it holds orthographic cameras.
        takes_one_kind: whether it does where all are, and pinholes are not asked for.
        hint: what a person should know before the next step, or type for it; {out} is the folder.
    """

    writer: str
    written: tuple[str, ...]
    takes: tuple[str, ...] = ()
    fixed: Mapping[str, bool] = field(default_factory=dict)
    is_exact: bool = False
    takes_one_kind: bool = False
    hint: str = ""

    @property
    def wants_points(self) -> bool:
        """Return whether coloured points of the mannequin are part of it."""
        return "points" in self.takes

    def holds_exactly(self, job: Job) -> bool:
        """Return whether orthographic views stay orthographic."""
        alike = all(view.camera.is_orthographic for view in job.views)
        return self.is_exact or (self.takes_one_kind and alike and not job.pinholes)

    def write(self, job: Job) -> Sequence[ExportView]:
        """Write it; return the views as they were written."""
        module, name = self.writer.split(":")
        write = getattr(import_module(f"toonset.dataset.exporters.{module}"), name)
        given = {name: getattr(job, name) for name in self.takes} | dict(self.fixed)
        written = write(job.out, job.views, mesh=job.mesh, force=job.force, **given)
        return job.views if written is None else written


TARGETS = {
    Format.colmap: Target(
        "colmap:write_colmap", (*BESIDE, "masks", "sparse"), takes=("points", "text", "old_layout")
    ),
    Format.nerfstudio: Target(
        "nerfstudio:write_transforms",
        (*BESIDE, "transforms.json", "sparse_pc.ply"),
        takes=("points", "pinholes"),
        takes_one_kind=True,
        hint="to keep world and cameras, and to train and evaluate on all views: ns-train nerfacto "
        "--pipeline.model.camera-optimizer.mode off nerfstudio-data --data {out} "
        "--orientation-method none --center-method none --auto-scale-poses False --eval-mode all",
    ),
    Format.instant_ngp: Target(
        "nerfstudio:write_transforms", (*BESIDE, "transforms.json"), fixed={"instant_ngp": True}
    ),
    Format.blender_synthetic: Target(
        "blender_synthetic:write_blender_synthetic",
        (*BESIDE[1:], "train", "transforms_*.json", "points3d.ply"),
        takes=("points",),
        hint="val and test name the pictures of train: a turnaround has no others",
    ),
    Format.blender: Target(
        "blender:write_blender_script",
        (*BESIDE, "import_cameras.py", "scene.glb", "body.glb"),
        takes=("body",),
        is_exact=True,
        hint="run it: blender --python {out}/import_cameras.py",
    ),
    Format.gltf: Target("gltf:write_gltf", (*BESIDE, "scene.glb"), is_exact=True),
}
