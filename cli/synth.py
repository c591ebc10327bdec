"""`toonset synth`: draw a turnaround of a mesh, with its ground truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from toonset.cli.common.output import (
    OUTPUT_PANEL,
    ForceFlag,
    JsonFlag,
    Printer,
    QuietFlag,
    SeedOption,
    UpOption,
    counted,
)
from toonset.dataset.synthetic.artist_options import ArtistOptions
from toonset.dataset.synthetic.options import CONDITIONS, SynthOptions
from toonset.write import check_output

WRITTEN = (
    *("sheet.png", "sheet.jpg", "views", "labels", "ink", "shadows", "test"),
    *("mannequin.obj", "truth.json"),
)
DEFAULT = SynthOptions()
FIELDS = {  # of SynthOptions, by the function's parameter
    "views": "views",
    "cell": "cell_px",
    "columns": "columns",
    "yaw_jitter": "yaw_jitter_deg",
    "elevation": "elevation_deg",
    "distance": "distance_heights",
    "outline": "outline_px",
    "label_lines": "label_lines",
    "warp": "warp_percent",
    "scale_error": "scale_error_percent",
    "background": "background",
}
TEST_VIEWS = 16


def synth(
    context: typer.Context,
    mesh: Annotated[
        Path, typer.Argument(help="Character: obj, ply, stl, glb, vrm, off; colours kept.")
    ],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder to write.", rich_help_panel=OUTPUT_PANEL)
    ],
    condition: Annotated[
        Literal["plain", "artist", "studio", "painted"],
        typer.Option(
            help="artist: another body in every drawing, shadow, paper, captions, JPEG. "
            "studio: few drawings of one side, another body in each, height lines, title. "
            "painted: soft light, hollows, brush strokes, thin tinted lines, JPEG. "
            "Other options override it."
        ),
    ] = "plain",
    views: Annotated[
        int,
        typer.Option(
            help="Drawings, evenly round; studio (4, at most 8): front, back, side, 3/4 first."
        ),
    ] = DEFAULT.views,
    pose_difference: Annotated[
        float, typer.Option(help="Bodies of a condition's drawings differ by this times as much.")
    ] = 1.0,
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
    up: UpOption = "y",
    seed: SeedOption = 0,
    force: ForceFlag = False,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Draw a turnaround sheet of a mesh, with errors of a hand as asked, and write its truth.

    Writes sheet.png, views/ with transforms.json, labels/, ink/, mannequin.obj and truth.json;
    with --condition artist or painted sheet.jpg instead, and artist shadows/. All conditions but
    plain have 16 exact views in test/ (studio and painted: 8 of the drawn side, then 8 of the
    other), and MESH.landmarks.json, if there is one, says where head and arms are.
    """
    chosen = CONDITIONS[condition]
    artist = replace(chosen.artist, body=chosen.artist.body.scaled(pose_difference))
    given = {**_typed(context), "following_parts": tuple(following or ())}
    options = replace(chosen, artist=artist, **given)
    from toonset.dataset.mannequin.landmark_file import read_known_points
    from toonset.dataset.mesh.load import load_mesh
    from toonset.dataset.synthetic.files import write_turnaround
    from toonset.dataset.synthetic.turnaround import make_turnaround

    printer = Printer(as_json, quiet)
    body = load_mesh(mesh, up=up)
    check_output(out, [mesh], WRITTEN, force=force)
    for remark in body.remarks:
        printer.say(remark)
    made = make_turnaround(body, options, seed, read_known_points(mesh, body.world_from_file))
    test = None
    if options.artist != ArtistOptions():
        test = make_turnaround(body, options.without_error(TEST_VIEWS), seed)
    write_turnaround(made, out, force=force, test=test)
    height, width = made.sheet.shape[:2]
    count = len(made.views)
    found = f"{counted(count, 'view')}, {counted(len(made.palette), 'colour')}"
    printer.say(f"{found}, sheet {width} x {height} px")
    printer.result({"folder": out, "views": count, "colors": len(made.palette)}, str(out))


def _typed(context: typer.Context) -> dict[str, Any]:
    """Return the options that were typed: what was not is the condition's."""
    given = (name for name in FIELDS if _is_typed(context, name))
    return {FIELDS[name]: context.params[name] for name in given}


def _is_typed(context: typer.Context, name: str) -> bool:
    source = context.get_parameter_source(name)
    return source is not None and source.name not in ("DEFAULT", "DEFAULT_MAP")
