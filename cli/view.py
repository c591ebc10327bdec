"""`toonset view`, `toonset planes`: a run in the browser, as one page or as data for your own."""

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


def view(
    folder: Annotated[
        Path, typer.Argument(metavar="RUN", help="A run folder, or a bundle.", show_default=False)
    ],
    out: Annotated[
        Path,
        typer.Option("-o", "--out", help="Page to write: .html.", rich_help_panel=OUTPUT_PANEL),
    ] = Path("character.html"),
    force: ForceFlag = False,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Write a page that anyone can open: the character turns and takes other colours.

    It is one file without anything from elsewhere, and works from the disk and offline. It shows
    the drawn look, the field's layers, the drawings beside their renderings, and how sure every
    camera is. A bundle that is not trained yet shows its drawings, cameras and mannequin.
    """
    printer = Printer(as_json, quiet)
    if out.suffix.lower() not in (".html", ".htm"):
        raise typer.BadParameter(f"{out}: a page's name ends in .html", param_hint="--out")
    from toonset.errors import BundleError
    from toonset.nerf.viewer.build import view_html
    from toonset.read import check_there
    from toonset.write import check_new_file, write_bytes

    check_there([folder], "run or bundle", BundleError)
    check_new_file(out, force=force)
    printer.progress("reading the field, drawing a turn")
    data = view_html(folder).encode("utf-8")
    write_bytes(out, data)
    printer.result(
        {"out": out, "bytes": len(data)},
        f"{out}: {len(data) / 1e6:.1f} MB; open it in a browser, or send it",
    )
