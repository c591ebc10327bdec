"""`toonset synth`: a mesh to a drawn turnaround with its exact truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toonset.cli.common.output import (
    OUTPUT_PANEL,
    ForceFlag,
    JsonFlag,
    Printer,
    QuietFlag,
    SeedOption,
)
from toonset.dataset.synthetic.options import SynthOptions
from toonset.write import check_output

WRITTEN = ("sheet.png", "views", "labels", "ink", "mannequin.obj", "truth.json")
DEFAULT = SynthOptions()


def synth(
    mesh: Annotated[Path, typer.Argument(help="Character: obj, ply, stl, glb, off; colours kept.")],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder to write.", rich_help_panel=OUTPUT_PANEL)
    ],
    views: Annotated[int, typer.Option(help="Drawings, evenly round.")] = DEFAULT.views,
    yaw_jitter: Annotated[
        float, typer.Option(help="Each view is turned wrongly by up to this, degrees.")
    ] = DEFAULT.yaw_jitter_deg,
    elevation: Annotated[
        float, typer.Option(help="Cameras look down by this, degrees.")
    ] = DEFAULT.elevation_deg,
    distance: Annotated[
        float, typer.Option(help="Camera distance in body heights; 0 = orthographic.")
    ] = DEFAULT.distance_heights,
    outline: Annotated[
        float, typer.Option(help="Width of the black outline, px; 0 = none.")
    ] = DEFAULT.outline_px,
    label_lines: Annotated[
        bool, typer.Option(help="Draw lines between colours, too.")
    ] = DEFAULT.label_lines,
    warp: Annotated[
        float, typer.Option(help="Smooth drawing error (rms), percent of the cell.")
    ] = DEFAULT.warp_percent,
    scale_error: Annotated[
        float, typer.Option(help="Each view is larger or smaller by up to this, percent.")
    ] = DEFAULT.scale_error_percent,
    following: Annotated[
        list[str] | None,
        typer.Option(metavar="PART", help="Mesh part that keeps facing the viewer; repeatable."),
    ] = None,
    background: Annotated[
        str, typer.Option(help="white, transparent or #rrggbb.")
    ] = DEFAULT.background,
    cell: Annotated[int, typer.Option(help="Side of a drawing's cell, px.")] = DEFAULT.cell_px,
    columns: Annotated[int, typer.Option(help="Drawings in a row; 0 = all.")] = DEFAULT.columns,
    seed: SeedOption = 0,
    force: ForceFlag = False,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Draw a turnaround sheet of a mesh, with errors of a hand as asked, and write its truth.

    Writes sheet.png, views/ with transforms.json, labels/, ink/, mannequin.obj and truth.json.
    """
    options = SynthOptions(
        views=views,
        cell_px=cell,
        columns=columns,
        yaw_jitter_deg=yaw_jitter,
        elevation_deg=elevation,
        distance_heights=distance,
        outline_px=outline,
        label_lines=label_lines,
        warp_percent=warp,
        scale_error_percent=scale_error,
        following_parts=tuple(following or ()),
        background=background,
    )
    from toonset.dataset.mesh.load import load_mesh
    from toonset.dataset.synthetic.files import write_turnaround
    from toonset.dataset.synthetic.turnaround import make_turnaround

    printer = Printer(as_json, quiet)
    check_output(out, [mesh], WRITTEN, force=force)
    turnaround = make_turnaround(load_mesh(mesh), options, seed)
    write_turnaround(turnaround, out, force=force)
    height, width = turnaround.sheet.shape[:2]
    printer.say(f"{views} views, {len(turnaround.palette)} colours, sheet {width} x {height} px")
    printer.result({"folder": out, "views": views, "colors": len(turnaround.palette)}, str(out))
