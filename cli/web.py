"""`toonset view`: a run or bundle as one HTML page; `toonset edit`: correct one in the browser."""

from __future__ import annotations

import signal
import sys
import threading
import time
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toonset.cli.common.body import is_no_body
from toonset.cli.common.output import OUTPUT_PANEL, ForceFlag, Printer, UpOption
from toonset.lock import hold
from toonset.options import Body

if TYPE_CHECKING:
    from toonset.apps.web.editor.session import Session

LOOK_S = 1.0  # between two looks at whether anybody is there
ENDS = ("SIGINT", "SIGTERM", "SIGHUP")  # Ctrl-C, the system, the terminal's window


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
    from toonset.apps.web.viewer.page import view_html
    from toonset.dataset.bundle.transforms_read import transforms_file
    from toonset.errors import BundleError
    from toonset.nerf.layered_views.build import run_of
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


def edit(
    place: Annotated[
        Path,
        typer.Argument(
            metavar="SHEET|BUNDLE",
            help="A character sheet, one picture, or a bundle of one.",
            show_default=False,
        ),
    ],
    mesh: Annotated[
        Path | None,
        typer.Option(
            "--mesh",
            metavar="FILE",
            help="Posed mannequin, as `calibrate` takes it; none: no body (default: the bundle's).",
        ),
    ] = None,
    up: UpOption = "y",
    out: Annotated[
        Path,
        typer.Option("-o", "--out", help="Bundle folder of a sheet.", rich_help_panel=OUTPUT_PANEL),
    ] = Path("bundle"),
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")
    ] = True,
    idle: Annotated[
        float,
        typer.Option(
            "--idle", metavar="MINUTES", min=0.01, help="Stop after so long without a correction."
        ),
    ] = 60.0,
    *,
    printer: Printer,
) -> None:
    """Correct a sheet's figures, cameras and palette on a page in the browser.

    A sheet without a bundle is calibrated first. Everything done is kept at once in the bundle's
    corrections.json, which `calibrate --corrections` and `palette --corrections` take, too; cameras
    and palette follow within seconds. The bundle's edit.html is the same page without a server.
    Stop with Ctrl-C.
    """
    from toonset.apps.web.editor.opening import folder_of, open_session
    from toonset.apps.web.editor.server import Server

    folder = folder_of(place, out)
    body = Body.NONE if is_no_body(mesh) else mesh
    title = place.stem if place.is_file() else folder.resolve().name
    with Server(title) as server, hold(folder):
        session = open_session(place, folder, body, printer.progress, up)
        ended = _ended()
        server.tell_address = lambda address: printer.say(f"for another tab: {address}")
        thread = server.serve(session)
        try:
            printer.result({"url": server.address, "bundle": folder}, server.address)
            sys.stdout.flush()
            printer.say(f"{folder}: open that address once; stop with Ctrl-C")
            if browser:  # a browser in this terminal would not return
                opening = threading.Thread(target=webbrowser.open, args=(server.address,))
                opening.daemon = True
                opening.start()
            _wait(session, ended, idle)
        finally:
            server.shutdown()
            session.stop()
            thread.join()
    printer.say(f"{folder}: everything is kept")


def _ended() -> threading.Event:
    """Return what is set when the process is asked to end."""
    ended = threading.Event()
    for name in ENDS:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda *_: ended.set())
    return ended


def _wait(session: Session, ended: threading.Event, idle_minutes: float) -> None:
    while not ended.wait(LOOK_S):
        if time.monotonic() - session.acted > 60 * idle_minutes:
            return
