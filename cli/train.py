"""`toonset train`: fit a radiance field to a bundle."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from toonset.cli.common.flags import Given
from toonset.cli.common.output import OUTPUT_PANEL, DetailPrinter, ForceFlag
from toonset.cli.common.train_run import Request, run
from toonset.nerf.options import PRESETS, PresetName, TrainOptions

WHILE_PANEL = "While it runs"


def train(
    bundle: Annotated[
        Path, typer.Argument(help="A bundle, or any folder with transforms.json and RGBA pictures.")
    ] = Path("bundle"),
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", help="Run folder (default: BUNDLE/run).", rich_help_panel=OUTPUT_PANEL
        ),
    ] = None,
    preset: Annotated[
        PresetName,
        typer.Option(
            "--preset", help="paper: the plain method, along whole rays, 2,000 steps, minutes."
        ),
    ] = "fast",
    options: Given[TrainOptions] = Given(TrainOptions),
    no_palette: Annotated[
        bool, typer.Option("--no-palette", help="Colours only: no palette, no labels.")
    ] = False,
    threads: Annotated[
        int | None, typer.Option("--threads", min=1, max=1024, help="CPU threads (default: two).")
    ] = None,
    test: Annotated[
        Path | None,
        typer.Option(
            "--test",
            metavar="FOLDER",
            help="Held-out views to look at now and then (default: BUNDLE/test if it is there).",
            rich_help_panel=WHILE_PANEL,
        ),
    ] = None,
    preview_every: Annotated[
        float | None,
        typer.Option(
            "--preview-every",
            metavar="SECONDS",
            min=0.1,
            help="Write RUN.unfinished/preview.png this often.",
            rich_help_panel=WHILE_PANEL,
        ),
    ] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit with 3 where the run is weak.")
    ] = False,
    force: ForceFlag = False,
    *,
    printer: DetailPrinter,
) -> None:
    """Train a triplane radiance field and a palette classifier on the drawings of a bundle.

    Says at the end whether the run is ok or weak, and why. Exit code 3 when training went wrong and
    was cut short, and with --strict when the run is weak; the files are written then too. Ctrl-C
    finishes the step and writes the run as it stands; a second one leaves at once.
    """
    root = bundle.parent if bundle.suffix.lower() == ".json" else bundle
    request = Request(
        bundle,
        test or _test_of(root),
        out or root / "run",
        options.over(PRESETS[preset]()),
        threads,
        preview_every,
        force=force,
        palette=not no_palette,
        strict=strict,
    )
    code = run(request, printer)
    if code:
        raise typer.Exit(code)


def _test_of(root: Path) -> Path | None:
    """Return the bundle's own held-out views."""
    folder = root / "test"
    return folder if (folder / "transforms.json").is_file() else None
