"""`toonset export`: write a bundle in another program's format."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from toonset.cli.common.export_formats import TARGETS, Format, Job
from toonset.cli.common.output import OUTPUT_PANEL, ForceFlag, Printer, SeedOption, UpOption
from toonset.errors import counted
from toonset.write import check_output

if TYPE_CHECKING:
    from toonset.dataset.exporters.common import ExportView
    from toonset.dataset.exporters.points import TrackedPoints
    from toonset.mesh import Mesh

COLMAP_PANEL, NERFSTUDIO_PANEL, BLENDER_PANEL = "COLMAP", "nerfstudio", "Blender"
NO_BODY, GLB = "none", b"glTF"
ASTRAY_PX = 0.1  # a principal point is worth a word from here


def export(
    to: Annotated[Format, typer.Option("--to", help="Format.")],
    out: Annotated[
        Path,
        typer.Option(
            "-o", "--out", help="Folder to write; the add-on's .zip.", rich_help_panel=OUTPUT_PANEL
        ),
    ],
    bundle: Annotated[
        Path | None,
        typer.Argument(
            metavar="BUNDLE",
            help="A bundle, or a folder with transforms.json; none for the add-on.",
        ),
    ] = None,
    mesh: Annotated[
        Path | None, typer.Option("--mesh", help="The mannequin (default: the bundle's own).")
    ] = None,
    up: UpOption = "y",
    text: Annotated[
        bool,
        typer.Option("--text", help="Write .txt files, not .bin.", rich_help_panel=COLMAP_PANEL),
    ] = False,
    layout: Annotated[
        Literal["new", "old"],
        typer.Option(
            "--layout",
            help="old: without rigs and frames, as COLMAP before 3.12.",
            rich_help_panel=COLMAP_PANEL,
        ),
    ] = "new",
    centre: Annotated[
        bool,
        typer.Option(
            "--centre",
            help="Pad pictures until the principal point is in the middle: Gaussian splatting's "
            "own reader takes it to be there.",
            rich_help_panel=COLMAP_PANEL,
        ),
    ] = False,
    pinholes: Annotated[
        bool,
        typer.Option(
            "--pinholes",
            help="Far pinholes for orthographic views, as splatfacto needs them.",
            rich_help_panel=NERFSTUDIO_PANEL,
        ),
    ] = False,
    body: Annotated[
        str | None,
        typer.Option(
            "--body",
            metavar="GLB|none",
            help="The painted body (default: the bundle's run, as `mesh --texture --outline`).",
            rich_help_panel=BLENDER_PANEL,
        ),
    ] = None,
    force: ForceFlag = False,
    seed: SeedOption = 0,
    *,
    printer: Printer,
) -> None:
    """Write a bundle for another program: pictures, cameras, mannequin, and toonset.json.

    Where a format has no orthographic camera, such views become pinholes 100 body heights away, and
    how far these may be off is printed. The exact cameras are in toonset.json.

    blender-addon is a panel for Blender's 3D view that runs this command: sheet, cameras, a compass
    for every drawing. Preferences > Add-ons > Install takes the zip; tell it where `toonset` is.
    """
    if to != Format.colmap and (text or centre or layout != "new"):
        raise typer.BadParameter("--text, --layout and --centre belong to --to colmap")
    if to != Format.nerfstudio and pinholes:
        raise typer.BadParameter("--pinholes belongs to --to nerfstudio")
    if to != Format.blender and body not in (None, NO_BODY):
        raise typer.BadParameter("--body belongs to --to blender")
    if to == Format.blender_addon:
        if bundle is not None or mesh is not None:
            raise typer.BadParameter("the add-on is of no bundle: leave out BUNDLE and --mesh")
        return _write_addon(printer, out, force=force)
    if bundle is None:
        raise typer.BadParameter(f"--to {to.value} needs a BUNDLE")
    from toonset.dataset.bundle.bundle import mannequin_of
    from toonset.dataset.bundle.transforms_read import transforms_file
    from toonset.dataset.exporters.common import read_views
    from toonset.dataset.exporters.pinhole import centre_view

    target = TARGETS[to]
    views = read_views(bundle)
    root = transforms_file(bundle).parent
    mannequin = mannequin_of(root, mesh, up=up)
    check_output(out, [bundle, mesh], target.written, force=force)
    painted = _painted_body(root, body, printer) if to == Format.blender else None
    if centre:
        views = tuple(centre_view(view) for view in views)
    points = None
    if target.wants_points:
        printer.progress("colouring points")
        points = _points(mannequin, views, seed, is_given=mesh is not None)
    job = Job(out, views, points, mannequin, painted, text, layout == "old", pinholes, force)
    for remark in () if mesh is None or mannequin is None else mannequin.remarks:
        printer.say(remark)
    _report(printer, to, job, target.write(job))


def _write_addon(printer: Printer, out: Path, *, force: bool) -> None:
    from toonset.dataset.exporters.blender_addon import write_blender_addon
    from toonset.errors import OutputError
    from toonset.write import check_new_file

    if out.suffix.lower() != ".zip":
        raise OutputError(f"{out}: Blender installs a .zip; end -o in .zip")
    check_new_file(out, force=force)
    write_blender_addon(out)
    printer.say("in Blender: Preferences > Add-ons > Install (from Disk); then 3D View > Sidebar")
    printer.result({"out": out, "format": Format.blender_addon.value}, str(out))


def _painted_body(bundle: Path, given: str | None, printer: Printer) -> bytes | None:
    """Return the GLB of a painted body: a file that was named, or the bundle's run as a mesh."""
    from toonset.errors import MeshError, ToonsetError
    from toonset.read import read_whole

    if given is not None and given != NO_BODY:
        data = read_whole(Path(given), "mesh", MeshError)
        if not data.startswith(GLB):
            raise MeshError(f"{given}: is no GLB; give what `toonset mesh --texture` writes")
        return data
    run = bundle / "run"
    if given == NO_BODY or not (run / "config.json").is_file():
        return None
    from toonset.nerf.run.folder import read_field
    from toonset.nerf.surface.texture import texture_surface
    from toonset.nerf.surface.textured_files import encode_textured_glb

    def progress(step: str, done: float) -> None:
        printer.progress(f"{step} {done:.0%}")

    trained = read_field(run)
    has_pen = trained.drawings is not None and trained.drawings.pen is not None
    try:
        textured = texture_surface(trained, progress=progress, outline=has_pen)
        return encode_textured_glb(textured)
    except ToonsetError as error:
        printer.say(f"no painted body: {error}")
        return None


def _points(
    body: Mesh | None, views: Sequence[ExportView], seed: int, *, is_given: bool
) -> TrackedPoints | None:
    """Return points of the mannequin, or, without one, of the drawings' visual hull."""
    from toonset.calib.mannequin_points import mannequin_points
    from toonset.dataset.exporters.hull_points import hull_points
    from toonset.errors import MeshError

    points = None if body is None else mannequin_points(body, views, seed)
    if points is None and body is not None and is_given:
        raise MeshError(
            f"{body.name}: no point of it lies on the figure in every drawing; give the mannequin "
            "of the calibration, or none"
        )
    return points or hull_points(views, seed)


def _report(printer: Printer, to: Format, job: Job, views: Sequence[ExportView]) -> None:
    from toonset.dataset.exporters.common import largest_error_px

    error_px = 0.0 if TARGETS[to].holds_exactly(job) else largest_error_px(views)
    printer.say("\n".join(_summary(to, job, views, error_px)))
    count = 0 if job.points is None else len(job.points.xyz)
    values = {"out": job.out, "format": to.value, "views": len(views), "points": count}
    printer.result({**values, "pinhole_error_px": error_px}, str(job.out))


def _summary(to: Format, job: Job, views: Sequence[ExportView], error_px: float) -> list[str]:
    """Return what a person should know, line by line."""
    target = TARGETS[to]
    far = sum(view.camera.is_orthographic for view in views)
    lines = [counted(len(views), "view")]
    if far and to == Format.nerfstudio and target.holds_exactly(job):
        lines.append("orthographic (ORTHOPHOTO); for splatfacto, which knows none, add --pinholes")
    elif far and not target.holds_exactly(job):
        lines.append(f"{far} orthographic, written as far pinholes: at most {error_px:.2f} px off")
    pairs = list(zip(job.views, views, strict=True))
    grown = max(new.camera.scale / old.camera.scale for old, new in pairs)
    if any(old.rgba.shape != new.rgba.shape for old, new in pairs):
        width, height = views[0].camera.size_wh
        lines.append(f"pictures padded to {width} x {height} px, enlarged by {grown:.3f} at most")
    astray = max(
        abs(float(2 * c - size)) / 2
        for view in views
        for c, size in zip(view.camera.center, view.camera.size_wh, strict=True)
    )
    if to == Format.colmap and astray > ASTRAY_PX:
        lines.append(
            f"principal points up to {astray:.1f} px off the pictures' middles; for Gaussian "
            "splatting's own reader, which takes them to be there, add --centre"
        )
    if target.wants_points and job.points is None:
        lines.append("no points: no three drawings share a volume; give a mannequin as --mesh")
    elif job.points is not None:
        several = int((job.points.seen.sum(axis=0) > 1).sum())
        lines.append(f"{len(job.points.xyz)} points, {several} of them seen by several views")
    return [*lines, target.hint.format(out=shlex.quote(str(job.out)))] if target.hint else lines
