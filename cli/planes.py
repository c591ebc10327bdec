"""`toonset planes`: a trained run's planes as pictures and JSON, for web pages."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toonset.cli.common.output import OUTPUT_PANEL, ForceFlag, JsonFlag, Printer, QuietFlag
from toonset.write import check_output

WRITTEN = ("planes.json", "plane_*.png", "hull.png")


def planes(
    run: Annotated[Path, typer.Argument(help="A run folder, as `toonset train` writes it.")],
    out: Annotated[
        Path,
        typer.Option("-o", "--out", help="Folder for the files.", rich_help_panel=OUTPUT_PANEL),
    ],
    force: ForceFlag = False,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Write what a WebGL page needs to render a trained run: planes, hull, decoder, palette.

    Planes and hull are PNGs with a byte per feature; planes.json holds the weights and every size.
    """
    from toonset.nerf.run.folder import read_field
    from toonset.nerf.run.planes import planes_files
    from toonset.write import new_folder, write_bytes

    trained = read_field(run)
    check_output(out, [run], WRITTEN, force=force)
    files = planes_files(trained)
    with new_folder(out, force=force) as folder:
        for name, data in files.items():
            write_bytes(folder / name, data)
    sizes = {name: len(data) for name, data in files.items()}
    total = sum(sizes.values()) / 1e3
    Printer(as_json, quiet).result(
        {"out": out, "bytes": sizes}, f"{out}: {len(sizes)} files, {total:.0f} kB"
    )
