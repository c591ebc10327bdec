"""`toonset train`: fit a radiance field to a bundle."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from toonset.cli.common.output import (
    OUTPUT_PANEL,
    ForceFlag,
    JsonFlag,
    Printer,
    QuietFlag,
    SeedOption,
    VerboseFlag,
)
from toonset.cli.common.train_run import Request, run
from toonset.nerf.options import MOST_STEPS, DeviceName, FieldName, PresetName
from toonset.nerf.options import preset as preset_options
from toonset.options import Symmetric

WHILE_PANEL = "While it runs"
MOST_BUDGET_S = 1e9


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
    steps: Annotated[
        int | None,
        typer.Option(
            "--steps",
            min=1,
            max=MOST_STEPS,
            help="Optimiser steps (default: 600, or 300 on the mannequin's shape).",
        ),
    ] = None,
    budget: Annotated[
        float | None,
        typer.Option(
            "--budget",
            metavar="SECONDS",
            min=0.1,
            max=MOST_BUDGET_S,
            help="Stop after this time, drawings and hull included, but not before 30 steps; "
            "finer and coarser planes are not tried then.",
        ),
    ] = None,
    preset: Annotated[
        PresetName,
        typer.Option(
            "--preset", help="paper: the plain method, along whole rays, 2,000 steps, minutes."
        ),
    ] = "fast",
    field: Annotated[
        FieldName | None,
        typer.Option(
            "--field",
            help="auto (default): planes as coarse as the drawings allow; triplane: one cell per "
            "pixel.",
        ),
    ] = None,
    no_mannequin: Annotated[
        bool,
        typer.Option(
            "--no-mannequin", help="Learn the shape from the drawings alone, not the mannequin's."
        ),
    ] = False,
    no_register: Annotated[
        bool, typer.Option("--no-register", help="Trust the cameras: do not register drawings.")
    ] = False,
    no_unwarp: Annotated[
        bool, typer.Option("--no-unwarp", help="Trust the outlines: do not unwarp drawings.")
    ] = False,
    no_fairing: Annotated[
        bool, typer.Option("--no-fairing", help="Keep the corners of the drawings' visual hull.")
    ] = False,
    symmetric: Annotated[
        Symmetric | None,
        typer.Option(
            "--symmetric",
            help="Mirror drawings for the side that nobody drew: auto unless a front or back shows "
            "that left and right differ (default: as the bundle says, else auto).",
        ),
    ] = None,
    no_palette: Annotated[
        bool, typer.Option("--no-palette", help="Colours only: no palette, no labels.")
    ] = False,
    device: Annotated[
        DeviceName, typer.Option("--device", help="auto: a GPU where there is one.")
    ] = "auto",
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
    seed: SeedOption = 0,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
    verbose: VerboseFlag = False,
) -> None:
    """Train a triplane radiance field and a palette classifier on the drawings of a bundle.

    Says at the end whether the run is ok or weak, and why. Exit code 3 when training went wrong and
    was cut short, and with --strict when the run is weak; the files are written then too. Ctrl-C
    finishes the step and writes the run as it stands; a second one leaves at once.
    """
    given: dict[str, Any] = {"steps": steps, "budget_s": budget, "device": device, "seed": seed}
    given |= {"field": field, "symmetric": symmetric}
    switches = {"fairing": no_fairing, "register": no_register}
    switches |= {"unwarp": no_unwarp, "mannequin": no_mannequin}
    given |= {name: False for name, off in switches.items() if off}
    root = bundle.parent if bundle.suffix.lower() == ".json" else bundle
    request = Request(
        bundle,
        test or _test_of(root),
        out or root / "run",
        {**preset_options(preset), **{k: v for k, v in given.items() if v is not None}},
        threads,
        preview_every,
        force=force,
        palette=not no_palette,
        strict=strict,
    )
    code = run(request, Printer(as_json, quiet, verbose))
    if code:
        raise typer.Exit(code)


def _test_of(root: Path) -> Path | None:
    """Return the bundle's own held-out views."""
    folder = root / "test"
    return folder if (folder / "transforms.json").is_file() else None
