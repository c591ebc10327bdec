"""`toonset view`: write a run or bundle as one HTML page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toonset.cli.common.output import OUTPUT_PANEL, ForceFlag, Printer


def view(
    folder: Annotated[
        Path, typer.Argument(metavar="RUN", help="A run folder, or a bundle.", show_default=False)
    ],
    out: Annotated[
        Path,
        typer.Option("-o", "--out", help="Page to write: .html.", rich_help_panel=OUTPUT_PANEL),
    ] = Path("character.html"),
    size: Annotated[
        int | None,
        typer.Option(
            "--size",
            min=8,
            max=4096,
            help="Side in px of the views' pictures (default: the figure is 400 px high).",
            show_default=False,
        ),
    ] = None,
    title: Annotated[
        str,
        typer.Option(
            "--title",
            metavar="TEXT",
            help="Title of the page and name of what it saves (default: the sheet's name).",
            show_default=False,
        ),
    ] = "",
    force: ForceFlag = False,
    *,
    printer: Printer,
) -> None:
    """Write a page that anyone can open: the character turns and takes other colours.

    It is one file without anything from elsewhere, and works from the disk and offline. It shows
    what `toonset render` draws in steps of 5 degrees, the field's layers, the drawings beside their
    renderings, and how sure every camera is. A bundle that is not trained yet shows its drawings,
    cameras and mannequin.
    """
    if out.suffix.lower() not in (".html", ".htm"):
        raise typer.BadParameter(f"{out}: a page's name ends in .html", param_hint="--out")
    from toonset.dataset.bundle.transforms_read import transforms_file
    from toonset.errors import BundleError
    from toonset.nerf.viewer.build import run_of, view_html
    from toonset.palette.names import one_line
    from toonset.read import check_there
    from toonset.write import check_new_file, new_files, write_bytes

    check_there([folder], "run or bundle", BundleError)
    if run_of(folder) is None:
        transforms_file(folder)  # refused before anything is drawn
    check_new_file(out, force=force)
    printer.progress("drawing all views of the page")
    data = view_html(folder, size, one_line(title)).encode("utf-8")
    with new_files(out, force=force) as new:
        write_bytes(new / out.name, data)
    printer.result(
        {"out": out, "bytes": len(data)},
        f"{out}: {len(data) / 1e6:.1f} MB; open it in a browser, or send it",
    )
