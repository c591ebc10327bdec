"""`toonset synth`: draw a turnaround of a mesh, with its ground truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import typer

from toonset.cli.common.flags import Given
from toonset.cli.common.output import OUTPUT_PANEL, ForceFlag, Printer, SeedOption, UpOption
from toonset.dataset.synthetic.artist_options import ArtistOptions
from toonset.dataset.synthetic.options import CONDITIONS, SynthOptions
from toonset.errors import counted
from toonset.write import check_output

WRITTEN = (
    *("sheet.png", "sheet.jpg", "views", "labels", "ink", "shadows", "test"),
    *("mannequin.obj", "truth.json"),
)
TEST_VIEWS = 16


def synth(
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
    typed: Given[SynthOptions] = Given(SynthOptions),
    pose_difference: Annotated[
        float, typer.Option(help="Bodies of a condition's drawings differ by this times as much.")
    ] = 1.0,
    up: UpOption = "y",
    seed: SeedOption = 0,
    force: ForceFlag = False,
    *,
    printer: Printer,
) -> None:
    """Draw a turnaround sheet of a mesh, with errors of a hand as asked, and write its truth.

    Writes sheet.png, views/ with transforms.json, labels/, ink/, mannequin.obj and truth.json;
    with --condition artist or painted sheet.jpg instead, and artist shadows/. All conditions but
    plain have 16 exact views in test/ (studio and painted: 8 of the drawn side, then 8 of the
    other), and MESH.landmarks.json, if there is one, says where head and arms are.
    """
    chosen = CONDITIONS[condition]
    artist = replace(chosen.artist, body=chosen.artist.body.scaled(pose_difference))
    options = typed.over(replace(chosen, artist=artist))
    from toonset.dataset.mannequin.landmark_file import read_known_points
    from toonset.dataset.mesh.load import load_mesh
    from toonset.dataset.synthetic.files import write_turnaround
    from toonset.dataset.synthetic.turnaround import make_turnaround

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
