"""`toonset import`: make a bundle of another program's cameras and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from toonset.cli.common.output import OUTPUT_PANEL, ForceFlag, Printer
from toonset.errors import counted
from toonset.write import check_output

if TYPE_CHECKING:
    from toonset.dataset.importers.detect import Imported
    from toonset.dataset.importers.to_bundle import ImportReport

WRITTEN = ("transforms.json", "images", "mannequin.obj")


def import_(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER",
            help="A nerfstudio, instant-ngp, Blender-synthetic or COLMAP folder, or any folder of "
            "`toonset export`.",
        ),
    ],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Bundle folder.", rich_help_panel=OUTPUT_PANEL)
    ] = Path("bundle"),
    images: Annotated[
        Path | None,
        typer.Option("--images", help="Pictures of a COLMAP model (default: images beside it)."),
    ] = None,
    masks: Annotated[
        Path | None,
        typer.Option("--masks", help="Folder of masks, white where the figure is: NAME.png."),
    ] = None,
    mesh: Annotated[
        Path | None, typer.Option("--mesh", help="The mannequin, in the world that is read.")
    ] = None,
    up: Annotated[
        Literal["y", "z"],
        typer.Option("--up", help="z: turn a world of Blender's (+Z up, front -Y) to ours."),
    ] = "y",
    force: ForceFlag = False,
    *,
    printer: Printer,
) -> None:
    """Make a bundle of another program's cameras and pictures.

    Pictures become RGBA: a mask becomes their alpha. Lens distortion is refused: undistort first.
    Of toonset's own exports the exact cameras beside them are taken.
    """
    from toonset.dataset.bundle.bundle import mannequin_of
    from toonset.dataset.importers.detect import read_import
    from toonset.dataset.importers.to_bundle import write_imported

    imported = read_import(path, images, masks)
    body = mannequin_of(path.parent if path.is_file() else path, mesh)
    check_output(out, [path, images, masks, mesh], WRITTEN, force=force)
    report = write_imported(out, imported, body, z_up=up == "z", force=force)
    for remark in () if mesh is None or body is None else body.remarks:
        printer.say(remark)
    printer.say(_summary(imported, report, has_mannequin=body is not None))
    values = {"bundle": out, "format": imported.program, "views": list(report.views)}
    values |= {"opaque": list(report.opaque), "masked": report.masked}
    printer.result({**values, "remarks": list(report.remarks)}, str(out))


def _summary(imported: Imported, report: ImportReport, *, has_mannequin: bool) -> str:
    exact = ", exact cameras of toonset.json" if imported.native is not None else ""
    lines = [f"{counted(len(report.views), 'view')} of {imported.program}{exact}"]
    if report.masked:
        lines.append(f"{report.masked} with a mask as alpha")
    if report.opaque:
        lines.append(
            f"{len(report.opaque)} without transparent background ({report.opaque[0]} ...): the "
            "whole picture counts as figure; give --masks"
        )
    lines += report.remarks
    if not has_mannequin:
        lines.append("no mannequin; --mesh puts one into the bundle")
    return "\n".join(lines)
