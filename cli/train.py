"""`toonset train`: a bundle becomes a field that can be rendered from anywhere."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toonset.cli.output import (
    OUTPUT_PANEL,
    ForceFlag,
    JsonFlag,
    Printer,
    QuietFlag,
    SeedOption,
    check_output,
)

if TYPE_CHECKING:
    from toonset.dataset.scene import Scene

WRITTEN = ("model.safetensors", "config.json", "metrics.json", "history.csv", "preview.png")
FEW_VIEWS = 4


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
    steps: Annotated[int, typer.Option("--steps", min=1, help="Optimiser steps.")] = 300,
    budget: Annotated[
        float | None, typer.Option("--budget", min=0.1, help="Train for at most SECONDS.")
    ] = None,
    no_palette: Annotated[
        bool, typer.Option("--no-palette", help="Colours only: no palette, no labels.")
    ] = False,
    device: Annotated[str, typer.Option("--device", help="auto, cpu or cuda.")] = "auto",
    threads: Annotated[
        int | None, typer.Option("--threads", min=1, help="CPU threads (default: all cores).")
    ] = None,
    force: ForceFlag = False,
    seed: SeedOption = 0,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Train a triplane radiance field and a palette classifier on the drawings of a bundle."""
    printer = Printer(as_json, quiet)
    if device not in ("auto", "cpu", "cuda"):
        raise typer.BadParameter(f"{device!r} is none of auto, cpu, cuda", param_hint="--device")
    target = out or (bundle.parent if bundle.suffix.lower() == ".json" else bundle) / "run"
    from toonset.dataset.transforms import read_scene
    from toonset.files import new_folder

    check_output(target, [bundle], WRITTEN, force=force)
    scene = read_scene(bundle)

    from toonset.nerf.options import TrainOptions
    from toonset.nerf.report import write_run
    from toonset.nerf.threads import use_threads
    from toonset.nerf.training import device_of
    from toonset.nerf.training import train as train_field

    use_threads(threads)
    device_of(device)  # refused before anything is computed or said
    scene = _with_palette(scene, no_palette, printer)
    if 1 < len(scene.frames) < FEW_VIEWS:
        printer.say(f"only {len(scene.frames)} views: what no drawing shows is a guess")
    options = TrainOptions(steps=steps, budget_s=budget, seed=seed, device=device)
    training = train_field(scene, options, printer.progress)
    with new_folder(target, force=force) as folder:
        metrics = write_run(folder, training, scene)
    if training.stopped not in ("steps", "budget"):
        printer.say(f"training stopped early: {training.stopped}")
    printer.result({"run": target, **metrics}, _summary(target, metrics))


def _with_palette(scene: Scene, no_palette: bool, printer: Printer) -> Scene:
    from toonset.nerf.labelling import labelled, without_palette
    from toonset.palette.names import hex_of

    if no_palette:
        return without_palette(scene)
    if scene.palette is not None and any(frame.labels is not None for frame in scene.frames):
        return scene
    scene, palette = labelled(scene)
    colors = " ".join(hex_of(color.rgb) for color in palette.colors)
    printer.say(f"palette, extracted: {colors}")
    return scene


def _summary(target: Path, metrics: dict[str, Any]) -> str:
    fit, counts = metrics["train"], metrics["counts"]
    seconds = sum(metrics["seconds"].values())
    hull = metrics["hull"]
    tried = ", ".join(f"{100 * iou:.1f} %" for iou in hull["left_out_iou"])
    evidence = f" (left-out views' outlines met with 0, 1 against: {tried})" if tried else ""
    return "\n".join(
        [
            f"{counts['views']} views, {counts['rays']} rays, {counts['parameters']} parameters; "
            f"{metrics['steps']} steps in {seconds:.1f} s",
            f"hull: filled where at most {hull['missing']} views say background{evidence}",
            f"fit to the drawings: PSNR {fit['psnr']:.2f} dB, inside the masks "
            f"{fit['psnr_mask']:.2f} dB",
            f"{target}: preview.png shows it; next: toonset render {target} --turntable 36",
        ]
    )
