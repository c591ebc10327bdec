"""`toonset mannequin`: make a plain body to calibrate with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toonset.cli.common.output import OUTPUT_PANEL, ForceFlag, Printer
from toonset.dataset.mannequin.options import MannequinOptions


def mannequin(
    out: Annotated[
        Path, typer.Option("-o", "--out", help="OBJ file to write.", rich_help_panel=OUTPUT_PANEL)
    ] = Path("mannequin.obj"),
    options: MannequinOptions = MannequinOptions(),
    force: ForceFlag = False,
    *,
    printer: Printer,
) -> None:
    """Make a plain body of a character's proportions and pose, for `calibrate --mesh`.

    Writes an OBJ with named parts and, beside it, NAME.landmarks.json with its joints and face.
    """
    from toonset.dataset.mannequin.files import check_files, landmarks_path, write_mannequin

    check_files(out, force=force)
    from toonset.dataset.mannequin.make import make_mannequin

    made = make_mannequin(options)
    write_mannequin(made, out, force=force)
    faces, beside = len(made.mesh.faces), landmarks_path(out)
    printer.say(f"{faces} faces; {len(made.landmarks)} landmarks in {beside}")
    printer.result({"mesh": out, "landmarks": beside, "faces": faces}, str(out))
