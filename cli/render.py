"""`toonset render`: render a trained run from given cameras or all round."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toonset.cli.common.output import OUTPUT_PANEL, ForceFlag, JsonFlag, Printer, QuietFlag, counted
from toonset.errors import did_you_mean
from toonset.nerf.options import FORMATS, LAYERS, Layer
from toonset.write import check_output

if TYPE_CHECKING:
    from toonset.camera import Camera
    from toonset.nerf.fields.trained_field import TrainedField

    Named = list[tuple[str, Camera]]

DEPTH_FILE = "depth.json"
WRITTEN = ("*.png", "*.svg", "turntable.*", "sprites.json", DEPTH_FILE)


def _like(incomplete: str) -> list[str]:
    """Return the lists of formats that one may become."""
    done, comma, last = incomplete.rpartition(",")
    return [f"{done}{comma}{name}" for name in FORMATS if name.startswith(last)]


def render(
    run: Annotated[Path, typer.Argument(help="A run folder, as `toonset train` writes it.")],
    out: Annotated[
        Path,
        typer.Option("-o", "--out", help="Folder for the pictures.", rich_help_panel=OUTPUT_PANEL),
    ],
    cameras: Annotated[
        Path | None, typer.Option("--cameras", help="A transforms.json: one picture per frame.")
    ] = None,
    views: Annotated[
        int | None, typer.Option("--turntable", min=1, max=3600, help="N views all round.")
    ] = None,
    elevation: Annotated[
        float | None,
        typer.Option(
            "--elevation",
            min=-90,
            max=90,
            help="Turntable: degrees, > 0 looks down (default: as drawn).",
        ),
    ] = None,
    size: Annotated[
        int | None,
        typer.Option(
            "--size",
            min=8,
            max=4096,
            help="Side in px of a turntable view (default: as large as drawn).",
        ),
    ] = None,
    shown: Annotated[
        list[Layer] | None,
        typer.Option("--layer", metavar=f"<{'|'.join(LAYERS)}>", help="What is shown; repeatable."),
    ] = None,
    recolor: Annotated[
        list[str] | None,
        typer.Option(
            "--recolor",
            help="OLD=NEW, e.g. '#aa0000=#00aa00' or 'teal=#00aa00'; repeatable; palette.",
        ),
    ] = None,
    palette: Annotated[
        str | None,
        typer.Option("--palette", help="Other colours, a file or '#aa0000,#00aa00'; in order."),
    ] = None,
    nearest: Annotated[
        bool, typer.Option("--nearest", help="Match --palette by likeness, not by order.")
    ] = False,
    lines: Annotated[
        bool, typer.Option("--lines/--no-lines", help="Draw the outline of the drawn look.")
    ] = True,
    ink_width: Annotated[
        float | None,
        typer.Option("--ink-width", min=0.1, max=100, help="Of the drawn outline, sheet px."),
    ] = None,
    ink_color: Annotated[
        str | None, typer.Option("--ink-color", help="Of the drawn outline, e.g. '#402010'.")
    ] = None,
    formats: Annotated[
        str | None,
        typer.Option(
            "--format",
            metavar=f"<{'|'.join(FORMATS)}>,...",
            help="Of all views together; svg: one per view.",
            autocompletion=_like,
        ),
    ] = None,
    gif: Annotated[
        bool | None, typer.Option("--gif/--no-gif", help="turntable.gif (default: turntables).")
    ] = None,
    threads: Annotated[
        int | None,
        typer.Option("--threads", min=1, max=1024, help="CPU threads (default: all cores)."),
    ] = None,
    force: ForceFlag = False,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Render a trained run: one PNG per camera and layer, SVG, and files of a whole turntable.

    A turntable passes through the drawings, at their elevation and size, unless --elevation or
    --size say otherwise; its GIF and WebP are 1024 px at most without --size. `drawn`, the default,
    puts views together from the drawings and draws their outline anew. `rgb` is the field's own
    colour; `palette` shows palette colours only; `normal` codes x, y, z of the world as red, green,
    blue, `normal-camera` right, up and towards the viewer; `depth` has 16 bits, which depth.json
    turns into world units. Several layers are written as NAME-LAYER.png. `--format svg` writes each
    view of `drawn` as smooth paths, too: a group per paint, and lines.
    """
    printer = Printer(as_json, quiet)
    repaint = bool(recolor or palette)
    layers = None if shown is None else [layer.value for layer in shown]
    _check_arguments(cameras, views, layers, repaint=repaint)
    if cameras is not None and (elevation is not None or size is not None):
        raise typer.BadParameter("--elevation and --size belong to --turntable")

    import torch

    from toonset.nerf.render.animation import ANIMATED_PX, check_mp4
    from toonset.nerf.render.files import render_files
    from toonset.nerf.render.layers import default_layer
    from toonset.nerf.render.recolor import change_pen, recolor_run, repaint_run
    from toonset.nerf.run.folder import read_field
    from toonset.write import new_folder, write_bytes

    together = _formats(formats, gif, turning=views is not None)
    if "mp4" in together:
        check_mp4()
    if threads is not None:
        torch.set_num_threads(threads)
    trained = recolor_run(read_field(run), recolor or [])
    trained = repaint_run(trained, palette, nearest=nearest) if palette else trained
    wanted = layers or [default_layer(trained)]
    wanted = ["palette"] if repaint and wanted == ["rgb"] else wanted
    trained = _style(trained, wanted, lines=lines)
    trained = change_pen(trained, ink_width, ink_color)
    angle = None if elevation is None else math.radians(elevation)
    named = _cameras(trained, cameras, views, angle, size)
    check_output(out, [run, cameras], WRITTEN, force=force)
    most_px = ANIMATED_PX if cameras is None and size is None else None
    files = render_files(trained, named, wanted, together, most_px, printer.progress, printer.say)
    sizes: dict[str, int] = {}
    with new_folder(out, force=force) as folder:
        for name, data in files:
            write_bytes(folder / name, data)
            sizes[name] = len(data)
    _report(out, wanted, sizes, len(named), printer)


def _report(
    out: Path, layers: list[str], sizes: dict[str, int], views: int, printer: Printer
) -> None:
    """Print what was written: pictures per view and layer, SVGs, and files of all views."""
    names = [name for name in sizes if name != DEPTH_FILE]
    files, others = names[: views * len(layers)], names[views * len(layers) :]
    traced = [name for name in others if name.endswith(".svg")]
    together = [name for name in others if name not in traced]
    extra = [f"{name} ({math.ceil(sizes[name] / 1000)} kB)" for name in together]
    if traced:
        extra.insert(
            0, f"{len(traced)} SVG ({math.ceil(sum(sizes[name] for name in traced) / 1000)} kB)"
        )
    shown = f"{counted(len(files), 'picture')} ({', '.join(layers)})"
    values = {"out": out, "layer": layers[0], "layers": layers, "files": files, "svg": traced}
    said = ", ".join([f"{out}: {shown}", *extra])
    printer.result({**values, "together": together}, said)


def _formats(given: str | None, gif: bool | None, *, turning: bool) -> tuple[str, ...]:
    """Return the names of the files that hold all views."""
    names = tuple(dict.fromkeys(word.strip() for word in given.split(","))) if given else ()
    for name in names:
        if name not in FORMATS:
            near = did_you_mean(name, FORMATS)
            said = f"{name!r} is none of {', '.join(FORMATS)}" + (f"; {near}" if near else "")
            raise typer.BadParameter(said, param_hint="--format")
    wanted = gif if gif is not None else turning and not names
    return names if "gif" in names or not wanted else ("gif", *names)


def _style(trained: TrainedField, layers: list[str], *, lines: bool) -> TrainedField:
    """Return the field with the lines that the pictures should have.

    Raises:
        BundleError: an ink layer of drawings without lines, or a drawn one without drawings.
    """
    from dataclasses import replace

    from toonset.errors import BundleError
    from toonset.nerf.fields.trained_field import NO_DRAWINGS, NO_LINES

    drawings = trained.drawings
    lined = drawings is not None and drawings.outline is not None
    if "ink" in layers and not (lined and lines):
        raise BundleError(NO_LINES)
    if {"drawn", "source"} & set(layers) and drawings is None:
        raise BundleError(NO_DRAWINGS)
    if lines or drawings is None:
        return trained
    return replace(trained, drawings=replace(drawings, pen=None))


def _check_arguments(
    cameras: Path | None, views: int | None, layers: list[str] | None, *, repaint: bool
) -> None:
    if (cameras is None) == (views is None):
        raise typer.BadParameter("give either --cameras transforms.json or --turntable N")
    if layers is None:
        return
    if len(set(layers)) < len(layers):
        raise typer.BadParameter("names a layer twice", param_hint="--layer")
    if repaint and not {"drawn", "palette", "labels"} & set(layers):
        raise typer.BadParameter("colours can be replaced on --layer drawn and palette only")


def _cameras(
    trained: TrainedField,
    cameras: Path | None,
    views: int | None,
    elevation: float | None,
    size: int | None,
) -> Named:
    from toonset.dataset.bundle.transforms_read import read_cameras
    from toonset.errors import BundleError
    from toonset.nerf.render.turntable import turntable

    if cameras is None:
        turn = turntable(trained, views or 1, elevation, size)
        return [(f"{i:03d}", camera) for i, camera in enumerate(turn)]
    named = [(Path(path).stem, camera) for path, camera in read_cameras(cameras)]
    names = [name for name, _ in named]
    double = next((name for name in names if names.count(name) > 1), None)
    if double:
        raise BundleError(f"{cameras}: two frames would be written as {double}.png; rename one")
    return named
