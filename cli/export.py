"""`toonset export`: a bundle in another program's format."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toonset.cli.output import (
    OUTPUT_PANEL,
    ForceFlag,
    JsonFlag,
    Printer,
    QuietFlag,
    SeedOption,
    check_output,
)

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float

    from toonset.camera import Camera
    from toonset.dataset.colmap import FarPinhole
    from toonset.dataset.colmap_points import TrackedPoints
    from toonset.dataset.scene import Frame
    from toonset.mesh import Mesh

WRITTEN = ("images", "masks", "sparse", "toonset.json")
RIM_SPACING_PX = 2.0
SURFACE_POINTS = 10_000  # about what a splatting trainer starts a single object from


class Format(StrEnum):
    """What is written."""

    colmap = "colmap"


def export(
    bundle: Annotated[Path, typer.Argument(help="A bundle, or a folder with transforms.json.")],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder to write.", rich_help_panel=OUTPUT_PANEL)
    ],
    to: Annotated[Format, typer.Option("--to", help="Format.")] = Format.colmap,
    mesh: Annotated[
        Path | None,
        typer.Option("--mesh", help="Mannequin for points3D (default: the bundle's own)."),
    ] = None,
    text: Annotated[bool, typer.Option("--text", help="Write .txt files, not .bin.")] = False,
    force: ForceFlag = False,
    seed: SeedOption = 0,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Write a bundle as a COLMAP dataset: images over white, masks, sparse/0 and exact cameras.

    COLMAP has no orthographic camera; such views become pinholes 100 body heights away, and how
    far these may be off is printed. points3D are points of the mannequin.
    """
    from toonset.dataset.bundle import MANNEQUIN
    from toonset.dataset.colmap import read_far_pinholes, write_colmap
    from toonset.dataset.mesh_file import load_mesh
    from toonset.dataset.transforms import read_scene, transforms_file
    from toonset.errors import MeshError

    printer = Printer(as_json, quiet)
    check_output(out, [bundle, mesh], WRITTEN, force=force)
    frames = read_scene(bundle).frames
    pinholes = read_far_pinholes(bundle)
    own = transforms_file(bundle).parent / MANNEQUIN
    body = mesh or (own if own.is_file() else None)
    points = None
    if body is not None:
        printer.progress("colouring points")
        cameras = [pinhole.camera for pinhole in pinholes]
        points = _points(load_mesh(body), frames, cameras, seed)
    if mesh is not None and points is None:
        raise MeshError(
            f"{mesh}: no point of it lies on the figure in every drawing; give the mannequin of "
            "the calibration, or none"
        )
    write_colmap(out, frames, pinholes, points, text=text, force=force)
    error_px = max(pinhole.error_px for pinhole in pinholes)
    printer.say(_summary(frames, pinholes, points))
    count = 0 if points is None else len(points.xyz)
    values = {"out": out, "format": to.value, "views": len(frames), "points": count}
    printer.result({**values, "pinhole_error_px": error_px}, str(out))


def _points(
    mesh: Mesh, frames: tuple[Frame, ...], cameras: list[Camera], seed: int
) -> TrackedPoints | None:
    """Return coloured points of the mannequin; None where none lies on the figure in all views."""
    import numpy as np

    from toonset.dataset.colmap_points import sample_surface, track_points

    candidates = [*_rims(mesh, cameras), sample_surface(mesh, SURFACE_POINTS, seed)]
    points = track_points(np.concatenate(candidates), mesh, frames, cameras)
    return points if len(points.xyz) else None


def _rims(mesh: Mesh, cameras: list[Camera]) -> list[Float[np.ndarray, "n 3"]]:
    """Return the points of the mannequin that are its outline in a view, per view."""
    from toonset.calib.rim import find_rim, prepare_surface

    surface = prepare_surface(mesh)
    rims = []
    for camera in cameras:
        pixels, _, in_front = camera.project(mesh.vertices)
        if in_front.all():
            rim = find_rim(surface, pixels, camera.size_wh, RIM_SPACING_PX)
            rims.append(rim.points + surface.middle)
    return rims


def _summary(
    frames: tuple[Frame, ...],
    pinholes: tuple[FarPinhole, ...],
    points: TrackedPoints | None,
) -> str:
    far = sum(frame.camera.is_orthographic for frame in frames)
    lines = [f"{len(frames)} {'view' if len(frames) == 1 else 'views'}"]
    if far:
        error_px = max(pinhole.error_px for pinhole in pinholes)
        lines.append(f"{far} orthographic, written as far pinholes: at most {error_px:.2f} px off")
    if points is None:
        lines.append("points3D is empty; give a mannequin that the drawings show as --mesh")
    else:
        several = int((points.seen.sum(axis=0) > 1).sum())
        lines.append(f"{len(points.xyz)} points, {several} of them seen by several views")
    return "\n".join(lines)
