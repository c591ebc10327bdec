"""`toonset info`: what a bundle, a run or a split folder holds, for a person."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from toonset.cli.folder_kind import RUN, SPLIT, kind_of
from toonset.cli.output import JsonFlag, Printer, QuietFlag


def info(
    bundle: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER", help="A bundle, a run, a split folder, or any transforms.json."
        ),
    ] = Path("bundle"),
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Tell what is in a bundle: views and how sure they are, colours, runs, sizes, versions.

    Also of a run folder, a folder of `toonset split`, and cameras of other programs. Pictures are
    not looked into; `toonset check` does that.
    """
    from toonset.cli.info_folders import run_text, split_text, summarise_run, summarise_split
    from toonset.cli.info_text import bundle_text

    printer = Printer(as_json, quiet)
    kind = kind_of(bundle)
    if kind == RUN:
        found = summarise_run(bundle)
        printer.result(found, run_text(found))
    elif kind == SPLIT:
        found = summarise_split(bundle)
        printer.result(found, split_text(found))
    else:
        found = _summarise_bundle(bundle)
        printer.result(found, bundle_text(found))


def _summarise_bundle(path: Path) -> dict[str, Any]:
    from toonset.cli.info_folders import summarise_run
    from toonset.dataset.bundle.summary import runs_of, summarise
    from toonset.errors import ToonsetError

    found = summarise(path) | {"runs": []}
    for run in runs_of(path if path.is_dir() else path.parent):
        try:
            found["runs"].append(summarise_run(run))
        except ToonsetError as error:
            found["damaged"].append(str(error))
    return found
