"""`toonset mannequin`: make a plain body to calibrate with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toonset.cli.common.output import OUTPUT_PANEL, ForceFlag, JsonFlag, Printer, QuietFlag
from toonset.dataset.mannequin.options import HEADS_TALL, SCALES, MannequinOptions, Pose

DEFAULT = MannequinOptions()
LOW, HIGH = SCALES


def mannequin(
    out: Annotated[
        Path, typer.Option("-o", "--out", help="OBJ file to write.", rich_help_panel=OUTPUT_PANEL)
    ] = Path("mannequin.obj"),
    heads: Annotated[
        float,
        typer.Option(min=HEADS_TALL[0], max=HEADS_TALL[1], help="Height over the head's height."),
    ] = DEFAULT.heads_tall,
    pose: Annotated[
        Pose, typer.Option(case_sensitive=False, help="Arms level, half down, or hanging.")
    ] = DEFAULT.pose,
    head: Annotated[
        float, typer.Option(min=LOW, max=HIGH, help="Width and depth of the head, times the usual.")
    ] = DEFAULT.head_scale,
    torso: Annotated[
        float,
        typer.Option(min=LOW, max=HIGH, help="Width and depth of the trunk, times the usual."),
    ] = DEFAULT.torso_scale,
    limbs: Annotated[
        float, typer.Option(min=LOW, max=HIGH, help="Thickness of arms and legs, times the usual.")
    ] = DEFAULT.limb_scale,
    force: ForceFlag = False,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Make a plain body of a character's proportions and pose, for `calibrate --mesh`.

    Writes an OBJ with named parts and, beside it, NAME.landmarks.json with its joints and face.
    """
    options = MannequinOptions(heads, pose, head, torso, limbs)
    from toonset.dataset.mannequin.files import check_files, landmarks_path, write_mannequin

    check_files(out, force=force)
    from toonset.dataset.mannequin.make import make_mannequin

    made = make_mannequin(options)
    write_mannequin(made, out, force=force)
    faces, beside = len(made.mesh.faces), landmarks_path(out)
    printer = Printer(as_json, quiet)
    printer.say(f"{faces} faces; {len(made.landmarks)} landmarks in {beside}")
    printer.result({"mesh": out, "landmarks": beside, "faces": faces}, str(out))
