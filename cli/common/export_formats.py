"""The table of `toonset export`: what each format writes, wants and says."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from toonset.dataset.exporters.common import ExportView
    from toonset.dataset.exporters.points import TrackedPoints
    from toonset.mesh import Mesh

BESIDE = ("images", "toonset.json", "mannequin.obj")


class Format(StrEnum):
    """What is written."""

    colmap = "colmap"
    nerfstudio = "nerfstudio"
    instant_ngp = "instant-ngp"
    blender_synthetic = "blender-synthetic"
    blender = "blender"
    gltf = "gltf"
    opencv = "opencv"
    opencv_xml = "opencv-xml"


@dataclass(frozen=True, eq=False)
class Job:
    """What is to be written, and how."""

    out: Path
    views: Sequence[ExportView]
    points: TrackedPoints | None
    mesh: Mesh | None
    text: bool
    old_layout: bool
    force: bool


@dataclass(frozen=True)
class Target:
    """One row of the table.

    Attributes:
        write: writes it; returns the views as they were written.
        written: patterns of the names in its folder.
        wants_points: whether coloured points of the mannequin are part of it.
        is_exact: whether it holds orthographic cameras.
        hint: what a person should know before the next step.
    """

    write: Callable[[Job], Sequence[ExportView]]
    written: tuple[str, ...]
    wants_points: bool = False
    is_exact: bool = False
    hint: str = ""


def _colmap(job: Job) -> Sequence[ExportView]:
    from toonset.dataset.exporters.colmap import write_colmap

    how = {"text": job.text, "old_layout": job.old_layout, "force": job.force}
    write_colmap(job.out, job.views, job.points, job.mesh, **how)
    return job.views


def _nerfstudio(job: Job) -> Sequence[ExportView]:
    from toonset.dataset.exporters.nerfstudio import write_transforms

    write_transforms(job.out, job.views, job.points, job.mesh, force=job.force)
    return job.views


def _instant_ngp(job: Job) -> Sequence[ExportView]:
    from toonset.dataset.exporters.nerfstudio import write_transforms

    write_transforms(job.out, job.views, None, job.mesh, instant_ngp=True, force=job.force)
    return job.views


def _blender_synthetic(job: Job) -> Sequence[ExportView]:
    from toonset.dataset.exporters.blender_synthetic import write_blender_synthetic

    return write_blender_synthetic(job.out, job.views, job.points, job.mesh, force=job.force)


def _blender(job: Job) -> Sequence[ExportView]:
    from toonset.dataset.exporters.blender import write_blender_script

    return write_blender_script(job.out, job.views, job.mesh, force=job.force)


def _gltf(job: Job) -> Sequence[ExportView]:
    from toonset.dataset.exporters.gltf import write_gltf

    return write_gltf(job.out, job.views, job.mesh, force=job.force)


def _opencv(job: Job) -> Sequence[ExportView]:
    from toonset.dataset.exporters.opencv import write_opencv

    write_opencv(job.out, job.views, job.mesh, force=job.force)
    return job.views


def _opencv_xml(job: Job) -> Sequence[ExportView]:
    from toonset.dataset.exporters.opencv import write_opencv

    write_opencv(job.out, job.views, job.mesh, xml=True, force=job.force)
    return job.views


TARGETS = {
    Format.colmap: Target(_colmap, (*BESIDE, "masks", "sparse"), wants_points=True),
    Format.nerfstudio: Target(
        _nerfstudio,
        (*BESIDE, "transforms.json", "sparse_pc.ply"),
        wants_points=True,
        hint="to keep the world as it is: ns-train METHOD nerfstudio-data --data FOLDER "
        "--orientation-method none --center-method none --auto-scale-poses False",
    ),
    Format.instant_ngp: Target(_instant_ngp, (*BESIDE, "transforms.json")),
    Format.blender_synthetic: Target(
        _blender_synthetic,
        (*BESIDE[1:], "train", "transforms_*.json", "points3d.ply"),
        wants_points=True,
        hint="val and test name the pictures of train: a turnaround has no others",
    ),
    Format.blender: Target(
        _blender,
        (*BESIDE, "import_cameras.py"),
        is_exact=True,
        hint="run it: blender --python import_cameras.py",
    ),
    Format.gltf: Target(_gltf, (*BESIDE, "scene.glb"), is_exact=True),
    Format.opencv: Target(_opencv, (*BESIDE, "cameras.yml")),
    Format.opencv_xml: Target(_opencv_xml, (*BESIDE, "cameras.xml")),
}
