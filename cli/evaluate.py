"""`toonset evaluate`: how near a run's renderings come to pictures it has not seen."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from toonset.cli.output import JsonFlag, Printer, QuietFlag


def evaluate(
    run: Annotated[Path, typer.Argument(help="A run folder, as `toonset train` writes it.")],
    test: Annotated[
        Path, typer.Option("--test", help="A transforms.json with RGBA pictures, or its folder.")
    ],
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Print PSNR and SSIM over white, and PSNR inside the masks, raw and in palette colours."""
    from toonset.dataset.transforms import read_scene
    from toonset.nerf.evaluation import evaluate as evaluate_run
    from toonset.nerf.run_folder import read_field

    printer = Printer(as_json, quiet)
    trained = read_field(run)
    result = evaluate_run(trained, read_scene(test))
    printer.result(result, _table(result))


def _table(result: dict[str, Any]) -> str:
    layers = [name for name in ("rgb", "palette") if result[name] is not None]
    lines = [f"{'view':<20}{'layer':<9}{'PSNR dB':>9}{'in mask':>9}{'SSIM':>8}"]
    for view in result["views"]:
        lines += [_row(view["name"], layer, view[layer]) for layer in layers]
    return "\n".join([*lines, *(_row("mean", layer, result[layer]) for layer in layers)])


def _row(name: str, layer: str, values: dict[str, float | None]) -> str:
    psnr, inside, ssim = (values[key] for key in ("psnr", "psnr_mask", "ssim"))
    inside_text = "-" if inside is None else f"{inside:.2f}"
    ssim_text = "-" if ssim is None else f"{ssim:.4f}"
    return f"{name[:19]:<20}{layer:<9}{psnr:>9.2f}{inside_text:>9}{ssim_text:>8}"
